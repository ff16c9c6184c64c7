#pragma once

#include <filesystem>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calibration/spheres/spheres.h"
#include "cli/command.h"
#include "core/task.h"
#include "rig/rig.h"

namespace sateen::cli {

struct CalibrateSpheresArgs {
  std::filesystem::path photos;
  std::filesystem::path output;     // a rig file, or an RTI .lp file
  std::filesystem::path rig_file;   // empty: the session's own; its camera counts
  std::filesystem::path reference;  // empty: ref.* in the folder, or else the mean of all frames
  std::filesystem::path mask;       // empty: the folder's own, if it has one
  std::filesystem::path circles;    // empty: outlines are found
  int spheres = 0;                  // 0: as many as are found
  double radius_mm = 0.0;           // 0: not known
  std::string highlight = "lamp";
  std::string encoding = "auto";
  int threads = 0;
  bool json = false;
};

// One frame's lamp and what it was found from.
struct LampFigures {
  SphereLight lamp;
  std::filesystem::path file;
  std::vector<std::optional<Highlight>> highlights;  // [sphere]
  size_t spheres_used = 0;

  // From the table's origin, unit.
  [[nodiscard]] Eigen::Vector3d Direction() const;
};

struct SpheresCalibration {
  Rig rig;
  std::vector<Sphere> spheres;
  std::string outlines;  // where they come from: "ref.JPG", "mask.png", "the mean of all frames"
  Image3 shown;          // the picture to draw on, linear
  std::vector<LampFigures> lights;
  std::vector<std::string> warnings;
  std::map<std::string, std::string> sha256_of_input;
  std::filesystem::path pictures;
  std::filesystem::path former_output;  // empty: there was none
  double seconds = 0.0;
};

void AddCalibrateSpheres(CLI::App& calibrate, CalibrateSpheresArgs& args);
int RunCalibrateSpheres(const CalibrateSpheresArgs& args, const Task& task, std::ostream& out,
                        std::ostream& log);

}  // namespace sateen::cli
