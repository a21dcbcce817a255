// 'kiroku hold' and 'kiroku release': legal holds of cases, stated in the appliance log.
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/standing_holds.h"
#include "apps/kiroku/user_name.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/holds.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> case_name, home, hold;
  std::string reason;
  bool list = false, json = false;
};

/// The case of this home's archive that was named.
std::string case_of(const Home& home, const Request& request) {
  if (!request.case_name) throw UsageError("name the CASE");
  const fs::path folder = find_case(home, *request.case_name);
  if (!home.holds(folder) || archive::is_excerpt(folder)) {
    throw UsageError(
        folder.string() +
        " is no case of this home's archive: only the recorder that recorded a case can hold it");
  }
  return fs::canonical(folder).filename().string();
}

void require_reason(const std::string& reason) {
  constexpr std::size_t kMost = 1'000;
  if (reason.empty()) throw UsageError("say why with --reason TEXT: it stands in the appliance log for good");
  if (reason.size() > kMost)
    throw UsageError("--reason has more than 1000 bytes: name where the rest is kept");
  require_printable(reason, "--reason");
}

/// What is still to be done about the store, a sentence; nothing where the home has none.
std::string about_the_store(const Home& home, bool on) {
  if (!home.configuration().store) return "";
  return std::string("In the store it is ") + (on ? "set" : "lifted") +
         " by 'kiroku ship', which kiroku-ship.service does by itself; 'kiroku ship --status' tells whether "
         "the store confirmed it.\n";
}

int hold(const Request& request) {
  const Home home = Home::open(request.home);
  const std::string name = case_of(home, request);
  require_reason(request.reason);
  const crypto::SigningKey key = home.signing_key();
  const auto log = open_log(home, key);
  const archive::ErasingTurn turn(home.archive());
  const std::uint64_t entry = log->case_held(name, request.reason, user_name());
  if (request.json) {
    print_json({{"case", name}, {"hold", entry}});
  } else {
    std::cout << "case " << name << " is under legal hold by entry " << entry
              << " of the appliance log: nothing of it is erased until 'kiroku release'\n"
              << about_the_store(home, true);
  }
  return kDone;
}

/// The hold that is to end: the one that was named, or the only one.
std::uint64_t which_hold(const Request& request, const std::string& name, const archive::Holds& holds) {
  const auto found = holds.find(name);
  if (found == holds.end() || found->second.empty())
    throw UsageError("case " + name + " is under no legal hold: there is nothing to release");
  const std::vector<archive::Hold>& standing = found->second;
  if (!request.hold) {
    if (standing.size() == 1) return standing.front().entry;
    throw UsageError(
        "case " + name + " is under " + std::to_string(standing.size()) +
        " legal holds: say which one ends with --hold ENTRY, as 'kiroku hold --list' names them");
  }
  for (const archive::Hold& each : standing) {
    if (std::to_string(each.entry) == *request.hold) return each.entry;
  }
  throw UsageError("no legal hold of case " + name + " stands by entry '" + printable(*request.hold) +
                   "': 'kiroku hold --list' names those that do");
}

int release(const Request& request) {
  const Home home = Home::open(request.home);
  const std::string name = case_of(home, request);
  require_reason(request.reason);
  const crypto::SigningKey key = home.signing_key();
  const auto log = open_log(home, key);
  const archive::ErasingTurn turn(home.archive());
  archive::Holds holds = standing_holds(home);
  const std::uint64_t entry = which_hold(request, name, holds);
  log->case_released(name, entry, request.reason, user_name());
  std::erase_if(holds[name], [&](const archive::Hold& each) { return each.entry == entry; });
  const std::string still = archive::why_held(holds, name);
  if (request.json) {
    print_json({{"case", name}, {"hold", entry}, {"still_held", !still.empty()}});
  } else {
    std::cout << "the legal hold of entry " << entry << " of case " << name << " ended"
              << (still.empty() ? "; no other stands\n" : "; " + still + "\n")
              << (still.empty() ? about_the_store(home, false) : "");
  }
  return kDone;
}

int list(const Request& request) {
  const Home home = Home::open(request.home);
  ordered_json rows = ordered_json::array();
  for (const auto& [name, standing] : standing_holds(home)) {
    for (const archive::Hold& each : standing) {
      rows.push_back({{"case", name},
                      {"hold", each.entry},
                      {"since", format_utc(each.since)},
                      {"who", each.who},
                      {"reason", each.reason}});
      if (!request.json)
        std::cout << name << "  entry " << each.entry << "  since " << format_local(each.since) << "  by "
                  << printable(each.who) << ": " << printable(each.reason) << "\n";
    }
  }
  if (request.json) {
    print_json({{"holds", rows}});
  } else if (rows.empty()) {
    std::cout << "No case is under legal hold.\n";
  }
  return kDone;
}

}  // namespace

void add_hold_command(Command& program) {
  Command& command = program.add_command("hold", "puts a case under legal hold: nothing of it is erased");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->case_name, "a case of this home, also one that is being recorded");
  command.option("--reason", "TEXT", request->reason, "why; stands in the appliance log for good");
  command.flag("--list", request->list, "tells which holds stand, instead");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "While a hold stands, 'kiroku erase' keeps everything of the case, by hand and by policy, and 'kiroku "
      "ship' sets the store's legal hold on every version of its objects. A case may be under several holds. "
      "Who held it, when and why stands in the appliance log, signed.");
  command.example("kiroku hold 20260805T091502Z-3f9c21ab --reason 'court of Kyoto, 2026 (wa) 1234'",
                  "from now on nothing of this case is erased");
  command.example("kiroku hold --list", "which cases are held, by whom, since when and why");
  command.on_run([request] {
    if (request->list && (request->case_name || !request->reason.empty()))
      throw UsageError("--list tells of all holds: leave out CASE and --reason");
    return request->list ? list(*request) : hold(*request);
  });
}

void add_release_command(Command& program) {
  Command& command = program.add_command("release", "ends a legal hold of a case");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->case_name, "a case of this home");
  command.option("--reason", "TEXT", request->reason, "why; stands in the appliance log for good");
  command.option("--hold", "ENTRY", request->hold, "the entry of the log that stated the hold",
                 "the only one that stands");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain("It erases nothing: the case is again what retention may take once it is due.");
  command.example("kiroku release 20260805T091502Z-3f9c21ab --reason 'settled on 2027-02-01'",
                  "ends the only hold of this case");
  command.on_run([request] { return release(*request); });
}

}  // namespace kiroku::apps
