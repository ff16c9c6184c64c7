#include "cli/help.h"

#include <CLI/CLI.hpp>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

namespace sateen::cli {
namespace {

constexpr size_t kColumns = 100;
constexpr size_t kDescriptionColumn = 30;  // CLI11's own

// Breaks a line at spaces. Continued lines are indented as CLI11 indents descriptions, if the line
// itself is indented.
std::string Wrapped(std::string_view line) {
  const std::string indent(line.substr(0, 1) == " " ? kDescriptionColumn : 0, ' ');
  std::string text;
  for (size_t width = kColumns; line.size() > width; width = kColumns - indent.size()) {
    const size_t space = line.rfind(' ', width);
    const size_t last = space == std::string_view::npos ? space : line.find_last_not_of(' ', space);
    if (last == std::string_view::npos) {
      break;  // a word that is longer than a line
    }
    text.append(line.substr(0, last + 1)).append("\n").append(indent);
    line.remove_prefix(space + 1);
  }
  return text.append(line).append("\n");
}

class WrappedFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override {
    std::istringstream lines(CLI::Formatter::make_help(app, std::move(name), mode));
    std::string text;
    for (std::string line; std::getline(lines, line);) {
      text += Wrapped(line);
    }
    return text;
  }
};

}  // namespace

void WrapHelp(CLI::App& app) { app.formatter(std::make_shared<WrappedFormatter>()); }

}  // namespace sateen::cli
