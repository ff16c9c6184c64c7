#include "cli/calibrate/calibrate_spheres.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "cli/calibrate/calibrate_spheres_report.h"
#include "cli/calibrate/sphere_pictures.h"
#include "cli/solve.h"
#include "core/angle.h"
#include "core/parallel.h"
#include "core/sha256.h"
#include "imaging/image_io.h"
#include "pipelines/calibrate/rig_record.h"
#include "scanner/sessions/dataset.h"
#include "scanner/sessions/files/circle_file.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kSameLampRad = 0.1 * kRadPerDeg;  // between the lamps of two frames
constexpr double kFarApartRad = 2.0 * kRadPerDeg;  // between two spheres' answers, without a camera
constexpr double kAnyMissRad = 0.5;
constexpr double kUsualFieldDeg = 40.0;  // of a lens that nobody told of

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

class SpheresCalibrator {
 public:
  SpheresCalibrator(const CalibrateSpheresArgs& args, const Task& task)
      : args_(args), task_(task) {}

  Result<SpheresCalibration> Run() {
    const auto start = std::chrono::steady_clock::now();
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
    result_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(result_);
  }

 private:
  Status ReadPhotographs() {
    ReadDatasetOptions options{.lights_unknown = true, .encoding = EncodingNamed(args_.encoding)};
    if (!args_.mask.empty()) {
      options.mask_file = args_.mask;
    }
    Result<Dataset> capture = ReadDataset(args_.photos, options, task_);
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
    if (!args_.rig_file.empty()) {
      Result<Rig> rig = ReadRig(args_.rig_file);
      const Result<std::string> hash = Sha256OfFile(args_.rig_file);
      if (!rig || !hash) {
        return tl::unexpected(rig ? hash.error() : rig.error());
      }
      result_.sha256_of_input[args_.rig_file.string()] = *hash;
      result_.rig = *std::move(rig);
    } else if (is_session) {
      result_.rig = capture_.rig;
    }
    if (args_.radius_mm > 0.0 && !result_.rig.camera) {
      return Fail(ErrorCode::kInvalidArgument,
                  "--radius {} without a camera gives no positions; give the camera with --rig, or "
                  "leave --radius out",
                  args_.radius_mm);
    }
    return {};
  }

  // The mean of the planes, 1 = full scale; of frames that never saturate, their brightest sample.
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

  // The picture for the outlines: by room light, or else the mean of the lit ones.
  Status ReadReference() {
    fs::path path = args_.reference;
    if (path.empty() && fs::is_directory(args_.photos)) {
      const Result<std::vector<std::string>> names = FilesInNaturalOrder(args_.photos);
      if (!names) {
        return tl::unexpected(names.error());
      }
      const auto name = std::ranges::find_if(*names, [](const std::string& file) {
        return IsReferenceName(file) && IsPhotoName(file);
      });
      path = name == names->end() ? fs::path() : args_.photos / *name;
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
    Result<Photo> photo = ReadPhoto(path, EncodingNamed(args_.encoding));
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
            .radius_mm = args_.radius_mm > 0.0 ? args_.radius_mm : 1.0};
  }

  Status FindSpheres() {
    const ImageSize size = grays_[0].Size();
    const bool given = !args_.circles.empty();
    const bool masked = !given && capture_.mask.has_value();
    if (masked) {
      result_.outlines = "the mask";
      gray_ = AsPhotograph(*capture_.mask);
    } else if (given) {
      result_.outlines = args_.circles.filename().string();
    }
    Result<std::vector<Circle>> circles =
        given    ? ReadCircles(args_.circles, size, result_.sha256_of_input)
        : masked ? CirclesInMask(*capture_.mask, args_.spheres, result_.outlines)
                 : FindCircles(gray_, args_.spheres, result_.outlines);
    if (!circles) {
      return tl::unexpected(circles.error());
    }
    if (given && args_.spheres != 0 && circles->size() != static_cast<size_t>(args_.spheres)) {
      return Fail(ErrorCode::kBadData, "{}: {} circles, but --spheres asks for {}",
                  args_.circles.string(), circles->size(), args_.spheres);
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
    return args_.highlight == "lamp"
               ? FindHighlight(grays_[frame], sphere, NameOf(frame))
               : MedianHighlight(capture_.stack[frame].rgb, sphere, NameOf(frame));
  }

  // One sphere without a highlight is left out where another has one.
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
    const bool has_depth = camera.has_value() && args_.radius_mm > 0.0;
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

  // Name, channel and what is known of its flux, from the rig's light of this name.
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
            AngleBetween(result_.lights[a].Direction(), result_.lights[b].Direction());
        if (apart < kSameLampRad) {
          result_.warnings.push_back(
              fmt::format("{} and {} show lamps only {:.2f} degrees apart: is each frame of a "
                          "light of its own?",
                          NameOf(a), NameOf(b), apart / kRadPerDeg));
        }
      }
    }
  }

  // What it may cost that the camera is not known.
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

  const CalibrateSpheresArgs& args_;
  const Task task_;
  Dataset capture_;
  std::vector<Image<float>> grays_;  // [frame]
  Image<float> gray_;                // where outlines are looked for
  SpheresCalibration result_;
};

// The .lp file of RTI: the count, then a line "file x y z" for each light.
std::string LpText(const SpheresCalibration& result) {
  std::string text = fmt::format("{}\n", result.lights.size());
  for (const LampFigures& figures : result.lights) {
    const Eigen::Vector3d l = figures.Direction();
    text += fmt::format("{} {:.9f} {:.9f} {:.9f}\n", figures.file.string(), l.x(), l.y(), l.z());
  }
  return text;
}

Status Write(const CalibrateSpheresArgs& args, SpheresCalibration& result) {
  result.pictures = args.output;
  result.pictures.replace_filename(args.output.stem().string() + "-spheres");
  RecordCalibration(result.rig, "spheres", nlohmann::json::parse(JsonReport(args, result)),
                    result.sha256_of_input);
  const bool as_lp = LowerCase(args.output.extension().string()) == ".lp";
  return result.rig.Validate(args.output.string())
      .and_then([&] { return DrawSpheres(result); })
      .and_then([&]() -> Status {
        Result<fs::path> former =
            ReplaceFile(args.output, as_lp ? LpText(result) : RigToJson(result.rig));
        if (!former) {
          return tl::unexpected(former.error());
        }
        result.former_output = *std::move(former);
        return {};
      });
}

}  // namespace

Eigen::Vector3d LampFigures::Direction() const {
  return lamp.light.model == LightModel::kDistant ? lamp.light.direction
                                                  : lamp.light.position_mm.normalized();
}

void AddCalibrateSpheres(CLI::App& calibrate, CalibrateSpheresArgs& args) {
  CLI::App* cmd = calibrate.add_subcommand(
      "spheres", "Directions or positions of the lights from photographs of chrome spheres");
  cmd->add_option("photos", args.photos,
                  "Folder of photographs in natural order, one a light; a session; an .lp file")
      ->required();
  cmd->add_option(
         "-o,--output", args.output,
         "Rig file to write, or a list of directions for RTI where it ends in .lp; a former "
         "one is kept as a copy")
      ->required();
  cmd->add_option("--spheres", args.spheres, "How many spheres there are; 0: as many as are found")
      ->check(CLI::Range(0, 16))
      ->capture_default_str();
  cmd->add_option("--rig", args.rig_file,
                  "Rig file with the camera's lens and pose, for the true perspective; a session's "
                  "own. Without one the view is orthographic");
  cmd->add_option("--radius", args.radius_mm,
                  "Radius of the spheres in mm: two of them and the camera give positions")
      ->check(CLI::PositiveNumber);
  cmd->add_option(
      "--reference", args.reference,
      "Picture by room light for the outlines; ref.* in the folder, or else the mean of "
      "all frames");
  CLI::Option* mask =
      cmd->add_option("--mask", args.mask, "Image that is white in the spheres; the folder's own");
  cmd->add_option("--circles", args.circles,
                  "Outlines marked by a person: a line 'x y radius' in pixels for each sphere, y "
                  "down from 0; or three lines x, y, radius, 1-based and y up")
      ->excludes(mask);
  cmd->add_option("--highlight", args.highlight,
                  "Its centre: lamp, of the bright core; median, of all pixels of the sphere from "
                  "250 of 255 on, as older toolboxes have it")
      ->check(CLI::IsMember({"lamp", "median"}))
      ->capture_default_str();
  cmd->add_option("--encoding", args.encoding,
                  "What integer files hold; auto: 8 bits are sRGB, 16 bits are linear")
      ->check(CLI::IsMember({"auto", "linear", "srgb"}))
      ->capture_default_str();
  cmd->add_option("--threads", args.threads, "Threads to use; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cmd->add_flag("--json", args.json, "Print one JSON object on stdout instead of the table");
}

int RunCalibrateSpheres(const CalibrateSpheresArgs& args, const Task& task, std::ostream& out,
                        std::ostream& log) {
  Result<SpheresCalibration> result = SpheresCalibrator(args, task.WithThreads(args.threads)).Run();
  task.ClearProgress();
  const Status status = result
                            ? task.CheckCancelled().and_then([&] { return Write(args, *result); })
                            : tl::unexpected(result.error());
  if (!status) {
    log << "sateen calibrate spheres: error: " << status.error().message << '\n';
    return ExitStatus(status.error());
  }
  for (const std::string& warning : result->warnings) {
    log << "sateen calibrate spheres: warning: " << warning << '\n';
  }
  out << (args.json ? JsonReport(args, *result) + "\n" : TextReport(args, *result));
  return 0;
}

}  // namespace sateen::cli
