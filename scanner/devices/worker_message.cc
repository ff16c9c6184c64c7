#include "scanner/devices/worker_message.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <string>

#include "core/json.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr size_t kLongestMessage = size_t{1} << 20;

// The fields of all messages, in both directions, and their types.
struct FieldType {
  const char* key;
  bool (*fits)(const nlohmann::json& value);
  const char* needed;
};

bool IsText(const nlohmann::json& value) { return value.is_string(); }
bool IsFlag(const nlohmann::json& value) { return value.is_boolean(); }
bool IsCount(const nlohmann::json& value) { return value.is_number_unsigned(); }
bool IsCode(const nlohmann::json& value) {
  return value.is_number_integer() && std::abs(value.get<double>()) <= 1e9;
}
bool IsTime(const nlohmann::json& value) { return IsCode(value) && value.get<double>() >= 0.0; }
bool AreTexts(const nlohmann::json& value) {
  return value.is_array() && std::all_of(value.begin(), value.end(), IsText);
}
bool IsObject(const nlohmann::json& value) { return value.is_object(); }
bool AreObjects(const nlohmann::json& value) {
  return value.is_array() && std::all_of(value.begin(), value.end(), IsObject);
}

constexpr FieldType kFields[] = {{"do", IsText, "a string"},
                                 {"name", IsText, "a string"},
                                 {"folder", IsText, "a string"},
                                 {"port", IsText, "a string"},
                                 {"model", IsText, "a string"},
                                 {"value", IsText, "a string"},
                                 {"path", IsText, "a string"},
                                 {"text", IsText, "a string"},
                                 {"while", IsText, "a string"},
                                 {"settle_ms", IsTime, "a time, 0 to 1000000000 ms"},
                                 {"wait_ms", IsTime, "a time, 0 to 1000000000 ms"},
                                 {"after_ms", IsTime, "a time, 0 to 1000000000 ms"},
                                 {"bytes", IsCount, "a number of bytes"},
                                 {"code", IsCode, "a whole number"},
                                 {"errno", IsCode, "a whole number"},
                                 {"readonly", IsFlag, "true or false"},
                                 {"absent", IsFlag, "true or false"},
                                 {"choices", AreTexts, "an array of strings"},
                                 {"cameras", AreObjects, "an array of objects"},
                                 {"error", IsObject, "an object"}};

// Fails at the first field of another type, also of the objects in it.
Status CheckFields(const nlohmann::json& message) {
  for (const FieldType& field : kFields) {
    const auto value = message.find(field.key);
    if (value != message.end() && !field.fits(*value)) {
      return Fail(ErrorCode::kBadData, "'{}' is of type {}; need {}", field.key, value->type_name(),
                  field.needed);
    }
  }
  Status inner;
  if (const auto error = message.find("error"); error != message.end()) {
    inner = CheckFields(*error);
  }
  if (const auto cameras = message.find("cameras"); cameras != message.end()) {
    for (auto camera = cameras->begin(); inner && camera != cameras->end(); ++camera) {
      inner = CheckFields(*camera);
    }
  }
  return inner;
}

tl::unexpected<Error> Gone() {
  return Fail(ErrorCode::kDevice, "the process that talks to the camera has ended");
}

// kTimeout when `deadline` has passed.
Status WaitReadable(int socket, std::optional<steady_clock::time_point> deadline) {
  while (true) {
    int wait_ms = -1;
    if (deadline) {
      const auto left = std::chrono::ceil<milliseconds>(*deadline - steady_clock::now()).count();
      wait_ms = static_cast<int>(std::clamp<int64_t>(left, 0, 1'000'000));
    }
    pollfd wait = {.fd = socket, .events = POLLIN, .revents = 0};
    const int ready = poll(&wait, 1, wait_ms);
    if (ready > 0) {
      return {};
    }
    if (ready < 0 && errno != EINTR) {
      return Gone();
    }
    if (deadline && steady_clock::now() >= *deadline) {
      return Fail(ErrorCode::kTimeout, "no answer in time");
    }
  }
}

Status ReceiveAll(int socket, char* bytes, size_t size,
                  std::optional<steady_clock::time_point> deadline) {
  for (size_t done = 0; done < size;) {
    if (Status readable = WaitReadable(socket, deadline); !readable) {
      return readable;
    }
    const ssize_t got = recv(socket, bytes + done, size - done, 0);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) {
      continue;
    }
    if (got <= 0) {
      return Gone();
    }
    done += static_cast<size_t>(got);
  }
  return {};
}

}  // namespace

Status SendMessage(int socket, const nlohmann::json& message) {
  // A camera's names may hold any bytes.
  const std::string text = JsonText(message);
  std::string bytes;
  for (int k = 0; k < 4; ++k) {
    bytes.push_back(static_cast<char>(text.size() >> (8 * k) & 0xFF));
  }
  bytes += text;
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t sent = send(socket, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) {
      continue;
    }
    if (sent <= 0) {
      return Gone();
    }
    done += static_cast<size_t>(sent);
  }
  return {};
}

Result<nlohmann::json> ReceiveMessage(int socket, std::optional<milliseconds> longest) {
  std::optional<steady_clock::time_point> deadline;
  if (longest) {
    deadline = steady_clock::now() + *longest;
  }
  std::array<char, 4> head = {};
  if (Status received = ReceiveAll(socket, head.data(), head.size(), deadline); !received) {
    return tl::unexpected(received.error());
  }
  size_t size = 0;
  for (size_t k = 0; k < head.size(); ++k) {
    size |= static_cast<size_t>(static_cast<unsigned char>(head[k])) << (8 * k);
  }
  std::string text(std::min(size, kLongestMessage), '\0');
  if (Status received = ReceiveAll(socket, text.data(), text.size(), deadline); !received) {
    return tl::unexpected(received.error());
  }
  if (size > kLongestMessage) {
    return Fail(ErrorCode::kDevice, "a message of {} bytes; need at most {}", size,
                kLongestMessage);
  }
  Result<nlohmann::json> message = ParseJson(text, "message");  // not nested without end
  if (message && !message->is_object()) {
    return Fail(ErrorCode::kBadData, "the message is of type {}; need an object",
                message->type_name());
  }
  if (const Status typed = message ? CheckFields(*message) : Status(); !typed) {
    return tl::unexpected(typed.error());
  }
  return message;
}

}  // namespace sateen
