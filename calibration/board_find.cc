#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/board.h"
#include "calibration/markers.h"

namespace sateen {
namespace {

constexpr int kWidestForBoardPx = 1600;  // wider pictures are shrunk to find a chessboard in them
constexpr size_t kFewestCorners = 6;
constexpr double kThinnest = 0.1;          // a row of corners, relative to its length, is a line
constexpr double kCornerWindow = 0.25;     // of a square
constexpr int kSmallestWindowPx = 2;
constexpr int kLargestWindowPx = 12;
constexpr double kQuadrant = 0.3;          // of a square: where a quadrant of a crossing is read
constexpr double kCrossingContrast = 0.7;  // of the board's own; a mere edge has half
constexpr double kMarkerSlack = 0.3;       // of a square: how far markers may lie off a flat board
constexpr size_t kMarkersOfAPatch = 5;     // from which a corner's place is predicted

cv::Point2f PointOf(const Eigen::Vector2d& x) {
  return {static_cast<float>(x.x()), static_cast<float>(x.y())};
}

// Board millimetres to pixels. Empty where the points do not determine it.
cv::Mat PixelsFromBoard(const std::vector<cv::Point2f>& points_mm,
                        const std::vector<cv::Point2f>& corners_px, double slack_px = 0.0) {
  return slack_px > 0.0 ? cv::findHomography(points_mm, corners_px, cv::RANSAC, slack_px)
                        : cv::findHomography(points_mm, corners_px);
}

Eigen::Vector2d Mapped(const cv::Mat& homography, const Eigen::Vector2d& x) {
  const Eigen::Vector3d y = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
                                homography.ptr<double>()) *
                            x.homogeneous();
  return y.hnormalized();
}

std::optional<double> Grey(const Image<uint8_t>& grey, const Eigen::Vector2d& at) {
  if (!(at.x() >= 0.0 && at.y() >= 0.0 && at.x() <= grey.width - 1 && at.y() <= grey.height - 1)) {
    return std::nullopt;
  }
  return grey.At(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
}

// How much brighter the top right and bottom left squares about a corner are than the others.
std::optional<double> CrossingAt(const Image<uint8_t>& grey, const cv::Mat& pixels_from_board,
                                 const Eigen::Vector2d& at_mm, double square_mm) {
  double contrast = 0.0;
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      const Eigen::Vector2d quadrant_mm = at_mm + kQuadrant * square_mm * Eigen::Vector2d(x, y);
      const std::optional<double> value = Grey(grey, Mapped(pixels_from_board, quadrant_mm));
      if (!value) {
        return std::nullopt;
      }
      contrast += 0.5 * x * y * *value;
    }
  }
  return contrast;
}

// Half the side of the square in which a corner is refined.
int WindowPx(const cv::Mat& pixels_from_board, const Eigen::Vector2d& at_mm, double reach_mm) {
  const Eigen::Vector2d at = Mapped(pixels_from_board, at_mm);
  double reach_px = kLargestWindowPx;
  for (const Eigen::Vector2d& step : {Eigen::Vector2d(reach_mm, 0), Eigen::Vector2d(0, reach_mm)}) {
    reach_px = std::min(reach_px, (Mapped(pixels_from_board, at_mm + step) - at).norm());
  }
  return std::max(static_cast<int>(reach_px), kSmallestWindowPx);
}

BoardView WholeView(const Image<uint8_t>& grey, const BoardSpec& spec) {
  BoardView view = {.size_px = grey.Size(), .ids = {}, .corners_px = {}, .points_mm = {}};
  const auto count = static_cast<size_t>(spec.CornerCount());
  view.ids.reserve(count);
  view.corners_px.reserve(count);
  view.points_mm.reserve(count);
  return view;
}

void AddCorner(BoardView& view, const BoardSpec& spec, int id, const Eigen::Vector2d& at_px) {
  view.ids.push_back(id);
  view.corners_px.push_back(at_px);
  view.points_mm.push_back(spec.CornerPoint(id));
}

cv::Mat PixelsFromBoardOf(const BoardView& view) {
  std::vector<cv::Point2f> points_mm;
  std::vector<cv::Point2f> corners_px;
  points_mm.reserve(view.ids.size());
  corners_px.reserve(view.ids.size());
  for (size_t i = 0; i < view.ids.size(); ++i) {
    points_mm.push_back(PointOf(view.points_mm[i].head<2>()));
    corners_px.push_back(PointOf(view.corners_px[i]));
  }
  return PixelsFromBoard(points_mm, corners_px);
}

// The corners of the chessboard to about a pixel, row by row from either end; none if not found.
std::vector<Eigen::Vector2d> RoughChessboard(const Image<uint8_t>& grey, const BoardSpec& spec) {
  const double shrink =
      std::max(1.0, static_cast<double>(std::max(grey.width, grey.height)) / kWidestForBoardPx);
  cv::Mat small(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data()));
  if (shrink > 1.0) {
    cv::resize(small, small, {}, 1.0 / shrink, 1.0 / shrink, cv::INTER_AREA);
  }
  const cv::Size size(spec.columns - 1, spec.rows - 1);
  std::vector<cv::Point2f> found;
  const int sector_flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE;
  const int quad_flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ADAPTIVE_THRESH;
  if (!cv::findChessboardCorners(small, size, found, quad_flags) &&
      !cv::findChessboardCornersSB(small, size, found, sector_flags)) {
    return {};
  }
  std::vector<Eigen::Vector2d> corners;
  corners.reserve(found.size());
  for (const cv::Point2f& corner : found) {
    corners.emplace_back((corner.x + 0.5) * shrink - 0.5, (corner.y + 0.5) * shrink - 0.5);
  }
  return corners;
}

// True where more corners follow beyond one of the four sides.
bool ContinuesBeyond(const Image<uint8_t>& grey, const cv::Mat& pixels_from_board,
                     const BoardSpec& spec, double contrast) {
  const auto is_crossing = [&](int column, int row) {
    const Eigen::Vector2d at_mm = {(column - 0.5 * spec.columns) * spec.square_mm,
                                   (0.5 * spec.rows - row) * spec.square_mm};
    const std::optional<double> crossing =
        CrossingAt(grey, pixels_from_board, at_mm, spec.square_mm);
    return crossing && std::abs(*crossing) > kCrossingContrast * contrast ? 1 : 0;
  };
  for (const int column : {0, spec.columns}) {
    int crossings = 0;
    for (int row = 1; row < spec.rows; ++row) {
      crossings += is_crossing(column, row);
    }
    if (2 * crossings > spec.rows - 1) {
      return true;
    }
  }
  for (const int row : {0, spec.rows}) {
    int crossings = 0;
    for (int column = 1; column < spec.columns; ++column) {
      crossings += is_crossing(column, row);
    }
    if (2 * crossings > spec.columns - 1) {
      return true;
    }
  }
  return false;
}

Result<BoardView> FindChessboard(const Image<uint8_t>& grey, const BoardSpec& spec) {
  std::vector<Eigen::Vector2d> corners = RoughChessboard(grey, spec);
  if (corners.empty()) {
    return Fail(ErrorCode::kDegenerate,
                "no chessboard of {} x {} inner corners found; show the whole board with its white "
                "margin, flat, sharp and evenly lit, or correct the numbers",
                spec.columns - 1, spec.rows - 1);
  }
  // The top left square is black, so the top left corner is dark at its top left and bottom right.
  double contrast = 0.0;
  for (const bool turn : {false, true}) {
    if (turn) {
      std::reverse(corners.begin(), corners.end());
    }
    BoardView rough = WholeView(grey, spec);
    for (int id = 0; id < spec.CornerCount(); ++id) {
      AddCorner(rough, spec, id, corners[static_cast<size_t>(id)]);
    }
    const cv::Mat pixels_from_board = PixelsFromBoardOf(rough);
    contrast = 0.0;
    for (int id = 0; id < spec.CornerCount(); ++id) {
      const int column = id % (spec.columns - 1);
      const int row = id / (spec.columns - 1);
      const double sign = (column + row) % 2 == 0 ? 1.0 : -1.0;
      contrast += sign / spec.CornerCount() *
                  CrossingAt(grey, pixels_from_board, spec.CornerPoint(id).head<2>(),
                             spec.square_mm).value_or(0.0);
    }
    if (contrast < 0.0 && !turn) {
      continue;
    }
    if (ContinuesBeyond(grey, pixels_from_board, spec, std::abs(contrast))) {
      return Fail(ErrorCode::kDegenerate,
                  "the chessboard has more than {} x {} inner corners; correct the numbers",
                  spec.columns - 1, spec.rows - 1);
    }
    BoardView view = WholeView(grey, spec);
    for (int id = 0; id < spec.CornerCount(); ++id) {
      const int window_px = WindowPx(pixels_from_board, spec.CornerPoint(id).head<2>(),
                                     kCornerWindow * spec.square_mm);
      AddCorner(view, spec, id,
                RefineCorner(grey, corners[static_cast<size_t>(id)], window_px));
    }
    return view;
  }
  return Fail(ErrorCode::kDegenerate, "unreachable");
}

}  // namespace
}  // namespace sateen
