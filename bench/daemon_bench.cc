// The daemon with the real firmware in simulated time: under random API calls, right and wrong (the
// bar: --rate 200 --seconds 60 under the address sanitizer); under hostile clients (--hostile: turning
// the lights off takes 1 s at most); over a day (--sessions 2000: what it uses does not grow).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "core/interrupt.h"
#include "tests/scanner/daemon/hostile_clients.h"
#include "tests/simulation/virtual_rig/daemon_day.h"

namespace {

using sateen::testing::DaemonDay;
using sateen::testing::HostileKind;
using sateen::testing::StressClient;
using sateen::testing::StressCounts;
using sateen::testing::StressedDaemon;
using sateen::testing::Usage;
using std::chrono::steady_clock;

void Print(const std::string& when, const Usage& usage) {
  fmt::print("{:<20} {:.1f} MB, {} descriptors, {} threads, {} scratch files\n", when,
             static_cast<double>(usage.memory_kb) / 1024.0, usage.descriptors, usage.threads,
             usage.scratch_files);
  std::fflush(stdout);
}

// Turns the lights off under 70 clients of each kind, while a capture runs.
int RunHostile() {
  constexpr int kClients = 70;
  constexpr double kBar_s = 1.0;
  double longest_s = 0.0;
  int refused = 0;
  const std::size_t kinds = sateen::testing::HostileKinds(1).size();
  for (std::size_t k = 0; k < kinds && !sateen::InterruptFlag(); ++k) {
    StressedDaemon daemon({});
    const auto ask = [&](const std::string& method, const std::string& path,
                         const std::string& body = "") {
      return sateen::testing::TimedExchange(daemon.socket,
                                            sateen::testing::HttpRequest(method, path, body));
    };
    ask("POST", "/v1/lights/3", R"({"level": 0.5})");
    const HostileKind kind = sateen::testing::HostileKinds(1)[k];
    const auto crowd = sateen::testing::Attack(kind, daemon.socket, kClients);
    const auto off = ask("POST", "/v1/lights/off");
    const auto state = ask("GET", "/v1/state");
    const int status = sateen::testing::StatusOf(off.text);
    const bool whole = sateen::testing::IsWholeAnswer(state.text);
    const auto start = steady_clock::now();
    daemon.service.Stop();
    daemon.servers.clear();
    const double end_s = std::chrono::duration<double>(steady_clock::now() - start).count();
    fmt::print(
        "{:<24} lights/off {} after {:.3f} s; another client {} after {:.3f} s{}; ended in "
        "{:.3f} s\n",
        kind.name, status, off.time.count(), sateen::testing::StatusOf(state.text),
        state.time.count(), whole ? "" : " WITHOUT A BODY", end_s);
    std::fflush(stdout);
    longest_s = std::max({longest_s, off.time.count(), end_s});
    refused += status == 200 && whole ? 0 : 1;
  }
  const bool good = refused == 0 && longest_s <= kBar_s;
  fmt::print("longest {:.3f} s, bar {} s: {}\n", longest_s, kBar_s, good ? "met" : "NOT MET");
  return good ? 0 : 3;
}

// Compares the daemon's use after a tenth of the sessions, at least five, with that at the end.
int RunDay(int sessions) {
  StressedDaemon daemon({});
  DaemonDay day(daemon);
  Usage early;
  int wrong = 0;
  const auto start = steady_clock::now();
  for (int session = 1; session <= sessions && !sateen::InterruptFlag(); ++session) {
    for (const std::string& what : day.LiveOneSession()) {
      fmt::print("session {}: {}\n", session, what);
      ++wrong;
    }
    if (session == std::max(sessions / 10, 5)) {
      early = sateen::testing::UsageNow(daemon);
    }
    if (session % std::max(sessions / 10, 1) == 0) {
      Print(fmt::format("after {} sessions", session), sateen::testing::UsageNow(daemon));
    }
  }
  const Usage late = sateen::testing::UsageNow(daemon);
  const double took_s = std::chrono::duration<double>(steady_clock::now() - start).count();
  // Allocators keep some for good; 2 KB of each session would show.
  const bool good = wrong == 0 && late.descriptors <= early.descriptors + 2 &&
                    late.threads <= early.threads + 2 && late.scratch_files == 0 &&
                    late.memory_kb <= early.memory_kb + 4096;
  fmt::print("{} sessions in {:.0f} s, {} answers wrong: {}\n", sessions, took_s, wrong,
             good ? "met" : "NOT MET");
  return good ? 0 : 3;
}

// Calls at even times until the end; one that is late is made at once.
void Drive(StressClient& client, double rate, steady_clock::time_point end, bool captures) {
  const auto period =
      std::chrono::duration_cast<steady_clock::duration>(std::chrono::duration<double>(1.0 / rate));
  int call = 0;
  for (auto next = steady_clock::now(); next < end && !sateen::InterruptFlag(); next += period) {
    std::this_thread::sleep_until(next);
    client.Call(captures && ++call % 100 == 0);
  }
}

int Report(const std::vector<StressClient>& clients, const StressedDaemon& daemon, double took_s) {
  StressCounts all;
  for (const StressClient& client : clients) {
    for (const auto& [what, statuses] : client.counts.statuses) {
      for (const auto& [status, count] : statuses) {
        all.statuses[what][status] += count;
      }
    }
    all.milliseconds.insert(all.milliseconds.end(), client.counts.milliseconds.begin(),
                            client.counts.milliseconds.end());
    all.wrong.insert(all.wrong.end(), client.counts.wrong.begin(), client.counts.wrong.end());
  }
  for (const auto& [what, statuses] : all.statuses) {
    fmt::print("{:<20}", what);
    for (const auto& [status, count] : statuses) {
      fmt::print("  {} x {}", count, status == 0 ? "no answer" : std::to_string(status));
    }
    fmt::print("\n");
  }
  std::sort(all.milliseconds.begin(), all.milliseconds.end());
  const auto quantile = [&](double q) {
    return all.milliseconds[static_cast<std::size_t>(
        q * static_cast<double>(all.milliseconds.size() - 1))];
  };
  fmt::print(
      "calls                {} in {:.1f} s: {:.0f} a second; each followed by checks of state\n",
      all.milliseconds.size(), took_s, static_cast<double>(all.milliseconds.size()) / took_s);
  fmt::print("answered after       median {:.2f} ms, 99 % {:.1f} ms, longest {:.0f} ms\n",
             quantile(0.5), quantile(0.99), quantile(1.0));
  fmt::print("lights               on {} times; {} times two together, {} times without a job\n",
             daemon.witness.TimesOn(), daemon.witness.Two(), daemon.witness.WithoutJob());
  fmt::print("wrong                {}\n", all.wrong.size());
  for (std::size_t i = 0; i < std::min<std::size_t>(all.wrong.size(), 10); ++i) {
    fmt::print("  {}\n", all.wrong[i]);
  }
  const bool good = all.wrong.empty() && daemon.witness.Two() == 0 &&
                    daemon.witness.WithoutJob() == 0 && daemon.witness.Lit() == 0;
  fmt::print("{}\n", good ? "met" : "NOT MET");
  return good ? 0 : 3;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The daemon under random calls, with the real firmware");
  double seconds = 5;
  double rate = 200;
  int clients_count = 8;
  std::uint64_t seed = 1;
  bool captures = true;
  bool hostile = false;
  int sessions = 0;
  app.add_option("--seconds", seconds, "How long")->capture_default_str();
  app.add_option("--rate", rate, "Calls a second, of all clients")->capture_default_str();
  app.add_option("--clients", clients_count, "Threads that call")->capture_default_str();
  app.add_option("--seed", seed, "Of the calls")->capture_default_str();
  app.add_flag("!--no-captures", captures, "Without captures among the jobs");
  app.add_flag("--hostile", hostile, "Hostile clients of each kind instead");
  app.add_option("--sessions", sessions, "So many sessions one after the other instead");
  CLI11_PARSE(app, argc, argv);
  sateen::InstallInterruptHandlers();
  if (hostile) {
    return RunHostile();
  }
  if (sessions > 0) {
    return RunDay(sessions);
  }
  StressedDaemon daemon({.client_time = std::chrono::milliseconds(2000),
                         .heartbeat = std::chrono::milliseconds(500)});
  std::vector<StressClient> clients;
  for (int i = 0; i < clients_count; ++i) {
    clients.emplace_back(daemon, seed * 1000 + static_cast<std::uint64_t>(i));
  }
  const auto start = steady_clock::now();
  const auto after = [&](double part) {
    return start + std::chrono::duration_cast<steady_clock::duration>(
                       std::chrono::duration<double>(seconds * part));
  };
  std::vector<std::thread> threads;
  threads.reserve(clients.size());
  for (StressClient& client : clients) {
    threads.emplace_back([&] { Drive(client, rate / clients_count, after(1.0), captures); });
  }
  for (const double part : {0.1, 0.4, 0.7, 1.0}) {
    std::this_thread::sleep_until(after(part));
    Print(fmt::format("after {:>3.0f} %", 100 * part), sateen::testing::UsageNow(daemon));
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  const double took_s = std::chrono::duration<double>(steady_clock::now() - start).count();
  daemon.service.Stop();
  return Report(clients, daemon, took_s);
}
