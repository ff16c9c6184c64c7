#pragma once

#include <Eigen/Core>
#include <string_view>

#include "calibration/spheres/sphere_outline.h"
#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// Mirror image of a lamp in a sphere.
struct Highlight {
  Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
  double peak = 0.0;        // smoothed brightness
  double radius_px = 0.0;   // radius of a circle of the blob's area
  double area_share = 0.0;  // area over that of the sphere's disc
  double runner_up = 0.0;   // light of the second brightest blob over that of this one
};

struct HighlightOptions {
  // Least rise of the peak above the sphere's median brightness. Fraction of full scale, (0, 1).
  double least_rise = 0.05;
  // Level at which a blob begins, as a share of the way from the median to the peak; [0.3, 0.95].
  double level = 0.9;
  // Largest area of a lamp as a share of the sphere's disc; a window is larger. (0, 0.5].
  double most_area = 0.02;
  // Largest light of the second blob as a share of the first one's; above it the frame is
  // ambiguous. (0, 1].
  double most_runner_up = 0.5;

  // Names the first field out of range, with its value and its range.
  [[nodiscard]] Status Validate() const;
};

/// Finds the lamp's highlight in one sphere. Of the connected blobs of pixels above
///
///     t = median + level (peak - median)                                                    (1)
///
/// it is the one with most light, sum (i - t). Its place c is its own mean in a window half as wide
/// as the blob,
///
///     c = sum_x g(x - c) w(x) x / sum_x g(x - c) w(x),   w = max(0, i - (median + peak) / 2)   (2)
///     g(y) = exp(-|y|^2 / (2 s^2)),   s = max(1.5 px, sqrt(area / pi) / 2)
///
/// The window keeps out what joins a lamp's image: streaks of a brushed or oily sphere, flare,
/// reflections of the room. Brightness i is smoothed over a two-hundredth of the radius first, so
/// that a hot pixel is no lamp.
///
/// gray     linear, 1 = full scale
/// frame    its name, for messages
/// Errors   kInvalidArgument: an option out of range
///          kBadData: the sphere is not within the photograph
///          kDegenerate: no highlight; one too large for a lamp; two that are alike
/// Cost     O(pixels of the sphere)
/// Source   (2) is the mean shift of Comaniciu and Meer, IEEE PAMI 24(5), 2002.
[[nodiscard]] Result<Highlight> FindHighlight(const Image<float>& gray, const Sphere& sphere,
                                              std::string_view frame,
                                              const HighlightOptions& options = {});

/// Returns the highlight as older toolboxes find it: the medians of x and of y over all pixels of
/// the sphere whose luma, 0.2989 R + 0.587 G + 0.114 B of sRGB values, is at least 250 / 255. Every
/// bright spot of the sphere pulls on it, even the lamp's image in another sphere.
///
/// photo    linear, 1 = full scale
/// Errors   kBadData: the sphere is not within the photograph
///          kDegenerate: no pixel is as bright
/// Source   Xiong, PSBox, 2014.
[[nodiscard]] Result<Highlight> MedianHighlight(const Image3& photo, const Sphere& sphere,
                                                std::string_view frame);

}  // namespace sateen
