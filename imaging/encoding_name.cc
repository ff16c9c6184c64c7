#include "imaging/encoding_name.h"

namespace sateen {

std::string_view Name(Encoding encoding) {
  switch (encoding) {
    case Encoding::kAuto:
      return "auto";
    case Encoding::kLinear:
      return "linear";
    case Encoding::kSrgb:
      return "srgb";
  }
  return "auto";
}

std::optional<Encoding> EncodingNamed(std::string_view name) {
  for (const Encoding encoding : {Encoding::kAuto, Encoding::kLinear, Encoding::kSrgb}) {
    if (name == Name(encoding)) {
      return encoding;
    }
  }
  return std::nullopt;
}

}  // namespace sateen
