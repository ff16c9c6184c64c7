#include "scanner/sheet_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "scanner/session_layout.h"
#include "scanner/sheet_frames.h"
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

Eigen::Vector3d MeanOf(const std::vector<Eigen::Vector3d>& blocks) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& block : blocks) {
    mean += block / static_cast<double>(blocks.size());
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

// A block of one frame, less the dark, and what is wrong with it.
struct BlockSample {
  SheetSample sample;
  bool is_lit = false;
  bool saturated = false;
};

std::vector<BlockSample> BlockSamplesOf(const BlockMeans& means,
                                        const std::vector<Eigen::Vector3d>& dark) {
  const Eigen::Array3d noise = NoisePerRadiance(means);
  std::vector<BlockSample> blocks;
  blocks.reserve(means.blocks.size());
  for (size_t i = 0; i < means.blocks.size(); ++i) {
    const BlockMean& mean = means.blocks[i];
    BlockSample block{.sample = {.radiance_rgb = mean.radiance_rgb}, .saturated = mean.saturated};
    if (!dark.empty()) {
      block.sample.radiance_rgb -= dark[i];
    }
    const Eigen::Array3d variance = noise * mean.radiance_rgb.array() / mean.sites_rgb.array();
    block.sample.sd_rgb = variance.max(kSmallestVariance).sqrt();
    block.is_lit =
        (block.sample.radiance_rgb.array() > kDarkSignal * block.sample.sd_rgb.array()).all();
    blocks.push_back(block);
  }
  return blocks;
}

// `allow_bad`: what is wrong with more than half of a frame goes into sheet.faults.
Status CheckFrame(const FrameFile& file, const std::vector<BlockSample>& blocks, size_t light,
                  bool allow_bad, Sheet& sheet) {
  const auto share = [&](auto is_so) {
    return static_cast<double>(std::ranges::count_if(blocks, is_so)) /
           static_cast<double>(blocks.size());
  };
  const double saturated = share([](const BlockSample& block) { return block.saturated; });
  const double unlit = share([](const BlockSample& block) { return !block.is_lit; });
  const std::string& name = sheet.rig.lights[light].name;
  if (allow_bad && std::max(saturated, unlit) > kMostSpoilt) {
    sheet.faults[light] = saturated > kMostSpoilt ? FrameFault::kSaturated : FrameFault::kDark;
    return {};
  }
  if (saturated > kMostSpoilt) {
    return Fail(ErrorCode::kBadData,
                "{}: {:.0f} % of the sheet under light '{}' is saturated; need less than half, and "
                "best none: expose for less",
                file.path.string(), 100.0 * saturated, name);
  }
  if (unlit > kMostSpoilt) {
    return Fail(
        ErrorCode::kBadData,
        "{}: {:.0f} % of the sheet under light '{}' is dark; did the light come on, and does "
        "the paper fill the table?",
        file.path.string(), 100.0 * unlit, name);
  }
  if (saturated > 0.0) {
    sheet.warnings.push_back(fmt::format("{}: {:.1f} % of the blocks are saturated and left out",
                                         file.path.string(), 100.0 * saturated));
  }
  return {};
}

// Whether a block shows nothing but the blank inside of the sheet.
bool IsBlank(const Camera& camera, const Eigen::Isometry3d& table_from_sheet,
             const Eigen::AlignedBox2d& extent_px, const SheetBorder& border) {
  using Corner = Eigen::AlignedBox2d::CornerType;
  for (const Corner corner :
       {Corner::BottomLeft, Corner::BottomRight, Corner::TopLeft, Corner::TopRight}) {
    const auto point = SheetPointOfPixel(camera, table_from_sheet, extent_px.corner(corner));
    if (!point ||
        !border.BlankMm().contains((table_from_sheet.inverse() * *point).head<2>().eval())) {
      return false;
    }
  }
  return true;
}

// Where the centre of each block lies on the sheet; nothing where it is not to be used.
std::vector<std::optional<Eigen::Vector3d>> PlacesOf(const BlockMeans& means, const Sheet& sheet,
                                                     const std::optional<SheetBorder>& border) {
  std::vector<std::optional<Eigen::Vector3d>> places;
  places.reserve(means.blocks.size());
  for (int row = 0; row < means.grid.rows; ++row) {
    for (int column = 0; column < means.grid.columns; ++column) {
      const bool usable = !border || IsBlank(*sheet.rig.camera, sheet.table_from_sheet,
                                             means.Extent(column, row), *border);
      places.push_back(usable ? SheetPointOfPixel(*sheet.rig.camera, sheet.table_from_sheet,
                                                  means.Center(column, row))
                              : std::nullopt);
    }
  }
  return places;
}

void AddSamples(const std::vector<BlockSample>& blocks,
                const std::vector<std::optional<Eigen::Vector3d>>& places, size_t light,
                Sheet& sheet) {
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (places[i] && blocks[i].is_lit && !blocks[i].saturated) {
      SheetSample sample = blocks[i].sample;
      sample.point_mm = *places[i];
      sample.normal = sheet.table_from_sheet.linear().col(2);
      sheet.samples[light].push_back(sample);
      sheet.blocks[light].push_back(static_cast<int>(i));
    }
  }
}

// By the border of the sheet.
Status FindPose(const std::filesystem::path& dir, const CapturePlan& plan,
                const SheetBorder& border, const Task& task, Sheet& sheet) {
  std::vector<FrameFile> lit;
  std::vector<std::string> names;
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (sheet.faults[k] == FrameFault::kNone) {
      lit.push_back(*plan.lit[k]);
      names.push_back(plan.lit[k]->path.lexically_relative(dir).string());
    }
  }
  task.BeginStage("pose of " + dir.filename().string(), static_cast<int>(lit.size()));
  const Camera& camera = *sheet.rig.camera;
  Result<SheetPose> pose =
      ReadSheetFrames(lit, SheetShrink(camera, border), task).and_then([&](const auto& frames) {
        return FitSheetPose(frames, camera, border, names);
      });
  if (!pose) {
    return Fail(pose.error().code, "{}: {}", dir.string(), pose.error().message);
  }
  if (2 * pose->markers_used < pose->markers) {
    sheet.warnings.push_back(
        fmt::format("{}: {} of {} markers of the border are seen whole; show more of the paper's "
                    "rim for a surer pose",
                    dir.string(), pose->markers_used, pose->markers));
  }
  sheet.table_from_sheet = pose->table_from_sheet;
  sheet.found_pose = *std::move(pose);
  return {};
}

Status CheckPlan(const std::filesystem::path& dir, const CapturePlan& plan, bool allow_missing) {
  if (plan.session->kind != SessionKind::kSheet) {
    return Fail(ErrorCode::kBadData, "{}: is a session of kind '{}'; need a sheet", dir.string(),
                Name(plan.session->kind));
  }
  if (Status pose = plan.rig.RequirePose(dir.string()); !pose) {
    return pose;
  }
  if (std::ranges::none_of(plan.lit, [](const auto& file) { return file.has_value(); })) {
    return Fail(ErrorCode::kBadData, "{}: has no lit frame", dir.string());
  }
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (!plan.lit[k] && !allow_missing) {
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
  if (Status status = CheckPlan(dir, *plan, options.allow_bad_frames); !status) {
    return tl::unexpected(status.error());
  }
  Sheet sheet{.rig = plan->rig, .grid = options.grid};
  sheet.table_from_sheet = plan->session->table_from_sheet.value_or(Eigen::Isometry3d::Identity());
  sheet.pose_is_recorded = plan->session->table_from_sheet.has_value();
  sheet.sha256_of_input = plan->sha256_of_input;
  const size_t count = plan->lit.size();
  sheet.samples.resize(count);
  sheet.blocks.resize(count);
  sheet.faults.resize(count, FrameFault::kNone);
  task.BeginStage("reading " + dir.filename().string(),
                  static_cast<int>(count + plan->dark.size()));
  const Result<std::vector<Eigen::Vector3d>> dark = MeanOfDark(plan->dark, options.grid, sheet);
  if (!dark) {
    return tl::unexpected(dark.error());
  }
  if (!dark->empty()) {
    sheet.dark_rgb = MeanOf(*dark);
  }
  task.Advance(static_cast<int>(plan->dark.size()));
  std::vector<Result<BlockMeans>> means(count);
  const Status ran = ParallelFor(static_cast<int>(count), 1, task, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      if (const std::optional<FrameFile>& file = plan->lit[static_cast<size_t>(k)]) {
        means[static_cast<size_t>(k)] = ReadBlockMeans(*file, options.grid);
      }
    }
  });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  std::vector<std::vector<BlockSample>> blocks(count);
  size_t any = 0;  // a frame that there is
  for (size_t k = 0; k < count; ++k) {
    if (!plan->lit[k]) {
      sheet.faults[k] = FrameFault::kDark;
      continue;
    }
    any = k;
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
    blocks[k] = BlockSamplesOf(*means[k], *dark);
    if (Status status = CheckFrame(file, blocks[k], k, options.allow_bad_frames, sheet); !status) {
      return tl::unexpected(status.error());
    }
  }
  if (options.border && (options.find_poses || !sheet.pose_is_recorded)) {
    if (Status status = FindPose(dir, *plan, *options.border, task, sheet); !status) {
      return tl::unexpected(status.error());
    }
  }
  const auto places = PlacesOf(*means[any], sheet, options.border);
  for (size_t k = 0; k < count; ++k) {
    if (sheet.faults[k] == FrameFault::kNone) {
      AddSamples(blocks[k], places, k, sheet);
    }
  }
  return sheet;
}

}  // namespace sateen
