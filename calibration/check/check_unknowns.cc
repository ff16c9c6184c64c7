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

}  // namespace

PriorTerm PriorOfUnknown(int local, double value) {
  const double sd = PriorSdOf(local);
  const double precision = 1.0 / (sd * sd);
  return {precision, -precision * value, precision * value * value};
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

LocalNormal& LocalNormal::operator+=(const LocalNormal& other) {
  matrix += other.matrix;
  gradient += other.gradient;
  chi2 += other.chi2;
  return *this;
}

void LocalNormal::AddPriorsOf(size_t light, const RigChange& change) {
  for (int i = 0; i < kOfLight; ++i) {
    const PriorTerm prior = PriorOfUnknown(i, UnknownAt(change, 0, light, i));
    matrix(i, i) += prior.precision;
    gradient[i] += prior.gradient;
    chi2 += prior.chi2;
  }
}

}  // namespace sateen
