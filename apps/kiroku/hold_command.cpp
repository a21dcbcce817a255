// 'kiroku hold' and 'kiroku release': legal holds of cases, stated in the appliance log.
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/standing_holds.h"
#include "apps/kiroku/user_name.h"
#include "archive/reading/case_reader.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/holds.h"
#include "archive/upkeep/retention.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
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

/// What a hold comes too late for, and what only it keeps.
struct Erased {
  std::set<std::string> streams;  // of which segments were erased
  std::uint64_t left = 0;         // files of these that an erasure left which was cut off
};
/// Nothing of a case that cannot be read: that is no reason not to hold it.
Erased erased_of(const Home& home, const std::string& name) try {
  const archive::CaseReader reader = archive::CaseReader::open(home.archive() / name);
  std::vector<archive::ErasedEntry> entries;
  reader.for_each([&](const archive::CaseEntry& entry) {
    if (const auto* gone = std::get_if<archive::ErasedEntry>(&entry.body)) entries.push_back(*gone);
  });
  Erased erased;
  for (const archive::ErasedEntry& each : entries) erased.streams.insert(each.stream);
  erased.left = archive::files_to_erase(archive::real_file_system(), reader.folder(), entries).size();
  return erased;
} catch (const Error&) {
  return {};
}
std::string left_text(const Erased& erased, const std::string& sentence) {
  return erased.left == 0 ? ""
                          : counted(erased.left, "file", "files") + " of an erasure that was cut off " +
                                (erased.left == 1 ? "is" : "are") + " still there: " + sentence + "\n";
}

int hold(const Request& request) {
  const Home home = Home::open(request.home);
  const std::string name = case_of(home, request);
  require_reason(request.reason);
  const crypto::SigningKey key = home.signing_key();
  const auto log = open_log(home, key);
  const archive::ErasingTurn turn(home.archive());
  const std::uint64_t entry = log->case_held(name, request.reason, user_name());
  const Erased erased = erased_of(home, name);
  if (request.json) {
    print_json({{"case", name},
                {"hold", entry},
                {"erased_before", erased.streams},
                {"left_of_erasures", erased.left}});
  } else {
    std::cout << "case " << name << " is under legal hold by entry " << entry
              << " of the appliance log: nothing of it is erased until 'kiroku release'\n"
              << (erased.streams.empty() ? ""
                                         : "segments of " + printable(joined(erased.streams)) +
                                               " were erased before, as its ledger says\n")
              << left_text(erased, "the hold keeps what is left") << about_the_store(home, true);
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
    std::cout
        << "the legal hold of entry " << entry << " of case " << name << " ended"
        << (still.empty() ? "; no other stands\n" : "; " + still + "\n")
        << (still.empty()
                ? left_text(
                      erased_of(home, name),
                      "no start removes what is left any more; 'kiroku erase' does, if it is still to go") +
                      about_the_store(home, false)
                : "");
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
  command.explain(
      "It erases nothing: the case is again what retention may take once it is due. What an erasure left "
      "that "
      "was cut off before the hold stays, too, until 'kiroku erase' is asked again.");
  command.example("kiroku release 20260805T091502Z-3f9c21ab --reason 'settled on 2027-02-01'",
                  "ends the only hold of this case");
  command.on_run([request] { return release(*request); });
}

}  // namespace kiroku::apps
