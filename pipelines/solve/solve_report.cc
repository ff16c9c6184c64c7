#include "pipelines/solve/solve_report.h"

#include <nlohmann/json.hpp>

#include "core/json.h"
#include "core/version.h"
#include "imaging/encoding_name.h"

namespace sateen {
namespace {

nlohmann::json ToJson(const ErrorStatistics& error) {
  return {{"mean", error.mean},
          {"median", error.median},
          {"p99", error.p99},
          {"max", error.max},
          {"count", error.count}};
}

nlohmann::json OptionsToJson(const SolveOptions& options) {
  return {{"backend", Name(options.least_squares.backend)},
          {"robust", Name(options.robust)},
          {"domain", Name(options.domain)},
          {"lights", options.lights},
          {"shadow_level", options.least_squares.shadow_level},
          {"clip_level", options.least_squares.clip_level},
          {"dark_level", options.least_squares.dark_level},
          {"max_condition", options.least_squares.max_condition},
          {"normal_y", Name(options.normal_y)},
          {"height_mm", options.height_mm},
          {"relief", options.relief},
          {"undistort", options.undistort},
          {"encoding", Name(options.encoding)}};
}

nlohmann::json ToJson(const RungSummary& rung) {
  return {{"pixels", rung.pixels},
          {"seconds", rung.seconds},
          {"mean_uncertainty_deg", rung.mean_uncertainty_deg}};
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

// Adds errors against truth, where there are any, and the verdict of fail_above_deg.
void AddEvaluation(const SolveOptions& options, const SolveOutcome& outcome,
                   nlohmann::json& report) {
  const Evaluation& evaluation = outcome.evaluation;
  if (evaluation.angular_error_deg) {
    report["truth"] = outcome.dataset.truth->source;
    report["angular_error_deg"] = ToJson(*evaluation.angular_error_deg);
  }
  if (evaluation.low_frequency_error_deg) {
    report["low_frequency_error_deg"] = ToJson(*evaluation.low_frequency_error_deg);
  }
  if (evaluation.albedo_error) {
    report["albedo_error"] = ToJson(*evaluation.albedo_error);
  }
  if (options.fail_above_deg) {
    report["fail_above_deg"] = *options.fail_above_deg;
    report["passed"] = Passed(options, evaluation);
  }
}

// Adds the keys that only some solves have.
void AddOptional(const SolveOptions& options, const SolveOutcome& outcome, nlohmann::json& report) {
  const Dataset& dataset = outcome.dataset;
  if (!dataset.why_no_mosaics.empty()) {
    report["why_rgb"] = dataset.why_no_mosaics;
  }
  if (options.robust) {
    report["ladder"] = LadderToJson(outcome.field.summary);
  }
  if (dataset.mosaics && dataset.mosaics->noise) {
    const SensorNoise& noise = *dataset.mosaics->noise;
    report["sensor_noise"] = {{"source", noise.source},
                              {"gain_dn_per_electron", noise.gain_dn},
                              {"read_noise_dn", noise.read_dn}};
  }
  if (const std::optional<ReliefOutcome>& relief = outcome.relief) {
    report["relief"] = {{"height_mm", {relief->lowest_mm, relief->highest_mm}},
                        {"turned_deg", ToJson(relief->turned_deg)},
                        {"seconds", relief->seconds}};
  }
  if (outcome.maps.pixel_mm) {
    report["pixel_mm"] = *outcome.maps.pixel_mm;
  }
  if (options.undistort) {
    const Camera& camera = *outcome.maps.camera;
    report["map_camera"] = {{"k", {camera.fx, camera.fy, camera.cx, camera.cy}},
                            {"distortion", {0, 0, 0, 0, 0}}};
  }
}

}  // namespace

std::string SolveReportJson(const SolveOptions& options, const SolveOutcome& outcome) {
  const SolveSummary& summary = outcome.field.summary;
  const ImageSize size = outcome.dataset.Size();
  nlohmann::json report = {{"schema", "sateen.solve/1"},
                           {"version", Version()},
                           {"capture", options.capture.string()},
                           {"layout", outcome.dataset.layout},
                           {"output", options.output.string()},
                           {"domain", outcome.dataset.mosaics ? "raw" : "rgb"},
                           {"size_px", {size.width, size.height}},
                           {"lights", outcome.dataset.rig.lights.size()},
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
                           {"options", OptionsToJson(options)},
                           {"warnings", outcome.dataset.warnings},
                           {"inputs", outcome.dataset.sha256_of_input}};
  AddOptional(options, outcome, report);
  AddEvaluation(options, outcome, report);
  // A path that is not UTF-8 must not end the run.
  return JsonText(report);
}

}  // namespace sateen
