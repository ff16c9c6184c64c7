#include "calibration/check/check_unknowns.h"

namespace sateen {
namespace {

constexpr double kDifferenceMm = 0.01;
constexpr double kDifferenceRad = 1e-5;

// Serves changes and constant ones.
template <typename Change>
auto& UnknownOf(Change& change, size_t sheet, size_t light, int local) {
  if (local < kMovedAt) {
    return change.lights[light].log_flux[local];
  }
  if (local < kTurnedAt) {
    return change.lights[light].moved_mm[local - kMovedAt];
  }
  if (local < kCameraAt) {
    return change.lights[light].turned_rad[local - kTurnedAt];
  }
  return local < kSheetAt ? change.camera[local - kCameraAt]
                          : change.sheets[sheet][local - kSheetAt];
}

}  // namespace

double PriorSdOf(int local) {
  if (local < kMovedAt) {
    return kFluxPrior;
  }
  if (local < kTurnedAt) {
    return kMovedPriorMm;
  }
  if (local < kCameraAt) {
    return kTurnedPriorRad;
  }
  if (local < kSheetAt) {
    return local == kSheetAt - 1 ? kCameraPriorRad : kCameraPriorMm;
  }
  return kSheetPriorMm;
}

double StepOfUnknown(int local) {
  const bool is_angle = (local >= kTurnedAt && local < kCameraAt) || local == kSheetAt - 1;
  return is_angle ? kDifferenceRad : kDifferenceMm;
}

double& UnknownAt(RigChange& change, size_t sheet, size_t light, int local) {
  return UnknownOf(change, sheet, light, local);
}

double UnknownAt(const RigChange& change, size_t sheet, size_t light, int local) {
  return UnknownOf(change, sheet, light, local);
}

void AddPriorsOf(size_t light, const RigChange& change, LocalEquations& equations) {
  Unknowns<kLocal> from_mean = Unknowns<kLocal>::Zero();
  UnknownsMatrix<kLocal> precision = UnknownsMatrix<kLocal>::Zero();
  for (int i = 0; i < kOfLight; ++i) {
    from_mean[i] = UnknownAt(change, 0, light, i);
    precision(i, i) = 1.0 / (PriorSdOf(i) * PriorSdOf(i));
  }
  equations.AddPrior(from_mean, precision);
}

}  // namespace sateen
