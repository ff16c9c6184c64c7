// Vectors of pixels for solver/kernels/fast_kernel.cc, and the scaling of radiance far from 1.
// Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_FAST_KERNEL_VECTORS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_FAST_KERNEL_VECTORS_INL_H_
#undef SATEEN_SOLVER_FAST_KERNEL_VECTORS_INL_H_
#else
#define SATEEN_SOLVER_FAST_KERNEL_VECTORS_INL_H_
#endif

#include <hwy/highway.h>
#if HWY_ARCH_X86
#include <xmmintrin.h>
#endif

#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::ScalableTag<float>;
using DI = hn::RebindToSigned<D>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;
using M = hn::Mask<D>;

// Makes subnormal inputs count as zero while it lives. SolveVector scales pixels that need them.
class FlushSubnormals {
 public:
#if HWY_ARCH_X86
  FlushSubnormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040U); }
  ~FlushSubnormals() { _mm_setcsr(saved_); }
  FlushSubnormals(const FlushSubnormals&) = delete;
  FlushSubnormals& operator=(const FlushSubnormals&) = delete;

 private:
  unsigned saved_;
#endif
};

HWY_INLINE M NoLanes() { return hn::FirstN(D(), 0); }

struct Vector3 {
  V x, y, z;
};

HWY_INLINE V Dot(const Vector3& a, const Vector3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}

// Returns the lanes inside the mask; null: all.
HWY_INLINE M InsideOf(const uint8_t* mask, size_t offset) {
  if (mask == nullptr) {
    return hn::Not(NoLanes());
  }
  const hn::Rebind<uint8_t, D> du8;
  const VI bytes = hn::PromoteTo(DI(), hn::LoadU(du8, mask + offset));
  return hn::RebindMask(D(), hn::Ne(bytes, hn::Zero(DI())));
}

HWY_INLINE void StoreBytes(VI values, uint8_t* to) {
  const hn::Rebind<uint8_t, D> du8;
  hn::StoreU(hn::DemoteTo(du8, values), du8, to);
}

// Returns 1 / v to the last bit but one, for v from 1e-37 to 1e37: an estimate and a step of
// Newton's method, because the processor has only one divider.
HWY_INLINE V ReciprocalOf(V v) {
  const D d;
#if HWY_ARCH_X86
  const V guess = hn::ApproximateReciprocal(v);
  return hn::Mul(guess, hn::NegMulAdd(v, guess, hn::Set(d, 2.0F)));
#else
  return hn::Div(hn::Set(d, 1.0F), v);
#endif
}

// Returns 1 / v to some 3e-4, for weights and uncertainties.
HWY_INLINE V RoughReciprocalOf(V v) {
#if HWY_ARCH_X86
  return hn::ApproximateReciprocal(v);
#else
  return hn::Div(hn::Set(D(), 1.0F), v);
#endif
}

// Returns 1 / sqrt(v) as precisely as ReciprocalOf().
HWY_INLINE V ReciprocalRootOf(V v) {
  const D d;
#if HWY_ARCH_X86
  const V guess = hn::ApproximateReciprocalSqrt(v);
  const V half = hn::Mul(hn::Set(d, 0.5F), hn::Mul(v, guess));
  return hn::MulAdd(guess, hn::NegMulAdd(half, guess, hn::Set(d, 0.5F)), guess);
#else
  return hn::Div(hn::Set(d, 1.0F), hn::Sqrt(v));
#endif
}

// Returns the root of v to some 3e-4.
HWY_INLINE V RoughRootOf(V v) {
#if HWY_ARCH_X86
  return hn::Mul(v, hn::ApproximateReciprocalSqrt(hn::Max(v, hn::Set(D(), 1e-37F))));
#else
  return hn::Sqrt(v);
#endif
}

HWY_INLINE V RootOf(V v) { return hn::Mul(v, ReciprocalRootOf(hn::Max(v, hn::Set(D(), 1e-37F)))); }

// Returns the power of two at or below v, a positive number that is not subnormal.
HWY_INLINE V PowerOfTwoBelow(V v) {
  const DI di;
  return hn::BitCast(D(), hn::And(hn::BitCast(di, v), hn::Set(di, 0x7f800000)));
}

HWY_INLINE V ReciprocalOfPower(V power) {
  const DI di;
  return hn::BitCast(D(), hn::Sub(hn::Set(di, 0x7f000000), hn::BitCast(di, power)));
}

// ---- Radiance far from 1 -----------------------------------------------------------------------

constexpr float kTwoTo40 = 1.099511627776e12F;
constexpr float kTwoToMinus40 = 1.0F / kTwoTo40;
constexpr int32_t kSmallestNormalBits = 0x00800000;
constexpr int32_t kInfinityBits = 0x7f800000;
constexpr float kTwoTo49 = 562949953421312.0F;

// Power of two per lane by which samples are multiplied and results divided.
struct Scale {
  V forward;
  V backward;
  M subnormal;  // the lane's samples may be subnormal: forward = 2^100
};

HWY_INLINE Scale ScaleFor(VI brightest_bits) {
  const D d;
  const DI di;
  const auto bits_of = [&](int exponent) { return hn::Set(di, (exponent + 127) << 23); };
  VI exponent = hn::Set(di, 0);
  exponent = hn::IfThenElse(hn::Lt(brightest_bits, bits_of(-40)), hn::Set(di, 60), exponent);
  const auto tiny = hn::Lt(brightest_bits, bits_of(-100));
  exponent = hn::IfThenElse(tiny, hn::Set(di, 100), exponent);
  exponent = hn::IfThenElse(hn::Gt(brightest_bits, bits_of(40)), hn::Set(di, -60), exponent);
  exponent = hn::IfThenElse(hn::Gt(brightest_bits, bits_of(90)), hn::Set(di, -100), exponent);
  const VI bias = hn::Set(di, 127);
  return {hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(bias, exponent))),
          hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(bias, exponent))), hn::RebindMask(d, tiny)};
}

HWY_INLINE V ScaleUp(V value, const Scale& scale) {
  const D d;
  const DI di;
  const VI bits = hn::BitCast(di, value);
  const VI magnitude = hn::And(bits, hn::Set(di, 0x7fffffff));
  // A subnormal is its significand times 2^-149, and 2^-149 * 2^100 = 2^-49.
  const V exact =
      hn::CopySign(hn::Mul(hn::ConvertTo(d, magnitude), hn::Set(d, 1.0F / kTwoTo49)), value);
  const M subnormal = hn::And(
      scale.subnormal, hn::RebindMask(d, hn::Lt(magnitude, hn::Set(di, kSmallestNormalBits))));
  return hn::IfThenElse(subnormal, exact, hn::Mul(value, scale.forward));
}

HWY_INLINE V ScaleDown(V value, const Scale& scale) {
  const D d;
  const V result = hn::Mul(value, scale.backward);
  const V significand = hn::Mul(value, hn::Set(d, kTwoTo49));
  const M subnormal = hn::And(
      scale.subnormal, hn::Lt(significand, hn::Set(d, static_cast<float>(kSmallestNormalBits))));
  // Lanes that are not subnormal must not overflow the conversion.
  const V safe = hn::IfThenElseZero(subnormal, significand);
  return hn::IfThenElse(subnormal, hn::BitCast(d, hn::NearestInt(safe)), result);
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
