// A flat, white sheet of 2 x 2 pixels under four distant lights: its normal must be (0, 0, 1).

#include <cmath>
#include <iostream>

#include "pipelines/overview/session_overview.h"
#include "pipelines/simulate/simulate.h"
#include "solver/lambertian.h"

int main() {
  sateen::Rig rig;
  sateen::LightStack stack;
  for (int k = 0; k < 4; ++k) {
    const double azimuth_rad = k * std::acos(0.0);
    sateen::Light light;
    light.direction = {0.6 * std::cos(azimuth_rad), 0.6 * std::sin(azimuth_rad), 0.8};
    rig.lights.push_back(light);
    sateen::LightFrame frame;
    frame.rgb = sateen::Image3({2, 2}, 0.8F);  // n . l of n = (0, 0, 1)
    stack.push_back(frame);
  }

  const auto field = sateen::SolveLambertian(stack, rig, std::nullopt);
  if (!field) {
    std::cerr << field.error().message << '\n';
    return 1;
  }
  const sateen::Image3& n = field->normal;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      const float error = std::hypot(n[0].At(x, y), n[1].At(x, y), n[2].At(x, y) - 1.0F);
      if (!(error < 1e-5F)) {
        std::cerr << "pixel " << x << ", " << y << ": the normal is off by " << error << '\n';
        return 1;
      }
    }
  }
  return 0;
}
