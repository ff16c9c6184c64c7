#include "core/version.h"

namespace sateen {

std::string Version() { return SATEEN_VERSION; }

}  // namespace sateen
