// Samples of a vector of pixels and their ranks, for solver/kernels/consensus_kernel-inl.h:
// equations (1) and (2) of solver/robust/consensus.h. Compiled once per instruction set, hence the
// guard that toggles.
#if defined(SATEEN_SOLVER_CONSENSUS_SAMPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_CONSENSUS_SAMPLES_INL_H_
#undef SATEEN_SOLVER_CONSENSUS_SAMPLES_INL_H_
#else
#define SATEEN_SOLVER_CONSENSUS_SAMPLES_INL_H_
#endif

#include <hwy/highway.h>

#include "imaging/color.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/fast_kernel_equations-inl.h"
#include "solver/kernels/fast_kernel_gather-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/robust/consensus.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {

HWY_INLINE V One(M mask) { return hn::IfThenElseZero(mask, hn::Set(D(), 1.0F)); }

// Band of samples in each lane: ranks [begin, end) among the usable ones, darkest first.
struct Band {
  V median;
  V begin;
  V end;
};

struct Samples {
  const KernelParams& params;
  const float* scratch;
  float* ranks;  // of each sample, then its value j
  V threshold;   // luminances above are usable

  [[nodiscard]] size_t Count() const { return params.lights.size(); }
  [[nodiscard]] const float* Slot(size_t k) const {
    return scratch + k * kScratchPerLight * hn::Lanes(D());
  }
  [[nodiscard]] M Usable(size_t k) const {
    return hn::Gt(hn::Load(D(), Slot(k) + 6 * hn::Lanes(D())), threshold);
  }
  [[nodiscard]] V Value(size_t k) const {
    return hn::Load(D(), ranks + (Count() + k) * hn::Lanes(D()));
  }
  void SetValue(size_t k, V value) const {
    hn::Store(value, D(), ranks + (Count() + k) * hn::Lanes(D()));
  }
  [[nodiscard]] V Channel(size_t k, size_t c) const {
    return hn::Load(D(), Slot(k) + (3 + c) * hn::Lanes(D()));
  }
  [[nodiscard]] Vector3 Direction(size_t k) const {
    const D d;
    const size_t lanes = hn::Lanes(d);
    return {hn::Load(d, Slot(k)), hn::Load(d, Slot(k) + lanes), hn::Load(d, Slot(k) + 2 * lanes)};
  }
  [[nodiscard]] V Rank(size_t k) const { return hn::Load(D(), ranks + k * hn::Lanes(D())); }
  void SetRank(size_t k, V rank) const { hn::Store(rank, D(), ranks + k * hn::Lanes(D())); }
};

// w of (1) in each lane.
struct Projection {
  V w[3];

  [[nodiscard]] Vector3 Of(const Vector3* n) const {
    return {hn::MulAdd(w[0], n[0].x, hn::MulAdd(w[1], n[1].x, hn::Mul(w[2], n[2].x))),
            hn::MulAdd(w[0], n[0].y, hn::MulAdd(w[1], n[1].y, hn::Mul(w[2], n[2].y))),
            hn::MulAdd(w[0], n[0].z, hn::MulAdd(w[1], n[1].z, hn::Mul(w[2], n[2].z)))};
  }
};

HWY_INLINE Projection OnLuminance() {
  const D d;
  return {{hn::Set(d, kLuminance[0]), hn::Set(d, kLuminance[1]), hn::Set(d, kLuminance[2])}};
}

HWY_INLINE Projection Select(M mask, const Projection& yes, const Projection& no) {
  return {{hn::IfThenElse(mask, yes.w[0], no.w[0]), hn::IfThenElse(mask, yes.w[1], no.w[1]),
           hn::IfThenElse(mask, yes.w[2], no.w[2])}};
}

// Returns the projection on the departure from grey in the `colourful` lanes, on luminance in the
// others.
HWY_INLINE Projection OnChroma(const Samples& samples, M& colourful) {
  const D d;
  const V zero = hn::Zero(d);
  V sum[3] = {zero, zero, zero};
  for (size_t k = 0; k < samples.Count(); ++k) {
    const M usable = samples.Usable(k);
    for (size_t c = 0; c < 3; ++c) {
      sum[c] = hn::Add(sum[c], hn::IfThenElseZero(usable, samples.Channel(k, c)));
    }
  }
  const V grey = hn::Mul(hn::Add(sum[0], hn::Add(sum[1], sum[2])), hn::Set(d, 1.0F / 3.0F));
  const Vector3 chroma{hn::Sub(sum[0], grey), hn::Sub(sum[1], grey), hn::Sub(sum[2], grey)};
  const V squared = Dot(chroma, chroma);
  const V brightness = Dot({sum[0], sum[1], sum[2]}, {sum[0], sum[1], sum[2]});
  colourful = hn::Gt(squared, hn::Mul(brightness, hn::Set(d, kLeastChroma * kLeastChroma)));
  const V luminance = hn::MulAdd(
      hn::Set(d, kLuminance[0]), sum[0],
      hn::MulAdd(hn::Set(d, kLuminance[1]), sum[1], hn::Mul(hn::Set(d, kLuminance[2]), sum[2])));
  // chroma . sum = squared, because chroma adds up to zero: the projections add up to the
  // luminance.
  const V unit = hn::Div(luminance, hn::IfThenElse(colourful, squared, hn::Set(d, 1.0F)));
  const Projection on_chroma{
      {hn::Mul(chroma.x, unit), hn::Mul(chroma.y, unit), hn::Mul(chroma.z, unit)}};
  return Select(colourful, on_chroma, OnLuminance());
}

// Stores the values of (1), -1 for samples that are not usable. Returns the brightest.
HWY_INLINE V Project(const Samples& samples, const Projection& on) {
  const D d;
  V brightest = hn::Zero(d);
  for (size_t k = 0; k < samples.Count(); ++k) {
    const V projected = hn::MulAdd(
        on.w[0], samples.Channel(k, 0),
        hn::MulAdd(on.w[1], samples.Channel(k, 1), hn::Mul(on.w[2], samples.Channel(k, 2))));
    const V value = hn::IfThenElse(samples.Usable(k), projected, hn::Set(d, -1.0F));
    brightest = hn::Max(brightest, value);
    samples.SetValue(k, value);
  }
  return brightest;
}

// Ranks the usable samples, -1 for the others. Returns their number.
HWY_INLINE V RankSamples(const Samples& samples, V threshold) {
  const D d;
  const V one = hn::Set(d, 1.0F);
  V count = hn::Zero(d);
  for (size_t k = 0; k < samples.Count(); ++k) {
    samples.SetRank(k, hn::Zero(d));
  }
  for (size_t k = 0; k < samples.Count(); ++k) {
    const V i = samples.Value(k);
    const M usable = hn::Gt(i, threshold);
    V rank = samples.Rank(k);
    for (size_t j = 0; j < k; ++j) {
      const V other = samples.Value(j);
      const M below = hn::Le(other, i);
      rank = hn::Add(rank, One(hn::And(below, hn::Gt(other, threshold))));
      samples.SetRank(j, hn::Add(samples.Rank(j), One(hn::AndNot(below, usable))));
    }
    samples.SetRank(k, rank);
    count = hn::Add(count, One(usable));
  }
  for (size_t k = 0; k < samples.Count(); ++k) {
    const M usable = hn::Gt(samples.Value(k), threshold);
    samples.SetRank(k, hn::IfThenElse(usable, samples.Rank(k), hn::Neg(one)));
  }
  return count;
}

HWY_INLINE Band BandOf(const Samples& samples, V count) {
  const D d;
  const V zero = hn::Zero(d);
  const V middle = hn::Floor(hn::Mul(hn::Sub(count, hn::Set(d, 1.0F)), hn::Set(d, 0.5F)));
  Band band{zero, zero, count};
  for (size_t k = 0; k < samples.Count(); ++k) {
    band.median =
        hn::Add(band.median, hn::IfThenElseZero(hn::Eq(samples.Rank(k), middle), samples.Value(k)));
  }
  const V dark = hn::Mul(band.median, hn::Set(d, kDarkOfMedian));
  for (size_t k = 0; k < samples.Count(); ++k) {
    const M is_dark = hn::And(hn::Ge(samples.Rank(k), zero), hn::Le(samples.Value(k), dark));
    band.begin = hn::Add(band.begin, One(is_dark));
  }
  const M too_few =
      hn::Lt(hn::Sub(count, band.begin), hn::Set(d, static_cast<float>(kFewestAgreeing)));
  band.begin = hn::IfThenElse(too_few, zero, band.begin);
  const V beyond = hn::Max(
      hn::Sub(hn::Sub(count, band.begin), hn::Set(d, static_cast<float>(kUntrimmedSamples))), zero);
  band.begin = hn::Add(band.begin, hn::Floor(hn::Mul(beyond, hn::Set(d, kTrimDark))));
  band.end = hn::Sub(count, hn::Floor(hn::Mul(beyond, hn::Set(d, kTrimBright))));
  return band;
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
