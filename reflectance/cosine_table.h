#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "reflectance/isotropic_angles.h"

namespace sateen {

// Nodes on [0, 1] at (i / cells)^2, i = 0..cells: denser towards 0, where albedos change fastest
// with the cosine (0 is a grazing angle) and with alpha (0 is a mirror).
struct NodeCell {
  int first;        // x lies between the nodes `first` and `first` + 1,
  double fraction;  // at this fraction of the way, along the square root
};

inline double NodePosition(int i, int cells) {
  const double root = static_cast<double>(i) / cells;
  return root * root;
}

inline NodeCell CellOf(double x, int cells) {
  const double root = std::sqrt(UnitCosine(x)) * cells;
  const int first = std::min(static_cast<int>(root), cells - 1);
  return {first, root - first};
}

// A function of one cosine, computed at the nodes and interpolated between them.
template <typename Value>
class CosineTable {
 public:
  CosineTable() = default;

  // `function` of the cosine is called cells + 1 times.
  template <typename Function>
  CosineTable(int cells, const Function& function) : cells_(cells) {
    values_.reserve(static_cast<std::size_t>(cells) + 1);
    for (int i = 0; i <= cells; ++i) {
      values_.push_back(function(NodePosition(i, cells)));
    }
  }

  [[nodiscard]] bool Empty() const { return values_.empty(); }

  [[nodiscard]] Value At(double x) const {
    const NodeCell cell = CellOf(x, cells_);
    const auto first = static_cast<std::size_t>(cell.first);
    return (1.0 - cell.fraction) * values_[first] + cell.fraction * values_[first + 1];
  }

 private:
  int cells_ = 0;
  std::vector<Value> values_;
};

}  // namespace sateen
