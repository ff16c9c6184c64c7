// Any bytes go for a table of lights, an .lp file and a file of circles. What is read from them is
// valid.
#include "fuzz/target.h"
#include "scanner/sessions/files/circle_file.h"
#include "scanner/sessions/files/light_table.h"
#include "scanner/sessions/lp_layout.h"

namespace sateen::fuzz {

void Try(std::string_view bytes) {
  const std::filesystem::path path = FileOf("lights.lp", bytes);
  std::map<std::string, std::string> hashes;
  if (const auto lights = ReadLightTable(path, hashes)) {
    Need(Rig{.lights = *lights}.Validate("lights").has_value());
  }
  if (const auto circles = ReadCircles(path, {640, 480}, hashes)) {
    for (const Circle& circle : *circles) {
      Need(circle.radius_px > 0.0);
    }
  }
  if (const auto plan = PlanLp(path)) {
    Need(plan->lit.size() == plan->rig.lights.size());
    Need(plan->rig.Validate("lights").has_value());
  }
}

}  // namespace sateen::fuzz
