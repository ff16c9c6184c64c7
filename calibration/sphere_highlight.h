#pragma once

#include <Eigen/Core>
#include <string_view>

#include "calibration/sphere_outline.h"
#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// A lamp's mirror image in a sphere.
struct Highlight {
  Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
  double peak = 0.0;        // smoothed brightness
  double area_share = 0.0;  // of the sphere's disc
  double runner_up = 0.0;   // light of the next brightest blob over that of this one
  double saturated = 0.0;   // share of its pixels at full scale
};

struct HighlightOptions {
  // How far the peak must rise above the sphere's median brightness. Fraction of full scale.
  double least_rise = 0.05;
  // Where a blob begins: this share of the way from the median to the peak, [0.3, 0.95].
  double level = 0.9;
  // The largest blob that is a lamp and no window, as a share of the sphere's disc, (0, 0.5].
  double most_area = 0.02;
  // A second blob of more than this share of the first one's light makes the frame ambiguous, (0, 1].
  double most_runner_up = 0.5;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// The lamp's highlight in one sphere: of the connected blobs b of pixels above
///
///     t = median + level (peak - median)
///
/// the one of most light W = sum (i - t), at the centroid weighted with i - t. Brightness i is
/// smoothed over a two-hundredth of the radius first, so that one hot pixel is no lamp. A saturated
/// disc weighs evenly; fainter reflections, of the table, the object and the other sphere, stay
/// below t or make blobs of less light.
///
/// gray     linear, 1 = full scale; `frame` names it in messages
/// Errors   kInvalidArgument: an option out of range
///          kBadData: the sphere is not within the photograph
///          kDegenerate: no highlight; one too large for a lamp; two that are alike
/// Cost     O(pixels of the sphere)
[[nodiscard]] Result<Highlight> FindHighlight(const Image<float>& gray, const Sphere& sphere,
                                              std::string_view frame,
                                              const HighlightOptions& options = {});

}  // namespace sateen
