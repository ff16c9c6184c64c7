#include "pipelines/calibrate/pictures/pose_pictures.h"

#include <cmath>

#include "core/files/output_folder.h"
#include "imaging/image_io.h"
#include "imaging/show/canvas.h"
#include "rig/projection.h"
#include "scanner/sessions/board_photos.h"

namespace sateen {
namespace {

constexpr int kAxesWidthPx = 1000;
constexpr int kAxesHeadPx = 34;
constexpr double kGridMm = 50.0;
constexpr double kReachMm = 1000.0;  // of the grid
constexpr double kAxisMm = 50.0;
constexpr Color8 kGridInk = {90, 190, 255};

// Lines on the table, bent as the lens bends them.
class TablePen {
 public:
  TablePen(const Camera& camera, double scale, Canvas& canvas)
      : camera_(camera), scale_(scale), canvas_(canvas) {}

  // Returns the canvas's point of a table point; nothing outside the image.
  [[nodiscard]] std::optional<Eigen::Vector2d> At(const Eigen::Vector3d& x_mm) const {
    const Eigen::Vector3d in_camera = camera_.table_from_camera.inverse() * x_mm;
    if (!(in_camera.z() > 1.0)) {
      return std::nullopt;
    }
    const Eigen::Vector2d ideal = PixelOfTablePoint(PinholeOf(camera_), x_mm);
    const auto at = PixelOfPinholePixel(camera_, ideal.x(), ideal.y());
    const bool inside = at && at->x() > -1.0 && at->y() > -1.0 && at->x() < camera_.size_px.width &&
                        at->y() < camera_.size_px.height;
    return inside ? std::optional<Eigen::Vector2d>(scale_ * *at + Eigen::Vector2d(0, kAxesHeadPx))
                  : std::nullopt;
  }

  void Draw(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& to_mm, const Color8& ink,
            int thickness_px) {
    constexpr int kPieces = 200;
    std::optional<Eigen::Vector2d> before = At(from_mm);
    for (int i = 1; i <= kPieces; ++i) {
      const auto next = At(from_mm + (to_mm - from_mm) * i / kPieces);
      if (before && next) {
        canvas_.Line(*before, *next, ink, thickness_px);
      }
      before = next;
    }
  }

 private:
  const Camera& camera_;
  double scale_;
  Canvas& canvas_;
};

}  // namespace

Status DrawPose(const PoseCalibration& result, double thickness_mm) {
  const Result<BoardPicture> picture = ReadBoardPicture(result.found.photos.front());
  if (!picture) {
    return tl::unexpected(picture.error());
  }
  const double scale = static_cast<double>(kAxesWidthPx) / picture->grey.width;
  const Rgb8 photo = ScaledGrey(picture->grey, scale);
  Canvas canvas(kAxesWidthPx, kAxesHeadPx + photo[0].height, {24, 26, 30});
  canvas.Place(photo, 0, kAxesHeadPx);
  canvas.Text({12, 22},
              fmt::format("Table: x red, y green, z blue, {:g} mm each; blue grid {:g} mm; origin "
                          "at the board's centre",
                          kAxisMm, kGridMm),
              kWhiteInk);
  // Where the print is, so that it can be judged: the table lies a thickness below.
  const Camera& camera = *result.rig.camera;
  TablePen pen(camera, scale, canvas);
  const auto on_print = [&](double x, double y, double z) {
    return Eigen::Vector3d(x, y, z + thickness_mm);
  };
  const int lines = static_cast<int>(2.0 * kReachMm / kGridMm);
  for (int line = 0; line <= lines; ++line) {
    const double at = -kReachMm + line * kGridMm;
    pen.Draw(on_print(at, -kReachMm, 0), on_print(at, kReachMm, 0), kGridInk, 1);
    pen.Draw(on_print(-kReachMm, at, 0), on_print(kReachMm, at, 0), kGridInk, 1);
  }
  pen.Draw(on_print(0, 0, 0), on_print(kAxisMm, 0, 0), kRedInk, 3);
  pen.Draw(on_print(0, 0, 0), on_print(0, kAxisMm, 0), kGreenInk, 3);
  pen.Draw(on_print(0, 0, 0), on_print(0, 0, kAxisMm), kBlueInk, 3);
  for (const auto& [name, end, ink] : {std::tuple("x", on_print(kAxisMm + 4, -2, 0), kRedInk),
                                       std::tuple("y", on_print(-2, kAxisMm + 6, 0), kGreenInk)}) {
    if (const auto at = pen.At(end)) {
      canvas.Text(*at, name, ink);
    }
  }
  if (const auto at = pen.At(on_print(0, 0, 0))) {
    canvas.Dot(*at, 4, kWhiteInk);
  }
  Result<OutputFolder> folder = OutputFolder::Open(result.pictures);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  return WritePng8(folder->Stage("axes.png"), canvas.Taken()).and_then([&] {
    return folder->Commit();
  });
}

}  // namespace sateen
