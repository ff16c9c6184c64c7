#include "scanner/sheet_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "scanner/session_layout.h"
#include "scanner/stack_reader.h"

namespace sateen {
namespace {

constexpr double kMostSpoilt = 0.5;   // share of a frame's blocks
constexpr double kDarkSignal = 20.0;  // times its own standard deviation: light, not noise
constexpr double kSmallestVariance =
    1e-14;  // of a noiseless simulation, so that weights stay finite

// The mean of the dark frames; empty without any.
Result<std::vector<Eigen::Vector3d>> MeanOfDark(const std::vector<FrameFile>& dark,
                                                const BlockGrid& grid, Sheet& sheet) {
  std::vector<Eigen::Vector3d> mean;
  for (const FrameFile& file : dark) {
    const Result<BlockMeans> one = ReadBlockMeans(file, grid);
    if (!one) {
      return tl::unexpected(one.error());
    }
    sheet.sha256_of_input[file.path.string()] = one->sha256;
    mean.resize(one->blocks.size(), Eigen::Vector3d::Zero());
    for (size_t i = 0; i < mean.size(); ++i) {
      mean[i] += one->blocks[i].radiance_rgb / static_cast<double>(dark.size());
    }
  }
  return mean;
}

// Variance of a site over its radiance, for each colour: on white paper all noise is that of the
// light. One figure for the frame, because what a single block shows is uncertain by a third, and
// weights as uncertain as that cost precision; the median, so that folds and edges do not count.
Eigen::Array3d NoisePerRadiance(const BlockMeans& means) {
  Eigen::Array3d noise = Eigen::Array3d::Constant(kSmallestVariance);
  for (Eigen::Index c = 0; c < 3; ++c) {
    std::vector<double> ratios;
    ratios.reserve(means.blocks.size());
    for (const BlockMean& block : means.blocks) {
      if (!block.saturated && block.radiance_rgb[c] > 0.0) {
        ratios.push_back(block.site_variance_rgb[c] / block.radiance_rgb[c]);
      }
    }
    if (!ratios.empty()) {
      const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
      std::nth_element(ratios.begin(), middle, ratios.end());
      noise[c] = std::max(*middle, kSmallestVariance);
    }
  }
  return noise;
}

// Where a pixel's ray meets the sheet.
std::optional<Eigen::Vector3d> SheetPointOfPixel(const Camera& camera,
                                                 const Eigen::Isometry3d& table_from_sheet,
                                                 const Eigen::Vector2d& pixel) {
  const std::optional<Eigen::Vector3d> ray = RayOfPixel(camera, pixel.x(), pixel.y());
  if (!ray) {
    return std::nullopt;
  }
  const Eigen::Vector3d normal = table_from_sheet.linear().col(2);
  const Eigen::Vector3d eye_mm = camera.table_from_camera.translation();
  const double t = normal.dot(table_from_sheet.translation() - eye_mm) / normal.dot(*ray);
  return t > 0.0 ? std::optional<Eigen::Vector3d>(eye_mm + t * *ray) : std::nullopt;
}

// One frame's usable blocks as samples of its light.
Status AddSamples(const FrameFile& file, const BlockMeans& means,
                  const std::vector<Eigen::Vector3d>& dark, size_t light, Sheet& sheet) {
  const Eigen::Array3d noise = NoisePerRadiance(means);
  size_t saturated = 0;
  size_t unlit = 0;
  for (int row = 0; row < means.grid.rows; ++row) {
    for (int column = 0; column < means.grid.columns; ++column) {
      const int block = row * means.grid.columns + column;
      const BlockMean& mean = means.blocks[static_cast<size_t>(block)];
      const std::optional<Eigen::Vector3d> point =
          SheetPointOfPixel(*sheet.rig.camera, sheet.table_from_sheet, means.Center(column, row));
      SheetSample sample{.normal = sheet.table_from_sheet.linear().col(2),
                         .radiance_rgb = mean.radiance_rgb};
      if (!dark.empty()) {
        sample.radiance_rgb -= dark[static_cast<size_t>(block)];
      }
      const Eigen::Array3d variance = noise * mean.radiance_rgb.array() / mean.sites_rgb.array();
      sample.sd_rgb = variance.max(kSmallestVariance).sqrt();
      const bool is_lit = (sample.radiance_rgb.array() > kDarkSignal * sample.sd_rgb.array()).all();
      saturated += mean.saturated ? 1 : 0;
      unlit += is_lit ? 0 : 1;
      if (point && is_lit && !mean.saturated) {
        sample.point_mm = *point;
        sheet.samples[light].push_back(sample);
        sheet.blocks[light].push_back(block);
      }
    }
  }
  const auto share = [&](size_t count) {
    return static_cast<double>(count) / static_cast<double>(means.blocks.size());
  };
  const std::string& name = sheet.rig.lights[light].name;
  if (share(saturated) > kMostSpoilt) {
    return Fail(ErrorCode::kBadData,
                "{}: {:.0f} % of the sheet under light '{}' is saturated; need less than half, and "
                "best none: expose for less",
                file.path.string(), 100.0 * share(saturated), name);
  }
  if (share(unlit) > kMostSpoilt) {
    return Fail(
        ErrorCode::kBadData,
        "{}: {:.0f} % of the sheet under light '{}' is dark; did the light come on, and does "
        "the paper fill the table?",
        file.path.string(), 100.0 * share(unlit), name);
  }
  if (saturated > 0) {
    sheet.warnings.push_back(fmt::format("{}: {:.1f} % of the blocks are saturated and left out",
                                         file.path.string(), 100.0 * share(saturated)));
  }
  return {};
}

Status CheckPlan(const std::filesystem::path& dir, const CapturePlan& plan) {
  if (plan.session->kind != SessionKind::kSheet) {
    return Fail(ErrorCode::kBadData, "{}: is a session of kind '{}'; need a sheet", dir.string(),
                Name(plan.session->kind));
  }
  if (!plan.rig.camera) {
    return Fail(ErrorCode::kBadData,
                "{}: the rig has no camera; calibrate lens and pose first, so that pixels have a "
                "place on the sheet",
                dir.string());
  }
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (!plan.lit[k]) {
      return Fail(ErrorCode::kBadData, "{}: has no frame of light '{}'", dir.string(),
                  plan.rig.lights[k].name);
    }
  }
  return {};
}

}  // namespace

Result<Sheet> ReadSheet(const std::filesystem::path& dir, const ReadSheetOptions& options,
                        const Task& task) {
  Result<CapturePlan> plan = PlanSession(dir, {.rig_file = options.rig_file});
  if (!plan) {
    return tl::unexpected(plan.error());
  }
  if (Status status = CheckPlan(dir, *plan); !status) {
    return tl::unexpected(status.error());
  }
  Sheet sheet{.rig = plan->rig, .grid = options.grid};
  sheet.table_from_sheet = plan->session->table_from_sheet.value_or(Eigen::Isometry3d::Identity());
  sheet.sha256_of_input = plan->sha256_of_input;
  const size_t count = plan->lit.size();
  sheet.samples.resize(count);
  sheet.blocks.resize(count);
  task.BeginStage("reading " + dir.filename().string(),
                  static_cast<int>(count + plan->dark.size()));
  const Result<std::vector<Eigen::Vector3d>> dark = MeanOfDark(plan->dark, options.grid, sheet);
  if (!dark) {
    return tl::unexpected(dark.error());
  }
  task.Advance(static_cast<int>(plan->dark.size()));
  std::vector<Result<BlockMeans>> means(count);
  const Status ran = ParallelFor(static_cast<int>(count), 1, task, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      means[static_cast<size_t>(k)] =
          ReadBlockMeans(*plan->lit[static_cast<size_t>(k)], options.grid);
    }
  });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  for (size_t k = 0; k < count; ++k) {
    const FrameFile& file = *plan->lit[k];
    if (!means[k]) {
      return tl::unexpected(means[k].error());
    }
    if (means[k]->size_px != sheet.rig.camera->size_px) {
      return Fail(ErrorCode::kBadData, "{}: is {} x {} px, but the rig's camera has {} x {}",
                  file.path.string(), means[k]->size_px.width, means[k]->size_px.height,
                  sheet.rig.camera->size_px.width, sheet.rig.camera->size_px.height);
    }
    sheet.sha256_of_input[file.path.string()] = means[k]->sha256;
    if (Status status = AddSamples(file, *means[k], *dark, k, sheet); !status) {
      return tl::unexpected(status.error());
    }
  }
  return sheet;
}

}  // namespace sateen
