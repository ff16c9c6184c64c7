// The daemon under random API calls, right and wrong, with the real firmware in simulated time. The
// bar: --rate 200 --seconds 60 under the address sanitizer.
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "core/interrupt.h"
#include "tests/simulation/virtual_rig/daemon_stress.h"

namespace {

using sateen::testing::StressClient;
using sateen::testing::StressCounts;
using sateen::testing::StressedDaemon;
using std::chrono::steady_clock;

// Kilobytes of memory, and open descriptors, of this program.
std::pair<long, long> Used() {
  std::ifstream status("/proc/self/status");
  long kb = 0;
  for (std::string word; status >> word;) {
    if (word == "VmRSS:") {
      status >> kb;
    }
  }
  long descriptors = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    ++descriptors;
  }
  return {kb, descriptors};
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
  app.add_option("--seconds", seconds, "How long")->capture_default_str();
  app.add_option("--rate", rate, "Calls a second, of all clients")->capture_default_str();
  app.add_option("--clients", clients_count, "Threads that call")->capture_default_str();
  app.add_option("--seed", seed, "Of the calls")->capture_default_str();
  app.add_flag("!--no-captures", captures, "Without captures among the jobs");
  CLI11_PARSE(app, argc, argv);
  sateen::InstallInterruptHandlers();
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
    const auto [kb, descriptors] = Used();
    fmt::print("after {:>3.0f} %          {} MB, {} descriptors\n", 100 * part, kb / 1024,
               descriptors);
    std::fflush(stdout);
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  const double took_s = std::chrono::duration<double>(steady_clock::now() - start).count();
  daemon.service.Stop();
  return Report(clients, daemon, took_s);
}
