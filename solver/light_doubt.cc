#include "solver/light_doubt.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/linear_algebra.h"
#include "rig/projection.h"

namespace sateen {
namespace {

constexpr int kTile = 64;  // pixels

using Vector6d = Eigen::Vector<double, 6>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct LightErrors {
  double direction = 0.0;   // sd(delta)^2, in radians
  double irradiance = 0.0;  // sd(epsilon)^2
};

// Returns (2).
LightErrors ErrorsOf(const Light& light, const Eigen::Vector3d& x_mm) {
  LightErrors errors{.irradiance = std::pow(light.irradiance_sd.value_or(0.0), 2.0)};
  if (light.model == LightModel::kDistant) {
    // Half of it lies along each of two axes.
    errors.direction = std::pow(light.direction_sd_deg.value_or(0.0) * kRadPerDeg, 2.0) / 2.0;
  } else if (light.position_sd_mm) {
    const Eigen::Vector3d to_light = light.position_mm - x_mm;
    const double along = light.position_sd_mm->cwiseProduct(to_light.normalized()).squaredNorm();
    errors.direction = (light.position_sd_mm->squaredNorm() - along) / 2.0 / to_light.squaredNorm();
  }
  return errors;
}

// Packs a symmetric matrix so that n . m n = PackedOf(m) . p.
Vector6d PackedOf(const Eigen::Matrix3d& m) {
  return Vector6d{{m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)}};
}

std::array<float, 21> FormOf(const Matrix6d& m) {
  std::array<float, 21> form = {};
  size_t next = 0;
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = i; j < 6; ++j) {
      form[next++] = static_cast<float>(i == j ? m(i, i) : m(i, j) + m(j, i));
    }
  }
  return form;
}

// Forms of (3) at a place on the table. For unit n, 1 = p . (1, 1, 1, 0, 0, 0).
struct Forms {
  Matrix6d across = Matrix6d::Zero();
  Matrix6d along = Matrix6d::Zero();
};

Forms FormsAt(const Lights& lights, const Eigen::Vector3d& x_mm) {
  Eigen::MatrixX3d directions(static_cast<Eigen::Index>(lights.size()), 3);
  for (size_t k = 0; k < lights.size(); ++k) {
    directions.row(static_cast<Eigen::Index>(k)) = IncidentAt(lights[k], x_mm).l;
  }
  const Eigen::Matrix3Xd g =
      SolveBySvd(directions, Eigen::MatrixXd::Identity(directions.rows(), directions.rows()))
          .x;  // (1)
  const Vector6d one{{1.0, 1.0, 1.0, 0.0, 0.0, 0.0}};
  Forms forms;
  for (size_t k = 0; k < lights.size(); ++k) {
    const LightErrors errors = ErrorsOf(lights[k], x_mm);
    const auto column = static_cast<Eigen::Index>(k);
    const Eigen::Vector3d l = directions.row(column).transpose();
    const Vector6d variance = errors.direction * one +
                              (errors.irradiance - errors.direction) * PackedOf(l * l.transpose());
    const Vector6d along = PackedOf(g.col(column) * g.col(column).transpose());
    forms.along += along * variance.transpose();
    forms.across += (g.col(column).squaredNorm() * one - along) * variance.transpose();
  }
  return forms;
}

using Columns = std::array<float, kTile>;

// Returns p . form p of each column, at least 0.
Columns ValuesOf(const std::array<float, 21>& form, const std::array<Columns, 6>& p) {
  Columns values = {};
  size_t next = 0;
  for (size_t i = 0; i < 6; ++i) {
    for (size_t k = i; k < 6; ++k) {
      for (size_t j = 0; j < kTile; ++j) {
        values[j] += form[next] * p[i][j] * p[k][j];
      }
      ++next;
    }
  }
  for (float& value : values) {
    value = std::max(0.0F, value);
  }
  return values;
}

void AddInSquares(float error, float most, float& uncertainty) {
  uncertainty = std::min(most, std::sqrt(uncertainty * uncertainty + error * error));
}

// Returns the table point that the middle of a tile sees; the origin where it sees none or there is
// no camera.
Eigen::Vector3d PlaceOf(const Rig& rig, double column, double row) {
  const std::optional<Eigen::Vector3d> place =
      rig.camera ? TablePointOfPixel(*rig.camera, column, row) : std::nullopt;
  return place.value_or(Eigen::Vector3d::Zero());
}

}  // namespace

std::optional<LightDoubt> LightDoubt::Make(const Rig& rig, ImageSize size) {
  if (std::ranges::none_of(rig.lights, [](const Light& light) {
        return light.position_sd_mm || light.direction_sd_deg || light.irradiance_sd;
      })) {
    return std::nullopt;
  }
  LightDoubt doubt;
  doubt.columns_ = (size.width + kTile - 1) / kTile;
  const int rows = (size.height + kTile - 1) / kTile;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < doubt.columns_; ++column) {
      const Forms forms =
          FormsAt(rig.lights, PlaceOf(rig, std::min((column + 0.5) * kTile, size.width - 1.0),
                                      std::min((row + 0.5) * kTile, size.height - 1.0)));
      doubt.tiles_.push_back({FormOf(forms.across), FormOf(forms.along)});
    }
  }
  return doubt;
}

void LightDoubt::AddToRow(int row, size_t first, NormalField& field) const {
  const auto width = static_cast<size_t>(field.reason.width);
  for (size_t begin = 0; begin < width; begin += kTile) {
    const size_t count = std::min<size_t>(kTile, width - begin);
    const Tile& tile = tiles_[static_cast<size_t>(row / kTile * columns_) + begin / kTile];
    // No branches: becomes vectors.
    std::array<Columns, 6> p = {};
    for (size_t j = 0; j < count; ++j) {
      const float x = field.normal[0].pixels[first + begin + j];
      const float y = field.normal[1].pixels[first + begin + j];
      const float z = field.normal[2].pixels[first + begin + j];
      p[0][j] = x * x;
      p[1][j] = y * y;
      p[2][j] = z * z;
      p[3][j] = 2.0F * x * y;
      p[4][j] = 2.0F * x * z;
      p[5][j] = 2.0F * y * z;
    }
    const Columns across = ValuesOf(tile.across, p);
    const Columns along = ValuesOf(tile.along, p);
    for (size_t j = 0; j < count; ++j) {
      const size_t pixel = first + begin + j;
      if (IsSolved(field, pixel)) {
        AddInSquares(std::sqrt(across[j]) * static_cast<float>(kDegPerRad), 180.0F,
                     field.uncertainty.pixels[pixel]);
        AddInSquares(std::sqrt(along[j]), 1.0F, field.albedo_uncertainty.pixels[pixel]);
      }
    }
  }
}

}  // namespace sateen
