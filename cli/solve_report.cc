#include "cli/solve_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/version.h"

namespace sateen::cli {
namespace {

// Share of pixels on the robust rung from which on something may be wrong with the rig.
constexpr double kFewExplained = 0.9;

nlohmann::json ToJson(const ErrorStatistics& error) {
  return {{"mean", error.mean},
          {"median", error.median},
          {"p99", error.p99},
          {"max", error.max},
          {"count", error.count}};
}

nlohmann::json OptionsToJson(const SolveArgs& args) {
  return {{"backend", args.backend},
          {"robust", args.robust},
          {"domain", args.domain},
          {"lights", args.read.lights},
          {"shadow_level", args.solver.shadow_level},
          {"clip_level", args.solver.clip_level},
          {"dark_level", args.solver.dark_level},
          {"max_condition", args.solver.max_condition},
          {"normal_y", args.normal_y},
          {"height_mm", args.height_mm},
          {"relief", args.relief},
          {"undistort", args.undistort},
          {"encoding", args.encoding}};
}

// "123 dark, 4 saturated", or nothing.
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

nlohmann::json ToJson(const RungSummary& rung) {
  return {{"pixels", rung.pixels},
          {"seconds", rung.seconds},
          {"mean_uncertainty_deg", rung.mean_uncertainty_deg}};
}

std::string WordsOf(const Lobe& lobe) {
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

nlohmann::json LadderToJson(const SolveSummary& summary) {
  nlohmann::json robust = ToJson(summary.robust);
  robust["turned_deg"] = summary.turned_deg;
  robust["unexplained"] = summary.unexplained;
  nlohmann::json least_squares = ToJson(summary.least_squares);
  least_squares["unchecked"] = summary.unchecked;
  nlohmann::json lobe = ToJson(summary.under_lobe);
  if (summary.lobe) {
    lobe["model"] = Name(summary.lobe->model);
    lobe["alpha"] = summary.lobe->alpha;
    lobe["strength"] = summary.lobe->strength;
    if (summary.lobe->model == LobeModel::kGgxAnisotropic) {
      lobe["alpha_along"] = summary.lobe->alpha_along;
      lobe["azimuth_deg"] = summary.lobe->azimuth_deg;
    }
  }
  return {{"noise", summary.noise_known ? "known" : "estimated"},
          {"noise_scale", summary.noise_scale},
          {"least_squares", std::move(least_squares)},
          {"robust", std::move(robust)},
          {"lobe", std::move(lobe)}};
}

// What each rung did, a line each.
std::string LadderWords(const SolveSummary& summary, bool is_forced) {
  const auto rung = [](std::string_view name, const RungSummary& of) {
    return fmt::format("{}: {} pixels in {:.3f} s, mean uncertainty {:.2g} degrees", name,
                       of.pixels, of.seconds, of.mean_uncertainty_deg);
  };
  std::string text =
      summary.least_squares.pixels > 0
          ? rung("least squares", summary.least_squares)
          : std::string(is_forced ? "least squares: not asked" : "least squares: no pixel");
  if (summary.unchecked > 0) {
    text += fmt::format("; {} with 3 samples, which nothing checks", summary.unchecked);
  }
  if (is_forced && summary.robust.pixels == 0) {
    return text + "; of noise alone: whether the samples fit was not asked\n";
  }
  text += '\n' + (summary.robust.pixels > 0 ? rung("robust", summary.robust)
                                            : std::string("robust: no pixel"));
  if (summary.robust.pixels > 0) {
    text +=
        fmt::format("; it turned their normals by {:.3g} degrees in the mean", summary.turned_deg);
  }
  if (summary.unexplained > 0) {
    text += fmt::format("; {} unexplained (see model.png)", summary.unexplained);
  }
  text += '\n';
  if (!is_forced && static_cast<double>(summary.robust.pixels) >
                        kFewExplained * static_cast<double>(summary.solved)) {
    text +=
        "nearly no pixel is as the lights say: the cloth shines, or the rig's lights are not "
        "calibrated or not these (sateen calibrate lights, calibrate check)\n";
  }
  if (summary.lobe) {
    text += rung("lobe", summary.under_lobe) + WordsOf(*summary.lobe);
  }
  return text;
}

// "auto (AVX3)", or "qr", which is not vectorised by us.
std::string BackendWords(const SolveSummary& summary) {
  return summary.instruction_set.empty()
             ? std::string(Name(summary.backend))
             : fmt::format("{} ({})", Name(summary.backend), summary.instruction_set);
}

// By which mosaics were weighted; null: nothing was.
const SensorNoise* NoiseOfMosaics(const Dataset& capture) {
  return capture.mosaics && capture.mosaics->noise ? &*capture.mosaics->noise : nullptr;
}

}  // namespace

std::string JsonReport(const SolveArgs& args, const SolveOutcome& outcome) {
  const SolveSummary& summary = outcome.field.summary;
  const ImageSize size = outcome.capture.Size();
  nlohmann::json report = {{"schema", "sateen.solve/1"},
                           {"version", Version()},
                           {"capture", args.capture.string()},
                           {"layout", outcome.capture.layout},
                           {"output", args.output.string()},
                           {"domain", outcome.capture.mosaics ? "raw" : "rgb"},
                           {"size_px", {size.width, size.height}},
                           {"lights", outcome.capture.rig.lights.size()},
                           {"pixels", summary.pixels},
                           {"solved", summary.solved},
                           {"unsolved",
                            {{"dark", summary.dark},
                             {"too_few_samples", summary.too_few_samples},
                             {"saturated", summary.saturated},
                             {"ill_conditioned", summary.ill_conditioned}}},
                           {"resolved_by_reference", summary.resolved_by_reference},
                           {"seconds", summary.seconds},
                           {"seconds_reading", outcome.seconds_reading},
                           {"seconds_total", outcome.seconds_total},
                           {"threads", summary.threads},
                           {"backend", Name(summary.backend)},
                           {"instruction_set", summary.instruction_set},
                           {"options", OptionsToJson(args)},
                           {"warnings", outcome.capture.warnings},
                           {"inputs", outcome.capture.sha256_of_input}};
  if (!outcome.capture.why_no_mosaics.empty()) {
    report["why_rgb"] = outcome.capture.why_no_mosaics;
  }
  if (args.robust != "none") {
    report["ladder"] = LadderToJson(summary);
  }
  if (const auto* noise = NoiseOfMosaics(outcome.capture)) {
    report["sensor_noise"] = {{"source", noise->source},
                              {"gain_dn_per_electron", noise->gain_dn},
                              {"read_noise_dn", noise->read_dn}};
  }
  if (outcome.angular_error_deg) {
    report["truth"] = outcome.capture.truth->source;
    report["angular_error_deg"] = ToJson(*outcome.angular_error_deg);
  }
  if (outcome.low_frequency_error_deg) {
    report["low_frequency_error_deg"] = ToJson(*outcome.low_frequency_error_deg);
  }
  if (outcome.albedo_error) {
    report["albedo_error"] = ToJson(*outcome.albedo_error);
  }
  if (outcome.relief) {
    report["relief"] = {{"height_mm", {outcome.relief->lowest_mm, outcome.relief->highest_mm}},
                        {"turned_deg", ToJson(outcome.relief->turned_deg)},
                        {"seconds", outcome.relief->seconds}};
  }
  if (args.undistort) {
    const Camera& camera = *outcome.capture.rig.camera;
    report["map_camera"] = {{"k", {camera.fx, camera.fy, camera.cx, camera.cy}},
                            {"distortion", {0, 0, 0, 0, 0}}};
  }
  if (args.fail_above_deg) {
    report["fail_above_deg"] = *args.fail_above_deg;
    report["passed"] = Passed(args, outcome);
  }
  // A path that is not UTF-8 must not end the run.
  return report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TextReport(const SolveArgs& args, const SolveOutcome& outcome) {
  const SolveSummary& summary = outcome.field.summary;
  const ImageSize size = outcome.capture.Size();
  std::string text = fmt::format(
      "solved {} of {} pixels ({}x{} px, {} lights) in {:.3f} s, {} thread{}, backend {}, "
      "from {}\n",
      summary.solved, summary.pixels, size.width, size.height, outcome.capture.rig.lights.size(),
      summary.seconds, summary.threads, summary.threads == 1 ? "" : "s", BackendWords(summary),
      outcome.capture.mosaics                                        ? "the mosaics"
      : std::ranges::any_of(outcome.capture.stack, &LightFrame::raw) ? "interpolated colours"
                                                                     : "colours");
  // Of photographs nobody expects it.
  if (!outcome.capture.why_no_mosaics.empty() &&
      outcome.capture.why_no_mosaics.find("not camera RAW") == std::string::npos) {
    text += fmt::format("not from the mosaics: {}\n", outcome.capture.why_no_mosaics);
  }
  if (const auto* noise = NoiseOfMosaics(outcome.capture)) {
    text += fmt::format("noise by {}: {:.3g} DN an electron, {:.2g} DN of reading\n", noise->source,
                        noise->gain_dn, noise->read_dn);
  }
  if (outcome.capture.mosaics && args.robust != "none" && !summary.noise_known) {
    text += summary.noise_scale > 0.0
                ? fmt::format("noise by residuals and neighbours: {:.2g} DN an electron",
                              summary.noise_scale * summary.noise_scale)
                : "nothing tells of the noise: uncertainty is 180 degrees";
    text += "; sateen calibrate response measures it\n";
  }
  if (const std::string words = UnsolvedWords(summary); !words.empty()) {
    text += fmt::format("unsolved: {} (see reason.png)\n", words);
  }
  if (args.robust != "none") {
    text += LadderWords(summary, args.robust != "auto");
  }
  if (!outcome.relief && args.height_mm != 0.0) {
    text += fmt::format("the surface is taken {:g} mm above the table\n", args.height_mm);
  }
  if (outcome.relief) {
    const ReliefOutcome& relief = *outcome.relief;
    text += fmt::format(
        "relief from {:+.3g} to {:+.3g} mm around {:g} mm, found in {:.3f} s; solving again with "
        "it "
        "turned the normals by {:.3g} degrees in the mean, {:.3g} at most\n",
        relief.lowest_mm - args.height_mm, relief.highest_mm - args.height_mm, args.height_mm,
        relief.seconds, relief.turned_deg.mean, relief.turned_deg.max);
  }
  if (outcome.angular_error_deg) {
    const ErrorStatistics& error = *outcome.angular_error_deg;
    text += fmt::format(
        "angular error against {}: mean {:.4g}, median {:.4g}, p99 {:.4g}, max {:.4g} degrees\n",
        outcome.capture.truth->source, error.mean, error.median, error.p99, error.max);
  }
  if (outcome.low_frequency_error_deg) {
    text +=
        fmt::format("below 1 cycle per 50 mm: mean {:.4g}, max {:.4g} degrees\n",
                    outcome.low_frequency_error_deg->mean, outcome.low_frequency_error_deg->max);
  }
  if (outcome.albedo_error) {
    text += fmt::format("albedo error: mean {:.3g} %, max {:.3g} %\n",
                        100.0 * outcome.albedo_error->mean, 100.0 * outcome.albedo_error->max);
  }
  text += fmt::format("maps are in {}; look at {}", args.output.string(),
                      (args.output / "overview.png").string());
  return text;
}

}  // namespace sateen::cli
