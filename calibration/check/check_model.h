#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibration/check/check_unknowns.h"
#include "calibration/check/rig_change.h"
#include "calibration/sheet/sheet_readings.h"
#include "rig/rig.h"

namespace sateen {

/// Readings of white paper as a rig predicts them that may have changed:
///
///     r_jkc = (i_jkc - rho e_kc(x_j) max(0, n_j . l_k(x_j))) / sd_jkc                         (1)
///     x_j = point of the sheet on the ray of block j from the camera where it now stands
///     z(u, v) = h_0 + h_1 u + h_2 v + h_3 u^2 + h_4 u v + h_5 v^2,   n_j from its slope       (2)
///
/// u and v run from -1 to 1 over the sheet; z is its height above where it was said to lie.
/// Derivatives are central differences of rig/light.h, so that every model of a light will do.
///
/// Cost     two evaluations of a light per sample and unknown
class CheckModel {
 public:
  // The rig has a camera. Rig and sheets outlive the model.
  CheckModel(const Rig& rig, const std::vector<SheetReadings>& sheets, double albedo);

  [[nodiscard]] size_t LightCount() const { return rig_.lights.size(); }
  [[nodiscard]] const std::vector<SheetReadings>& Sheets() const { return sheets_; }
  [[nodiscard]] RigChange Unchanged() const;

  // Returns the radiance of a sample that a rig so changed predicts.
  [[nodiscard]] Eigen::Vector3d Predict(size_t sheet, size_t light, const SheetSample& sample,
                                        const RigChange& change) const;

  // Returns (1) of all samples, three per sample.
  [[nodiscard]] std::vector<double> Residuals(size_t sheet, size_t light,
                                              const RigChange& change) const;

  // Returns the unknowns of a light by which its readings change. Only LEDs have an axis.
  [[nodiscard]] WantedUnknowns WantedOf(size_t light, bool moved, bool turned, bool camera,
                                        bool sheet) const;

  // Adds (1) of all samples, each times its weight. Derivatives by unknowns that are not wanted are
  // taken as 0.
  void AddReadings(size_t sheet, size_t light, const RigChange& change,
                   const std::vector<double>& weights, const WantedUnknowns& wanted,
                   LocalEquations& equations) const;

  // Largest height and slope of a sheet against where it was said to lie.
  struct Lie {
    double height_mm = 0.0;
    double slope_rad = 0.0;
  };
  [[nodiscard]] Lie LieOf(size_t sheet, const RigChange& change) const;

 private:
  // Plane of a sheet: its middle, two directions along it, its normal and half its size.
  struct Plane {
    Eigen::Vector3d middle_mm;
    Eigen::Vector3d u;
    Eigen::Vector3d v;
    Eigen::Vector3d normal;
    double half_mm = 1.0;
  };

  [[nodiscard]] static Plane PlaneOf(const SheetReadings& sheet);
  [[nodiscard]] Eigen::Vector3d PredictUnder(const Light& light, size_t sheet,
                                             const SheetSample& sample,
                                             const RigChange& change) const;

  const Rig& rig_;
  const std::vector<SheetReadings>& sheets_;
  double albedo_;
  std::vector<Plane> planes_;
};

}  // namespace sateen
