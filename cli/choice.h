#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command.h"

namespace sateen::cli {

// Adds an option whose text is one of `names`. `take` gets the index of the name that was typed.
// Help shows names[initial] as the default, if there is one.
void AddNamedChoice(CLI::App& cmd, const std::string& flag, const std::string& help,
                    std::vector<std::string> names, std::optional<size_t> initial,
                    std::function<void(size_t)> take);

// Adds an option for a value of an enumeration, which is typed as Name(value). The default is what
// `value` holds, one of `choices`.
template <typename Value>
void AddChoice(CLI::App& cmd, const std::string& flag, const std::string& help,
               const std::vector<Value>& choices, Value& value) {
  std::vector<std::string> names;
  std::optional<size_t> initial;
  for (size_t k = 0; k < choices.size(); ++k) {
    names.emplace_back(Name(choices[k]));
    initial = choices[k] == value ? k : initial;
  }
  AddNamedChoice(cmd, flag, help, std::move(names), initial,
                 [choices, &value](size_t k) { value = choices[k]; });
}

}  // namespace sateen::cli
