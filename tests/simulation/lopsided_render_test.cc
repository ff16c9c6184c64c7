#include <gtest/gtest.h>

#include "simulation/render.h"
#include "tests/testing/lopsided_rig.h"

namespace sateen::lopsided_render_test {
namespace {

// A flat table of albedo rho under each near light: rho phi (1000 / |d|)^2 d_z / |d|, at the point
// that the camera's figures give by hand.
TEST(Render, APlaneUnderALopsidedRig) {
  Scene scene;
  scene.rig = testing::LopsidedRig();
  scene.surface = MakePlane(0.0, 0.0).value();
  scene.materials.resize(1);
  const Eigen::Vector3d rho(0.7, 0.5, 0.3);
  scene.materials[0].albedo = ConstantAlbedo{rho};
  SceneRenderer renderer = SceneRenderer::Create(scene).value();
  const ImageSize size = scene.rig.camera->size_px;
  for (size_t k = 0; k < scene.rig.lights.size(); ++k) {
    const Light& light = scene.rig.lights[k];
    const RenderedFrame frame = renderer.Render(k).value();
    ASSERT_EQ(frame.radiance[0].width, size.width);
    ASSERT_EQ(frame.radiance[0].height, size.height);
    for (int v = 0; v < size.height; v += 3) {
      for (int u = 0; u < size.width; u += 5) {
        const Eigen::Vector3d d =
            light.position_mm - testing::TablePointByHand(*scene.rig.camera, u, v);
        for (size_t c = 0; c < 3; ++c) {
          const auto i = static_cast<Eigen::Index>(c);
          const double expected =
              rho[i] * light.flux_rgb[i] * 1e6 / d.squaredNorm() * d.z() / d.norm();
          EXPECT_NEAR(static_cast<double>(frame.radiance[c].At(u, v)), expected, 1e-5 * expected)
              << light.name << ' ' << u << ' ' << v;
        }
      }
    }
  }
}

}  // namespace
}  // namespace sateen::lopsided_render_test
