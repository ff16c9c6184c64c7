#pragma once

#include <filesystem>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>

#include "cli/command.h"
#include "core/task.h"
#include "scanner/daemon/http/http_client.h"
#include "scanner/devices/byte_port.h"

namespace sateen::cli {

struct LightArgs {
  std::string what;           // channel, light's name, "off", "status" or "limits"
  std::string target;         // channel or name whose limits are meant; empty: all
  std::string port;           // empty: the one that looks like the LED board
  std::filesystem::path rig;  // holds the lights' names
  std::string level = "50%";
  std::string on_time;  // empty: until Ctrl-C, or the light's limit
  bool clear_fault = false;
  bool json = false;
  // Limits to set; empty, 0 or absent: unchanged.
  std::string max_level;
  std::string max_on;
  int max_lit = 0;
  std::optional<int> dim_clock;  // 0: 16 kHz, 1: 2 kHz, 2: 250 Hz
  std::optional<bool> sync_rising;
};

void AddLight(CLI::App& root, LightArgs& args);

// Return the exit status. The first asks the daemon where one is running and args name no port;
// else it opens a port.
int RunLight(const LightArgs& args, const Task& task, std::ostream& out, std::ostream& log);
int RunLightByDaemon(const LightArgs& args, const DaemonClient& daemon, const Task& task,
                     std::ostream& out, std::ostream& log);
int RunLightOn(const LightArgs& args, std::unique_ptr<BytePort> port, const Task& task,
               std::ostream& out, std::ostream& log);

}  // namespace sateen::cli
