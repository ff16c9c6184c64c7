#include "tests/testing/places.h"

namespace sateen::testing {

std::string SourceDir() { return SATEEN_SOURCE_DIR; }
std::string ProgramDir() { return SATEEN_PROGRAM_DIR; }
std::string FirmwareDir() { return SATEEN_FIRMWARE_DIR; }

}  // namespace sateen::testing
