#include "scanner/devices/worker_message.h"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <nlohmann/json.hpp>

#include "scanner/devices/worker_process.h"

namespace sateen::worker_message_test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

constexpr milliseconds kLong{20'000};

const std::vector<json> kValues = {nullptr,
                                   true,
                                   5,
                                   -5,
                                   1e300,
                                   18446744073709551615ULL,
                                   "text",
                                   "",
                                   json::array(),
                                   json::object(),
                                   json::array({1, "a", nullptr}),
                                   json{{"do", 5}},
                                   0.5};

// The real process. Whatever a message holds, there is an answer, and the next one is answered too.
TEST(WorkerMessage, EveryWrongRequestIsAnsweredByAnError) {
  Result<WorkerProcess> worker = WorkerProcess::Start(WorkerProcess::DefaultProgram());
  ASSERT_TRUE(worker) << worker.error().message;
  int asked = 0;
  const auto ask = [&](const json& request) {
    const Result<json> answer = worker->Ask(request, kLong);
    ASSERT_TRUE(answer) << request.dump() << ": " << answer.error().message;
    EXPECT_TRUE(answer->contains("error")) << request.dump() << ": " << answer->dump();
    EXPECT_TRUE((*answer)["error"]["text"].is_string()) << request.dump();
    ++asked;
  };
  for (const json& value : kValues) {
    ask({{"do", value}});
  }
  // No camera is open, and none is at this port.
  for (const char* verb :
       {"open", "get", "set", "trigger", "await", "info", "download", "delete"}) {
    for (const char* key :
         {"do", "name", "folder", "port", "value", "path", "settle_ms", "wait_ms", "other"}) {
      for (const json& value : kValues) {
        json request = {{"do", verb}, {"port", "ptpip:0.0.0.0:1:1"}};
        request[key] = value;
        if (request["do"] == "open" && key == std::string("port")) {
          continue;  // which may be a camera of this computer, as "" is
        }
        ask(request);
      }
    }
  }
  for (const json& no_object : {json(5), json::array({1}), json(nullptr), json("list")}) {
    ask(no_object);
  }
  EXPECT_GT(asked, 900);
  // It is still well.
  const Result<json> closed = worker->Ask({{"do", "close"}}, kLong);
  ASSERT_TRUE(closed) << closed.error().message;
  EXPECT_FALSE(closed->contains("error"));
}

// What the process answers is checked on this side as well.
TEST(WorkerMessage, AFieldOfAnotherTypeIsNamed) {
  std::array<int, 2> ends = {};
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()), 0);
  for (const char* message :
       {R"({"choices":["a",5]})", R"({"after_ms":"soon"})", R"({"bytes":-1})",
        R"({"error":{"code":"bad"}})", R"({"error":5})", R"({"cameras":[{"model":5}]})",
        R"({"cameras":[5]})", R"({"readonly":1})", R"({"wait_ms":-1})", R"({"wait_ms":1e10})"}) {
    ASSERT_TRUE(SendMessage(ends[0], json::parse(message)));
    const Result<json> received = ReceiveMessage(ends[1], kLong);
    ASSERT_FALSE(received) << message;
    EXPECT_EQ(received.error().code, ErrorCode::kBadData);
    EXPECT_THAT(received.error().message, HasSubstr("need")) << message;
  }
  ASSERT_TRUE(SendMessage(ends[0], {{"choices", {"a"}}, {"error", {{"code", -7}}}}));
  EXPECT_TRUE(ReceiveMessage(ends[1], kLong));
  close(ends[0]);
  close(ends[1]);
}

}  // namespace
}  // namespace sateen::worker_message_test
