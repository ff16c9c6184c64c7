#include <gtest/gtest.h>

#include "core/angle.h"
#include "solver/lambertian.h"
#include "tests/testing/lopsided_rig.h"

namespace sateen::lopsided_test {
namespace {

// Waves of normals over the table, shaded at the points that the camera's figures give by hand.
TEST(SolveLambertian, FindsNormalsUnderALopsidedRig) {
  const Rig rig = testing::LopsidedRig();
  const ImageSize size = rig.camera->size_px;
  const auto normal_at = [](const Eigen::Vector3d& x) {
    return Eigen::Vector3d(0.3 * std::sin(x.x() / 15.0), 0.2 * std::cos(x.y() / 11.0), 1.0)
        .normalized();
  };
  LightStack stack;
  for (const Light& light : rig.lights) {
    LightFrame frame{.rgb = Image3(size), .name = light.name};
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const Eigen::Vector3d x = testing::TablePointByHand(*rig.camera, u, v);
        const Eigen::Vector3d d = light.position_mm - x;
        const double shading = 1e6 / d.squaredNorm() * normal_at(x).dot(d) / d.norm();
        for (size_t c = 0; c < 3; ++c) {
          frame.rgb[c].At(u, v) =
              static_cast<float>(0.6 * light.flux_rgb[static_cast<Eigen::Index>(c)] * shading);
        }
      }
    }
    stack.push_back(std::move(frame));
  }
  for (const Backend backend : {Backend::kJacobiSvd, Backend::kFast}) {
    const NormalField field =
        SolveLambertian(stack, rig, std::nullopt, {.backend = backend}).value();
    double worst_deg = 0.0;
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const Eigen::Vector3d found(field.normal[0].At(u, v), field.normal[1].At(u, v),
                                    field.normal[2].At(u, v));
        const Eigen::Vector3d exact = normal_at(testing::TablePointByHand(*rig.camera, u, v));
        worst_deg = std::max(worst_deg, AngleBetweenRad(found, exact) * kDegPerRad);
      }
    }
    EXPECT_EQ(field.summary.solved, field.summary.pixels);
    EXPECT_LT(worst_deg, 1e-3) << Name(backend);  // float samples; a swap of fx and fy costs 3.8
  }
}

}  // namespace
}  // namespace sateen::lopsided_test
