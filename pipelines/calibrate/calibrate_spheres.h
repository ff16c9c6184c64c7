#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calibration/spheres/spheres.h"
#include "core/task.h"
#include "imaging/image_io.h"
#include "pipelines/calibrate/rig_calibration.h"

namespace sateen {

// Ways to find a highlight's centre.
enum class HighlightCenter {
  kLamp,    // of the bright core
  kMedian,  // of all pixels of the sphere from 250 of 255 on, as older toolboxes have it
};

// "lamp", "median".
[[nodiscard]] std::string_view Name(HighlightCenter center);

struct CalibrateSpheresOptions {
  std::filesystem::path photos;     // a folder, a session or an .lp file
  std::filesystem::path output;     // a rig file, or an RTI .lp file
  std::filesystem::path rig_file;   // with the camera; empty: the session's own
  std::filesystem::path reference;  // empty: ref.* in the folder, or else the mean of all frames
  std::filesystem::path mask;       // empty: the folder's own, if it has one
  std::filesystem::path circles;    // empty: outlines are found
  int spheres = 0;                  // 0: as many as are found
  double radius_mm = 0.0;           // 0: not known
  HighlightCenter highlight = HighlightCenter::kLamp;
  Encoding encoding = Encoding::kAuto;
};

// One frame's lamp and the highlights that it was found from.
struct LampFigures {
  SphereLight lamp;
  std::filesystem::path file;
  std::vector<std::optional<Highlight>> highlights;  // [sphere]
  size_t spheres_used = 0;

  // Unit vector from the table's origin.
  [[nodiscard]] Eigen::Vector3d Direction() const;
};

struct SpheresCalibration : RigCalibration {
  std::vector<Sphere> spheres;
  std::string outlines;  // where they come from: "ref.JPG", "mask.png", "the mean of all frames"
  Image3 shown;          // the picture to draw on, linear
  std::vector<LampFigures> lights;
  SpheresRecord record;
};

/// Finds the lights' directions, or positions, from photographs of chrome spheres
/// (calibration/spheres/spheres.h), draws the pictures of sphere_pictures.h and writes a rig, or a
/// list of directions where the output ends in .lp. Fluxes stay as in the rig, or are 1.
///
/// Errors   kInvalidArgument: a radius without a camera
///          kBadData: pictures of different sizes, other counts of spheres; as ReadDataset(),
///          FindCircles(), FindHighlight(), LightFromRays()
///          kCancelled: nothing is written
[[nodiscard]] Result<SpheresCalibration> CalibrateLightsFromSpheres(
    const CalibrateSpheresOptions& options, const Task& task = {});

}  // namespace sateen
