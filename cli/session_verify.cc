#include "cli/session_verify.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <ostream>

#include "scanner/capture/session_proof.h"

namespace sateen::cli {

void AddSessionVerify(CLI::App& session, SessionVerifyArgs& args) {
  CLI::App* cmd = session.add_subcommand(
      "verify",
      "Verify a session: record, journal and rig agree, every light has its frame, every file has "
      "its hash and lies in the session. Exit status 3 with a list of faults if not");
  cmd->add_option("session", args.session, "Folder of the session")->required();
  cmd->add_flag("--json", args.json, "Print JSON");
}

int RunSessionVerify(const SessionVerifyArgs& args, const Task& task, std::ostream& out,
                     std::ostream& log) {
  const Result<SessionProof> proof = ProveSession(args.session, task);
  task.ClearProgress();
  const std::vector<std::string> faults =
      proof ? proof->faults : std::vector<std::string>{proof.error().message};
  const int files = proof ? proof->files : 0;
  if (args.json) {
    out << nlohmann::ordered_json{{"schema", "sateen.session.verify/1"},
                                  {"session", args.session.string()},
                                  {"whole", faults.empty()},
                                  {"files", files},
                                  {"faults", faults}}
               .dump(2, ' ', false, nlohmann::json::error_handler_t::replace)
        << '\n';
  } else if (faults.empty()) {
    out << fmt::format("{} is whole: {} files are as they were captured\n", args.session.string(),
                       files);
  }
  for (const std::string& fault : faults) {
    log << "sateen session verify: error: " << fault << '\n';
  }
  if (!proof) {
    return ExitStatus(proof.error());
  }
  return faults.empty() ? 0 : ExitStatus({ErrorCode::kBadData, ""});
}

}  // namespace sateen::cli
