#include "cli/solve_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace sateen::cli {
namespace {

// Share of pixels on the robust rung above which the rig is suspected.
constexpr double kFewExplained = 0.9;

// Returns "123 dark, 4 saturated"; empty where all pixels are solved.
std::string UnsolvedWords(const SolveSummary& summary) {
  std::string words;
  const auto add = [&](int64_t count, std::string_view reason) {
    if (count > 0) {
      words += fmt::format("{}{} {}", words.empty() ? "" : ", ", count, reason);
    }
  };
  add(summary.dark, "dark");
  add(summary.too_few_samples, "with fewer than 3 usable samples");
  add(summary.saturated, "saturated");
  add(summary.ill_conditioned, "ill-conditioned");
  return words;
}

std::string LobeWords(const Lobe& lobe) {
  switch (lobe.model) {
    case LobeModel::kCloth:
      return fmt::format("; the scene's fuzz has roughness {:.2f}, strength {:.2f}\n", lobe.alpha,
                         lobe.strength);
    case LobeModel::kGgx:
      return fmt::format("; the scene's gloss has roughness {:.2f}, strength {:.2f}\n", lobe.alpha,
                         lobe.strength);
    case LobeModel::kGgxAnisotropic:
      return fmt::format(
          "; the gloss of the scene's yarns has roughness {:.2f} across and {:.2f} along them, "
          "strength {:.2f}; the yarns lie at {:.0f} and {:.0f} degrees from x\n",
          lobe.alpha, lobe.alpha_along, lobe.strength, std::fmod(lobe.azimuth_deg + 90.0, 180.0),
          lobe.azimuth_deg);
  }
  return "\n";
}

// Describes each rung on a line of its own.
std::string LadderWords(const SolveSummary& summary, bool is_forced) {
  const auto rung = [](std::string_view name, const RungSummary& of) {
    return fmt::format("{}: {} pixels in {:.3f} s, mean uncertainty {:.2g} degrees", name,
                       of.pixels, of.seconds, of.mean_uncertainty_deg);
  };
  std::string text =
      summary.least_squares.pixels > 0
          ? rung("least squares", summary.least_squares)
          : std::string(is_forced ? "least squares: not used" : "least squares: no pixel");
  if (summary.unchecked > 0) {
    text += fmt::format("; {} with 3 samples, which nothing checks", summary.unchecked);
  }
  if (is_forced && summary.robust.pixels == 0) {
    return text + "; uncertainty from noise alone: the fit of the samples was not tested\n";
  }
  text += '\n' + (summary.robust.pixels > 0 ? rung("robust", summary.robust)
                                            : std::string("robust: no pixel"));
  if (summary.robust.pixels > 0) {
    text += fmt::format("; changed their normals by {:.3g} degrees on average", summary.turned_deg);
  }
  if (summary.unexplained > 0) {
    text += fmt::format("; {} unexplained (see model.png)", summary.unexplained);
  }
  text += '\n';
  if (!is_forced && static_cast<double>(summary.robust.pixels) >
                        kFewExplained * static_cast<double>(summary.solved)) {
    text +=
        "almost no pixel fits the lights: the cloth shines, or the rig's lights are not calibrated "
        "or "
        "not those of this session (sateen calibrate lights, calibrate check)\n";
  }
  if (summary.lobe) {
    text += rung("lobe", summary.under_lobe) + LobeWords(*summary.lobe);
  }
  return text;
}

// Returns "auto (AVX3)", or "qr" where no vector loop ran.
std::string BackendWords(const SolveSummary& summary) {
  return summary.instruction_set.empty()
             ? std::string(Name(summary.backend))
             : fmt::format("{} ({})", Name(summary.backend), summary.instruction_set);
}

// Names what was solved: "the mosaics", "interpolated colours" or "colours".
std::string_view SourceWords(const Dataset& dataset) {
  if (dataset.mosaics) {
    return "the mosaics";
  }
  return std::ranges::any_of(dataset.stack, &LightFrame::raw) ? "interpolated colours" : "colours";
}

std::string HeadWords(const SolveOutcome& outcome) {
  const SolveSummary& summary = outcome.field.summary;
  const Dataset& dataset = outcome.dataset;
  const ImageSize size = dataset.Size();
  std::string text = fmt::format(
      "solved {} of {} pixels ({}x{} px, {} lights) in {:.3f} s, {} thread{}, backend {}, from "
      "{}\n",
      summary.solved, summary.pixels, size.width, size.height, dataset.rig.lights.size(),
      summary.seconds, summary.threads, summary.threads == 1 ? "" : "s", BackendWords(summary),
      SourceWords(dataset));
  // Nobody expects mosaics of photographs.
  if (!dataset.why_no_mosaics.empty() &&
      dataset.why_no_mosaics.find("not camera RAW") == std::string::npos) {
    text += fmt::format("not from the mosaics: {}\n", dataset.why_no_mosaics);
  }
  return text;
}

std::string NoiseWords(const SolveOptions& options, const SolveOutcome& outcome) {
  if (!outcome.dataset.mosaics) {
    return "";
  }
  std::string text;
  if (const std::optional<SensorNoise>& noise = outcome.dataset.mosaics->noise) {
    text = fmt::format("noise from {}: {:.3g} DN per electron, read noise {:.2g} DN\n",
                       noise->source, noise->gain_dn, noise->read_dn);
  }
  const SolveSummary& summary = outcome.field.summary;
  if (options.robust && !summary.noise_known) {
    text += summary.noise_scale > 0.0
                ? fmt::format("noise from residuals and neighbours: {:.2g} DN per electron",
                              summary.noise_scale * summary.noise_scale)
                : "the noise is not known: uncertainty is 180 degrees";
    text += "; sateen calibrate response measures it\n";
  }
  return text;
}

std::string HeightWords(const SolveOptions& options, const SolveOutcome& outcome) {
  if (!outcome.relief) {
    return options.height_mm == 0.0
               ? ""
               : fmt::format("the surface is {:g} mm above the table\n", options.height_mm);
  }
  const ReliefOutcome& relief = *outcome.relief;
  return fmt::format(
      "relief from {:+.3g} to {:+.3g} mm around {:g} mm, found in {:.3f} s; the second solve "
      "changed the normals by {:.3g} degrees on average, by {:.3g} at most\n",
      relief.lowest_mm - options.height_mm, relief.highest_mm - options.height_mm,
      options.height_mm, relief.seconds, relief.turned_deg.mean, relief.turned_deg.max);
}

std::string ErrorWords(const SolveOutcome& outcome) {
  const Evaluation& evaluation = outcome.evaluation;
  std::string text;
  if (const std::optional<ErrorStatistics>& error = evaluation.angular_error_deg) {
    text += fmt::format(
        "angular error against {}: mean {:.4g}, median {:.4g}, p99 {:.4g}, max {:.4g} degrees\n",
        outcome.dataset.truth->source, error->mean, error->median, error->p99, error->max);
  }
  if (const std::optional<ErrorStatistics>& slow = evaluation.low_frequency_error_deg) {
    text += fmt::format("below 1 cycle per 50 mm: mean {:.4g}, max {:.4g} degrees\n", slow->mean,
                        slow->max);
  }
  if (const std::optional<ErrorStatistics>& albedo = evaluation.albedo_error) {
    text += fmt::format("albedo error: mean {:.3g} %, max {:.3g} %\n", 100.0 * albedo->mean,
                        100.0 * albedo->max);
  }
  return text;
}

}  // namespace

std::string TextReport(const SolveOptions& options, const SolveOutcome& outcome) {
  std::string text = HeadWords(outcome) + NoiseWords(options, outcome);
  if (const std::string words = UnsolvedWords(outcome.field.summary); !words.empty()) {
    text += fmt::format("unsolved: {} (see reason.png)\n", words);
  }
  if (options.robust) {
    text += LadderWords(outcome.field.summary, *options.robust != LadderMode::kAuto);
  }
  return text + HeightWords(options, outcome) + ErrorWords(outcome) +
         fmt::format("maps are in {}; look at {}", options.output.string(),
                     (options.output / "overview.png").string());
}

}  // namespace sateen::cli
