#include "calibration/print/chessboard.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/print/markers.h"
#include "calibration/print/plane_map.h"

namespace sateen {
namespace {

constexpr int kWidestForBoardPx = 1600;  // wider pictures are shrunk to find the board in them
constexpr double kCornerReach = 0.25;    // of a square, about a corner, from which it is refined
constexpr double kBoardCrossing = 0.7;   // of the board's contrast; a mere edge has half

// Every corner to about a pixel, row by row from either end; none if not found.
std::vector<Eigen::Vector2d> RoughCorners(const Image<uint8_t>& grey, const BoardSpec& spec) {
  const double shrink =
      std::max(1.0, static_cast<double>(std::max(grey.width, grey.height)) / kWidestForBoardPx);
  cv::Mat small(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data()));
  if (shrink > 1.0) {
    cv::resize(small, small, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
  }
  const cv::Size size(spec.columns - 1, spec.rows - 1);
  std::vector<cv::Point2f> found;
  // The older findChessboardCorners() takes up to 15 s where the board is not there.
  if (!cv::findChessboardCornersSB(small, size, found, cv::CALIB_CB_NORMALIZE_IMAGE) &&
      !cv::findChessboardCornersSB(small, size, found,
                                   cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE)) {
    return {};
  }
  std::vector<Eigen::Vector2d> corners;
  corners.reserve(found.size());
  for (const cv::Point2f& corner : found) {
    corners.emplace_back((static_cast<double>(corner.x) + 0.5) * shrink - 0.5,
                         (static_cast<double>(corner.y) + 0.5) * shrink - 0.5);
  }
  return corners;
}

BoardView ViewOf(const Image<uint8_t>& grey, const BoardSpec& spec,
                 std::vector<Eigen::Vector2d> corners) {
  BoardView view = {
      .size_px = grey.Size(), .ids = {}, .corners_px = std::move(corners), .points_mm = {}};
  view.ids.reserve(view.corners_px.size());
  view.points_mm.reserve(view.corners_px.size());
  for (int id = 0; id < spec.CornerCount(); ++id) {
    view.ids.push_back(id);
    view.points_mm.push_back(spec.CornerPoint(id));
  }
  return view;
}

// Mean contrast of the board's corners; below zero where black and white are swapped.
double BoardContrast(const Image<uint8_t>& grey, const BoardSpec& spec, const PlaneMap& map) {
  double contrast = 0.0;
  for (int id = 0; id < spec.CornerCount(); ++id) {
    const double sign = (id % (spec.columns - 1) + id / (spec.columns - 1)) % 2 == 0 ? 1.0 : -1.0;
    const Eigen::Vector2d at_mm = spec.CornerPoint(id).head<2>();
    contrast += sign * CrossingContrast(grey, map, at_mm, spec.square_mm).value_or(0.0);
  }
  return contrast / spec.CornerCount();
}

// True where most places of a row beyond one of the four sides are corners too.
bool GoesOn(const Image<uint8_t>& grey, const BoardSpec& spec, const PlaneMap& map,
            double contrast) {
  const auto crosses = [&](int column, int row) {
    const Eigen::Vector2d at_mm = {(column - 0.5 * spec.columns) * spec.square_mm,
                                   (0.5 * spec.rows - row) * spec.square_mm};
    const double crossing = CrossingContrast(grey, map, at_mm, spec.square_mm).value_or(0.0);
    return std::abs(crossing) > kBoardCrossing * contrast ? 1 : 0;
  };
  std::array<int, 4> crossings = {};
  for (int row = 1; row < spec.rows; ++row) {
    crossings[0] += crosses(0, row);
    crossings[1] += crosses(spec.columns, row);
  }
  for (int column = 1; column < spec.columns; ++column) {
    crossings[2] += crosses(column, 0);
    crossings[3] += crosses(column, spec.rows);
  }
  return 2 * std::max(crossings[0], crossings[1]) > spec.rows - 1 ||
         2 * std::max(crossings[2], crossings[3]) > spec.columns - 1;
}

}  // namespace

Result<BoardView> FindChessboard(const Image<uint8_t>& grey, const BoardSpec& spec) {
  std::vector<Eigen::Vector2d> corners = RoughCorners(grey, spec);
  BoardView view = ViewOf(grey, spec, corners);
  std::optional<PlaneMap> map;
  if (!corners.empty()) {
    map = FitPlaneMap(view.points_mm, corners);
  }
  if (!map) {
    return Fail(ErrorCode::kDegenerate,
                "no chessboard of {} x {} inner corners found; show the whole board with its white "
                "margin, flat, sharp and evenly lit, or correct the numbers",
                spec.columns - 1, spec.rows - 1);
  }
  double contrast = BoardContrast(grey, spec, *map);
  if (contrast < 0.0 && !spec.IsSymmetric()) {  // the top left square is the black one
    std::reverse(corners.begin(), corners.end());
    view = ViewOf(grey, spec, corners);
    map = FitPlaneMap(view.points_mm, corners);
    contrast = BoardContrast(grey, spec, *map);
  }
  if (GoesOn(grey, spec, *map, std::abs(contrast))) {
    return Fail(ErrorCode::kDegenerate,
                "the chessboard has more than {} x {} inner corners; correct the numbers",
                spec.columns - 1, spec.rows - 1);
  }
  const Image<uint8_t> smooth = SmoothedForCorners(grey);
  for (size_t i = 0; i < corners.size(); ++i) {
    const int window_px =
        CornerWindowPx(*map, view.points_mm[i].head<2>(), kCornerReach * spec.square_mm);
    view.corners_px[i] = RefineCorner(smooth, corners[i], window_px);
  }
  return view;
}

}  // namespace sateen
