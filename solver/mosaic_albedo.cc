#include "solver/mosaic_albedo.h"

#include <algorithm>

#include "core/parallel.h"
#include "solver/fast_rows.h"

namespace sateen {
namespace {

// Three rows about the one that is interpolated; null beyond the border.
struct NearRows {
  std::array<const float*, 3> rows;
  int width;

  // Mean of the solved ones among neighbours at these steps; 0 where none is.
  template <size_t N>
  [[nodiscard]] float Mean(int x, const std::array<std::array<int, 2>, N>& steps) const {
    float sum = 0.0F;
    float count = 0.0F;
    for (const auto& [right, down] : steps) {
      const float* row = rows[static_cast<size_t>(down + 1)];
      const int column = x + right;
      if (row != nullptr && column >= 0 && column < width && row[column] > 0.0F) {
        sum += row[column];
        count += 1.0F;
      }
    }
    return count > 0.0F ? sum / count : 0.0F;
  }
};

using Step = std::array<int, 2>;
constexpr std::array<Step, 2> kBeside = {{{-1, 0}, {1, 0}}};
constexpr std::array<Step, 2> kAboveBelow = {{{0, -1}, {0, 1}}};
constexpr std::array<Step, 4> kCross = {{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
constexpr std::array<Step, 4> kCorners = {{{-1, -1}, {1, -1}, {-1, 1}, {1, 1}}};

// A colour at a site of another one.
float ColourBeside(const std::array<uint8_t, 4>& cfa, size_t site, size_t colour,
                   const NearRows& near, int x) {
  const bool beside = cfa[site ^ 1U] == colour;
  const bool above = cfa[site ^ 2U] == colour;
  const float mean = beside && above ? near.Mean(x, kCross)
                     : beside        ? near.Mean(x, kBeside)
                     : above         ? near.Mean(x, kAboveBelow)
                                     : near.Mean(x, kCorners);
  return mean > 0.0F ? mean : near.rows[1][x];
}

void InterpolateRow(const std::array<uint8_t, 4>& cfa, int row, const NearRows& near,
                    std::array<float*, 3> albedo) {
  for (int x = 0; x < near.width; ++x) {
    const auto site = static_cast<size_t>(row % 2 * 2 + x % 2);
    const float own = near.rows[1][x];
    for (size_t c = 0; c < 3; ++c) {
      albedo[c][x] = own <= 0.0F       ? 0.0F
                     : cfa[site] == c ? own
                                      : ColourBeside(cfa, site, c, near, x);
    }
  }
}

}  // namespace

Status InterpolateAlbedo(const std::array<uint8_t, 4>& cfa, int first_row,
                         const Image<float>& own_colour, const RowsBeyond& beyond, const Task& task,
                         NormalField& field) {
  const Task silent{.threads = task.threads, .progress = nullptr, .cancel = task.cancel};
  const int height = own_colour.height;
  const auto row_at = [&](int row) -> const float* {
    if (row < 0 || row >= height) {
      const std::span<const float> other = row < 0 ? beyond.above : beyond.below;
      return other.empty() ? nullptr : other.data();
    }
    return own_colour.pixels.data() + own_colour.Index(0, row);
  };
  return ParallelFor(height, RowsPerPiece(own_colour.Size()), silent, [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      const size_t at = own_colour.Index(0, row);
      InterpolateRow(cfa, first_row + row,
                     {{row_at(row - 1), row_at(row), row_at(row + 1)}, own_colour.width},
                     {field.albedo[0].pixels.data() + at, field.albedo[1].pixels.data() + at,
                      field.albedo[2].pixels.data() + at});
    }
  });
}

}  // namespace sateen
