#include "targets/spec_text.h"

namespace sateen {
namespace {

template <typename T>
bool ReadPair(std::string_view text, T& first, T& second) {
  const size_t cross = text.find('x');
  return cross != std::string_view::npos && ReadWhole(text.substr(0, cross), first) &&
         ReadWhole(text.substr(cross + 1), second);
}

}  // namespace

std::vector<std::string_view> FieldsOf(std::string_view text) {
  std::vector<std::string_view> fields;
  while (true) {
    const size_t end = text.find(':');
    fields.push_back(text.substr(0, end));
    if (end == std::string_view::npos) {
      return fields;
    }
    text.remove_prefix(end + 1);
  }
}

bool ReadGrid(std::string_view text, int& columns, int& rows) {
  return ReadPair(text, columns, rows);
}

bool ReadLength(std::string_view text, double& length_mm) {
  return text.ends_with("mm") && ReadWhole(text.substr(0, text.size() - 2), length_mm);
}

bool ReadSize(std::string_view text, Eigen::Vector2d& size_mm) {
  return text.ends_with("mm") &&
         ReadPair(text.substr(0, text.size() - 2), size_mm.x(), size_mm.y());
}

}  // namespace sateen
