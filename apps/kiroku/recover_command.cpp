#include <algorithm>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recovering.h"
#include "archive/storage/file_system.h"

namespace kiroku::apps {
namespace {

using archive::CaseRecovery;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> home;
  bool json = false;
};

std::string outcome_name(CaseRecovery::Outcome outcome) {
  switch (outcome) {
    case CaseRecovery::Outcome::kRecovered:
      return "recovered";
    case CaseRecovery::Outcome::kFinished:
      return "finished";
    case CaseRecovery::Outcome::kNotBegun:
      return "not-begun";
    case CaseRecovery::Outcome::kRefused:
      break;
  }
  return "refused";
}

ordered_json recovery_json(const CaseRecovery& recovery) {
  ordered_json gaps = ordered_json::array();
  for (const archive::GapEntry& gap : recovery.gaps) {
    gaps.push_back({{"stream", gap.stream}, {"start_ns", gap.span.start_ns}, {"end_ns", gap.span.end_ns}});
  }
  return {{"case", recovery.case_id},
          {"folder", recovery.folder.string()},
          {"outcome", outcome_name(recovery.outcome)},
          {"after", recovery.after},
          {"truncated", recovery.truncated},
          {"segments", recovery.segments},
          {"incomplete", recovery.incomplete},
          {"tokens", recovery.tokens},
          {"gaps", gaps},
          {"stamped", recovery.stamped},
          {"problem", recovery.problem}};
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const archive::RecordingLock lock =
      archive::RecordingLock::take(archive::real_file_system(), home.archive());
  const Configuration configuration = home.configuration();
  const Authorities authorities(home, configuration, {});
  const WritableHome writable(home);
  const std::vector<CaseRecovery> recovered = recover_home(writable, authorities.named(), lock);
  if (request.json) {
    ordered_json cases = ordered_json::array();
    for (const CaseRecovery& each : recovered) cases.push_back(recovery_json(each));
    print_json({{"cases", cases}});
  } else if (recovered.empty()) {
    std::cout << "Every case in " << printable(home.archive().string()) << " was brought to its end.\n";
  } else {
    for (const CaseRecovery& each : recovered) std::cout << recovery_text(each);
  }
  const bool refused = std::any_of(recovered.begin(), recovered.end(), [](const CaseRecovery& each) {
    return each.outcome == CaseRecovery::Outcome::kRefused;
  });
  return refused ? kRefused : kDone;
}

}  // namespace

void add_recover_command(Command& program) {
  Command& command = program.add_command("recover", "closes cases that a power cut or a crash left unclosed");
  const auto request = std::make_shared<Request>();
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "What was durable is kept and entered, what was lost is stated as a gap, the case is closed and "
      "time-stamped; it then verifies as intact with gaps. 'kiroku record' does the same before it begins. "
      "While a recorder is running, nothing is touched.");
  command.explain("Exit status: 0 every case is closed, 2 one was left as it is, and the words say why.");
  command.example("kiroku recover", "after a power cut, without recording anything new");
  command.example("kiroku recover --json | jq -r '.cases[] | .case + \" \" + .outcome'",
                  "what became of each case, for a script");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
