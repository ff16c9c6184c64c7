#pragma once

namespace sateen {

// Constants of equations (6) to (12) of solver/ladder.h, shared by the plain form and the kernel.
// Found on the DiLiGenT ball, the rendered bunny and random choices of their lights; docs/decisions.md
// has the figures.

// A pixel whose colour departs from grey by this fraction of its brightness may be solved on
// that departure, which highlights of white light have no part in ...
inline constexpr float kLeastChroma = 0.2F;
// ... if the product of (9) is below this fraction of the luminance's: the departure is noisier.
inline constexpr float kChromaAdvantage = 0.1F;
// A sample below this fraction of the pixel's median usable one is left out: in the penumbra, at the
// terminator and between fibres the model is at its worst.
inline constexpr float kDarkOfMedian = 0.4F;
// Of the samples beyond these, so many of the darkest and brightest are left out.
inline constexpr int kUntrimmedSamples = 10;
inline constexpr float kTrimDark = 0.34F;
inline constexpr float kTrimBright = 0.5F;
// Samples that triples are made of: all of them up to this number, then evenly spaced ranks.
inline constexpr int kTripleSamples = 10;
// Triples whose |l_a x l_b . l_c| is not above this are left out.
inline constexpr float kLeastTripleVolume = 0.05F;
// c of (9), in medians.
inline constexpr float kConsensusScale = 0.03F;
// Steps and tuning constant of (10), in medians.
inline constexpr int kReweightings = 2;
inline constexpr float kReweightScale = 0.1F;
// A sample agrees where its residual is at most this, in medians.
inline constexpr float kAgreeing = 0.1F;
// Fewer samples in agreement than this say nothing: any three do.
inline constexpr int kFewestAgreeing = 4;
// (11): the spread of the samples tells of the model's error only in part.
inline constexpr float kUncertaintyFactor = 4.0F;
inline constexpr float kLeastModelUncertainty = 0.0523598776F;  // 3 degrees
// (12): of what two estimates differ by, so much is doubt about the better one.
inline constexpr float kUncertaintyOfTurn = 0.4F;

// Of the albedo: gloss so rough that it is in all samples alike goes into it, of a dielectric (4 % of the
// light, some lobe) some 0.05.
inline constexpr double kGlossInAlbedo = 0.05;

}  // namespace sateen
