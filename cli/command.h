#pragma once

#include <functional>
#include <iosfwd>
#include <memory>
#include <string>
#include <vector>

#include "core/task.h"

namespace CLI {
class App;
}

namespace sateen::cli {

// Adds a subcommand that only groups others, as `sateen calibrate`; one of them must be typed.
CLI::App& AddGroup(CLI::App& parent, const std::string& name, const std::string& help);

/// The commands of the program. A command is a struct of arguments and two functions:
///
///     AddX   adds the subcommand and binds its options to the arguments
///     RunX   does the work: results go to `out`, warnings and errors to `log`; returns the exit
///            status
class CommandTable {
 public:
  template <typename Args>
  void Add(CLI::App& parent, void (*add)(CLI::App&, Args&),
           int (*run)(const Args&, const Task&, std::ostream&, std::ostream&)) {
    const auto args = std::make_shared<Args>();
    add(parent, *args);
    Append(parent, [args, run](const Task& task, std::ostream& out, std::ostream& log) {
      return run(*args, task, out, log);
    });
  }

  // Runs the command that was typed. Returns its exit status.
  int RunTyped(const Task& task, std::ostream& out, std::ostream& log) const;

 private:
  using Run = std::function<int(const Task&, std::ostream&, std::ostream&)>;
  struct Command {
    const CLI::App* app;
    Run run;
  };

  // `run` is of the subcommand that `parent` got last.
  void Append(CLI::App& parent, Run run);

  std::vector<Command> commands_;
};

}  // namespace sateen::cli
