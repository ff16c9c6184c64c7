// Any bytes go for a rig.json. The text of a rig that was read gives the same rig again.
#include "fuzz/target.h"
#include "rig/rig.h"

namespace sateen::fuzz {

void Try(std::string_view bytes) {
  const Result<Rig> rig = ReadRig(FileOf("rig.json", bytes));
  if (rig) {
    const std::string text = RigToJson(*rig);
    const Result<Rig> again = ReadRig(FileOf("again.json", text));
    Need(again && RigToJson(*again) == text);
  }
}

}  // namespace sateen::fuzz
