#include <nlohmann/json.hpp>

#include "cli/bench/bench_calibrate.h"
#include "core/json.h"

namespace sateen::cli {

std::string TextReport(const CalibrateBenchReport& report) {
  std::string text = fmt::format(
      "{} lights, RAW frames of {} x {} ({:.1f} megapixels), 14-bit sensor with noise, lights 15 "
      "mm "
      "off at the start; {} threads\n\n  {:<18} {:>11} {:>13} {:>8} {:>10} {:>8} {:>8}\n",
      report.lights, report.size.width, report.size.height,
      1e-6 * static_cast<double>(report.size.PixelCount()), report.threads, "sheets", "position mm",
      "direction deg", "flux %", "flat deg", "seconds", "peak GB");
  for (const CalibrateRow& row : report.rows) {
    text += fmt::format("  {:<18} {:>11.4f} {:>13.5f} {:>8.4f} {:>10.4f} {:>8.2f} {:>8.2f}\n",
                        row.sheets, row.position_mm, row.direction_deg, 100.0 * row.flux,
                        row.flat_deg, row.seconds, row.peak_memory_gb);
  }
  text += fmt::format(
      "\nDecoding the {} RAW files of all sheets and nothing else takes {:.2f} s.\n\n"
      "Denim twill solved with lights from\n\n  {:<18} {:>26} {:>16}\n",
      report.raw_frames, report.raw_seconds, "", "worst below 1/50 mm [deg]", "mean, all [deg]");
  for (const FabricRow& row : report.fabric) {
    text += fmt::format("  {:<18} {:>26.4f} {:>16.4f}\n", row.lights, row.low_frequency_deg,
                        row.mean_deg);
  }
  text += fmt::format(
      "\nActual errors over predicted standard deviations, root mean square\n\n"
      "  {:<18} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>10}\n",
      "sheets", "rigs", "x", "y", "z", "red", "green", "blue", "direction");
  for (const auto& [tilts, ratios] : report.ratios) {
    text += fmt::format(
        "  {:<18} {:>6} {:>6.2f} {:>6.2f} {:>6.2f} {:>6.2f} {:>6.2f} {:>6.2f} {:>10.2f}\n",
        tilts == 0 ? "one flat" : fmt::format("flat and {} tilts", tilts), ratios.rigs,
        ratios.position[0], ratios.position[1], ratios.position[2], ratios.flux[0], ratios.flux[1],
        ratios.flux[2], ratios.direction);
  }
  return text;
}

std::string JsonReport(const CalibrateBenchReport& report) {
  nlohmann::ordered_json json = {{"schema", "sateen.bench.calibrate/1"},
                                 {"size_px", {report.size.width, report.size.height}},
                                 {"lights", report.lights},
                                 {"threads", report.threads},
                                 {"rows", nlohmann::ordered_json::array()},
                                 {"raw_frames", report.raw_frames},
                                 {"raw_seconds", report.raw_seconds},
                                 {"fabric", nlohmann::ordered_json::array()},
                                 {"predicted", nlohmann::ordered_json::array()}};
  for (const CalibrateRow& row : report.rows) {
    json["rows"].push_back({{"sheets", row.sheets},
                            {"position_mm", row.position_mm},
                            {"direction_deg", row.direction_deg},
                            {"flux", row.flux},
                            {"flat_deg", row.flat_deg},
                            {"seconds", row.seconds},
                            {"peak_memory_gb", row.peak_memory_gb}});
  }
  for (const FabricRow& row : report.fabric) {
    json["fabric"].push_back({{"lights", row.lights},
                              {"low_frequency_deg", row.low_frequency_deg},
                              {"mean_deg", row.mean_deg}});
  }
  for (const auto& [tilts, ratios] : report.ratios) {
    json["predicted"].push_back(
        {{"tilts", tilts},
         {"rigs", ratios.rigs},
         {"position", {ratios.position[0], ratios.position[1], ratios.position[2]}},
         {"flux", {ratios.flux[0], ratios.flux[1], ratios.flux[2]}},
         {"direction", ratios.direction}});
  }
  return JsonText(json) + "\n";
}

}  // namespace sateen::cli
