#include "scanner/checks/frame_registration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scanner/checks/gloss_shift.h"
#include "scanner/checks/registration_images.h"
#include "scanner/checks/registration_level.h"
#include "scanner/checks/shift_correlation.h"

namespace sateen {
namespace {

constexpr int kFewestTileCells = 32;  // along each side of the picture
constexpr int kLevels = 4;            // levels of the pyramid, each half of the one before
constexpr int kMostSteps = 6;         // steps of Gauss-Newton per level
constexpr double kSmallCells = 0.01;  // a step that ends a level
constexpr double kPxOfCell = 2.0;

std::vector<RegistrationLevel> PyramidOf(const FramesToRegister& input) {
  std::vector<Image<float>> frames = input.frames;
  std::vector<RegistrationLevel> levels;
  double cells = 1.0;
  while (levels.size() < kLevels &&
         std::min(frames[0].width, frames[0].height) >= kFewestTileCells) {
    levels.emplace_back(frames, input, cells);
    std::ranges::transform(frames, frames.begin(), Halved);
    cells *= 2.0;
  }
  return levels;
}

class Registration {
 public:
  explicit Registration(const FramesToRegister& input)
      : levels_(PyramidOf(input)), sd_(input.frames.size(), 0.0) {}

  [[nodiscard]] bool CanTell() const { return !levels_.empty() && !levels_[0].IsEmpty(); }

  // Refines `shifts`, in cells, through the `levels` finest levels.
  void Refine(size_t levels, std::vector<Eigen::Vector2d> shifts) {
    for (size_t level = std::min(levels, levels_.size()); level-- > 0;) {
      const double cells = std::pow(2.0, static_cast<double>(level));
      for (Eigen::Vector2d& shift : shifts) {
        shift /= cells;
      }
      for (int step = 0; step < kMostSteps; ++step) {
        if (levels_[level].Step(shifts, sd_) < kSmallCells) {
          break;
        }
      }
      for (Eigen::Vector2d& shift : shifts) {
        shift *= cells;
      }
    }
    const double misfit = levels_[0].Misfit(shifts);
    if (best_.empty() || misfit < misfit_) {
      misfit_ = misfit;
      explained_ = levels_[0].Explained();
      best_ = std::move(shifts);
      best_sd_ = sd_;
    }
  }

  // All frames from one on have moved like the last: the best such start.
  std::vector<Eigen::Vector2d> BestStart(const Eigen::Vector2d& last) {
    std::vector<Eigen::Vector2d> best;
    double least = 0.0;
    for (size_t from = 1; from < sd_.size(); ++from) {
      std::vector<Eigen::Vector2d> shifts(sd_.size(), Eigen::Vector2d::Zero());
      std::fill(shifts.begin() + static_cast<std::ptrdiff_t>(from), shifts.end(), last);
      const double misfit = levels_[0].Misfit(shifts);
      if (best.empty() || misfit < least) {
        least = misfit;
        best = std::move(shifts);
      }
    }
    return best;
  }

  [[nodiscard]] double Explained() const { return explained_; }

  [[nodiscard]] std::vector<Shift> Shifts() const {
    std::vector<Shift> shifts(best_.size(), Shift{.sd_px = 0.0});
    for (size_t k = 1; k < best_.size(); ++k) {
      shifts[k] = {.px = kPxOfCell * best_[k], .sd_px = kPxOfCell * best_sd_[k]};
    }
    return shifts;
  }

 private:
  std::vector<RegistrationLevel> levels_;
  std::vector<double> sd_;
  std::vector<Eigen::Vector2d> best_;
  std::vector<double> best_sd_;
  double misfit_ = 0.0;
  double explained_ = 0.0;
};

}  // namespace

bool IsSignificant(const Shift& shift) {
  constexpr double kLeastPx = 0.05;
  return shift.px.norm() > std::max(kLeastPx, 3.0 * shift.sd_px);
}

std::vector<Shift> RegisterFrames(const FramesToRegister& input, double min_peak) {
  constexpr size_t kFewestFrames = 5;
  constexpr double kFarPx = 0.7;
  std::vector<Shift> nothing(input.frames.size());
  if (input.frames.size() < kFewestFrames) {
    return nothing;
  }
  const Correlation last = ShiftBetween(input.frames.front(), input.frames.back());
  if (!(last.peak >= min_peak)) {
    return nothing;
  }
  Registration registration(input);
  if (!registration.CanTell()) {
    return nothing;
  }
  registration.Refine(kLevels,
                      std::vector<Eigen::Vector2d>(input.frames.size(), Eigen::Vector2d::Zero()));
  if (last.px.norm() > kFarPx) {
    registration.Refine(1, registration.BestStart(last.px / kPxOfCell));
  }
  if (registration.Explained() < min_peak) {
    return nothing;  // first and last frame have the same noise, and nothing else in common
  }
  std::vector<Shift> shifts = registration.Shifts();
  const Image<float>& first = input.frames.front();
  const Eigen::Vector2d middle(0.5 * first.width, 0.5 * first.height);
  std::vector<Eigen::Vector2d> l;
  for (size_t k = 0; k < input.frames.size(); ++k) {
    l.emplace_back(input.light(k, middle).normalized().head<2>());
  }
  for (size_t k = l.size(); k-- > 0;) {
    l[k] -= l[0];
  }
  TakeOutGloss(l, shifts);
  return shifts;
}

}  // namespace sateen
