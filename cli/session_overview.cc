#include "cli/session_overview.h"

#include <CLI/CLI.hpp>
#include <ostream>

namespace sateen::cli {

void AddSessionOverview(CLI::App& session, SessionOverviewArgs& args) {
  CLI::App* cmd = session.add_subcommand(
      "overview", "Show all frames of a session, and the maps of its solve, in one picture");
  cmd->add_option("session", args.options.session, "Folder of the session")->required();
  cmd->add_option("--maps", args.options.maps, "Folder of maps that sateen solve has written");
  cmd->add_option("-o,--output", args.options.output, "PNG file")->required();
}

int RunSessionOverview(const SessionOverviewArgs& args, const Task& task, std::ostream& out,
                       std::ostream& log) {
  const Status written = WriteSessionOverview(args.options, task);
  task.ClearProgress();
  if (!written) {
    log << "sateen session overview: error: " << written.error().message << '\n';
    return ExitStatus(written.error());
  }
  out << args.options.output.string() << '\n';
  return 0;
}

}  // namespace sateen::cli
