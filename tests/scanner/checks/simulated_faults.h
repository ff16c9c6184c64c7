#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/scanner/checks/simulated_looks.h"
#include "tests/testing/seeds.h"

// Simulated sessions with what goes wrong in a capture, and how often each is found.
namespace sateen::testing {

inline constexpr double kRulerMm = 30.0;
inline const Eigen::Vector2d kNudgePx(-1.8, 2.4);  // 3 px

struct Rate {
  const char* name;
  // Does the damage and says what must be found: exactly these lights by this kind of fault.
  std::function<CaptureFault(const Fabric&, SessionLooks&, uint64_t)> damage;
  bool needs_calibration = false;  // levels are not known of a rig by the ruler
  int found = 0;
  int sessions = 0;
};

inline size_t AnyLight(uint64_t seed) { return HashOf(seed, 200) % kLookLights; }

inline std::vector<Rate> Rates() {
  return {
      {"two lights swapped",
       [](const Fabric&, SessionLooks& looks, uint64_t seed) {
         const size_t a = AnyLight(seed);
         const size_t b = (a + 1 + HashOf(seed, 201) % (kLookLights - 1)) % kLookLights;
         std::swap(looks.lit[a], looks.lit[b]);
         return CaptureFault{CaptureFaultKind::kOtherLight, {std::min(a, b), std::max(a, b)}, ""};
       }},
      {"dead LED",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         looks.lit[AnyLight(seed)] = LookAt(fabric.dark, seed);
         return CaptureFault{CaptureFaultKind::kDark, {AnyLight(seed)}, ""};
       }},
      {"light at 80 %",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] = LookAt(Mixed(fabric.lit[k], 0.8F, fabric.dark, 0.0F), seed);
         return CaptureFault{CaptureFaultKind::kLevel, {k}, ""};
       },
       true},
      {"two lights on",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] =
             LookAt(Mixed(fabric.lit[k], 1.0F, fabric.lit[(k + 3) % kLookLights], 1.0F), seed);
         return CaptureFault{CaptureFaultKind::kLevel, {k}, ""};
       }},
      {"ambient light on (5 %)",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         looks.repeat = LookAt(Mixed(fabric.lit[0], 1.0F, fabric.lit[5], 0.05F), seed);
         looks.dark_last = LookAt(Mixed(fabric.dark, 1.0F, fabric.lit[5], 0.05F), seed);
         return CaptureFault{CaptureFaultKind::kAmbient, {}, ""};
       }},
      {"nudge of 3 px",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         looks.Nudge(fabric, 1 + HashOf(seed, 202) % kLookLights, seed);
         return CaptureFault{CaptureFaultKind::kMoved, {}, ""};
       }},
      {"shadow of a passer-by",
       [](const Fabric& fabric, SessionLooks& looks, uint64_t seed) {
         const size_t k = AnyLight(seed);
         looks.lit[k] = LookAt(PassersShadow(HashOf(seed, 203)).On(fabric.lit[k]), seed);
         return CaptureFault{CaptureFaultKind::kShaded, {k}, ""};
       }},
  };
}

inline std::vector<size_t> LightsOf(const CaptureCheck& check, CaptureFaultKind kind) {
  std::vector<size_t> lights;
  for (const CaptureFault& fault : check.faults) {
    if (fault.kind == kind) {
      lights.insert(lights.end(), fault.lights.begin(), fault.lights.end());
    }
  }
  return lights;
}

inline bool Found(const CaptureCheck& check, const CaptureFault& wanted) {
  return std::ranges::any_of(check.faults,
                             [&](const CaptureFault& f) { return f.kind == wanted.kind; }) &&
         std::ranges::all_of(check.faults,
                             [&](const CaptureFault& f) { return f.kind == wanted.kind; }) &&
         LightsOf(check, wanted.kind) == wanted.lights;
}

inline std::string WordsOf(const CaptureCheck& check) {
  std::string words;
  for (const CaptureFault& fault : check.faults) {
    words += "\n  " + fault.text;
  }
  return words.empty() ? " nothing" : words;
}

// Results of the clean sessions.
struct Clean {
  int sessions = 0;
  int false_alarms = 0;
  double level = 0.0;
  double shift_px = 0.0;

  void Add(const std::string& fabric, const CaptureCheck& check) {
    ++sessions;
    false_alarms += check.faults.empty() ? 0 : 1;
    if (!check.faults.empty()) {
      fmt::print("{}, clean:{}\n", fabric, WordsOf(check));
    }
    for (const double one : check.levels) {
      level = std::max(level, std::abs(one - 1.0));
    }
    for (const Shift& shift : check.shifts) {
      shift_px = std::max(shift_px, shift.px.norm());
    }
  }
};

// Sessions of these fabrics: 25 clean ones of each, or few, and each fault in every other.
// The bars: each fault is found in 99 of 100 sessions, and is the only one; 1 false alarm in 200.
inline void ExpectFaultsAreFound(const std::vector<std::string>& fabrics, uint64_t first_seed) {
  const int seeds = SeedsOf(25, 5);
  const Rig calibrated = CalibratedRig();
  std::vector<Rate> rates = Rates();
  Clean clean;
  double nudge_error = 0.0;
  for (const std::string& name : fabrics) {
    const Fabric fabric(name, calibrated, kNudgePx);
    for (int i = 0; i < seeds; ++i) {
      const uint64_t seed = HashOf(1, first_seed + static_cast<uint64_t>(clean.sessions));
      const Rig rig = i / 2 % 2 == 0 ? calibrated : RoughRig(calibrated, kRulerMm, seed);
      const SessionLooks looks(fabric, seed);
      clean.Add(name, CheckCapture(rig, looks, {}));
      if (i % 2 == 1) {
        continue;
      }
      for (Rate& rate : rates) {
        SessionLooks damaged = looks;
        const CaptureFault wanted = rate.damage(fabric, damaged, seed);
        const CaptureCheck found =
            CheckCapture(rate.needs_calibration ? calibrated : rig, damaged, {});
        rate.found += Found(found, wanted) ? 1 : 0;
        ++rate.sessions;
        if (!Found(found, wanted)) {
          fmt::print("{}, {} (seed {}):{}\n", name, rate.name, seed, WordsOf(found));
        }
        if (wanted.kind == CaptureFaultKind::kMoved && !found.shifts.empty()) {
          nudge_error = std::max(nudge_error, (found.shifts.back().px - kNudgePx).norm());
        }
      }
    }
  }
  for (const Rate& rate : rates) {
    fmt::print("{:24} found, and nothing else, in {:3} of {} sessions\n", rate.name, rate.found,
               rate.sessions);
    EXPECT_GE(rate.found, 0.99 * rate.sessions) << rate.name;
  }
  fmt::print("{:24} {} of {} sessions; levels within {:.1f} %, shifts within {:.2f} px\n",
             "false alarms in", clean.false_alarms, clean.sessions, 100.0 * clean.level,
             clean.shift_px);
  fmt::print("{:24} within {:.2f} px\n", "the nudge is measured", nudge_error);
  EXPECT_LE(clean.false_alarms, clean.sessions / 200);
  EXPECT_LT(nudge_error, 0.5);
}

}  // namespace sateen::testing
