#include "apps/kiroku/log_prove_command.h"

#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/witnessed_note.h"
#include "apps/verify/outside_note.h"
#include "archive/reading/log_proving.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  std::string named, output;
  std::vector<std::string> against;
  std::optional<std::string> home;
  bool force = false, json = false;
};

int run(const Request& request) {
  if (!request.force && fs::exists(request.output)) {
    throw UsageError(request.output + " is there already: name another file, or give --force to replace it");
  }
  const Home home = Home::open(request.home);
  const fs::path folder = find_case(home, request.named);
  std::vector<archive::OutsideNote> kept = load_kept_outside(request.against).newest({home.device()});
  if (auto witnessed = home_witnessed_note(home)) kept.push_back(std::move(*witnessed));
  const archive::MadeLogProof made =
      archive::prove_case_in_log(folder, home.log_folder(), home.device(), kept,
                                 [&](const std::string& case_id) { return find_case(home, case_id); });
  OutputFile file{fs::path(request.output)};
  file.write(bytes_of(made.proof.to_text()));
  file.commit(OutputFile::Durability::kEventually);
  if (!made.signed_then) {
    print_error("kiroku",
                "warning: " + home.device().name() + " did not sign entry " + std::to_string(made.entry) +
                    " of the appliance log before another followed: somebody who could write to the "
                    "log's disk may have added it. 'kiroku verify' compares the case with the log");
  }
  if (request.json) {
    print_json({{"case", made.case_id},
                {"file", request.output},
                {"entry", made.entry},
                {"checkpoint", made.checkpoint},
                {"entries", made.log.size}});
  } else {
    std::cout << printable(request.output) << ": entry " << made.entry
              << " of the appliance log, which says how case " << printable(made.case_id)
              << " ended, in the checkpoint over " << made.log.size << " entries of "
              << printable(made.checkpoint) << "\n";
  }
  return kDone;
}

}  // namespace

void add_log_prove_command(Command& log) {
  Command& command =
      log.add_command("prove", "writes a proof that the log knows a case's end, for whoever has no log");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->named,
                   "case folder, excerpt folder, or identifier of a case in the home's archive");
  command.required_option("-o,--output", "FILE", request->output, "where to: NAME.tlog-proof");
  command.option("--against", "NOTE", request->against,
                 "a checkpoint of the log that witnesses cosigned; before the one that the home keeps");
  add_home_option(command, request->home);
  command.flag("--force", request->force, "replaces a file that is there");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The proof travels with a receipt, an excerpt or the case. It shows the log's entry of the case's end "
      "in "
      "one of the log's checkpoints, and nothing else of the log. A checkpoint that witnesses cosigned is "
      "taken "
      "where it holds the entry, else the log's newest one. The form is C2SP's tlog-proof.");
  command.example("kiroku log prove 20260805T091502Z-3f9c21ab -o case.tlog-proof",
                  "for the receipt of a case");
  command.example("kiroku log prove for-the-court -o for-the-court.tlog-proof",
                  "for an excerpt whose case is in the home's archive");
  command.example(
      "kiroku-verify CASE --device device.pub --trust roots.pem --proof case.tlog-proof --witnesses "
      "witnesses.txt",
      "what the one who gets them runs");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
