#include "pipelines/solve/solve_checks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

namespace sateen {
namespace {

// Highest surface, as a share of the lowest light's height: no cloth is thicker.
constexpr double kMostHeight = 0.25;

// Height of the lowest light that has a position; infinite where none has.
double LowestLightMm(const Rig& rig) {
  double lowest_mm = std::numeric_limits<double>::infinity();
  for (const Light& light : rig.lights) {
    if (light.model != LightModel::kDistant) {
      lowest_mm = std::min(lowest_mm, light.position_mm.z());
    }
  }
  return lowest_mm;
}

Status CheckHeight(const SolveOptions& options, const Dataset& dataset) {
  const double lowest_mm = LowestLightMm(dataset.rig);
  if ((options.relief || options.height_mm != 0.0) && std::isinf(lowest_mm)) {
    return Fail(ErrorCode::kBadData,
                "{}: all {} lights are distant, and their light is the same at every height; {} "
                "needs lights with a position (near, led or led+field) and a calibrated camera",
                options.capture.string(), dataset.rig.lights.size(),
                options.relief ? "--relief" : "--height");
  }
  if (!(std::abs(options.height_mm) <= kMostHeight * lowest_mm)) {
    return Fail(ErrorCode::kInvalidArgument,
                "--height {:g}: the lowest light is {:.4g} mm above the table; need a surface "
                "within a quarter of that, from {:.4g} to {:.4g} mm",
                options.height_mm, lowest_mm, -kMostHeight * lowest_mm, kMostHeight * lowest_mm);
  }
  return {};
}

}  // namespace

bool SolvesMosaics(Backend backend) { return backend != Backend::kQr && backend != Backend::kLdlt; }

Status CheckSupported(const SolveOptions& options, const Dataset& dataset) {
  if (dataset.session && dataset.session->table_from_sheet) {
    return Fail(ErrorCode::kBadData,
                "{}: the session has table_from_sheet, but solving a tilted sheet is not supported "
                "yet; remove the key if the sheet lay on the table",
                options.capture.string());
  }
  if (options.fail_above_deg && !dataset.truth) {
    return Fail(ErrorCode::kBadData,
                "{}: the capture has no truth; --fail-above needs truth/normal.exr, normal_gt.exr "
                "or Normal_gt.mat, or --truth",
                options.capture.string());
  }
  if (options.domain == Domain::kRaw && !SolvesMosaics(options.least_squares.backend)) {
    return Fail(ErrorCode::kInvalidArgument,
                "--backend {} is for interpolated colours; use --domain rgb, or --backend auto, "
                "fast or jacobi-svd",
                Name(options.least_squares.backend));
  }
  if (options.undistort && !dataset.rig.camera) {
    return Fail(ErrorCode::kBadData,
                "{}: --undistort needs the lens, and the rig has no camera; run sateen calibrate "
                "lens, or give a rig with a camera by --rig",
                options.capture.string());
  }
  std::error_code ignored;  // a folder that does not exist yet is no other folder
  if (std::filesystem::equivalent(options.capture, options.output, ignored)) {
    return Fail(ErrorCode::kInvalidArgument,
                "{}: is the capture itself; give another folder for the maps",
                options.output.string());
  }
  return CheckHeight(options, dataset);
}

}  // namespace sateen
