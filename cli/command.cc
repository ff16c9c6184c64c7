#include "cli/command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <utility>

#include "core/check.h"

namespace sateen::cli {

CLI::App& AddGroup(CLI::App& parent, const std::string& name, const std::string& help) {
  CLI::App* group = parent.add_subcommand(name, help);
  group->require_subcommand(1);
  return *group;
}

int CommandTable::RunTyped(const Task& task, std::ostream& out, std::ostream& log) const {
  const auto typed =
      std::ranges::find_if(commands_, [](const Command& command) { return command.app->parsed(); });
  SATEEN_CHECK(typed != commands_.end());
  return typed->run(task, out, log);
}

void CommandTable::Append(CLI::App& parent, Run run) {
  commands_.push_back({parent.get_subcommands({}).back(), std::move(run)});
}

}  // namespace sateen::cli
