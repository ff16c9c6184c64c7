#include "pipelines/calibrate/pictures/lens_pictures.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "calibration/print/pose_solve.h"
#include "core/files/output_folder.h"
#include "imaging/image_io.h"
#include "imaging/show/canvas.h"
#include "rig/projection.h"
#include "scanner/sessions/board_photos.h"

namespace sateen {
namespace {

constexpr int kWidthPx = 960;  // of a picture
constexpr int kHeadPx = 34;    // above it, for words
constexpr int kMarginPx = 12;
constexpr int kWordsBelow = 22;      // from the top to the words' base line
constexpr double kLongestPx = 40.0;  // of the 95th percentile's residual, as drawn
constexpr Color8 kPaper = {24, 26, 30};
constexpr Color8 kCellCovered = {38, 46, 42};
constexpr Color8 kCellEmpty = {96, 34, 34};

// The image as an area of a canvas.
struct Frame {
  double scale = 1.0;
  Eigen::Vector2d origin;  // where pixel (0, 0) is

  [[nodiscard]] Eigen::Vector2d At(const Eigen::Vector2d& pixel) const {
    return origin + scale * pixel;
  }
};

Canvas HeadedCanvas(ImageSize size_px, Frame& frame, const std::string& words) {
  frame.scale = static_cast<double>(kWidthPx - 2 * kMarginPx) / size_px.width;
  frame.origin = {kMarginPx, kHeadPx};
  const int height = kHeadPx + static_cast<int>(frame.scale * size_px.height) + kMarginPx;
  Canvas canvas(kWidthPx, height, kPaper);
  canvas.Text({kMarginPx, kWordsBelow}, words, kWhiteInk);
  return canvas;
}

Rgb8 Coverage(const LensCalibration& result) {
  const Image<int>& cells = result.fit.coverage;
  size_t corners = 0;
  size_t views = 0;
  for (const LensViewReport& view : result.fit.views) {
    corners += view.left_out.empty() ? view.corners : 0;
    views += view.left_out.empty() ? 1 : 0;
  }
  Frame frame;
  const ImageSize size = result.found.size_px;
  Canvas canvas =
      HeadedCanvas(size, frame,
                   fmt::format("{} corners of {} views, a colour each. Red: no corner, show the "
                               "board there.",
                               corners, views));
  const Eigen::Vector2d cell(frame.scale * size.width / cells.width,
                             frame.scale * size.height / cells.height);
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const Eigen::Vector2d at = frame.origin + cell.cwiseProduct(Eigen::Vector2d(x, y));
      canvas.Box(static_cast<int>(at.x()) + 1, static_cast<int>(at.y()) + 1,
                 static_cast<int>(cell.x()) - 1, static_cast<int>(cell.y()) - 1,
                 cells.At(x, y) > 0 ? kCellCovered : kCellEmpty);
      canvas.Text(at + Eigen::Vector2d(6, 18), std::to_string(cells.At(x, y)), kGreyInk);
    }
  }
  for (size_t i = 0; i < result.found.views.size(); ++i) {
    if (!result.fit.views[i].left_out.empty()) {
      continue;
    }
    for (const Eigen::Vector2d& corner : result.found.views[i].corners_px) {
      canvas.Dot(frame.At(corner), 2, DistinctColor(i));
    }
  }
  return canvas.Taken();
}

struct Residual {
  size_t view;
  Eigen::Vector2d corner_px;
  Eigen::Vector2d off_px;  // from where the lens puts it
};

std::vector<Residual> ResidualsOf(const LensCalibration& result) {
  std::vector<Residual> residuals;
  Camera lens = result.fit.camera;
  lens.table_from_camera.setIdentity();
  for (size_t i = 0; i < result.found.views.size(); ++i) {
    const BoardView& view = result.found.views[i];
    const Result<PlanePose> pose = SolvePlanePose(lens, view.points_mm, view.corners_px);
    if (!result.fit.views[i].left_out.empty() || !pose) {
      continue;
    }
    for (size_t j = 0; j < view.ids.size(); ++j) {
      const Eigen::Vector2d at =
          PixelOfTablePoint(lens, pose->camera_from_plane * view.points_mm[j]);
      residuals.push_back({i, view.corners_px[j], view.corners_px[j] - at});
    }
  }
  return residuals;
}

Rgb8 Residuals(const LensCalibration& result) {
  const std::vector<Residual> residuals = ResidualsOf(result);
  std::vector<double> lengths;
  lengths.reserve(residuals.size());
  for (const Residual& residual : residuals) {
    lengths.push_back(residual.off_px.norm());
  }
  double large_px = 1.0;
  if (!lengths.empty()) {
    const auto place = lengths.begin() +
                       static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(lengths.size() - 1));
    std::nth_element(lengths.begin(), place, lengths.end());
    large_px = std::max(*place, 1e-6);
  }
  // 1, 2 or 5 times a power of ten, so that the bar has a round length.
  const double decade = std::pow(10.0, std::floor(std::log10(large_px)));
  const double bar_px = (large_px / decade > 5.0   ? 5.0
                         : large_px / decade > 2.0 ? 2.0
                                                   : 1.0) *
                        decade;
  const double enlarged = kLongestPx / large_px;  // canvas pixels for one of the image
  Frame frame;
  Canvas canvas = HeadedCanvas(
      result.found.size_px, frame,
      fmt::format("Corners off the lens by {:.3f} px rms. No pattern: good. The bar is {:g} px:",
                  result.fit.rms_px, bar_px));
  const double bar_length = enlarged * bar_px;
  const Eigen::Vector2d bar(kWidthPx - kMarginPx - bar_length, kWordsBelow - 6.0);
  canvas.Line(bar, bar + Eigen::Vector2d(bar_length, 0), kWhiteInk, 3);
  for (const Residual& residual : residuals) {
    const Eigen::Vector2d from = frame.At(residual.corner_px);
    canvas.Line(from, from + enlarged * residual.off_px, DistinctColor(residual.view));
    canvas.Dot(from, 1, kWhiteInk);
  }
  return canvas.Taken();
}

// Corners of one row or column, from end to end.
using Chain = std::vector<size_t>;

std::vector<Chain> ChainsOf(const BoardView& view, int corner_columns) {
  std::map<int, Chain> rows;
  std::map<int, Chain> columns;
  for (size_t i = 0; i < view.ids.size(); ++i) {
    rows[view.ids[i] / corner_columns].push_back(i);
    columns[view.ids[i] % corner_columns].push_back(i);
  }
  std::vector<Chain> chains;
  for (const auto& lines : {rows, columns}) {
    for (const auto& [number, chain] : lines) {
      if (chain.size() > 2) {
        chains.push_back(chain);
      }
    }
  }
  return chains;
}

double LineDeviationPx(const std::vector<Eigen::Vector2d>& corners,
                       const std::vector<Chain>& chains) {
  double most = 0.0;
  for (const Chain& chain : chains) {
    const Eigen::Vector2d& from = corners[chain.front()];
    const Eigen::Vector2d along = (corners[chain.back()] - from).normalized();
    for (const size_t i : chain) {
      const Eigen::Vector2d at = corners[i] - from;
      most = std::max(most, std::abs(along.x() * at.y() - along.y() * at.x()));
    }
  }
  return most;
}

std::vector<Eigen::Vector2d> Undistorted(const Camera& lens,
                                         const std::vector<Eigen::Vector2d>& corners) {
  Camera camera = lens;
  camera.table_from_camera.setIdentity();
  std::vector<Eigen::Vector2d> result;
  result.reserve(corners.size());
  for (const Eigen::Vector2d& corner : corners) {
    const auto ray = RayOfPixel(camera, corner.x(), corner.y());
    result.push_back(ray ? PixelOfTablePoint(PinholeOf(camera), *ray) : corner);
  }
  return result;
}

Image<uint8_t> Undistorted(const Camera& lens, const Image<uint8_t>& grey) {
  Image<uint8_t> result(grey.Size());
  for (int v = 0; v < grey.height; ++v) {
    for (int u = 0; u < grey.width; ++u) {
      const auto at = PixelOfPinholePixel(lens, u, v);
      if (at && at->x() >= 0.0 && at->y() >= 0.0 && at->x() <= grey.width - 1 &&
          at->y() <= grey.height - 1) {
        const int x = std::min(static_cast<int>(at->x()), grey.width - 2);
        const int y = std::min(static_cast<int>(at->y()), grey.height - 2);
        const double a = at->x() - x;
        const double b = at->y() - y;
        result.At(u, v) = static_cast<uint8_t>(
            std::lround((1 - b) * ((1 - a) * grey.At(x, y) + a * grey.At(x + 1, y)) +
                        b * ((1 - a) * grey.At(x, y + 1) + a * grey.At(x + 1, y + 1))));
      }
    }
  }
  return result;
}

Rgb8 LinedPanel(const Image<uint8_t>& grey, const std::vector<Eigen::Vector2d>& corners,
                const std::vector<Chain>& chains, const std::string& words) {
  Frame frame;
  Canvas canvas = HeadedCanvas(grey.Size(), frame, words);
  canvas.Place(ScaledGrey(grey, frame.scale), kMarginPx, kHeadPx);
  for (const Chain& chain : chains) {
    canvas.Line(frame.At(corners[chain.front()]), frame.At(corners[chain.back()]), kRedInk);
  }
  for (const Eigen::Vector2d& corner : corners) {
    canvas.Dot(frame.At(corner), 2, kGreenInk);
  }
  return canvas.Taken();
}

// The view used whose rows and columns are farthest from straight.
size_t MostBentView(const LensCalibration& result) {
  size_t best = 0;
  double most_px = -1.0;
  for (size_t i = 0; i < result.found.views.size(); ++i) {
    const BoardView& view = result.found.views[i];
    const double deviation_px =
        LineDeviationPx(view.corners_px, ChainsOf(view, result.board.columns - 1));
    if (result.fit.views[i].left_out.empty() && deviation_px > most_px) {
      most_px = deviation_px;
      best = i;
    }
  }
  return best;
}

Result<Rgb8> BeforeAndAfter(LensCalibration& result) {
  const size_t best = MostBentView(result);
  const Result<BoardPicture> picture = ReadBoardPicture(result.found.photos[best]);
  if (!picture) {
    return tl::unexpected(picture.error());
  }
  const BoardView& view = result.found.views[best];
  const std::vector<Chain> chains = ChainsOf(view, result.board.columns - 1);
  const std::vector<Eigen::Vector2d> straight = Undistorted(result.fit.camera, view.corners_px);
  result.line_deviation = {LineDeviationPx(view.corners_px, chains),
                           LineDeviationPx(straight, chains)};
  return ContactSheet(
      {LinedPanel(picture->grey, view.corners_px, chains,
                  fmt::format("{} as photographed: {:.2f} px off straight lines", view.name,
                              result.line_deviation.before_px)),
       LinedPanel(Undistorted(result.fit.camera, picture->grey), straight, chains,
                  fmt::format("without distortion: {:.2f} px", result.line_deviation.after_px))},
      2);
}

}  // namespace

Status DrawLens(LensCalibration& result) {
  Result<OutputFolder> folder = OutputFolder::Open(result.pictures);
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  const Result<Rgb8> lines = BeforeAndAfter(result);
  if (!lines) {
    return tl::unexpected(lines.error());
  }
  return WritePng8(folder->Stage("coverage.png"), Coverage(result))
      .and_then([&] { return WritePng8(folder->Stage("residuals.png"), Residuals(result)); })
      .and_then([&] { return WritePng8(folder->Stage("undistorted.png"), *lines); })
      .and_then([&] { return folder->Commit(); });
}

}  // namespace sateen
