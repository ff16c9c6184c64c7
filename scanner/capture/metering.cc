#include "scanner/capture/metering.h"

#include <algorithm>
#include <utility>

#include "scanner/capture/exposure_search.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

constexpr double kFabricPeak = 0.8;  // share of what saturates
constexpr double kSheetPeak = 0.6;   // its readings must be proportional to 0.2 %
constexpr int kMostTests = 8;        // frames to find an exposure by

// Returns how bright the light's frame is at this exposure.
Result<SignalLevels> TakeTestFrame(const Rig& rig, std::size_t light, double exposure_s, int tries,
                                   const fs::path& folder, FrameTaker& taker) {
  for (int attempt = 1;; ++attempt) {
    Result<SignalLevels> levels =
        taker.Take(rig.lights[light], exposure_s, folder).and_then([&](const TakenFrame& taken) {
          return ReadSignalLevels({.path = taken.path, .response = rig.response});
        });
    if (levels || attempt == tries || !MayTryAgain(levels.error().code) || taker.NeedsAPerson()) {
      return levels;
    }
    if (const Status again = taker.Recover(levels.error()); !again) {
      return tl::unexpected(again.error());
    }
  }
}

}  // namespace

std::size_t BrightestLight(const Rig& rig) {
  std::size_t brightest = 0;
  double most = 0.0;
  for (std::size_t k = 0; k < rig.lights.size(); ++k) {
    const Incident incident = IncidentAt(rig.lights[k], Eigen::Vector3d::Zero());
    const double given = incident.e_rgb.maxCoeff() * std::max(0.0, incident.l.z());
    if (given > most) {
      most = given;
      brightest = k;
    }
  }
  return brightest;
}

Result<std::vector<double>> FindExposures(const Rig& rig, std::size_t light,
                                          const MeteringOptions& options, const fs::path& folder,
                                          FrameTaker& taker, const MeteringObserver& observer) {
  const Result<double> longest_s = taker.LongestExposureOf(rig.lights);
  if (!longest_s) {
    return tl::unexpected(longest_s.error());
  }
  const bool is_sheet = options.kind == SessionKind::kSheet;
  Result<ExposureSearch> search =
      ExposureSearch::Begin(taker.ExposureTimes(), {.peak = is_sheet ? kSheetPeak : kFabricPeak,
                                                    .low = DarkestUseful(rig.response),
                                                    .most = is_sheet ? 1 : options.brackets,
                                                    .longest_s = *longest_s});
  for (int test = 1; search && !search->Found(); ++test) {
    observer.on_test(search->TestTime());
    const Result<SignalLevels> levels =
        TakeTestFrame(rig, light, search->TestTime(), options.tries, folder, taker);
    Status taken = levels ? search->Take(*levels) : tl::unexpected(levels.error());
    if (taken && !search->Found() && test == kMostTests) {
      taken =
          Fail(ErrorCode::kDevice, "no exposure found with {} test frames; give --exposure", test);
    }
    if (!taken) {
      return Fail(taken.error().code, "test frame of light '{}': {}", rig.lights[light].name,
                  taken.error().message);
    }
    observer.on_levels(*levels);
  }
  return search.map([](const ExposureSearch& found) { return found.Exposures(); });
}

}  // namespace sateen
