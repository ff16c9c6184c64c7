#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/scanner/daemon/http_talk.h"

// Clients that take connections and give nothing, and what the others still get.
namespace sateen::testing {

using Crowd = std::vector<std::unique_ptr<RawClient>>;

// Time for an answer that nobody holds up, on a machine however busy: the clients here hold up for
// 60 s who waits for them. bench/daemon_bench.cc measures the promise, which is 1 s.
inline constexpr std::chrono::seconds kSoon{20};

// How one client of a kind behaves once it is connected. It stays until its crowd goes.
struct HostileKind {
  std::string name;
  std::function<void(const RawClient&)> act;
  bool leaves = false;  // closes its connection at once
  bool stays = false;   // takes its connection for as long as the daemon lets it
};

inline std::vector<HostileKind> HostileKinds(std::uint64_t running_job) {
  const auto send = [](std::string bytes) {
    return [bytes = std::move(bytes)](const RawClient& client) { client.Send(bytes); };
  };
  const std::string is_json = "Content-Type: application/json\r\n";
  return {
      {.name = "silent", .act = send(""), .stays = true},
      {.name = "slow head", .act = send("GET /v1/st"), .stays = true},
      {.name = "slow body",
       .act = send("POST /v1/jobs HTTP/1.1\r\n" + is_json + "Content-Length: 5\r\n\r\n{"),
       .stays = true},
      {.name = "slow body of lights/off",
       .act = send("POST /v1/lights/off HTTP/1.1\r\n" + is_json + "Content-Length: 5\r\n\r\n{")},
      {.name = "half closed",
       .act =
           [](const RawClient& client) {
             client.Send("GET /v1/st");
             client.EndSending();
           }},
      {.name = "never reading", .act = send(HttpRequest("GET", "/v1/jobs"))},
      {.name = "pipelined garbage",
       .act = send(HttpRequest("GET", "/v1/state") + std::string(100'000, '\xff'))},
      {.name = "huge head",
       .act = send("GET /v1/state HTTP/1.1\r\nX: " + std::string(60'000, 'x')),
       .stays = true},
      {.name = "huge body",
       .act = send(HttpRequest("POST", "/v1/jobs", std::string(300'000, ' ')))},
      {.name = "idle keep-alive",
       .act = send(
           HttpRequest("GET", "/v1/state", "", "Host: localhost\r\nConnection: keep-alive\r\n"))},
      {.name = "event listener",
       .act = send(HttpRequest("GET", fmt::format("/v1/jobs/{}/events", running_job)))},
      {.name = "connect and leave", .act = send(""), .leaves = true},
  };
}

inline Crowd Attack(const HostileKind& kind, const std::filesystem::path& socket, int clients) {
  Crowd crowd;
  for (int i = 0; i < clients; ++i) {
    crowd.push_back(std::make_unique<RawClient>(socket));
    kind.act(*crowd.back());
    if (kind.leaves) {
      crowd.pop_back();
    }
  }
  return crowd;
}

struct TimedAnswer {
  std::string text;
  std::chrono::duration<double> time{0};
};

template <typename Place>
TimedAnswer TimedExchange(const Place& place, const std::string& bytes) {
  const auto start = std::chrono::steady_clock::now();
  std::string text = Exchange(place, bytes);
  return {.text = std::move(text), .time = std::chrono::steady_clock::now() - start};
}

// An answer that a client can act on: served, or told in JSON that there are too many.
inline bool IsWholeAnswer(const std::string& answer) {
  const int status = StatusOf(answer);
  return (status == 200 || status == 503) && nlohmann::json::accept(BodyOf(answer));
}

}  // namespace sateen::testing
