#include "pipelines/overview/session_overview.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>
#include <vector>

#include "core/files/output_folder.h"
#include "core/json.h"
#include "core/quantity.h"
#include "core/sha256.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "imaging/show/canvas.h"
#include "imaging/show/pictures.h"
#include "rig/rig.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/session.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr int kOverviewPanelPx = 320;
constexpr int kOverviewColumns = 5;
constexpr double kOverviewHeatTop = 0.99;  // of the values; above is white

std::string CaptionOf(const SessionFrame& frame) {
  std::string caption = frame.role == FrameRole::kDark ? "dark" : frame.light;
  if (frame.role == FrameRole::kRepeat) {
    caption += " again";
  }
  return frame.exposure_s ? caption + ", " + ExposureText(*frame.exposure_s) : caption;
}

// Returns the means of factor x factor pixels, with the factor that makes it at most
// kOverviewPanelPx wide.
Image3 SmallOf(const Image3& image) {
  const int factor = (image[0].width + kOverviewPanelPx - 1) / kOverviewPanelPx;
  Image3 small({image[0].width / factor, std::max(1, image[0].height / factor)});
  const float share = 1.0F / static_cast<float>(factor * factor);
  for (size_t c = 0; c < 3; ++c) {
    for (int y = 0; y < small[c].height * factor && y < image[c].height; ++y) {
      for (int x = 0; x < small[c].width * factor; ++x) {
        small[c].At(x / factor, y / factor) += share * image[c].At(x, y);
      }
    }
  }
  return small;
}

Result<Image3> ReadSmallFrame(const fs::path& path, const std::optional<Response>& response) {
  if (!IsRawName(path)) {
    return ReadPhoto(path).map([](const Photo& photo) { return SmallOf(photo.rgb); });
  }
  return ReadRawMosaic(path).map([&](const RawMosaic& mosaic) {
    std::array<float, 3> balance = mosaic.camera_white_balance;
    for (size_t c = 0; c < 3 && response; ++c) {
      balance[c] = static_cast<float>(response->white_balance[static_cast<Eigen::Index>(c)]);
    }
    return SmallOf(Demosaic(mosaic, balance));
  });
}

// Shows every frame as bright as it is: 1 is the white of the brightest one.
Result<std::vector<Rgb8>> FramePanels(const fs::path& dir, const Session& session,
                                      const std::optional<Response>& response, const Task& task) {
  std::vector<Image3> frames;
  float white = 0.0F;
  task.BeginStage("reading", static_cast<int>(session.frames.size()));
  for (const SessionFrame& frame : session.frames) {
    Result<Image3> rgb =
        task.CheckCancelled().and_then([&] { return ReadSmallFrame(dir / frame.file, response); });
    if (!rgb) {
      return tl::unexpected(rgb.error());
    }
    white = std::max(white, frame.role == FrameRole::kDark ? 0.0F : WhiteOf(*rgb));
    frames.push_back(*std::move(rgb));
    task.Advance();
  }
  std::vector<Rgb8> panels;
  for (size_t k = 0; k < frames.size(); ++k) {
    panels.push_back(
        Captioned(ShowLinear(frames[k], std::max(white, 1e-6F)), CaptionOf(session.frames[k])));
  }
  return panels;
}

// Shows an error or a residual as heat, with its scale.
Rgb8 HeatOf(const Image<float>& values, const std::string& what, const std::string& unit) {
  std::vector<float> sorted = values.pixels;
  const auto place =
      sorted.begin() +
      static_cast<std::ptrdiff_t>(kOverviewHeatTop * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), place, sorted.end());
  const float top = std::max(*place, 1e-6F);
  const Rgb8 heat = ShowHeat(values, top, Image<uint8_t>(values.width, values.height, 1));
  return Captioned(Shrunk(heat, kOverviewPanelPx), HeatCaption(what, top, unit));
}

// Fails where the maps were solved from other frames. solve.json has the hash of every file that
// the solve read: at least one frame of this session must be among them.
Status CheckMapsAreOf(const Session& session, const SessionOverviewOptions& options) {
  const fs::path record = options.maps / "solve.json";
  const Result<std::string> text = ReadFileBytes(record);
  const Result<nlohmann::json> json =
      text ? ParseJson(*text, record.string()) : tl::unexpected(text.error());
  if (!json) {
    return Fail(json.error().code, "{}; give a folder of maps that sateen solve has written",
                json.error().message);
  }
  std::set<std::string> hashes;
  const bool has_inputs = json->is_object() && json->contains("inputs");
  for (const auto& [file, hash] : has_inputs ? (*json)["inputs"].items() : json->items()) {
    hashes.insert(hash.is_string() ? hash.get<std::string>() : "");
  }
  int known = 0;
  for (const SessionFrame& frame : session.frames) {
    if (frame.role == FrameRole::kLit) {
      const Result<std::string> hash = Sha256OfFile(options.session / frame.file);
      known += hash && hashes.contains(*hash) ? 1 : 0;
    }
  }
  return known > 0
             ? Status()
             : Fail(ErrorCode::kBadData,
                    "{}: lists other frames than those of {}; give the maps of a solve of this "
                    "session, or solve it again",
                    record.string(), options.session.string());
}

Result<std::vector<Rgb8>> MapPanels(const fs::path& maps) {
  std::vector<Rgb8> panels;
  const auto add = [&](const char* file, const char* caption, const auto& show) -> Status {
    return ReadImage3(maps / file).map([&](const Image3& map) {
      panels.push_back(Captioned(Shrunk(show(map), kOverviewPanelPx), caption));
    });
  };
  Status status =
      add("normal.exr", "normal", [](const Image3& map) { return ShowNormal(map); }).and_then([&] {
        return add("albedo.exr", "albedo", [](const Image3& map) { return ShowLinear(map); });
      });
  for (const auto& [file, what, unit] : {std::tuple{"residual.exr", "residual", ""},
                                         std::tuple{"uncertainty.exr", "uncertainty", "deg"},
                                         std::tuple{"error.exr", "error", "deg"}}) {
    std::error_code ignored;
    if (status && fs::exists(maps / file, ignored)) {
      status = ReadPhoto(maps / file).map([&, what = what, unit = unit](const Photo& map) {
        panels.push_back(HeatOf(map.rgb[0], what, unit));
      });
    }
  }
  return status ? Result<std::vector<Rgb8>>(std::move(panels)) : tl::unexpected(status.error());
}

}  // namespace

Status WriteSessionOverview(const SessionOverviewOptions& options, const Task& task) {
  if (LowerCase(options.output.extension().string()) != ".png") {
    return Fail(ErrorCode::kInvalidArgument, "{}: the contact sheet is a PNG; need a name in .png",
                options.output.string());
  }
  const Result<Session> session = ReadSessionRecord(options.session);
  const Result<Rig> rig =
      session ? ReadRig(options.session / session->rig) : tl::unexpected(session.error());
  Status ours = session && !options.maps.empty() ? CheckMapsAreOf(*session, options) : Status();
  if (!ours) {
    return ours;
  }
  Result<std::vector<Rgb8>> panels =
      rig ? FramePanels(options.session, *session, rig->response, task)
          : tl::unexpected(rig.error());
  if (panels && !options.maps.empty()) {
    // Maps begin a row of their own.
    while (panels->size() % kOverviewColumns != 0) {
      Rgb8 empty = panels->back();
      for (Image<uint8_t>& plane : empty) {
        std::ranges::fill(plane.pixels, uint8_t{255});
      }
      panels->push_back(std::move(empty));
    }
    panels =
        MapPanels(options.maps).and_then([&](std::vector<Rgb8> maps) -> Result<std::vector<Rgb8>> {
          if (maps.front()[0].Size() != panels->front()[0].Size()) {
            return Fail(
                ErrorCode::kBadData,
                "{}: its maps differ in shape from the frames of {}; give the maps of a solve of "
                "this session",
                options.maps.string(), options.session.string());
          }
          panels->insert(panels->end(), maps.begin(), maps.end());
          return *std::move(panels);
        });
  }
  if (!panels) {
    return tl::unexpected(panels.error());
  }
  Result<OutputFolder> folder = OutputFolder::Open(
      options.output.has_parent_path() ? options.output.parent_path() : fs::path("."));
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  return WritePng8(folder->Stage(options.output.filename().string()),
                   ContactSheet(*panels, kOverviewColumns))
      .and_then([&] { return folder->Commit(); });
}

}  // namespace sateen
