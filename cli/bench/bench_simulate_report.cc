#include "cli/bench/bench_simulate_report.h"

#include <nlohmann/json.hpp>

#include "core/json.h"

namespace sateen::cli {

std::string TextReport(const SimulateBenchReport& report) {
  std::string text = fmt::format(
      "A session of {} frames of {} x {} ({:.1f} megapixels), near lights, Lambertian, 14-bit "
      "sensor\nwith noise, DNG files; {} threads\n\n  {:<10} {:>8}  {:>20}\n",
      report.frames, report.size.width, report.size.height,
      1e-6 * static_cast<double>(report.size.PixelCount()), report.threads, "step", "seconds",
      "ns a pixel and frame");
  for (const SimulateStage& stage : report.stages) {
    text += fmt::format("  {:<10} {:>8.2f}  {:>20.1f}\n", stage.name, stage.seconds,
                        stage.ns_per_pixel);
  }
  text += fmt::format("  {:<10} {:>8.2f}\n\nPeak memory {:.2f} GB\n\n", "all", report.seconds,
                      report.peak_memory_gb);
  text += fmt::format(
      "What each switch of a scene costs, and what it does to a least-squares solve\n\n"
      "  {:<28} {:>20}  {:>8}  {:>10}  {:>9}\n",
      "switch", "ns a pixel and frame", "x plain", "mean [deg]", "p99 [deg]");
  for (const SimulateSwitch& one : report.switches) {
    text += fmt::format("  {:<28} {:>20.1f}  {:>8.2f}  {:>10.4f}  {:>9.4f}\n", one.name,
                        one.ns_per_pixel, one.times_plain, one.angular_error_deg.mean,
                        one.angular_error_deg.p99);
  }
  return text;
}

std::string JsonReport(const SimulateBenchReport& report) {
  nlohmann::ordered_json json = {
      {"schema", "sateen.bench.simulate/1"},
      {"size_px", {report.size.width, report.size.height}},
      {"frames", report.frames},
      {"threads", report.threads},
      {"seconds", report.seconds},
      {"peak_memory_gb", report.peak_memory_gb},
      {"steps", nlohmann::ordered_json::array()},
      {"switches", nlohmann::ordered_json::array()},
  };
  for (const SimulateStage& stage : report.stages) {
    json["steps"].push_back(
        {{"step", stage.name}, {"seconds", stage.seconds}, {"ns_per_pixel", stage.ns_per_pixel}});
  }
  for (const SimulateSwitch& one : report.switches) {
    json["switches"].push_back({{"switch", one.name},
                                {"ns_per_pixel", one.ns_per_pixel},
                                {"times_plain", one.times_plain},
                                {"mean_angular_error_deg", one.angular_error_deg.mean},
                                {"p99_angular_error_deg", one.angular_error_deg.p99}});
  }
  return JsonText(json, 2) + "\n";
}

}  // namespace sateen::cli
