#include "scanner/sessions/sheet_reader.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"
#include "scanner/sessions/dataset.h"
#include "scanner/sessions/session_layout.h"
#include "scanner/sessions/sheet_blocks.h"
#include "scanner/sessions/sheet_frames.h"

namespace sateen {
namespace {

// The mean of the dark frames; empty without any.
Result<std::vector<Eigen::Vector3d>> MeanOfDark(const std::vector<FrameFile>& dark,
                                                const BlockGrid& grid, Sheet& sheet) {
  std::vector<Eigen::Vector3d> mean;
  double sum = 0.0;
  for (const FrameFile& file : dark) {
    sum += file.exposure * file.exposure;
  }
  for (const FrameFile& file : dark) {
    const Result<BlockMeans> one = ReadBlockMeans(file, grid);
    if (!one) {
      return tl::unexpected(one.error());
    }
    sheet.sha256_of_input[file.path.string()] = one->sha256;
    mean.resize(one->blocks.size(), Eigen::Vector3d::Zero());
    for (size_t i = 0; i < mean.size(); ++i) {
      mean[i] += (file.exposure * file.exposure / sum) * one->blocks[i].radiance_rgb;
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

// `allow_bad`: what is wrong with more than half of a frame goes into sheet.faults.
Status CheckFrame(const FrameFile& file, const Spoilt& spoilt, size_t light, bool allow_bad,
                  Sheet& sheet) {
  const auto [saturated, unlit] = spoilt;
  const std::string& name = sheet.rig.lights[light].name;
  if (allow_bad && spoilt.Fault() != FrameFault::kNone) {
    sheet.faults[light] = spoilt.Fault();
    return {};
  }
  if (spoilt.Fault() == FrameFault::kSaturated) {
    return Fail(ErrorCode::kBadData,
                "{}: {:.0f} % of the sheet under light '{}' is saturated; need less than half, and "
                "best none: expose for less",
                file.path.string(), 100.0 * saturated, name);
  }
  if (spoilt.Fault() == FrameFault::kDark) {
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

void AddSamples(const std::vector<BlockSample>& blocks, const Places& places, size_t light,
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

// By the border of the sheet, in the frame of each light that is `usable`.
Status FindPose(const std::filesystem::path& dir, const ReadPlan& plan,
                const std::vector<std::optional<size_t>>& usable, const SheetBorder& border,
                const Task& task, Sheet& sheet) {
  std::vector<FrameFile> lit;
  std::vector<std::string> names;
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (usable[k]) {
      lit.push_back(plan.lit[k][*usable[k]]);
      names.push_back(lit.back().path.lexically_relative(dir).string());
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
                    "border for a more certain pose",
                    dir.string(), pose->markers_used, pose->markers));
  }
  sheet.table_from_sheet = pose->table_from_sheet;
  sheet.found_pose = *std::move(pose);
  return {};
}

Status CheckPlan(const std::filesystem::path& dir, const ReadPlan& plan, bool allow_missing) {
  if (plan.session->kind != SessionKind::kSheet) {
    return Fail(ErrorCode::kBadData, "{}: is a session of kind '{}'; need a sheet", dir.string(),
                Name(plan.session->kind));
  }
  if (Status pose = plan.rig.RequirePose(dir.string()); !pose) {
    return pose;
  }
  if (std::ranges::none_of(plan.lit, [](const auto& files) { return !files.empty(); })) {
    return Fail(ErrorCode::kBadData, "{}: has no lit frame", dir.string());
  }
  for (size_t k = 0; k < plan.lit.size(); ++k) {
    if (plan.lit[k].empty() && !allow_missing) {
      return Fail(ErrorCode::kBadData, "{}: has no frame of light '{}'", dir.string(),
                  plan.rig.lights[k].name);
    }
  }
  return {};
}

class SheetReader {
 public:
  SheetReader(const std::filesystem::path& dir, const ReadSheetOptions& options, ReadPlan plan,
              const Task& task)
      : dir_(dir), options_(options), plan_(std::move(plan)), task_(task) {}

  Result<Sheet> Run() {
    sheet_.rig = plan_.rig;
    sheet_.grid = options_.grid;
    sheet_.table_from_sheet =
        plan_.session->table_from_sheet.value_or(Eigen::Isometry3d::Identity());
    sheet_.pose_is_recorded = plan_.session->table_from_sheet.has_value();
    sheet_.sha256_of_input = plan_.sha256_of_input;
    sheet_.warnings = plan_.warnings;
    const Status status = ReadFrames()
                              .and_then([&] { return TakeBlocks(); })
                              .and_then([&] { return FindPoseByBorder(); })
                              .and_then([&] { return TakeSamples(); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    return std::move(sheet_);
  }

 private:
  Status ReadFrames() {
    size_t count = plan_.dark.size();
    for (size_t k = 0; k < plan_.lit.size(); ++k) {
      for (const FrameFile& file : plan_.lit[k]) {
        files_.emplace_back(k, &file);
        ++count;
      }
    }
    task_.BeginStage("reading " + dir_.filename().string(), static_cast<int>(count));
    Result<std::vector<Eigen::Vector3d>> dark = MeanOfDark(plan_.dark, options_.grid, sheet_);
    if (!dark) {
      return tl::unexpected(dark.error());
    }
    dark_ = *std::move(dark);
    if (!dark_.empty()) {
      sheet_.dark_rgb = MeanOf(dark_);
    }
    task_.Advance(static_cast<int>(plan_.dark.size()));
    means_.resize(files_.size());
    return ParallelFor(static_cast<int>(files_.size()), 1, task_, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const auto f = static_cast<size_t>(i);
        means_[f] = ReadBlockMeans(*files_[f].second, options_.grid);
      }
    });
  }

  // [light][block]; no blocks for a light without a frame.
  Status TakeBlocks() {
    const Places everywhere(
        static_cast<size_t>(options_.grid.columns) * static_cast<size_t>(options_.grid.rows),
        Eigen::Vector3d::Zero());
    blocks_.resize(plan_.lit.size());
    usable_.resize(plan_.lit.size());
    std::vector<size_t> seen(plan_.lit.size(), 0);  // frames of each light
    for (size_t f = 0; f < files_.size(); ++f) {
      if (!means_[f]) {
        return tl::unexpected(means_[f].error());
      }
      const auto& [k, file] = files_[f];
      const ImageSize& size = means_[f]->size_px;
      const ImageSize& expected = sheet_.rig.camera->size_px;
      if (size != expected) {
        return Fail(ErrorCode::kBadData, "{}: is {} x {} px, but the rig's camera has {} x {}",
                    file->path.string(), size.width, size.height, expected.width, expected.height);
      }
      sheet_.sha256_of_input[file->path.string()] = means_[f]->sha256;
      std::vector<BlockSample> blocks = BlockSamplesOf(*means_[f], dark_);
      if (!usable_[k] && SpoiltOf(blocks, everywhere).Fault() == FrameFault::kNone) {
        usable_[k] = seen[k];
      }
      ++seen[k];
      TakeUnsaturated(std::move(blocks), blocks_[k]);
      any_ = f;
    }
    return {};
  }

  // Adds a shorter exposure to what the longer ones say.
  static void TakeUnsaturated(std::vector<BlockSample> shorter, std::vector<BlockSample>& blocks) {
    if (blocks.empty()) {
      blocks = std::move(shorter);
      return;
    }
    for (size_t b = 0; b < blocks.size(); ++b) {
      if (blocks[b].saturated) {
        blocks[b] = shorter[b];
      }
    }
  }

  Status FindPoseByBorder() {
    if (!options_.border || (sheet_.pose_is_recorded && !options_.find_poses)) {
      return {};
    }
    return FindPose(dir_, plan_, usable_, *options_.border, task_, sheet_);
  }

  Status TakeSamples() {
    const Places places =
        PlacesOf(*means_[any_], *sheet_.rig.camera, sheet_.table_from_sheet, options_.border);
    sheet_.blank_blocks = static_cast<int>(
        std::ranges::count_if(places, [](const auto& place) { return place.has_value(); }));
    if (sheet_.blank_blocks == 0) {
      return Fail(ErrorCode::kBadData,
                  "{}: no part of the picture shows the blank inside of the sheet{}; check where "
                  "the sheet is said to lie",
                  dir_.string(), options_.border ? "'s border" : "");
    }
    const size_t count = blocks_.size();
    sheet_.samples.resize(count);
    sheet_.blocks.resize(count);
    sheet_.faults.resize(count, FrameFault::kDark);
    for (size_t k = 0; k < count; ++k) {
      if (plan_.lit[k].empty()) {
        continue;
      }
      sheet_.faults[k] = FrameFault::kNone;
      if (Status status = CheckFrame(plan_.lit[k].back(), SpoiltOf(blocks_[k], places), k,
                                     options_.allow_bad_frames, sheet_);
          !status) {
        return status;
      }
      if (sheet_.faults[k] == FrameFault::kNone) {
        AddSamples(blocks_[k], places, k, sheet_);
      }
    }
    return {};
  }

  const std::filesystem::path dir_;
  const ReadSheetOptions options_;
  const ReadPlan plan_;
  const Task task_;
  std::vector<Eigen::Vector3d> dark_;
  std::vector<std::pair<size_t, const FrameFile*>> files_;  // with the light, longest first
  std::vector<Result<BlockMeans>> means_;                   // one per file
  std::vector<std::vector<BlockSample>> blocks_;
  std::vector<std::optional<size_t>>
      usable_;      // [light]: its longest exposure to find the border in
  size_t any_ = 0;  // a file
  Sheet sheet_;
};

}  // namespace

Result<Sheet> ReadSheet(const std::filesystem::path& dir, const ReadSheetOptions& options,
                        const Task& task) {
  Result<ReadPlan> plan = PlanSession(dir, {.rig_file = options.rig_file});
  if (!plan) {
    return tl::unexpected(plan.error());
  }
  if (Status status = CheckPlan(dir, *plan, options.allow_bad_frames); !status) {
    return tl::unexpected(status.error());
  }
  return SheetReader(dir, options, *std::move(plan), task).Run();
}

}  // namespace sateen
