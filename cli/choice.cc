#include "cli/choice.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <utility>

namespace sateen::cli {

void AddNamedChoice(CLI::App& cmd, const std::string& flag, const std::string& help,
                    std::vector<std::string> names, size_t initial,
                    std::function<void(size_t)> take) {
  const auto parse = [names, take = std::move(take)](const std::string& text) {
    take(static_cast<size_t>(std::ranges::find(names, text) - names.begin()));
  };
  const std::string shown = names[initial];
  cmd.add_option_function<std::string>(flag, parse, help)
      ->check(CLI::IsMember(std::move(names)))  // before `parse`
      ->default_str(shown);
}

}  // namespace sateen::cli
