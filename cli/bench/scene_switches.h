#pragma once

#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "simulation/scene.h"
#include "simulation/sensor.h"

namespace sateen::cli {

// One key of a scene file, turned on in a scene that has nothing else, to show its cost, its effect
// on a solve and its picture (docs/simulation.md).
struct SceneSwitch {
  std::string_view key;   // as in a scene file, with its value
  std::string_view file;  // stem of its picture
  std::function<void(Scene&)> turn_on = [](Scene&) {};
  std::optional<Sensor> sensor = std::nullopt;  // absent: radiance as it is
};

// Returns waves under ten near lights, Lambertian, with attached shadows.
[[nodiscard]] Result<Scene> PlainScene(ImageSize size);

// Lists the switches. The first turns nothing on.
[[nodiscard]] std::vector<SceneSwitch> SceneSwitches();

// A surface that a scene may have, for its picture.
struct SceneShape {
  std::string_view file;  // stem of its picture: the value of surface.shape
  double width_mm = 0.0;  // of the picture
  std::function<Result<SurfacePtr>()> make;
};

[[nodiscard]] std::vector<SceneShape> SceneShapes();

// Returns the surface under ten near lights, each part in a colour of its own.
[[nodiscard]] Result<Scene> ShapeScene(const SceneShape& shape, ImageSize size);

}  // namespace sateen::cli
