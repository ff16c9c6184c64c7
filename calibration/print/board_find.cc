#include "calibration/print/board_find.h"

#include <algorithm>
#include <cmath>

#include "calibration/print/chessboard.h"
#include "calibration/print/edge_width.h"
#include "calibration/print/markers.h"
#include "calibration/print/plane_map.h"

namespace sateen {
namespace {

constexpr size_t kFewestCorners = 6;
constexpr size_t kFewestBoardMarkers = 3;
constexpr double kFewestBoardInPlace = 0.9;  // share of the markers
constexpr double kMarkerSlack = 0.35;        // of a square: largest deviation by the lens
constexpr size_t kMarkersOfAPatch = 4;       // nearest markers that predict a corner's place
constexpr double kPatchSquares = 3.0;        // distance of the farthest of them, in squares
constexpr double kReachOfGap = 0.9;          // share of the gap around a corner that is used
constexpr double kQuadrantShare = 0.35;      // largest share of the square for CrossingContrast()
constexpr double kCrossing = 0.25;           // least contrast of a corner over the board's

// Marker of the board in the picture.
struct BoardMarker {
  Eigen::Vector3d center_mm;
  std::array<Eigen::Vector3d, 4> corners_mm;
  std::array<Eigen::Vector2d, 4> corners_px;
};

std::vector<BoardMarker> BoardMarkersOf(const std::vector<MarkerView>& seen,
                                        const BoardSpec& spec) {
  const std::vector<Eigen::Vector3d> centers = spec.MarkerCenters();
  const double half = 0.5 * spec.marker_mm;
  std::vector<BoardMarker> markers;
  markers.reserve(seen.size());
  for (const MarkerView& marker : seen) {
    if (static_cast<size_t>(marker.id) < centers.size()) {
      const Eigen::Vector3d& c = centers[static_cast<size_t>(marker.id)];
      markers.push_back({.center_mm = c,
                         .corners_mm = {c + Eigen::Vector3d(-half, half, 0.0),
                                        c + Eigen::Vector3d(half, half, 0.0),
                                        c + Eigen::Vector3d(half, -half, 0.0),
                                        c + Eigen::Vector3d(-half, -half, 0.0)},
                         .corners_px = marker.corners_px});
    }
  }
  return markers;
}

// Keeps the markers that lie as on one flat board; a lens may bend it a little.
std::vector<BoardMarker> InPlace(const std::vector<BoardMarker>& markers, double square_mm) {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<Eigen::Vector2d> corners_px;
  points_mm.reserve(4 * markers.size());
  corners_px.reserve(4 * markers.size());
  double side_px = 0.0;
  for (const BoardMarker& marker : markers) {
    points_mm.insert(points_mm.end(), marker.corners_mm.begin(), marker.corners_mm.end());
    corners_px.insert(corners_px.end(), marker.corners_px.begin(), marker.corners_px.end());
    const double side_mm = (marker.corners_mm[2] - marker.corners_mm[0]).norm();
    side_px += (marker.corners_px[2] - marker.corners_px[0]).norm() / side_mm * square_mm;
  }
  const double slack_px = kMarkerSlack * side_px / static_cast<double>(markers.size());
  const std::optional<PlaneMap> map = FitPlaneMap(points_mm, corners_px, slack_px);
  std::vector<BoardMarker> kept;
  kept.reserve(markers.size());
  for (const BoardMarker& marker : markers) {
    bool near = map.has_value();
    for (size_t c = 0; near && c < 4; ++c) {
      const Eigen::Vector2d at = MapPoint(*map, marker.corners_mm[c].head<2>());
      near = (at - marker.corners_px[c]).norm() <= slack_px;
    }
    if (near) {
      kept.push_back(marker);
    }
  }
  return kept;
}

// Returns the map of the board around a corner, from the nearest markers; nothing where no square
// that meets there has a marker.
std::optional<PlaneMap> PatchAt(const std::vector<BoardMarker>& markers,
                                const Eigen::Vector3d& at_mm, double square_mm) {
  std::vector<std::pair<double, const BoardMarker*>> nearest;
  nearest.reserve(markers.size());
  for (const BoardMarker& marker : markers) {
    const double distance_mm = (marker.center_mm - at_mm).norm();
    if (distance_mm < kPatchSquares * square_mm) {
      nearest.emplace_back(distance_mm, &marker);
    }
  }
  const size_t count = std::min(nearest.size(), kMarkersOfAPatch);
  if (count == 0) {
    return std::nullopt;
  }
  std::stable_sort(nearest.begin(), nearest.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  if (nearest[0].first > square_mm) {  // not a marker of the squares that meet at the corner
    return std::nullopt;
  }
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<Eigen::Vector2d> corners_px;
  points_mm.reserve(4 * count);
  corners_px.reserve(4 * count);
  for (size_t i = 0; i < count; ++i) {
    const BoardMarker& marker = *nearest[i].second;
    points_mm.insert(points_mm.end(), marker.corners_mm.begin(), marker.corners_mm.end());
    corners_px.insert(corners_px.end(), marker.corners_px.begin(), marker.corners_px.end());
  }
  return FitPlaneMap(points_mm, corners_px);
}

// Returns the refined corners beside the markers that look like corners: their contrast is large
// enough, and has the sign that the colours of the squares give it.
BoardView CornersBeside(const Image<uint8_t>& grey, const BoardSpec& spec,
                        const std::vector<BoardMarker>& markers) {
  const Image<uint8_t> smooth = SmoothedForCorners(grey);
  struct Candidate {
    int id;
    Eigen::Vector2d corner_px;
    double crossing;
  };
  std::vector<Candidate> candidates;
  candidates.reserve(static_cast<size_t>(spec.CornerCount()));
  const double reach_mm = kReachOfGap * 0.5 * (spec.square_mm - spec.marker_mm);
  double strongest = 0.0;
  for (int id = 0; id < spec.CornerCount(); ++id) {
    const Eigen::Vector3d at_mm = spec.CornerPoint(id);
    const std::optional<PlaneMap> map = PatchAt(markers, at_mm, spec.square_mm);
    if (!map) {
      continue;
    }
    const std::optional<double> crossing =
        CrossingContrast(grey, *map, at_mm.head<2>(), reach_mm / kQuadrantShare);
    const Eigen::Vector2d rough = MapPoint(*map, at_mm.head<2>());
    const int window_px = CornerWindowPx(*map, at_mm.head<2>(), reach_mm);
    const Eigen::Vector2d corner = RefineCorner(smooth, rough, window_px);
    if (crossing && corner != rough && (corner - rough).norm() <= window_px) {
      const bool dark_first = spec.IsBlack(id % (spec.columns - 1), id / (spec.columns - 1));
      candidates.push_back({id, corner, dark_first ? *crossing : -*crossing});
      strongest = std::max(strongest, std::abs(*crossing));
    }
  }
  BoardView view = {.size_px = grey.Size()};
  view.ids.reserve(candidates.size());
  view.corners_px.reserve(candidates.size());
  view.points_mm.reserve(candidates.size());
  for (const Candidate& candidate : candidates) {
    if (candidate.crossing > kCrossing * strongest) {
      view.ids.push_back(candidate.id);
      view.corners_px.push_back(candidate.corner_px);
      view.points_mm.push_back(spec.CornerPoint(candidate.id));
    }
  }
  return view;
}

Result<BoardView> FindCharuco(const Image<uint8_t>& grey, const BoardSpec& spec) {
  const std::vector<MarkerView> seen = FindMarkers(grey, spec.dictionary);
  if (seen.size() < kFewestBoardMarkers) {
    return Fail(ErrorCode::kDegenerate,
                "{} markers of {} found; need {}: show the board, flat, sharp and evenly lit, and "
                "name its own dictionary",
                seen.size(), spec.dictionary, kFewestBoardMarkers);
  }
  const std::vector<BoardMarker> markers = InPlace(BoardMarkersOf(seen, spec), spec.square_mm);
  if (static_cast<double>(markers.size()) <
      kFewestBoardInPlace * static_cast<double>(seen.size())) {
    return Fail(
        ErrorCode::kDegenerate,
        "{} of {} markers lie where '{}' has them; it is another board, or of the other pattern "
        "(with ':legacy' or without), or two boards are in view",
        markers.size(), seen.size(), spec.Text());
  }
  BoardView view = CornersBeside(grey, spec, markers);
  if (view.ids.size() < kFewestCorners || !FitPlaneMap(view.points_mm, view.corners_px)) {
    return Fail(ErrorCode::kDegenerate,
                "{} corners of the board found; need {} in more than one row: show more of it",
                view.ids.size(), kFewestCorners);
  }
  return view;
}

}  // namespace

Result<BoardView> FindBoard(const Image<uint8_t>& grey, const BoardSpec& spec) {
  Result<BoardView> view = spec.pattern == BoardPattern::kChessboard ? FindChessboard(grey, spec)
                                                                     : FindCharuco(grey, spec);
  if (view) {
    view->edge_px = EdgeWidthPx(grey, spec, *view);
  }
  return view;
}

}  // namespace sateen
