#include "pipelines/solve/stage_maps.h"

#include <utility>
#include <vector>

#include "imaging/image_io.h"
#include "pipelines/solve/maps.h"
#include "pipelines/solve/mosaic_maps.h"
#include "solver/undistort.h"

namespace sateen {
namespace {

// Images that become maps; the outcome stays in the camera's own pixels.
struct MapsToWrite {
  NormalField field;
  LightFrame first_frame;  // of the overview
  std::optional<Image<float>> error_deg;
};

// Removes the lens's distortion from everything that becomes a map.
Status UndistortMaps(const Camera& camera, const Task& task, MapsToWrite& maps) {
  Result<NormalField> field = Undistorted(maps.field, camera, task);
  if (!field) {
    return tl::unexpected(field.error());
  }
  maps.field = *std::move(field);
  std::vector<Image<float>*> planes;
  for (Image<float>& plane : maps.first_frame.rgb.planes) {
    planes.push_back(&plane);
  }
  if (maps.error_deg) {
    planes.push_back(&*maps.error_deg);
  }
  for (Image<float>* plane : planes) {
    Result<Image<float>> undistorted = Undistorted(*plane, camera, task);
    if (!undistorted) {
      return tl::unexpected(undistorted.error());
    }
    *plane = *std::move(undistorted);
  }
  return {};
}

}  // namespace

Status StageWhole(const SolveOptions& options, const SolveOutcome& outcome, const Task& task,
                  OutputFolder& folder) {
  const LightFrame first = outcome.dataset.mosaics ? ShowFrame(outcome.dataset.mosaics->stack, 0)
                                                   : outcome.dataset.stack.front();
  const std::optional<Image<float>>& error_deg = outcome.evaluation.error_map_deg;
  if (!options.undistort) {
    return StageMaps(outcome.field, first, error_deg, outcome.maps, folder);
  }
  MapsToWrite maps{outcome.field, first, error_deg};
  return UndistortMaps(*outcome.dataset.rig.camera, task, maps).and_then([&] {
    return StageMaps(maps.field, maps.first_frame, maps.error_deg, outcome.maps, folder);
  });
}

Status StageHeight(const SolveOptions& options, const SolveOutcome& outcome, const Task& task,
                   OutputFolder& folder) {
  if (!outcome.relief) {
    folder.Retire("height.exr");
    return {};
  }
  if (!options.undistort) {
    return WriteExr(folder.Stage("height.exr"), outcome.relief->height_mm);
  }
  return Undistorted(outcome.relief->height_mm, *outcome.dataset.rig.camera, task)
      .and_then([&](const Image<float>& straight) {
        return WriteExr(folder.Stage("height.exr"), straight);
      });
}

}  // namespace sateen
