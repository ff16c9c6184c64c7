#include <cmath>
#include <nlohmann/json.hpp>

#include "cli/calibrate/calibrate_pose.h"
#include "core/angle.h"
#include "core/output_folder.h"
#include "core/version.h"
#include "imaging/image_io.h"
#include "imaging/show/canvas.h"

namespace sateen::cli {
namespace {

constexpr int kAxesWidthPx = 1000;
constexpr int kAxesHeadPx = 34;
constexpr double kGridMm = 50.0;
constexpr double kReachMm = 1000.0;  // of the grid
constexpr double kAxisMm = 50.0;
constexpr Color8 kGridInk = {90, 190, 255};

// Between the camera's axis and straight down.
double LeanDeg(const Camera& camera) {
  const Eigen::Vector3d axis = camera.table_from_camera.linear().col(2);
  return std::atan2(axis.head<2>().norm(), -axis.z()) * kDegPerRad;
}

std::string DegreesOf(const Eigen::Vector3d& rad) {
  return fmt::format("{:.4f}, {:.4f}, {:.4f}", rad[0] * kDegPerRad, rad[1] * kDegPerRad,
                     rad[2] * kDegPerRad);
}

// Lines on the table, bent as the lens bends them.
class TablePen {
 public:
  TablePen(const Camera& camera, double scale, Canvas& canvas)
      : camera_(camera), scale_(scale), canvas_(canvas) {}

  // Where the canvas shows a table point; nothing outside the image.
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

std::string JsonReport(const CalibratePoseArgs& args, const PoseCalibration& result) {
  const Camera& camera = *result.rig.camera;
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = camera.table_from_camera.matrix();
  const PoseFit& fit = result.fit;
  nlohmann::json report = {
      {"schema", "sateen.calibrate.pose/1"},
      {"version", Version()},
      {"output", args.output.string()},
      {"former_rig", result.former_rig.string()},
      {"pictures", result.pictures.string()},
      {"board", result.board.Text()},
      {"thickness_mm", args.thickness_mm},
      {"photographs", result.found.views.size()},
      {"corners", result.corners},
      {"table_from_camera", std::vector<double>(pose.data(), pose.data() + pose.size())},
      {"lean_deg", LeanDeg(camera)},
      {"rms_px", fit.reprojection_rms_px},
      {"position_sd_mm", {fit.position_sd_mm[0], fit.position_sd_mm[1], fit.position_sd_mm[2]}},
      {"rotation_sd_deg",
       {fit.rotation_sd_rad[0] * kDegPerRad, fit.rotation_sd_rad[1] * kDegPerRad,
        fit.rotation_sd_rad[2] * kDegPerRad}},
      {"edge_sd_mm", result.edge_sd_mm},
      {"moved_mm", result.moved_mm},
      {"turned_deg", result.turned_deg},
      {"seconds", result.seconds},
      {"warnings", result.warnings},
      {"inputs", result.sha256_of_input}};
  if (result.position_error_mm) {
    report["position_error_mm"] = *result.position_error_mm;
    report["rotation_error_deg"] = *result.rotation_error_deg;
  }
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const CalibratePoseArgs& args, const PoseCalibration& result) {
  const Camera& camera = *result.rig.camera;
  const Eigen::Vector3d at_mm = camera.table_from_camera.translation();
  const PoseFit& fit = result.fit;
  std::string text = fmt::format(
      "camera at        {:.2f}, {:.2f}, {:.2f} mm +- {:.3f}, {:.3f}, {:.3f}\n"
      "it leans by      {:.3f} degrees from straight down; rotation +- {} degrees about x, y, z\n"
      "at field's edge  a pixel's place on the table is known to +- {:.4f} mm, a light's direction "
      "or a normal to +- {:.4f} degrees\n"
      "corners          {} from {} photograph{}, off by {:.3f} px\n",
      at_mm.x(), at_mm.y(), at_mm.z(), fit.position_sd_mm[0], fit.position_sd_mm[1],
      fit.position_sd_mm[2], LeanDeg(camera), DegreesOf(fit.rotation_sd_rad), result.edge_sd_mm,
      fit.rotation_sd_rad.head<2>().norm() * kDegPerRad, result.corners, result.found.views.size(),
      result.found.views.size() == 1 ? "" : "s", fit.reprojection_rms_px);
  if (result.position_error_mm) {
    text +=
        fmt::format("error against truth/rig.json: position {:.3g} mm, rotation {:.3g} degrees\n",
                    *result.position_error_mm, *result.rotation_error_deg);
  }
  if (!result.former_rig.empty()) {
    text += fmt::format("the former rig is kept as {}\n", result.former_rig.string());
  }
  text += fmt::format("{} is written after {:.1f} s; look at {}\n", args.output.string(),
                      result.seconds, (result.pictures / "axes.png").string());
  return text;
}

}  // namespace sateen::cli
