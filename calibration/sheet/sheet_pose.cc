#include "calibration/sheet/sheet_pose.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calibration/print/border_view.h"
#include "calibration/print/print_fit.h"
#include "core/angle.h"
#include "core/statistics.h"
#include "targets/marker_dictionary.h"

namespace sateen {
namespace {

constexpr double kEnoughPx = 48.0;  // size of a marker above which pixels are averaged
constexpr size_t kFewestBorderMarkers = 4;
constexpr double kFewestInPlace = 0.9;  // share of the markers seen
constexpr double kSlack = 0.15;         // of a marker: largest deviation of its corners
constexpr double kNotToScale = 0.06;    // of a marker: deviation that no pose explains
constexpr double kVagueDeg = 0.1;       // largest standard deviation of the tilt
constexpr double kQuiet = 0.2;          // of a marker: half of the least gap between two
constexpr double kMostQuietMm = 3.0;    // within the paper's margin
constexpr double kCoveredTimes = 3.0;   // times the median misfit: a partly covered marker
constexpr double kCoveredLeast = 0.08;
constexpr double kMovedTimes = 2.0;  // times the median misfit: the sheet is elsewhere
constexpr double kMovedLeast = 0.12;
constexpr double kNotThePrint = 0.25;  // misfit

Image<float> MeanOf(const std::vector<Image<float>>& frames) {
  Image<float> mean(frames[0].Size());
  const float share = 1.0F / static_cast<float>(frames.size());
  for (const Image<float>& frame : frames) {
    for (size_t i = 0; i < mean.pixels.size(); ++i) {
      mean.pixels[i] += share * frame.pixels[i];
    }
  }
  return mean;
}

Camera Shrunk(const Camera& camera, int factor) {
  Camera small = camera;
  small.size_px = {camera.size_px.width / factor, camera.size_px.height / factor};
  small.fx /= factor;
  small.fy /= factor;
  small.cx = (camera.cx + 0.5) / factor - 0.5;
  small.cy = (camera.cy + 0.5) / factor - 0.5;
  return small;
}

std::vector<double> Known(const std::vector<double>& misfit) {
  std::vector<double> known;
  std::ranges::copy_if(misfit, std::back_inserter(known), [](double m) { return m >= 0.0; });
  return known;
}

class SheetFitter {
 public:
  SheetFitter(const std::vector<Image<float>>& frames, const Camera& camera,
              const SheetBorder& border, const std::vector<std::string>& names)
      : frames_(frames),
        names_(names),
        border_(border),
        camera_(Shrunk(camera, SheetShrink(camera, border))) {}

  Result<SheetPose> Run() {
    for (const Image<float>& frame : frames_) {
      if (!(frame.Size() == camera_.size_px)) {
        return Fail(ErrorCode::kInvalidArgument, "a frame of {} x {} px; need {} x {}", frame.width,
                    frame.height, camera_.size_px.width, camera_.size_px.height);
      }
    }
    if (frames_.empty()) {
      return Fail(ErrorCode::kInvalidArgument, "no frames of the sheet; need one or more");
    }
    mean_ = MeanOf(frames_);
    return Find().and_then([&](const BorderView& view) { return Fit(view); });
  }

 private:
  [[nodiscard]] std::string NameOf(size_t frame) const {
    return frame < names_.size() ? names_[frame] : fmt::format("frame {}", frame);
  }

  // Returns the side of a marker in the picture.
  [[nodiscard]] double MarkerPx() const {
    return camera_.fx * border_.marker_mm / camera_.table_from_camera.translation().z();
  }

  [[nodiscard]] BorderView Seen(const Image<float>& picture) const {
    return InPlace(LookForBorder(picture, camera_, border_), kSlack * MarkerPx());
  }

  Result<BorderView> Find() {
    BorderView view = Seen(mean_);
    if (view.ids.size() >= kFewestBorderMarkers &&
        static_cast<double>(view.ids.size()) >= kFewestInPlace * static_cast<double>(view.seen)) {
      return view;
    }
    if (Status apart = CheckFramesAgree(); !apart) {
      return tl::unexpected(apart.error());
    }
    if (view.seen >= kFewestBorderMarkers) {
      return Fail(ErrorCode::kDegenerate,
                  "{} of {} markers found lie where '{}' has them; it is another sheet, it is not "
                  "flat, or two sheets are in view",
                  view.ids.size(), view.seen, border_.Text());
    }
    return Fail(
        ErrorCode::kDegenerate,
        "{} markers of the border '{}' found; need {} on more than one side: does the camera "
        "see the paper's rim, sharp, and is it this border?",
        view.seen, border_.Text(), kFewestBorderMarkers);
  }

  // Fails if frames show the border in different places, so that their mean is of no use.
  [[nodiscard]] Status CheckFramesAgree() const {
    std::optional<std::pair<size_t, BorderView>> first;
    for (size_t k = 0; k < frames_.size(); ++k) {
      BorderView view = Seen(frames_[k]);
      if (view.ids.size() < kFewestBorderMarkers) {
        continue;
      }
      if (!first) {
        first = {k, std::move(view)};
        continue;
      }
      for (size_t i = 0; i < view.ids.size(); ++i) {
        const auto same = std::ranges::find(first->second.ids, view.ids[i]);
        const auto at = static_cast<size_t>(same - first->second.ids.begin());
        if (same != first->second.ids.end() &&
            (first->second.corners_px[4 * at] - view.corners_px[4 * i]).norm() >
                kSlack * MarkerPx()) {
          return Fail(ErrorCode::kDegenerate,
                      "{} and {} show the border in different places: did the sheet or the camera "
                      "move, or are two sheets mixed up?",
                      NameOf(first->first), NameOf(k));
        }
      }
    }
    return {};
  }

  [[nodiscard]] std::vector<PrintedMarker> MarkersOf(const std::vector<int>& ids) const {
    const std::vector<Eigen::Vector3d> centers = border_.MarkerCenters();
    std::vector<PrintedMarker> markers;
    markers.reserve(ids.size());
    for (const int id : ids) {
      markers.push_back({.center_mm = centers[static_cast<size_t>(id)].head<2>(),
                         .side_mm = border_.marker_mm,
                         .quiet_mm = std::min(kQuiet * border_.marker_mm, kMostQuietMm),
                         .cells = MarkerCells(border_.dictionary, id)});
    }
    return markers;
  }

  Result<SheetPose> Fit(const BorderView& view) {
    const Result<PlanePose> rough = SolvePlanePose(camera_, view.points_mm, view.corners_px);
    if (!rough) {
      return Fail(rough.error().code, "the border's markers: {}", rough.error().message);
    }
    if (rough->rms_px > kNotToScale * MarkerPx()) {
      return Fail(ErrorCode::kDegenerate,
                  "no pose of '{}' shows its markers where they are seen ({:.1f} px off): it is "
                  "another sheet, printed out of scale, or not flat",
                  border_.Text(), rough->rms_px);
    }
    std::vector<PrintedMarker> markers = MarkersOf(view.ids);
    Result<PrintFit> fit = FitPrint(mean_, camera_, markers, rough->camera_from_plane);
    if (!fit) {
      return tl::unexpected(fit.error());
    }
    const double usual = Median(Known(fit->misfit));
    std::vector<PrintedMarker> whole;
    for (size_t i = 0; i < markers.size(); ++i) {
      if (fit->misfit[i] >= 0.0 &&
          fit->misfit[i] <= std::max(kCoveredTimes * usual, kCoveredLeast)) {
        whole.push_back(markers[i]);
      }
    }
    if (whole.size() < markers.size()) {
      markers = std::move(whole);
      fit = FitPrint(mean_, camera_, markers, fit->camera_from_plane);
      if (!fit) {
        return tl::unexpected(fit.error());
      }
    }
    if (Status status = CheckFrames(markers, *fit); !status) {
      return tl::unexpected(status.error());
    }
    SheetPose pose = PoseOf(*fit);
    const double tilt_sd_deg = pose.rotation_sd_rad.head<2>().norm() * kDegPerRad;
    if (!(tilt_sd_deg <= kVagueDeg)) {
      return Fail(ErrorCode::kDegenerate,
                  "{} of {} markers of the border are seen whole and leave the tilt uncertain by "
                  "{:.2g} degrees; need {:g}: show markers on all sides of the paper",
                  pose.markers_used, pose.markers, tilt_sd_deg, kVagueDeg);
    }
    return pose;
  }

  [[nodiscard]] Status CheckFrames(const std::vector<PrintedMarker>& markers,
                                   const PrintFit& fit) const {
    const double misfit = Median(Known(fit.misfit));
    if (misfit > kNotThePrint) {
      return Fail(
          ErrorCode::kDegenerate,
          "the markers do not look like those of '{}' ({:.0f} % off); is the picture out of "
          "focus, or did the sheet move between frames?",
          border_.Text(), 100.0 * misfit);
    }
    std::vector<double> of_frame;
    of_frame.reserve(frames_.size());
    for (const Image<float>& frame : frames_) {
      of_frame.push_back(Median(Known(PrintMisfit(frame, camera_, markers, fit))));
    }
    const double usual = Median(of_frame);
    for (size_t k = 0; k < frames_.size(); ++k) {
      if (of_frame[k] > std::max(kMovedTimes * usual, kMovedLeast)) {
        return Fail(ErrorCode::kDegenerate,
                    "{} does not show the border where the other frames do ({:.0f} % off, they "
                    "{:.0f} %): did the sheet or the camera move, or are two sheets mixed up?",
                    NameOf(k), 100.0 * of_frame[k], 100.0 * usual);
      }
    }
    return {};
  }

  [[nodiscard]] SheetPose PoseOf(const PrintFit& fit) const {
    const Eigen::Matrix3d& turn = camera_.table_from_camera.linear();
    Matrix6d table_from_camera = Matrix6d::Zero();
    table_from_camera.topLeftCorner<3, 3>() = turn;
    table_from_camera.bottomRightCorner<3, 3>() = turn;
    SheetPose pose{.table_from_sheet = camera_.table_from_camera * fit.camera_from_plane,
                   .covariance = table_from_camera * fit.covariance * table_from_camera.transpose(),
                   .markers_used = Known(fit.misfit).size(),
                   .markers = border_.MarkerCenters().size(),
                   .misfit = Median(Known(fit.misfit)),
                   .blur_px = fit.blur_px};
    pose.rotation_sd_rad = pose.covariance.diagonal().head<3>().cwiseSqrt();
    pose.position_sd_mm = pose.covariance.diagonal().tail<3>().cwiseSqrt();
    return pose;
  }

  const std::vector<Image<float>>& frames_;
  const std::vector<std::string>& names_;
  const SheetBorder& border_;
  Camera camera_;
  Image<float> mean_;
};

}  // namespace

int SheetShrink(const Camera& camera, const SheetBorder& border) {
  const double marker_px =
      camera.fx * border.marker_mm / camera.table_from_camera.translation().z();
  return std::max(1, static_cast<int>(marker_px / kEnoughPx));
}

Result<SheetPose> FitSheetPose(const std::vector<Image<float>>& frames, const Camera& camera,
                               const SheetBorder& border,
                               const std::vector<std::string>& frame_names) {
  return SheetFitter(frames, camera, border, frame_names).Run();
}

}  // namespace sateen
