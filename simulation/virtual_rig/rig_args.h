#pragma once

#include <optional>
#include <string>
#include <vector>

#include "simulation/virtual_rig/camera/rig_camera.h"

namespace sateen {

// Arguments of the program sateen-virtual-rig.
struct RigArgs {
  std::string rig;
  std::string firmware;  // empty: ours for as many lights
  int lights = 14;
  std::string port_link;
  std::string events;
  bool opening_resets = false;
  RigCameraOptions camera;             // none where it has no scene
  std::vector<std::string> faults;     // commands at the start
  std::vector<std::string> scheduled;  // "N:COMMAND"
  std::vector<std::string> command;
};

// Reads them from the command line. Returns the exit status where the program is to end: after
// --help, or where they are wrong, which is said on standard error.
[[nodiscard]] std::optional<int> ParseRigArgs(int argc, char** argv, RigArgs& args);

}  // namespace sateen
