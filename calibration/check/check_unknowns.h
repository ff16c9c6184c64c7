#pragma once

#include <Eigen/Core>
#include <array>

#include "calibration/check/rig_change.h"
#include "core/angle.h"
#include "core/gauss_newton.h"

// Unknowns on which the readings of one light on one sheet depend: their order, priors and steps.
namespace sateen {

inline constexpr int kFluxAt = 0;  // first unknown of each kind
inline constexpr int kMovedAt = 3;
inline constexpr int kTurnedAt = 6;
inline constexpr int kCameraAt = 8;
inline constexpr int kSheetAt = 12;
inline constexpr int kOfLight = kCameraAt;  // flux, position, axis
inline constexpr int kLocal = kSheetAt + 6;

// Priors are normal distributions about no change, of these standard deviations.
inline constexpr double kFluxPrior = 3.0;  // of the logarithm
inline constexpr double kMovedPriorMm = 100.0;
inline constexpr double kTurnedPriorRad = 20.0 * kRadPerDeg;
inline constexpr double kCameraPriorMm = 50.0;
inline constexpr double kCameraPriorRad = 5.0 * kRadPerDeg;
inline constexpr double kSheetPriorMm = 5.0;

/// Returns the standard deviation of the prior of unknown `local`, in the unknown's unit.
[[nodiscard]] double PriorSdOf(int local);

/// Returns the step of central differences by unknown `local`: 0.01 mm or 1e-5 rad.
[[nodiscard]] double StepOfUnknown(int local);

/// Returns unknown `local` of one light and sheet, where a change keeps it.
[[nodiscard]] double& UnknownAt(RigChange& change, size_t sheet, size_t light, int local);
[[nodiscard]] double UnknownAt(const RigChange& change, size_t sheet, size_t light, int local);

// Normal equations of readings of one light on one sheet.
using LocalEquations = NormalEquations<kLocal>;

// Adds the priors of the light's own unknowns, at their values in `change`.
void AddPriorsOf(size_t light, const RigChange& change, LocalEquations& equations);

// Unknowns by which derivatives are needed.
using WantedUnknowns = std::array<bool, kLocal>;

}  // namespace sateen
