#pragma once

#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/sha256.h"
#include "imaging/image_io.h"
#include "rig/rig.h"
#include "scanner/sessions/session.h"
#include "simulation/rigs.h"
#include "simulation/virtual_rig/camera/lit_scene.h"
#include "tests/testing/files.h"

// A scene of a few pixels that differs with the light, the colour and the place.
namespace sateen::testing {

inline constexpr ImageSize kSmallPx = {64, 48};

inline double SmallRadiance(size_t light, size_t colour, int x, int y) {
  return 0.05 + 0.02 * static_cast<double>(light) + 0.03 * static_cast<double>(colour) +
         0.001 * ((x + 3 * y) % 29);
}
inline constexpr double kSmallAmbient = 0.02;

inline Image3 SmallPicture(size_t light) {
  Image3 picture(kSmallPx);
  for (size_t c = 0; c < 3; ++c) {
    for (int y = 0; y < kSmallPx.height; ++y) {
      for (int x = 0; x < kSmallPx.width; ++x) {
        picture[c].At(x, y) = static_cast<float>(SmallRadiance(light, c, x, y));
      }
    }
  }
  return picture;
}

// As `sateen simulate --linear` writes it: lit frames hold the ambient light. `spoil` may change
// the session and the rig before they are written.
inline void WriteSmallScene(const std::filesystem::path& dir, double ambient = kSmallAmbient,
                            const std::function<void(Session&, Rig&)>& spoil = {}) {
  Rig rig = RingRig(kSmallPx, LightModel::kNear);
  Session session{.rig = "rig.json"};
  const auto write = [&](const std::string& name, const Image3& picture) {
    std::filesystem::create_directories(dir / "frames");
    ASSERT_TRUE(WriteExr(dir / "frames" / (name + ".exr"), picture));
    session.frames.push_back({.role = name == "dark" ? FrameRole::kDark : FrameRole::kLit,
                              .light = name == "dark" ? "" : name,
                              .file = "frames/" + name + ".exr",
                              .sha256 = *Sha256OfFile(dir / "frames" / (name + ".exr"))});
  };
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    Image3 picture = SmallPicture(k);
    for (Image<float>& plane : picture.planes) {
      for (float& value : plane.pixels) {
        value += static_cast<float>(ambient);
      }
    }
    write(rig.lights[k].name, picture);
  }
  write("dark", Image3(kSmallPx, static_cast<float>(ambient)));
  if (spoil) {
    spoil(session, rig);
  }
  const std::string rig_json = RigToJson(rig);
  session.rig_sha256 = Sha256(rig_json);
  WriteText(dir / "rig.json", rig_json);
  WriteText(dir / "session.json", SessionToJson(session));
}

// The same without the disk: v of LitScene (1) for a sensor of full scale 1.
inline LitScene SmallScene() {
  LitScene scene{.folder = "small",
                 .rig = RingRig(kSmallPx, LightModel::kNear),
                 .ambient = Image<float>(kSmallPx, static_cast<float>(kSmallAmbient))};
  for (size_t k = 0; k < scene.rig.lights.size(); ++k) {
    const Image3 picture = SmallPicture(k);
    Image<float> sites(kSmallPx);
    for (int y = 0; y < kSmallPx.height; ++y) {
      for (int x = 0; x < kSmallPx.width; ++x) {
        sites.At(x, y) = picture[Sensor().cfa[static_cast<size_t>(y % 2 * 2 + x % 2)]].At(x, y);
      }
    }
    scene.lights.push_back(std::move(sites));
  }
  return scene;
}

}  // namespace sateen::testing
