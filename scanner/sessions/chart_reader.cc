#include "scanner/sessions/chart_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "core/statistics.h"
#include "imaging/raw.h"
#include "scanner/sessions/dataset.h"
#include "scanner/sessions/files/patch_places.h"
#include "scanner/sessions/frames/frame_loader.h"
#include "scanner/sessions/session_layout.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kBrightShare = 0.02;  // share of the picture: the white patch and more
constexpr float kWellBelowWhite = 0.5F;
constexpr float kBelowWhite = 0.9F;
constexpr size_t kFewestPatchSites = 400;  // sites per patch: a hundred red ones

struct ChartFile {
  FrameFile file;
  std::optional<size_t> light;
  double exposure_s = 0.0;
};

Result<std::vector<ChartFile>> FilesOf(const fs::path& dir, const ReadPlan& plan) {
  std::vector<ChartFile> files;
  const std::vector<SessionFrame>& frames = plan.session->frames;
  for (const SessionFrame& frame : frames) {
    ChartFile file{.file = {dir / frame.file, frame.Exposure(), frame.sha256}};
    const std::string path = file.file.path.string();
    if (!IsRawName(file.file.path)) {
      return Fail(
          ErrorCode::kBadData,
          "{}: is not a camera RAW file; a sensor's response is measured from its raw readings, "
          "which developed files do not have",
          path);
    }
    if (!frame.exposure_s) {
      return Fail(ErrorCode::kBadData,
                  "{}: the session does not say its exposure_s; linearity needs it for every frame",
                  path);
    }
    if (frame.f_number != frames[0].f_number || frame.iso != frames[0].iso) {
      return Fail(ErrorCode::kBadData,
                  "{}: has another f_number or iso than {}; need one of each, and exposure_s alone "
                  "to differ",
                  path, frames[0].file);
    }
    file.exposure_s = *frame.exposure_s;
    if (frame.role == FrameRole::kLit) {
      const Lights& lights = plan.rig.lights;
      const auto light = std::ranges::find(lights, frame.light, &Light::name);
      if (light == lights.end()) {
        return Fail(ErrorCode::kBadData, "{}: is of light '{}', which is not in the rig", path,
                    frame.light);
      }
      file.light = static_cast<size_t>(light - lights.begin());
    }
    files.push_back(std::move(file));
  }
  if (std::ranges::none_of(files, [](const ChartFile& file) { return file.light.has_value(); })) {
    return Fail(ErrorCode::kBadData, "{}: has no lit frame", dir.string());
  }
  return files;
}

Image<float> CellsOf(const RawMosaic& mosaic) {
  Image<float> cells(mosaic.samples.width / 2, mosaic.samples.height / 2);
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const Image<float>& s = mosaic.samples;
      cells.At(x, y) = 0.25F * (s.At(2 * x, 2 * y) + s.At(2 * x + 1, 2 * y) +
                                s.At(2 * x, 2 * y + 1) + s.At(2 * x + 1, 2 * y + 1));
    }
  }
  return cells;
}

// Returns the level that a small share of the picture is above.
float BrightLevel(const Image<float>& cells) { return Quantile(cells.pixels, 1.0 - kBrightShare); }

class ChartReader {
 public:
  ChartReader(const fs::path& dir, const Chart& chart, const ReadChartOptions& options,
              const Task& task)
      : dir_(dir), chart_(chart), options_(options), task_(task) {}

  Result<ChartSession> Run() {
    Result<ReadPlan> plan = PlanSessionRig(dir_, {.rig_file = options_.rig_file});
    if (!plan) {
      return tl::unexpected(plan.error());
    }
    if (plan->session->kind != SessionKind::kChart) {
      return Fail(ErrorCode::kBadData, "{}: is a session of kind '{}'; need a chart", dir_.string(),
                  Name(plan->session->kind));
    }
    if (!plan->rig.camera) {
      return Fail(
          ErrorCode::kBadData,
          "{}: the rig has no camera; calibrate lens and pose first, so that the patches can be "
          "found in the picture",
          dir_.string());
    }
    Result<std::vector<ChartFile>> files = FilesOf(dir_, *plan);
    if (!files) {
      return tl::unexpected(files.error());
    }
    files_ = std::move(*files);
    capture_.rig = std::move(plan->rig);
    capture_.sha256_of_input = std::move(plan->sha256_of_input);
    const Status status = Find().and_then([&] { return ReadAll(); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    Describe();
    return std::move(capture_);
  }

 private:
  // By the exposure times, so that few frames are read twice: from the longest down to the first
  // whose brightest part is not saturated.
  Status Find() {
    std::vector<size_t> order;
    for (size_t f = 0; f < files_.size(); ++f) {
      if (files_[f].light) {
        order.push_back(f);
      }
    }
    std::ranges::stable_sort(
        order, [&](size_t a, size_t b) { return files_[a].exposure_s > files_[b].exposure_s; });
    task_.BeginStage("finding the chart", static_cast<int>(order.size()));
    for (const size_t f : order) {
      if (Status status = task_.CheckCancelled(); !status) {
        return status;
      }
      const Result<RawMosaic> mosaic = ReadRawMosaic(files_[f].file.path, files_[f].file.limit);
      if (!mosaic) {
        return tl::unexpected(mosaic.error());
      }
      capture_.cells = CellsOf(*mosaic);
      task_.Advance();
      if (BrightLevel(capture_.cells) < (f == order.back() ? kBelowWhite : kWellBelowWhite)) {
        return FindIn(f, *mosaic);
      }
    }
    return Fail(
        ErrorCode::kBadData,
        "{}: is saturated over more than {:g} % of the picture, as are all longer ones; add "
        "shorter exposures",
        files_[order.back()].file.path.string(), 100.0 * kBrightShare);
  }

  Status FindIn(size_t frame, const RawMosaic& mosaic) {
    const Camera& camera = *capture_.rig.camera;
    first_ = mosaic;
    if (mosaic.samples.Size() != camera.size_px) {
      return Fail(ErrorCode::kBadData, "{}: is {} x {} px, but the rig's camera has {} x {}",
                  files_[frame].file.path.string(), mosaic.samples.width, mosaic.samples.height,
                  camera.size_px.width, camera.size_px.height);
    }
    const Light& light = capture_.rig.lights[*files_[frame].light];
    Result<ChartPose> pose = FindChart(capture_.cells, camera, light, chart_, options_.find);
    if (!pose) {
      return Fail(pose.error().code, "{}: {}", files_[frame].file.path.string(),
                  pose.error().message);
    }
    capture_.pose = *pose;
    for (const ChartPatch& patch : chart_.patches) {
      places_.push_back(PlacesOf(patch, chart_.patch_mm, camera, pose->table_from_chart, mosaic));
      std::vector<Eigen::Vector2d>& corners = capture_.corners.emplace_back();
      for (const Eigen::Vector2d& corner_px : places_.back().corners_px) {
        corners.emplace_back(0.5 * corner_px - Eigen::Vector2d::Constant(0.25));
      }
      if (places_.back().index.size() < kFewestPatchSites) {
        return Fail(
            ErrorCode::kBadData,
            "{}: the middle of patch '{}' has {} sites; need at least {}: use larger patches "
            "or a camera of higher resolution",
            files_[frame].file.path.string(), patch.name, places_.back().index.size(),
            kFewestPatchSites);
      }
    }
    return {};
  }

  Result<ChartFrame> ReadFrame(const ChartFile& chart_file, std::string& sha256) const {
    Result<std::string> hash = CheckedHash(chart_file.file);
    if (!hash) {
      return tl::unexpected(hash.error());
    }
    sha256 = *std::move(hash);
    const std::string path = chart_file.file.path.string();
    const Result<RawMosaic> mosaic = ReadRawMosaic(chart_file.file.path, chart_file.file.limit);
    if (!mosaic) {
      return tl::unexpected(mosaic.error());
    }
    if (mosaic->samples.Size() != first_.samples.Size() || mosaic->cfa != first_.cfa ||
        mosaic->black != first_.black || mosaic->white != first_.white) {
      return Fail(ErrorCode::kBadData,
                  "{}: has another size, pattern, black or white level than the frames before it; "
                  "need one camera in one mode",
                  path);
    }
    ChartFrame frame{.file = path, .light = chart_file.light, .exposure_s = chart_file.exposure_s};
    for (const PatchPlaces& places : places_) {
      std::vector<uint16_t>& dn = frame.dn.emplace_back();
      dn.reserve(places.index.size());
      for (const size_t index : places.index) {
        const float reading =
            mosaic->samples.pixels[index] * (mosaic->white - mosaic->black) + mosaic->black;
        dn.push_back(static_cast<uint16_t>(std::clamp(std::lround(reading), 0L, 65535L)));
      }
    }
    return frame;
  }

  Status ReadAll() {
    const auto count = static_cast<int>(files_.size());
    task_.BeginStage("reading " + dir_.filename().string(), count);
    std::vector<Result<ChartFrame>> frames(files_.size());
    std::vector<std::string> hashes(files_.size());
    Status ran = ParallelFor(count, 1, task_, [&](int begin, int) {
      const auto f = static_cast<size_t>(begin);
      frames[f] = ReadFrame(files_[f], hashes[f]);
    });
    for (size_t f = 0; f < files_.size() && ran; ++f) {
      if (!frames[f]) {
        return tl::unexpected(frames[f].error());
      }
      capture_.sha256_of_input[frames[f]->file] = hashes[f];
      capture_.readings.frames.push_back(std::move(*frames[f]));
    }
    return ran;
  }

  void Describe() {
    ChartReadings& readings = capture_.readings;
    for (const Light& light : capture_.rig.lights) {
      readings.lights.push_back(light.name);
    }
    for (size_t i = 0; i < places_.size(); ++i) {
      readings.patch_names.push_back(chart_.patches[i].name);
      readings.reflectance_rgb.push_back(chart_.patches[i].reflectance_rgb);
      readings.patches.push_back(std::move(places_[i].sites));
    }
    readings.file_black_dn = static_cast<double>(first_.black);
    readings.file_white_dn = static_cast<double>(first_.white);
  }

  const fs::path& dir_;
  const Chart& chart_;
  const ReadChartOptions& options_;
  const Task& task_;
  std::vector<ChartFile> files_;
  RawMosaic first_;  // the frame in which the chart was found
  std::vector<PatchPlaces> places_;
  ChartSession capture_;
};

}  // namespace

Result<ChartSession> ReadChart(const fs::path& dir, const Chart& chart,
                               const ReadChartOptions& options, const Task& task) {
  return ChartReader(dir, chart, options, task).Run();
}

}  // namespace sateen
