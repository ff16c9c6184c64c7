#include "pipelines/calibrate/pictures/sphere_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

#include "core/angle.h"
#include "core/files/output_folder.h"
#include "core/whole_number.h"
#include "imaging/image_io.h"
#include "imaging/show/pictures.h"

namespace sateen {
namespace {

constexpr int kSpherePanelPx = 900;
constexpr double kPanelRadii = 1.12;  // half a panel, in radii of its sphere
constexpr int kFraction = 4;          // binary digits of the coordinates of antialiased lines
constexpr double kPolarRadiusPx = 380.0;

const cv::Scalar kGreen(40, 230, 80);
const cv::Scalar kYellow(255, 220, 40);
const cv::Scalar kInk(30, 30, 30);
const cv::Scalar kPale(205, 205, 205);
const cv::Scalar kBlue(20, 90, 200);
const cv::Scalar kRed(200, 40, 30);

cv::Point Fixed(const Eigen::Vector2d& at) {
  return {ClampedTo<int>(std::round(at.x() * (1 << kFraction))),
          ClampedTo<int>(std::round(at.y() * (1 << kFraction)))};
}

void Dot(cv::Mat3b& picture, const Eigen::Vector2d& at, double radius, const cv::Scalar& color,
         int thickness) {
  cv::circle(picture, Fixed(at), static_cast<int>(radius * (1 << kFraction)), color, thickness,
             cv::LINE_AA, kFraction);
}

// Draws text with a halo. `anchor`: share of its width and height that lies left of and above `at`.
void Text(cv::Mat3b& picture, const std::string& text, const Eigen::Vector2d& at, double scale,
          const cv::Scalar& color, const Eigen::Vector2d& anchor = {0.0, 0.5}) {
  int below = 0;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, 1, &below);
  const cv::Point corner(static_cast<int>(at.x() - anchor.x() * size.width),
                         static_cast<int>(at.y() + (1.0 - anchor.y()) * size.height));
  const bool on_dark = color[0] + color[1] + color[2] > 340.0;  // of 765
  cv::putText(picture, text, corner, cv::FONT_HERSHEY_SIMPLEX, scale,
              cv::Scalar::all(on_dark ? 0.0 : 255.0), 4, cv::LINE_AA);
  cv::putText(picture, text, corner, cv::FONT_HERSHEY_SIMPLEX, scale, color, 1, cv::LINE_AA);
}

cv::Mat3b AsMat(const Rgb8& picture) {
  cv::Mat3b mat(picture[0].height, picture[0].width);
  for (int y = 0; y < mat.rows; ++y) {
    for (int x = 0; x < mat.cols; ++x) {
      mat(y, x) = {picture[0].At(x, y), picture[1].At(x, y), picture[2].At(x, y)};
    }
  }
  return mat;
}

Rgb8 AsRgb8(const cv::Mat3b& mat) {
  Rgb8 picture = {Image<uint8_t>(mat.cols, mat.rows), Image<uint8_t>(mat.cols, mat.rows),
                  Image<uint8_t>(mat.cols, mat.rows)};
  for (int y = 0; y < mat.rows; ++y) {
    for (int x = 0; x < mat.cols; ++x) {
      for (size_t c = 0; c < 3; ++c) {
        picture[c].At(x, y) = mat(y, x)[static_cast<int>(c)];
      }
    }
  }
  return picture;
}

// Draws one sphere, enlarged, with its outline and the highlights in it.
Rgb8 SpherePanel(const SpheresCalibration& result, const cv::Mat3b& shown, size_t index) {
  const Sphere& sphere = result.spheres[index];
  const double half = kPanelRadii * sphere.outline.radius_px;
  const double scale = kSpherePanelPx / (2.0 * half);
  const Eigen::Vector2d corner = sphere.outline.center_px - Eigen::Vector2d(half, half);
  const cv::Matx23d panel_from_picture(scale, 0.0, -scale * corner.x(), 0.0, scale,
                                       -scale * corner.y());
  cv::Mat3b panel;
  cv::warpAffine(shown, panel, panel_from_picture, cv::Size(kSpherePanelPx, kSpherePanelPx),
                 cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(96, 96, 96));
  std::vector<cv::Point> rim;
  for (const Eigen::Vector2d& px : sphere.rim) {
    rim.push_back(Fixed(scale * (px - corner)));
  }
  cv::polylines(panel, rim, true, kGreen, 1, cv::LINE_AA, kFraction);
  for (size_t k = 0; k < result.lights.size(); ++k) {
    const std::optional<Highlight>& highlight = result.lights[k].highlights[index];
    if (highlight) {
      const Eigen::Vector2d at = scale * (highlight->at_px - corner);
      Dot(panel, at, 2.5, kYellow, -1);
      Dot(panel, at, std::max(5.0, scale * highlight->radius_px), kYellow, 1);
    }
  }
  for (size_t k = 0; k < result.lights.size(); ++k) {
    const std::optional<Highlight>& highlight = result.lights[k].highlights[index];
    if (highlight) {
      const Eigen::Vector2d at = scale * (highlight->at_px - corner);
      Text(panel, std::to_string(k + 1), at + Eigen::Vector2d(9.0, -9.0), 0.5, kYellow);
    }
  }
  Text(panel, fmt::format("sphere {}", index + 1), {12.0, 20.0}, 0.6, kGreen);
  return AsRgb8(panel);
}

// Draws the sky: the zenith in the middle, x to the right, y up, the horizon outermost.
Rgb8 PolarPlot(const SpheresCalibration& result) {
  cv::Mat3b plot(kSpherePanelPx, kSpherePanelPx, cv::Vec3b(255, 255, 255));
  const Eigen::Vector2d middle(kSpherePanelPx / 2.0, kSpherePanelPx / 2.0);
  const auto place = [&](double elevation_deg, double azimuth_deg) -> Eigen::Vector2d {
    const double radius = kPolarRadiusPx * (90.0 - elevation_deg) / 90.0;
    const double angle = azimuth_deg * kRadPerDeg;
    return middle + radius * Eigen::Vector2d(std::cos(angle), -std::sin(angle));
  };
  for (int azimuth_deg = 0; azimuth_deg < 360; azimuth_deg += 30) {
    cv::line(plot, Fixed(middle), Fixed(place(0.0, azimuth_deg)), kPale, 1, cv::LINE_AA, kFraction);
    Text(plot, std::to_string(azimuth_deg), place(-5.5, azimuth_deg), 0.5, kInk, {0.5, 0.5});
  }
  for (int elevation_deg = 0; elevation_deg < 90; elevation_deg += 15) {
    Dot(plot, middle, kPolarRadiusPx * (90 - elevation_deg) / 90.0, kPale, 1);
  }
  for (int elevation_deg = 15; elevation_deg < 90; elevation_deg += 15) {
    Text(plot, std::to_string(elevation_deg), place(elevation_deg, 345.0), 0.4, kInk, {0.5, 0.5});
  }
  for (size_t k = 0; k < result.lights.size(); ++k) {
    const Eigen::Vector3d l = result.lights[k].Direction();
    const bool has_position = result.lights[k].lamp.light.model != LightModel::kDistant;
    const Eigen::Vector2d at =
        place(std::asin(l.z()) / kRadPerDeg, std::atan2(l.y(), l.x()) / kRadPerDeg);
    Dot(plot, at, 5.0, has_position ? kRed : kBlue, -1);
    Text(plot, std::to_string(k + 1), at + Eigen::Vector2d(8.0, -8.0), 0.55, kInk);
  }
  Text(plot, "lights by elevation (rings) and azimuth (rays), degrees", {14.0, 20.0}, 0.55, kInk);
  Text(plot, "blue: direction, red: position seen from the table's origin",
       {14.0, kSpherePanelPx - 18.0}, 0.5, kInk);
  return AsRgb8(plot);
}

}  // namespace

Status DrawSpheres(const SpheresCalibration& result) {
  Result<OutputFolder> folder = OutputFolder::Open(result.pictures);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const cv::Mat3b shown = AsMat(ShowLinear(result.shown));
  std::vector<Rgb8> panels;
  for (size_t j = 0; j < result.spheres.size(); ++j) {
    panels.push_back(SpherePanel(result, shown, j));
  }
  const Status status =
      WritePng8(folder->Stage("outlines.png"), ContactSheet(panels, 2))
          .and_then([&] { return WritePng8(folder->Stage("polar.png"), PolarPlot(result)); })
          .and_then([&] { return folder->Commit(); });
  return status ? status : tl::unexpected(folder->InPlace(status.error()));
}

}  // namespace sateen
