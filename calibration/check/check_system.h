#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "calibration/sheet/sheet_sample.h"
#include "core/error.h"
#include "core/task.h"
#include "rig/rig.h"

namespace sateen {

// One sheet as every light of a rig shows it (scanner/sessions/sheet_reader.h).
struct CheckedSheet {
  int columns = 0;  // blocks of a frame
  int rows = 0;
  int blank_blocks = 0;  // how many may have samples: those inside a border; 0: all
  std::vector<std::vector<SheetSample>> samples;  // [light]; empty: no usable frame
  std::vector<std::vector<int>> blocks;           // [light]: which block each sample is, row-major
};

using SheetHeights = Eigen::Matrix<double, 6, 1>;  // [mm], see CheckSystem

// What of a light may have changed since it was measured.
struct LightChange {
  Eigen::Vector3d log_flux = Eigen::Vector3d::Zero();  // of today's flux over the rig's
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  Eigen::Vector2d turned_rad = Eigen::Vector2d::Zero();  // of the axis, about two across it
};

struct RigChange {
  std::vector<LightChange> lights;
  // The camera: moved along x, y, z [mm], turned about z [rad].
  Eigen::Vector4d camera = Eigen::Vector4d::Zero();
  std::vector<SheetHeights> sheets;
};

// Which of these a fit may change. Fluxes are always free.
struct ChangeMask {
  std::vector<bool> moved;
  std::vector<bool> turned;
  bool camera = false;
  bool sheets = false;

  [[nodiscard]] int Parameters(size_t sheet_count) const;
};

struct ChangeFit {
  RigChange change;
  double chi2 = 0.0;
  // Covariances, zero where not free.
  std::vector<Eigen::Matrix3d> flux;
  std::vector<Eigen::Matrix3d> moved_mm2;
  std::vector<Eigen::Matrix2d> turned_rad2;
  Eigen::Matrix4d camera = Eigen::Matrix4d::Zero();
};

// What one light would gain by moving or turning, the rest of a fit being kept.
struct ChangeGain {
  double moved = 0.0;  // of chi2
  double turned = 0.0;
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moved_mm2 = Eigen::Matrix3d::Zero();  // covariance
};

/// Sheets of white paper against a rig that may have changed in a few ways:
///
///     r_jkc = (i_jkc - rho e_kc(x_j) max(0, n_j . l_k(x_j))) / sd_jkc                         (1)
///     x_j = where the ray of block j, from the camera as it now stands, meets the sheet
///     z(u, v) = h_0 + h_1 u + h_2 v + h_3 u^2 + h_4 u v + h_5 v^2,   n_j from its slope       (2)
///
/// u, v in [-1, 1] over the sheet, z above where the sheet was said to lie. Gauss and Newton's
/// method, derivatives by central differences of rig/light.h, so that any model of a light will do;
/// weak priors (a lamp by 100 mm, a camera by 50 mm, a sheet by 5 mm) where the sheets say nothing.
/// Samples off every change of their own light by four standard deviations are left out: dust, folds.
/// The noise is that of the residuals, larger where they hang together over 6 x 6 blocks.
///
/// Cost     60 evaluations of a light a sample and step
class CheckSystem {
 public:
  // The rig has a camera; `used[k]`: whether light k takes part. Both outlive the system.
  CheckSystem(const Rig& rig, const std::vector<CheckedSheet>& sheets, double albedo,
              const std::vector<bool>& used, const Task& task);

  [[nodiscard]] ChangeFit Fit(const ChangeMask& mask, const RigChange& start) const;
  // Of each light; zero for those that take no part.
  [[nodiscard]] std::vector<ChangeGain> Gains(const ChangeFit& fit) const;
  // Nothing changed.
  [[nodiscard]] RigChange Unchanged() const;
  // What the rig, so changed, shows of a sample.
  [[nodiscard]] Eigen::Vector3d Predict(size_t sheet, size_t light, const SheetSample& sample,
                                        const RigChange& change) const;
  // How a sheet lies against where it was said to: highest place and steepest slope.
  struct Lie {
    double height_mm = 0.0;
    double slope_rad = 0.0;
  };
  [[nodiscard]] Lie LieOf(size_t sheet, const RigChange& change) const;

 private:
  static constexpr int kOfLight = 8;               // flux, position, axis
  static constexpr int kLocal = kOfLight + 4 + 6;  // and camera and one sheet
  using Local = Eigen::Matrix<double, kLocal, kLocal>;
  using LocalVector = Eigen::Matrix<double, kLocal, 1>;
  // The normal equations of one light on one sheet.
  struct Normal {
    Local matrix = Local::Zero();
    LocalVector gradient = LocalVector::Zero();
    double chi2 = 0.0;

    Normal& operator+=(const Normal& other);
  };
  // Where and how a sheet lies: its middle, two directions along it and half its size.
  struct Plane {
    Eigen::Vector3d middle_mm;
    Eigen::Vector3d u;
    Eigen::Vector3d v;
    Eigen::Vector3d normal;
    double half_mm = 1.0;
  };
  using Weights = std::vector<std::vector<double>>;  // [sheet][sample] of one light

  [[nodiscard]] static Plane PlaneOf(const CheckedSheet& sheet);
  // Which unknowns of one light and sheet need derivatives.
  using Wanted = std::array<bool, kLocal>;

  [[nodiscard]] Wanted WantedOf(size_t light, bool moved, bool turned, bool camera,
                                bool sheet) const;
  [[nodiscard]] Eigen::Vector3d PredictUnder(const Light& light, size_t sheet,
                                             const SheetSample& sample,
                                             const RigChange& change) const;
  [[nodiscard]] Normal NormalOf(size_t sheet, size_t light, const RigChange& change,
                                const std::vector<double>& weights, const Wanted& wanted) const;
  [[nodiscard]] std::vector<std::vector<Normal>> Normals(const RigChange& change,
                                                         const std::vector<Wanted>& wanted) const;
  [[nodiscard]] std::vector<double> Residuals(size_t sheet, size_t light,
                                              const RigChange& change) const;
  // Chooses the samples of one light that count, and finds its noise.
  void Settle(size_t light);
  [[nodiscard]] double SpreadTogether(size_t light, const RigChange& change) const;

  const Rig& rig_;
  const std::vector<CheckedSheet>& sheets_;
  double albedo_;
  std::vector<bool> used_;
  Task task_;
  std::vector<Plane> planes_;
  std::vector<Weights> weights_;  // [light]: 1 over the variance of a residual of (1), or 0
};

}  // namespace sateen
