// The fast kernel against the reference, on random stacks: the same reasons, the same normals.

#include "solver/kernels/fast_kernel.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "tests/solver/solver_cases.h"

namespace sateen::fast_kernel_test {
namespace {

using namespace sateen::testing;  // NOLINT(google-build-using-namespace): the cases of this file

// A rig, a stack and options that nobody would think of.
struct RandomCase {
  LightStack stack;
  Rig rig;
  std::optional<Mask> mask;
  LambertianOptions options;
};

class Generator {
 public:
  explicit Generator(unsigned seed) : rng_(seed) {}

  // With lights of one rung up to `highest`.
  RandomCase Make(LightModel highest) {
    const ImageSize size{Int(1, 70), Int(1, 9)};
    RandomCase random;
    const auto model = static_cast<LightModel>(Int(0, static_cast<int>(highest)));
    random.rig = RingRig(size, model);
    random.rig.lights = RandomLights(Int(3, 24), model);
    const ReliefScene scene{.shape = ReliefShape::kRipple,
                            .max_slope_rad = Real(0.0, 1.4),
                            .ripple_period_px = Real(3.0, 60.0),
                            .albedo_min = 0.02,
                            .sensor = SensorModel{.full_scale = Real(0.2, 3.0)},
                            .seed = rng_()};
    random.stack = RenderRelief(scene, random.rig, size).value().stack;
    Spoil(random.stack);
    if (Int(0, 2) == 0) {
      random.mask = Mask(size);
      for (uint8_t& inside : random.mask->pixels) {
        inside = static_cast<uint8_t>(Int(0, 1));
      }
    }
    random.options.shadow_level = Real(0.0, 0.2);
    random.options.clip_level = Real(0.5, 1.0);
    return random;
  }

 private:
  int Int(int low, int high) { return std::uniform_int_distribution<int>(low, high)(rng_); }
  double Real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }

  Lights RandomLights(int count, LightModel model) {
    Lights lights;
    for (int k = 0; k < count; ++k) {
      const double polar_rad = Real(0.05, 1.4);
      const double azimuth_rad = Real(0.0, 6.3);
      const Eigen::Vector3d up(std::sin(polar_rad) * std::cos(azimuth_rad),
                               std::sin(polar_rad) * std::sin(azimuth_rad), std::cos(polar_rad));
      lights.push_back({.name = std::to_string(k),
                        .model = model,
                        .direction = up,
                        .position_mm = Real(200.0, 900.0) * up,
                        .axis = -(up + Eigen::Vector3d(Real(-1, 1), Real(-1, 1), 0)).normalized(),
                        .anisotropy = std::max(0.0, Real(-1.0, 4.0)),
                        .flux_rgb = {Real(0.1, 1.0), Real(0.1, 1.0), Real(0.1, 1.0)}});
      if (model == LightModel::kLedField) {
        lights.back().field =
            LensRings({Real(-50, 50), Real(-50, 50)}, Real(-0.3, 0.3), Real(80, 200));
        if (k % 3 == 1) {
          lights.back().model = LightModel::kLed;  // beside those that have one
        }
      }
    }
    return lights;
  }

  // One sample in twenty becomes something that a file may hold but light does not.
  void Spoil(LightStack& stack) {
    constexpr std::array<float, 7> kBad = {std::numeric_limits<float>::quiet_NaN(),
                                           std::numeric_limits<float>::infinity(),
                                           -std::numeric_limits<float>::infinity(),
                                           -1.0F,
                                           0.0F,
                                           1e-41F,
                                           1e6F};
    for (LightFrame& frame : stack) {
      for (Image<float>& plane : frame.rgb.planes) {
        for (float& value : plane.pixels) {
          if (Int(0, 59) == 0) {
            value = kBad[static_cast<size_t>(Int(0, 6))];
          }
        }
      }
    }
  }

  std::mt19937 rng_;
};

int CaseCount() {
  const char* from_environment = std::getenv("SATEEN_FUZZ_CASES");
  return from_environment != nullptr ? std::atoi(from_environment) : 400;
}

void ExpectSameResidual(const NormalField& fast, const NormalField& reference) {
  for (size_t p = 0; p < fast.reason.pixels.size(); ++p) {
    if (ReasonAt(fast, p) == Reason::kSolved) {
      // Rounding is relative to the samples, some of which are larger than what is solved for.
      const float scale = reference.albedo[1].pixels[p] + reference.residual.pixels[p];
      ASSERT_NEAR(fast.residual.pixels[p], reference.residual.pixels[p], 1e-4F * scale);
    }
  }
}

void ExpectAgreement(int first_seed, int count, LightModel highest) {
  int64_t compared = 0;
  for (int seed = first_seed; seed < first_seed + count; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const RandomCase random = Generator(static_cast<unsigned>(seed)).Make(highest);
    const auto solve = [&](Backend backend) {
      LambertianOptions options = random.options;
      options.backend = backend;
      return SolveLambertian(random.stack, random.rig, random.mask, options);
    };
    const Result<NormalField> reference = solve(Backend::kJacobiSvd);
    const Result<NormalField> fast = solve(Backend::kFast);
    const Result<NormalField> combined = solve(Backend::kAuto);
    ASSERT_EQ(reference.has_value(), fast.has_value());
    if (!reference) {
      EXPECT_EQ(reference.error().message, fast.error().message);
      continue;
    }
    EXPECT_EQ(combined->reason.pixels, reference->reason.pixels);
    EXPECT_EQ(combined->samples.pixels, reference->samples.pixels);
    for (size_t p = 0; p < fast->reason.pixels.size(); ++p) {
      if (fast->reason.pixels[p] != reference->reason.pixels[p]) {
        // The only licence of the kernel: to refuse.
        ASSERT_EQ(ReasonAt(*fast, p), Reason::kIllConditioned);
      }
    }
    const ErrorStatistics angle = AngularErrorDeg(*fast, reference->normal).value();
    EXPECT_LT(angle.max, 1e-3);  // the bar; refused pixels are not in it
    // Rounding is relative to the samples, and spoiled ones are far larger than the albedo.
    EXPECT_LT(RelativeAlbedoError(*fast, reference->albedo).value().p99, 1e-4);
    ExpectSameResidual(*fast, *reference);
    compared += angle.count;
  }
  EXPECT_GT(compared, 100 * count);  // not all cases are refused
}

TEST(FastKernel, AgreesWithTheReferenceOnRandomStacks) {
  ExpectAgreement(0, CaseCount(), LightModel::kLed);
}

TEST(FastKernel, AgreesWithTheReferenceWithFields) {
  ExpectAgreement(1000, CaseCount() / 4, LightModel::kLedField);
}

TEST(FastKernel, TellsWhatItWasCompiledFor) { EXPECT_FALSE(KernelInstructionSet().empty()); }

}  // namespace
}  // namespace sateen::fast_kernel_test
