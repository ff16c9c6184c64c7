// Consensus of a vector of pixels, for solver/kernels/fast_kernel.cc: equations (1) to (6) of
// solver/robust/consensus.h. Compiled once per instruction set, hence the guard that toggles.
#if defined(SATEEN_SOLVER_CONSENSUS_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SATEEN_SOLVER_CONSENSUS_KERNEL_INL_H_
#undef SATEEN_SOLVER_CONSENSUS_KERNEL_INL_H_
#else
#define SATEEN_SOLVER_CONSENSUS_KERNEL_INL_H_
#endif

#include <hwy/highway.h>

#include <cmath>

#include "solver/kernels/consensus_samples-inl.h"
#include "solver/kernels/fast_kernel.h"
#include "solver/kernels/fast_kernel_equations-inl.h"
#include "solver/kernels/fast_kernel_gather-inl.h"
#include "solver/kernels/fast_kernel_vectors-inl.h"
#include "solver/kernels/fast_kernel_weights-inl.h"
#include "solver/lambertian.h"
#include "solver/robust/consensus.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {

// Sample that triples are made of; zero where the pixel has fewer.
struct TripleSample {
  V i;
  Vector3 l;
};

HWY_INLINE M InBand(const Band& band, V rank) {
  return hn::And(hn::Ge(rank, band.begin), hn::Lt(rank, band.end));
}

// Picks the samples of (3) in order of rank, in medians. Returns the number in the fullest lane.
HWY_INLINE size_t PickTripleSamples(const Samples& samples, const Band& band, V inverse_median,
                                    TripleSample* picked) {
  const D d;
  const V zero = hn::Zero(d);
  const V in_band = hn::Sub(band.end, band.begin);
  const V last = hn::Sub(in_band, hn::Set(d, 1.0F));
  const M all = hn::Le(in_band, hn::Set(d, static_cast<float>(kTripleSamples)));
  size_t fullest = 0;
  for (size_t j = 0; j < kTripleSamples; ++j) {
    const V place = hn::Set(d, static_cast<float>(j));
    const V spaced = hn::Floor(hn::MulAdd(
        last, hn::Set(d, static_cast<float>(j) / (kTripleSamples - 1)), hn::Set(d, 0.5F)));
    const V rank = hn::Add(band.begin, hn::IfThenElse(all, place, spaced));
    const M there = hn::Or(hn::Not(all), hn::Lt(place, in_band));
    TripleSample sample{zero, {zero, zero, zero}};
    for (size_t k = 0; k < samples.Count(); ++k) {
      const M is_it = hn::And(there, hn::Eq(samples.Rank(k), rank));
      const Vector3 l = samples.Direction(k);
      sample.i = hn::IfThenElse(is_it, samples.Value(k), sample.i);
      sample.l = {hn::IfThenElse(is_it, l.x, sample.l.x), hn::IfThenElse(is_it, l.y, sample.l.y),
                  hn::IfThenElse(is_it, l.z, sample.l.z)};
    }
    sample.i = hn::Mul(sample.i, inverse_median);
    picked[j] = sample;
    fullest = hn::AllFalse(d, there) ? fullest : j + 1;
  }
  return fullest;
}

HWY_INLINE Vector3 Cross(const Vector3& a, const Vector3& b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}

// Common terms of all triples with the samples a and b.
struct Pair {
  Vector3 cross;  // l_a x l_b
  Vector3 mixed;  // i_a l_b - i_b l_a
};

HWY_INLINE Pair PairOf(const TripleSample& a, const TripleSample& b) {
  return {Cross(a.l, b.l),
          {hn::MulSub(a.i, b.l.x, hn::Mul(b.i, a.l.x)), hn::MulSub(a.i, b.l.y, hn::Mul(b.i, a.l.y)),
           hn::MulSub(a.i, b.l.z, hn::Mul(b.i, a.l.z))}};
}

// Returns the product of (4), each factor divided by 16 to stay in a float. The triple's own
// samples are not left out: finding them costs more than their factors of 1.
HWY_INLINE V CostOf(const TripleSample* picked, size_t count, const Vector3& n) {
  const D d;
  const V slope = hn::Set(d, 1.0F / (16.0F * kConsensusScale));
  const V least = hn::Set(d, 1.0F / 16.0F);
  V cost = hn::Set(d, 1.0F);
  for (size_t k = 0; k < count; ++k) {
    const V r = hn::Abs(hn::NegMulAdd(
        picked[k].l.x, n.x,
        hn::NegMulAdd(picked[k].l.y, n.y, hn::NegMulAdd(picked[k].l.z, n.z, picked[k].i))));
    cost = hn::Mul(cost, hn::MulAdd(r, slope, least));
  }
  return cost;
}

// Finds the N of (3) and (4) and returns its product. `n` stays where no triple is well
// conditioned.
HWY_INLINE V SearchTriples(const TripleSample* picked, size_t count, Vector3& n) {
  const D d;
  V best = hn::Set(d, 3e38F);
  const V least_volume = hn::Set(d, kLeastTripleVolume);
  for (size_t a = 0; a + 2 < count; ++a) {
    for (size_t b = a + 1; b + 1 < count; ++b) {
      const Pair pair = PairOf(picked[a], picked[b]);
      for (size_t c = b + 1; c < count; ++c) {
        const V volume = Dot(pair.cross, picked[c].l);
        const M regular = hn::Gt(hn::Abs(volume), least_volume);
        const V inverse =
            hn::Div(hn::Set(d, 1.0F), hn::IfThenElse(regular, volume, hn::Set(d, 1.0F)));
        const Vector3 turned = Cross(pair.mixed, picked[c].l);
        const Vector3 m{hn::Mul(hn::MulAdd(picked[c].i, pair.cross.x, turned.x), inverse),
                        hn::Mul(hn::MulAdd(picked[c].i, pair.cross.y, turned.y), inverse),
                        hn::Mul(hn::MulAdd(picked[c].i, pair.cross.z, turned.z), inverse)};
        const V cost = CostOf(picked, count, m);
        const M better = hn::And(regular, hn::Lt(cost, best));
        best = hn::IfThenElse(better, cost, best);
        n = {hn::IfThenElse(better, m.x, n.x), hn::IfThenElse(better, m.y, n.y),
             hn::IfThenElse(better, m.z, n.z)};
      }
    }
  }
  // Takes the sixteenths out, whose number is that of the fullest lane: a pixel's answer must not
  // depend on its neighbours.
  return hn::Mul(best, hn::Set(d, std::exp2(4.0F * static_cast<float>(count))));
}

// Sums of (5) and (6) at one normal.
struct Reweighted {
  Symmetric3 a;  // sum of w l l^T
  Vector3 b[3];  // sum of w l i'_c
  V weights;     // sum of w
  V squares;     // sum of w r^2
  V agreeing;
};

// `start`: gives every sample of the band the weight 1.
HWY_INLINE Reweighted Reweigh(const Samples& samples, const Band& band, V inverse_median,
                              const Vector3& n, bool start) {
  const D d;
  const V zero = hn::Zero(d);
  const V one = hn::Set(d, 1.0F);
  const Vector3 zero3{zero, zero, zero};
  Reweighted sums{{zero, zero, zero, zero, zero, zero}, {zero3, zero3, zero3}, zero, zero, zero};
  for (size_t k = 0; k < samples.Count(); ++k) {
    const V rank = samples.Rank(k);
    const M usable = hn::Ge(rank, zero);
    const Vector3 l = samples.Direction(k);
    const V r = hn::Sub(hn::Mul(samples.Value(k), inverse_median), Dot(l, n));
    const V t = hn::Mul(r, hn::Set(d, 1.0F / kReweightScale));
    const V root = hn::Div(one, hn::MulAdd(t, t, one));
    const V w = hn::IfThenElseZero(InBand(band, rank), start ? one : hn::Mul(root, root));
    AddOuter(l, w, sums.a);
    for (size_t c = 0; c < 3; ++c) {
      const V i = hn::IfThenElseZero(usable, hn::Mul(samples.Channel(k, c), inverse_median));
      AddScaled(l, hn::Mul(w, i), sums.b[c]);
    }
    sums.weights = hn::Add(sums.weights, w);
    sums.squares = hn::MulAdd(hn::Mul(w, r), hn::IfThenElseZero(usable, r), sums.squares);
    sums.agreeing =
        hn::Add(sums.agreeing, One(hn::And(usable, hn::Le(hn::Abs(r), hn::Set(d, kAgreeing)))));
  }
  return sums;
}

// Returns the spread of (6) for a variance of VariancesOf().
HWY_INLINE V SpreadOf(V variance, const Reweighted& sums) {
  const D d;
  const V freedom = hn::Max(hn::Sub(sums.weights, hn::Set(d, 3.0F)), hn::Set(d, 1.0F));
  const V spread = hn::Div(hn::Mul(variance, sums.squares), freedom);
  return hn::Sqrt(hn::MulAdd(hn::Set(d, kUncertaintyFactor * kUncertaintyFactor), spread,
                             hn::Set(d, kLeastModelUncertainty * kLeastModelUncertainty)));
}

HWY_INLINE void StoreConsensus(const Reweighted& sums, const Vector3* n_rgb, const Vector3& n,
                               const Inverse& inverse, V median, M solved, V result_scale,
                               const Scale& scale, size_t offset, const KernelOutput& output) {
  const D d;
  const DI di;
  const V inverse_length = hn::Div(hn::Set(d, 1.0F), hn::Sqrt(Dot(n, n)));
  const auto store = [&](V value, float* to) {
    hn::StoreU(hn::IfThenElseZero(solved, value), d, to + offset);
  };
  store(hn::Mul(n.x, inverse_length), output.normal[0]);
  store(hn::Mul(n.y, inverse_length), output.normal[1]);
  store(hn::Mul(n.z, inverse_length), output.normal[2]);
  const V unit = hn::Mul(median, result_scale);
  for (size_t c = 0; c < 3; ++c) {
    store(ScaleDown(hn::Mul(hn::Sqrt(Dot(n_rgb[c], n_rgb[c])), unit), scale), output.albedo[c]);
  }
  const V mean = hn::Div(sums.squares, hn::Max(sums.weights, hn::Set(d, 1e-6F)));
  store(ScaleDown(hn::Mul(hn::Sqrt(mean), unit), scale), output.residual);
  const Variances variances = VariancesOf(inverse.a, n);
  store(hn::Mul(SpreadOf(variances.angular, sums), hn::Set(d, kDegreesPerRadian)),
        output.uncertainty);
  store(SpreadOf(variances.albedo, sums), output.albedo_uncertainty);
  const auto bits = hn::RebindMask(di, solved);
  StoreBytes(hn::IfThenElseZero(bits, hn::Min(hn::ConvertTo(di, sums.agreeing), hn::Set(di, 255))),
             output.agreeing + offset);
  StoreBytes(hn::IfThenElse(bits, hn::Set(di, static_cast<int32_t>(Reason::kSolved)),
                            hn::Set(di, static_cast<int32_t>(Reason::kIllConditioned))),
             output.reason + offset);
}

// Search in one projection.
struct Search {
  V count;
  Band band;
  V inverse_median;
  Vector3 n;  // in medians
  V cost;
};

HWY_INLINE void RankProjected(const KernelParams& params, const Samples& samples,
                              const Projection& on, Search& search) {
  const D d;
  const V brightest = Project(samples, on);
  search.count = RankSamples(samples, hn::Mul(brightest, hn::Set(d, params.shadow_level)));
  search.band = BandOf(samples, search.count);  // (2)
  const M known = hn::Gt(search.band.median, hn::Zero(d));
  search.inverse_median =
      hn::Div(hn::Set(d, 1.0F), hn::IfThenElse(known, search.band.median, hn::Set(d, 1.0F)));
}

HWY_INLINE Search SearchProjected(const KernelParams& params, const Samples& samples,
                                  const Projection& on, float condition) {
  const V zero = hn::Zero(D());
  Search search;
  RankProjected(params, samples, on, search);
  TripleSample picked[kTripleSamples];
  const size_t fullest = PickTripleSamples(samples, search.band, search.inverse_median, picked);
  const Reweighted sums = Reweigh(samples, search.band, search.inverse_median, {zero, zero, zero},
                                  /*start=*/true);
  const Inverse inverse = Invert(sums.a, condition);
  const Vector3 n_rgb[3] = {Times(inverse.a, sums.b[0]), Times(inverse.a, sums.b[1]),
                            Times(inverse.a, sums.b[2])};
  search.n = on.Of(n_rgb);
  search.cost = SearchTriples(picked, fullest, search.n);
  return search;
}

// Searches luminance and departure from grey; takes the one with more agreement in each lane.
HWY_INLINE Search SearchBoth(const KernelParams& params, const Samples& samples, float condition,
                             Projection& projection) {
  const D d;
  projection = OnLuminance();
  M colourful = NoLanes();
  const Projection on_chroma = OnChroma(samples, colourful);
  Search search = SearchProjected(params, samples, projection, condition);
  if (hn::AllFalse(d, colourful)) {
    return search;
  }
  const Search other = SearchProjected(params, samples, on_chroma, condition);
  const V in_band = hn::Sub(search.band.end, search.band.begin);
  const V of_other = hn::Sub(other.band.end, other.band.begin);
  const M as_many = hn::Ge(of_other, in_band);
  const M agrees = hn::Lt(other.cost, hn::Mul(search.cost, hn::Set(d, kChromaAdvantage)));
  const M better = hn::And(colourful, hn::And(as_many, agrees));
  projection = Select(better, on_chroma, projection);
  search.n = {hn::IfThenElse(better, other.n.x, search.n.x),
              hn::IfThenElse(better, other.n.y, search.n.y),
              hn::IfThenElse(better, other.n.z, search.n.z)};
  RankProjected(params, samples, projection, search);
  return search;
}

HWY_INLINE void ConsensusVector(const KernelParams& params, const Gathered& gathered,
                                const Scale& scale, const float* scratch, float* ranks,
                                size_t offset, const KernelOutput& output) {
  const D d;
  const Samples samples{params, scratch, ranks,
                        hn::Mul(gathered.brightest, hn::Set(d, params.shadow_level))};
  const float condition = params.max_condition_squared * kWeightedConditionFactor;
  Projection projection;
  const Search search = SearchBoth(params, samples, condition, projection);
  Vector3 n = search.n;
  Reweighted sums;
  Inverse inverse;
  Vector3 n_rgb[3];
  for (int step = 0; step < kReweightings; ++step) {  // (5)
    sums = Reweigh(samples, search.band, search.inverse_median, n, /*start=*/false);
    inverse = Invert(sums.a, condition);
    for (size_t c = 0; c < 3; ++c) {
      n_rgb[c] = Times(inverse.a, sums.b[c]);
    }
    n = projection.Of(n_rgb);
  }
  sums = Reweigh(samples, search.band, search.inverse_median, n, /*start=*/false);
  const V squared = Dot(n, n);
  const M finite = hn::And(hn::Gt(squared, hn::Set(d, 1e-12F)), hn::Lt(squared, hn::Set(d, 1e12F)));
  const M known = hn::Gt(search.band.median, hn::Zero(d));
  const M solved = hn::And(hn::And(known, hn::Ge(search.count, hn::Set(d, 3.0F))),
                           hn::And(finite, inverse.accepted));
  StoreConsensus(sums, n_rgb, n, inverse, search.band.median, solved,
                 hn::Set(d, params.result_scale), scale, offset, output);
}

}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
