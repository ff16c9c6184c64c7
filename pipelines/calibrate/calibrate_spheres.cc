#include "pipelines/calibrate/calibrate_spheres.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/angle.h"
#include "core/parallel.h"
#include "core/sha256.h"
#include "core/stopwatch.h"
#include "pipelines/calibrate/pictures/sphere_pictures.h"
#include "pipelines/calibrate/rig_record.h"
#include "pipelines/calibrate/spheres_record.h"
#include "scanner/sessions/dataset.h"
#include "scanner/sessions/files/circle_file.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kSameLampRad = 0.1 * kRadPerDeg;  // between the lamps of two frames
constexpr double kFarApartRad = 2.0 * kRadPerDeg;  // between two spheres' answers, without a camera
constexpr double kAnyMissRad = 0.5;
constexpr double kUsualFieldDeg = 40.0;  // of a lens that nobody told of

class SpheresCalibrator {
 public:
  SpheresCalibrator(const CalibrateSpheresOptions& options, const Task& task)
      : options_(options), task_(task) {}

  Result<SpheresCalibration> Run() {
    const Stopwatch stopwatch;
    BeginCalibration(options_.output, "spheres", result_);
    const Status status = ReadPhotographs()
                              .and_then([&] { return ReadReference(); })
                              .and_then([&] { return FindSpheres(); })
                              .and_then([&] { return FindHighlights(); })
                              .and_then([&] { return FindLamps(); });
    if (!status) {
      return tl::unexpected(status.error());
    }
    WarnOfSameLamps();
    WarnOfOrthography();
    result_.seconds = stopwatch.Seconds();
    if (Status wrote = task_.CheckCancelled().and_then([&] { return Write(); }); !wrote) {
      return tl::unexpected(wrote.error());
    }
    return std::move(result_);
  }

 private:
  Status ReadPhotographs() {
    ReadDatasetOptions read{.lights_unknown = true, .encoding = options_.encoding};
    if (!options_.mask.empty()) {
      read.mask_file = options_.mask;
    }
    Result<Dataset> capture = ReadDataset(options_.photos, read, task_);
    if (!capture) {
      return tl::unexpected(capture.error());
    }
    capture_ = *std::move(capture);
    result_.sha256_of_input = capture_.sha256_of_input;
    result_.warnings = capture_.warnings;
    const bool is_session = capture_.session.has_value();
    for (size_t k = 0; k < capture_.stack.size(); ++k) {
      const fs::path file = capture_.stack[k].name;
      if (!is_session) {
        capture_.rig.lights[k].name = file.stem().string();
      }
      grays_.push_back(AsShareOfFullScale(capture_.stack[k]));
      result_.lights.emplace_back();
      result_.lights.back().file = file.filename();
    }
    if (!options_.rig_file.empty()) {
      Result<Rig> rig = ReadRig(options_.rig_file);
      const Result<std::string> hash = Sha256OfFile(options_.rig_file);
      if (!rig || !hash) {
        return tl::unexpected(rig ? hash.error() : rig.error());
      }
      result_.sha256_of_input[options_.rig_file.string()] = *hash;
      result_.rig = *std::move(rig);
    } else if (is_session) {
      result_.rig = capture_.rig;
    }
    if (options_.radius_mm > 0.0 && !result_.rig.camera) {
      return Fail(ErrorCode::kInvalidArgument,
                  "--radius {} without a camera gives no positions; give the camera with --rig, or "
                  "leave --radius out",
                  options_.radius_mm);
    }
    return {};
  }

  // Returns the mean of the planes as a share of full scale, or of the brightest sample where
  // frames never saturate.
  static Image<float> AsShareOfFullScale(const LightFrame& frame) {
    Image<float> gray = MeanOfPlanes(frame.rgb);
    const float scale = std::isfinite(frame.full_scale)
                            ? frame.full_scale
                            : std::max(1e-30F, *std::ranges::max_element(gray.pixels));
    for (float& i : gray.pixels) {
      i /= scale;
    }
    return gray;
  }

  // Reads the picture for the outlines: one by room light, or else the mean of the lit ones.
  Status ReadReference() {
    fs::path path = options_.reference;
    if (path.empty() && fs::is_directory(options_.photos)) {
      const Result<std::vector<std::string>> names = FilesInNaturalOrder(options_.photos);
      if (!names) {
        return tl::unexpected(names.error());
      }
      const auto name = std::ranges::find_if(*names, [](const std::string& file) {
        return IsReferenceName(file) && IsPhotoName(file);
      });
      path = name == names->end() ? fs::path() : options_.photos / *name;
    }
    if (path.empty()) {
      result_.outlines = "the mean of all frames";
      gray_ = Image<float>(grays_[0].Size());
      for (const Image<float>& gray : grays_) {
        for (size_t p = 0; p < gray.pixels.size(); ++p) {
          gray_.pixels[p] += gray.pixels[p] / static_cast<float>(grays_.size());
        }
      }
      result_.shown.planes = {gray_, gray_, gray_};
      return {};
    }
    Result<Photo> photo = ReadPhoto(path, options_.encoding);
    const Result<std::string> hash = Sha256OfFile(path);
    if (!photo || !hash) {
      return tl::unexpected(photo ? hash.error() : photo.error());
    }
    if (photo->rgb.Size() != grays_[0].Size()) {
      return Fail(ErrorCode::kBadData, "{}: is {} x {} px but the photographs are {} x {}",
                  path.string(), photo->rgb.Size().width, photo->rgb.Size().height, grays_[0].width,
                  grays_[0].height);
    }
    result_.sha256_of_input[path.string()] = *hash;
    result_.outlines = path.filename().string();
    gray_ = MeanOfPlanes(photo->rgb);
    result_.shown = std::move(photo->rgb);
    return {};
  }

  // Without a radius the sphere is 1 mm large: directions do not depend on it.
  [[nodiscard]] SphereOptions OptionsOfSpheres() const {
    return {.camera = result_.rig.camera,
            .radius_mm = options_.radius_mm > 0.0 ? options_.radius_mm : 1.0};
  }

  Status FindSpheres() {
    const ImageSize size = grays_[0].Size();
    const bool given = !options_.circles.empty();
    const bool masked = !given && capture_.mask.has_value();
    if (masked) {
      result_.outlines = "the mask";
      gray_ = AsPhotograph(*capture_.mask);
    } else if (given) {
      result_.outlines = options_.circles.filename().string();
    }
    Result<std::vector<Circle>> circles =
        given    ? ReadCircles(options_.circles, size, result_.sha256_of_input)
        : masked ? CirclesInMask(*capture_.mask, options_.spheres, result_.outlines)
                 : FindCircles(gray_, options_.spheres, result_.outlines);
    if (!circles) {
      return tl::unexpected(circles.error());
    }
    if (given && options_.spheres != 0 &&
        circles->size() != static_cast<size_t>(options_.spheres)) {
      return Fail(ErrorCode::kBadData, "{}: {} circles, but --spheres asks for {}",
                  options_.circles.string(), circles->size(), options_.spheres);
    }
    for (const Circle& circle : *circles) {
      Result<Sphere> sphere =
          given ? SphereFromCircle(circle, size, result_.outlines, OptionsOfSpheres())
                : FindSphere(gray_, circle, result_.outlines, OptionsOfSpheres());
      if (!sphere) {
        return tl::unexpected(sphere.error());
      }
      result_.spheres.push_back(*std::move(sphere));
    }
    return {};
  }

  [[nodiscard]] std::string NameOf(size_t frame) const {
    return result_.lights[frame].file.string();
  }

  Result<Highlight> HighlightIn(size_t frame, const Sphere& sphere) const {
    return options_.highlight == HighlightCenter::kLamp
               ? FindHighlight(grays_[frame], sphere, NameOf(frame))
               : MedianHighlight(capture_.stack[frame].rgb, sphere, NameOf(frame));
  }

  // Leaves out a sphere without a highlight where another has one.
  Status FindHighlights() {
    const size_t count = result_.lights.size();
    std::vector<Status> statuses(count);
    std::vector<std::vector<std::string>> warnings(count);
    task_.BeginStage("finding highlights", static_cast<int>(count));
    Status ran = ParallelFor(static_cast<int>(count), 1, task_, [&](int begin, int end) {
      for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k) {
        LampFigures& figures = result_.lights[k];
        for (const Sphere& sphere : result_.spheres) {
          const Result<Highlight> highlight = HighlightIn(k, sphere);
          figures.highlights.push_back(highlight ? std::optional(*highlight) : std::nullopt);
          figures.spheres_used += highlight ? 1 : 0;
          if (!highlight) {
            warnings[k].push_back(highlight.error().message + "; this sphere was left out");
            statuses[k] = tl::unexpected(highlight.error());
          }
        }
      }
    });
    for (size_t k = 0; ran && k < count; ++k) {
      if (result_.lights[k].spheres_used == 0) {
        return statuses[k];
      }
      result_.warnings.insert(result_.warnings.end(), warnings[k].begin(), warnings[k].end());
    }
    return ran;
  }

  Status FindLamps() {
    const std::optional<Camera>& camera = result_.rig.camera;
    const bool has_depth = camera.has_value() && options_.radius_mm > 0.0;
    const SphereLightOptions options{
        .most_residual_rad = has_depth ? SphereLightOptions().most_residual_rad : kAnyMissRad};
    const Lights known = std::exchange(result_.rig.lights, {});
    for (size_t k = 0; k < result_.lights.size(); ++k) {
      LampFigures& figures = result_.lights[k];
      std::vector<SphereRay> rays;
      for (size_t j = 0; j < result_.spheres.size(); ++j) {
        if (figures.highlights[j]) {
          const Result<SphereRay> ray =
              ReflectedRay(result_.spheres[j], camera, figures.highlights[j]->at_px);
          if (!ray) {
            return Fail(ray.error().code, "{}: {}", NameOf(k), ray.error().message);
          }
          rays.push_back(*ray);
        }
      }
      Result<SphereLight> lamp = LightFromRays(rays, has_depth, NameOf(k), options);
      if (!lamp) {
        return tl::unexpected(lamp.error());
      }
      figures.lamp = *std::move(lamp);
      TakeOver(known, k, figures.lamp.light);
      const double elevation_deg = std::asin(figures.Direction().z()) / kRadPerDeg;
      if (!(elevation_deg > 0.0)) {
        return Fail(ErrorCode::kBadData,
                    "{}: the lamp lies behind the spheres, at an elevation of {:.1f} degrees; need "
                    "lamps on the camera's side: is this highlight the lamp's own?",
                    NameOf(k), elevation_deg);
      }
      if (!has_depth && figures.lamp.residual_rad > kFarApartRad) {
        result_.warnings.push_back(fmt::format(
            "{}: the spheres' directions differ from their mean by {:.1f} degrees: a lamp so near "
            "needs a position, from --rig (the camera) and --radius",
            NameOf(k), figures.lamp.residual_rad / kRadPerDeg));
      }
      result_.rig.lights.push_back(figures.lamp.light);
    }
    return {};
  }

  // Takes name, channel and, where both are of one kind, flux from the rig's light of this name.
  void TakeOver(const Lights& known, size_t frame, Light& light) const {
    light.name = capture_.rig.lights[frame].name;
    light.channel = static_cast<int>(frame);
    const auto same = std::ranges::find(known, light.name, &Light::name);
    if (same != known.end()) {
      light.channel = same->channel;
      const bool was_distant = same->model == LightModel::kDistant;
      if (was_distant == (light.model == LightModel::kDistant)) {
        light.flux_rgb = same->flux_rgb;
      }
    }
  }

  void WarnOfSameLamps() {
    for (size_t a = 0; a < result_.lights.size(); ++a) {
      for (size_t b = a + 1; b < result_.lights.size(); ++b) {
        const double apart =
            AngleBetweenRad(result_.lights[a].Direction(), result_.lights[b].Direction());
        if (apart < kSameLampRad) {
          result_.warnings.push_back(
              fmt::format("{} and {} show lamps only {:.2f} degrees apart: does each frame show "
                          "another light?",
                          NameOf(a), NameOf(b), apart / kRadPerDeg));
        }
      }
    }
  }

  // Warns of the error that an unknown camera may cause.
  void WarnOfOrthography() {
    if (result_.rig.camera) {
      return;
    }
    const ImageSize size = grays_[0].Size();
    const Eigen::Vector2d middle((size.width - 1) / 2.0, (size.height - 1) / 2.0);
    double off_px = 0.0;
    for (const Sphere& sphere : result_.spheres) {
      off_px = std::max(off_px, (sphere.outline.center_px - middle).norm());
    }
    const double half_width = size.width / 2.0;
    const double off_rad =
        std::atan(off_px / half_width * std::tan(kUsualFieldDeg / 2.0 * kRadPerDeg));
    result_.warnings.push_back(fmt::format(
        "no camera is known: the view is taken as orthographic. In a picture {:.0f} degrees wide "
        "that turns the lights of a sphere {:.0f} px from its centre by up to {:.1f} degrees; give "
        "the camera with --rig",
        kUsualFieldDeg, off_px, off_rad / kRadPerDeg));
  }

  Status Write() {
    result_.record = RecordOf(options_, result_);
    SpheresRecord& recorded = result_.rig.calibration.spheres.emplace(result_.record);
    recorded.date = DateOfNow();
    const bool as_lp = LowerCase(options_.output.extension().string()) == ".lp";
    return result_.rig.Validate(options_.output.string())
        .and_then([&] { return DrawSpheres(result_); })
        .and_then([&]() -> Status {
          Result<fs::path> former =
              ReplaceFile(options_.output, as_lp ? LpText() : RigToJson(result_.rig));
          if (!former) {
            return tl::unexpected(former.error());
          }
          result_.former_output = *std::move(former);
          return {};
        });
  }

  // Returns the .lp file of RTI: the count, then a line "file x y z" per light.
  [[nodiscard]] std::string LpText() const {
    std::string text = fmt::format("{}\n", result_.lights.size());
    for (const LampFigures& figures : result_.lights) {
      const Eigen::Vector3d l = figures.Direction();
      text += fmt::format("{} {:.9f} {:.9f} {:.9f}\n", figures.file.string(), l.x(), l.y(), l.z());
    }
    return text;
  }

  const CalibrateSpheresOptions& options_;
  const Task& task_;
  Dataset capture_;
  std::vector<Image<float>> grays_;  // [frame]
  Image<float> gray_;                // where outlines are looked for
  SpheresCalibration result_;
};

}  // namespace

std::string_view Name(HighlightCenter center) {
  return center == HighlightCenter::kLamp ? "lamp" : "median";
}

Eigen::Vector3d LampFigures::Direction() const {
  return lamp.light.model == LightModel::kDistant ? lamp.light.direction
                                                  : lamp.light.position_mm.normalized();
}

Result<SpheresCalibration> CalibrateLightsFromSpheres(const CalibrateSpheresOptions& options,
                                                      const Task& task) {
  return SpheresCalibrator(options, task).Run();
}

}  // namespace sateen
