#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recovering.h"
#include "apps/kiroku/stated_from_store.h"
#include "archive/storage/file_system.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

using archive::CaseRecovery;
using nlohmann::ordered_json;

struct Request {
  std::shared_ptr<std::optional<std::string>> home = std::make_shared<std::optional<std::string>>();
  FromStoreRequest from_store;
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

int run(const Request& request, const VerifyExtras& extras) {
  if (request.from_store.case_name)
    return state_from_store(request.from_store, *request.home, extras, request.json);
  if (request.from_store.says_anything()) {
    throw UsageError(
        "--appliance, --output, --force, --device, --trust and --own-authority are for --from-store CASE");
  }
  const Home home = Home::open(*request.home);
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
  const auto extras = std::make_shared<VerifyExtras>(verify_extras(request->home));
  FromStoreRequest& from_store = request->from_store;
  command.option(
      "--from-store", "CASE", from_store.case_name,
      "instead: states how far the store of [store] has this case of another appliance, which is gone");
  command.option("--appliance", "NAME", from_store.appliance, "whose case it is: its name in the store");
  command.option("-o,--output", "DIR", from_store.output,
                 "the folder that gets the case, and the statement beside");
  command.writes("--output", Writes::kCases);
  command.option("--device", "FILE", from_store.judging.devices,
                 "the case's device: its device.identity, a device.pub or that key itself");
  command.option("--trust", "PEM", from_store.judging.trust,
                 "roots of outside time-stamping authorities that are trusted; instead of the home's");
  command.option("--own-authority", "PEM", from_store.judging.own_authority,
                 "roots of the other appliance's own authority; instead of the home's");
  command.flag("--force", from_store.force,
               "also where something came from that appliance within 15 minutes: you know that it is gone");
  add_home_option(command, *request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "What was durable is kept and entered, what was lost is stated as a gap, the case is closed and "
      "time-stamped; it then verifies as intact with gaps. 'kiroku record' does the same before it begins. "
      "While a recorder is running, nothing is touched.");
  command.explain(
      "With --from-store: only its own device can close a case. Of one whose appliance was destroyed or "
      "stolen "
      "while it recorded, the store has what was shipped. This device gets that, verifies it, and states "
      "under "
      "its own keys how far the case came there, with a time-stamp, an entry in its own log, and a copy in "
      "the "
      "store under the case's lock. The case stays incomplete. It is refused for a case of this device, for "
      "one "
      "that was closed, and while the other appliance still ships.");
  command.explain(
      "Exit status: 0 every case is closed, 2 one was left as it is, and the words say why. With "
      "--from-store: 0 "
      "it is stated and in the store, 1 what the store has was tampered with, 2 it was refused, 3 it has no "
      "time-stamp, or is not in the store.");
  command.example("kiroku recover", "after a power cut, without recording anything new");
  command.example("kiroku recover --json | jq -r '.cases[] | .case + \" \" + .outcome'",
                  "what became of each case, for a script");
  command.example(
      "kiroku recover --from-store 20261126T091502Z-3f9c21ab --appliance or-1 --device or-1.identity -o "
      "fetched",
      "or-1 burned: states how far the store has its case, under this device's key");
  command.on_run([request, extras] { return run(*request, *extras); });
}

}  // namespace kiroku::apps
