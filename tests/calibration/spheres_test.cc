#include "calibration/spheres.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "core/angle.h"
#include "imaging/image_io.h"
#include "tests/testing/files.h"

namespace sateen {
namespace {

using ::testing::HasSubstr;

constexpr double kRadiusMm = 30.0;
constexpr int kFine = 2;  // rays along each side of a pixel

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kRadPerDeg;
}

// Sees 300 mm of the table from 600 mm, with a lens that bends the image's corners by 3 px.
Camera SphereCamera() {
  Camera camera = OverheadCamera({1500, 1000}, 600.0, 300.0);
  camera.distortion = {-0.05, 0.01, 0.0005, -0.0003, 0.0};
  return camera;
}

const std::vector<Eigen::Vector3d>& Centers() {
  static const std::vector<Eigen::Vector3d> centers = {{-85.0, 35.0, 30.0}, {90.0, -40.0, 30.0}};
  return centers;
}

// What a ray sees of one sphere: nothing beside it, otherwise the lamps' mirror images, each a
// bell of one degree about where it lies as seen from the place of reflection.
std::optional<double> Mirrored(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray,
                               const Eigen::Vector3d& center,
                               const std::vector<Eigen::Vector3d>& lamps) {
  const double b = ray.dot(origin - center);
  const double root = b * b - (origin - center).squaredNorm() + kRadiusMm * kRadiusMm;
  if (root <= 0.0) {
    return std::nullopt;
  }
  const Eigen::Vector3d hit = origin + (-b - std::sqrt(root)) * ray;
  const Eigen::Vector3d normal = (hit - center) / kRadiusMm;
  const Eigen::Vector3d mirrored = ray - 2.0 * ray.dot(normal) * normal;
  double value = 0.02;
  for (const Eigen::Vector3d& lamp : lamps) {
    value += std::exp(-std::pow(AngleDeg(mirrored, lamp - hit), 2));
  }
  return value;
}

// Chrome spheres on a grey table under these lamps; `exposure` above 1 saturates the highlights.
Image<float> RenderSpheres(const std::vector<Eigen::Vector3d>& lamps, double exposure = 0.9) {
  const Camera camera = SphereCamera();
  const Eigen::Vector3d origin = camera.table_from_camera.translation();
  Image<float> gray(camera.size_px, 0.3F);
  for (const Eigen::Vector3d& center : Centers()) {
    const Eigen::Vector2d at = PixelOfTablePoint(camera, center);
    for (int y = 0; y < gray.height; ++y) {
      for (int x = 0; x < gray.width; ++x) {
        if ((Eigen::Vector2d(x, y) - at).norm() > 200.0) {
          continue;
        }
        double sum = 0.0;
        for (int fine = 0; fine < kFine * kFine; ++fine) {
          const double u = x + (fine % kFine + 0.5) / kFine - 0.5;
          const double v = y + (fine / kFine + 0.5) / kFine - 0.5;
          const std::optional<double> seen =
              Mirrored(origin, RayOfPixel(camera, u, v).value(), center, lamps);
          sum += seen ? std::min(1.0, exposure * *seen) : 0.3;
        }
        gray.At(x, y) = static_cast<float>(sum / (kFine * kFine));
      }
    }
  }
  return gray;
}

std::vector<Sphere> SpheresOf(const Image<float>& gray, const std::optional<Camera>& camera) {
  std::vector<Sphere> spheres;
  spheres.reserve(2);
  const std::vector<Circle> circles = FindCircles(gray, 2, "mean").value();
  for (const Circle& circle : circles) {
    spheres.push_back(
        FindSphere(gray, circle, "mean", {.camera = camera, .radius_mm = kRadiusMm}).value());
  }
  return spheres;
}

TEST(Spheres, StandWhereTheyAre) {
  const std::vector<Sphere> spheres = SpheresOf(RenderSpheres({}), SphereCamera());

  for (size_t i = 0; i < 2; ++i) {
    EXPECT_LT((spheres[i].center - Centers()[i]).head<2>().norm(), 0.01) << i;
    EXPECT_NEAR(spheres[i].center.z(), 30.0, 0.2) << i;  // depth is 5.6 times as hard as width
    EXPECT_GT(spheres[i].seen, 0.99);
  }
}

TEST(Spheres, AMaskGivesThemToo) {
  Image<float> gray = RenderSpheres({});
  Mask mask(gray.Size());
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    mask.pixels[i] = gray.pixels[i] < 0.16F ? 255 : 0;
  }

  const std::vector<Circle> circles = CirclesInMask(mask, 2, "mask.png").value();

  for (const Circle& circle : circles) {
    const Sphere sphere = FindSphere(AsPhotograph(mask), circle, "mask.png",
                                     {.camera = SphereCamera(), .radius_mm = kRadiusMm})
                              .value();
    const bool left = circle.center_px.x() < 750.0;
    EXPECT_LT((sphere.center - Centers()[left ? 0 : 1]).head<2>().norm(), 0.03);
  }
  EXPECT_THAT(CirclesInMask(mask, 1, "mask.png").error().message,
              HasSubstr("mask.png: 2 regions; need 1"));
}

// Directions from each sphere, positions from both, lamps low and high, exact and saturated. The
// classic mistake, the normal for the light, and v = z are both far outside what is allowed.
TEST(Spheres, DirectionsAndPositions) {
  const Camera camera = SphereCamera();
  const std::vector<Sphere> spheres = SpheresOf(RenderSpheres({}), camera);
  for (const double exposure : {0.9, 4.0}) {
    for (const Eigen::Vector3d& lamp :
         {Eigen::Vector3d(250, 100, 500), Eigen::Vector3d(-400, 50, 300),
          Eigen::Vector3d(60, -300, 450)}) {
      const Image<float> frame = RenderSpheres({lamp}, exposure);
      std::vector<SphereRay> rays;
      rays.reserve(2);
      for (const Sphere& sphere : spheres) {
        const Highlight highlight =
            FindHighlight(frame, sphere, "frame", {.level = 0.5}).value();  // a few px wide
        rays.push_back(ReflectedRay(sphere, camera, highlight.at_px).value());
        const Eigen::Vector3d truth = lamp - rays.back().from;
        EXPECT_LT(AngleDeg(rays.back().direction, truth), 0.05);

        const Eigen::Vector3d normal = rays.back().from - sphere.center;
        EXPECT_GT(AngleDeg(normal, truth), 10.0);
        const Eigen::Vector3d n = normal.normalized();
        EXPECT_GT(AngleDeg(2.0 * n.z() * n - Eigen::Vector3d::UnitZ(), truth), 1.0);
      }
      const SphereLight light = LightFromRays(rays, true, "frame").value();
      ASSERT_EQ(light.light.model, LightModel::kNear);
      EXPECT_LT((light.light.position_mm - lamp).norm(), 2.0);
      EXPECT_LT(light.residual_rad, 0.05 * kRadPerDeg);
      EXPECT_GT(light.position_sd_mm->minCoeff(), 0.0);

      EXPECT_EQ(LightFromRays({rays[0]}, true, "frame")->light.model, LightModel::kDistant);
    }
  }
}

TEST(Spheres, AFarLampStaysADirection) {
  const Eigen::Vector3d away = Eigen::Vector3d(1, 2, 3).normalized();
  const std::vector<SphereRay> rays = {{Centers()[0], away}, {Centers()[1], away}};

  const SphereLight light = LightFromRays(rays, true, "frame").value();

  EXPECT_EQ(light.light.model, LightModel::kDistant);
  EXPECT_LT(AngleDeg(light.light.direction, away), 1e-6);
}

TEST(Spheres, ErrorsNameTheFrame) {
  const Camera camera = SphereCamera();
  const Image<float> dark = RenderSpheres({});
  const std::vector<Sphere> spheres = SpheresOf(dark, camera);
  EXPECT_THAT(FindHighlight(dark, spheres[0], "07.png").error().message,
              HasSubstr("07.png: no highlight in the sphere at"));

  const Image<float> two = RenderSpheres({{250, 100, 500}, {-250, 100, 500}});
  EXPECT_THAT(FindHighlight(two, spheres[0], "08.png").error().message,
              HasSubstr("08.png: two highlights alike in one sphere"));

  Image<float> cut(600, 900);  // the right sphere loses its right part... and the left its left
  for (int y = 0; y < cut.height; ++y) {
    for (int x = 0; x < cut.width; ++x) {
      cut.At(x, y) = dark.At(x + 300, y);
    }
  }
  const Circle half{{spheres[0].outline.center_px.x() - 300.0, spheres[0].outline.center_px.y()},
                    spheres[0].outline.radius_px};
  EXPECT_THAT(FindSphere(cut, half, "09.png").error().message,
              HasSubstr("is cut by the frame of 600 x 900 px"));

  EXPECT_THAT(FindCircles(Image<float>({300, 300}, 0.2F), 1, "10.png").error().message,
              HasSubstr("10.png: 0 of 1 spheres stand out"));
  EXPECT_THAT(ReflectedRay(spheres[0], camera, {5.0, 5.0}).error().message,
              HasSubstr("is not on the sphere"));
  const std::vector<SphereRay> askew = {{{0, 0, 0}, Eigen::Vector3d::UnitX()},
                                        {{0, 80, 0}, Eigen::Vector3d::UnitZ()}};
  EXPECT_THAT(LightFromRays(askew, true, "11.png").error().message,
              HasSubstr("11.png: the rays of 2 spheres miss one lamp"));
  EXPECT_THAT(FindSphere(dark, half, "12.png", {.camera = camera}).error().message,
              HasSubstr("radius_mm = 0; need"));
}

// Xiong's photographs: the spheres fill crops of 1200 px, the published directions are orthographic,
// x right, y up, z to the viewer, from circles marked by hand (circle_data.txt: 1-based, y up), one
// file a sphere; those of the object are the means of both. Columns are frames.
Eigen::Matrix<double, 3, 20> PublishedDirections(const std::filesystem::path& folder) {
  std::ifstream file(folder / "light_directions.txt");
  Eigen::Matrix<double, 3, 20> directions;
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 20; ++column) {
      file >> directions(row, column);
    }
  }
  return directions;
}

struct HarvardErrors {
  double worst_deg = 0.0;
  double mean_deg = 0.0;
};

HarvardErrors ErrorsOf(const Eigen::Matrix<double, 3, 20>& found,
                       const Eigen::Matrix<double, 3, 20>& published) {
  HarvardErrors errors;
  for (Eigen::Index k = 0; k < 20; ++k) {
    const double off = AngleDeg(found.col(k), published.col(k));
    errors.worst_deg = std::max(errors.worst_deg, off);
    errors.mean_deg += off / 20.0;
  }
  return errors;
}

Eigen::Matrix<double, 3, 20> FoundDirections(const std::filesystem::path& folder) {
  const Image<float> ref = MeanOfPlanes(ReadPhoto(folder / "ref.JPG")->rgb);
  const Circle rough = FindCircles(ref, 1, "ref.JPG").value().front();
  const Sphere sphere = FindSphere(ref, rough, "ref.JPG").value();
  Eigen::Matrix<double, 3, 20> directions;
  for (Eigen::Index k = 0; k < 20; ++k) {
    const std::string name = fmt::format("Image_{:02}.JPG", k + 1);
    const Image<float> frame = MeanOfPlanes(ReadPhoto(folder / name)->rgb);
    const Highlight highlight = FindHighlight(frame, sphere, name).value();
    directions.col(k) = ReflectedRay(sphere, std::nullopt, highlight.at_px)->direction;
  }
  return directions;
}

TEST(Spheres, HarvardPhotographsGiveThePublishedDirections) {
  SATEEN_NEEDS_DATA("harvard-psd");
  for (const char* object : {"cat", "frog"}) {
    const std::filesystem::path folder = testing::DataDir() / "harvard-psd" / object;
    Eigen::Matrix<double, 3, 20> mean = Eigen::Matrix<double, 3, 20>::Zero();
    for (const char* probe : {"LightProbe-1", "LightProbe-2"}) {
      const Eigen::Matrix<double, 3, 20> found = FoundDirections(folder / probe);
      const HarvardErrors errors = ErrorsOf(found, PublishedDirections(folder / probe));
      mean += found / 2.0;
      fmt::print("{} {}: worst {:.2f}, mean {:.2f} degrees\n", object, probe, errors.worst_deg,
                 errors.mean_deg);
      EXPECT_LT(errors.worst_deg, 1.6) << object << ' ' << probe;
      EXPECT_LT(errors.mean_deg, 1.1) << object << ' ' << probe;
    }
    const HarvardErrors errors = ErrorsOf(mean, PublishedDirections(folder));
    fmt::print("{}: worst {:.2f}, mean {:.2f} degrees\n", object, errors.worst_deg,
               errors.mean_deg);
    EXPECT_LT(errors.worst_deg, 1.5) << object;
  }
}

}  // namespace
}  // namespace sateen
