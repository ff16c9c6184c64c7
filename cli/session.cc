#include "cli/session.h"

#include <nlohmann/json.hpp>
#include <ostream>

#include "scanner/capture/capture_session.h"

namespace sateen::cli {

void AddSession(CLI::App& root, SessionArgs& args) {
  CLI::App* session = root.add_subcommand("session", "Look after sessions on disk");
  session->require_subcommand(1);
  CLI::App* verify = session->add_subcommand(
      "verify",
      "Prove a session whole: its record, its journal and its rig agree, every light has its frame "
      "and every file its hash; exit status 3 where not, with all that is wrong");
  verify->add_option("session", args.verify.session, "Folder of the session")->required();
  verify->add_flag("--json", args.verify.json, "Print JSON");
  AddSessionOverview(*session, args.overview);
}

int RunSession(const CLI::App& root, const SessionArgs& args, const Task& task, std::ostream& out,
               std::ostream& log) {
  return root.get_subcommand("session")->got_subcommand("verify")
             ? RunSessionVerify(args.verify, task, out, log)
             : RunSessionOverview(args.overview, task, out, log);
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
