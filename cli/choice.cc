#include "cli/choice.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <utility>

namespace sateen::cli {

void AddNamedChoice(CLI::App& cmd, const std::string& flag, const std::string& help,
                    std::vector<std::string> names, std::optional<size_t> initial,
                    std::function<void(size_t)> take) {
  const auto parse = [names, take = std::move(take)](const std::string& text) {
    take(static_cast<size_t>(std::ranges::find(names, text) - names.begin()));
  };
  CLI::Option* option = cmd.add_option_function<std::string>(flag, parse, help);
  if (initial) {
    option->default_str(names[*initial]);
  }
  option->check(CLI::IsMember(std::move(names)));  // runs before `parse`
}

}  // namespace sateen::cli
