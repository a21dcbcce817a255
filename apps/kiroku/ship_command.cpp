// 'kiroku ship': copies of the archive in a store whose locks nobody can lift.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/scratch_folder.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/log_publishing.h"
#include "apps/kiroku/stated_mending.h"
#include "apps/kiroku/store.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/kiroku/user_name.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/printable.h"
#include "fleet/fetcher.h"
#include "fleet/mender.h"
#include "fleet/shipper.h"

namespace kiroku::apps {
namespace {

constexpr std::chrono::seconds kLookInterval{5};
constexpr std::chrono::seconds kLongestPause{60};
/// Objects under legal hold, in one look; what is recorded meanwhile waits for about a minute at most.
constexpr std::uint64_t kLookedAtAgain = 500;

struct Request {
  std::optional<std::string> home, mend, scratch;
  bool follow = false, status = false, probe = false, json = false;
};

nlohmann::ordered_json json_of(const fleet::ShippingReport& report, const fleet::ShippingList::Totals& held) {
  nlohmann::ordered_json json{{"sent", report.sent},       {"sent_bytes", report.sent_bytes},
                              {"found", report.found},     {"in_store", held.objects},
                              {"waiting", report.waiting}, {"waiting_bytes", report.waiting_bytes}};
  if (report.waiting_since) json["waiting_since"] = format_utc(*report.waiting_since);
  json["holds_waiting"] = report.holds_waiting;
  json["lifted"] = report.lifted;
  json["lengthened"] = report.lengthened;
  json["locks_left"] = nullptr;
  if (const auto& left = report.locks_left)
    json["locks_left"] = {{"retain_s", left->retention.count()},
                          {"looked_at", left->looked_at},
                          {"lengthened", left->lengthened},
                          {"failed", left->failed}};
  json["problems"] = report.problems;
  return json;
}

std::string objects(std::uint64_t count) {
  return std::to_string(count) + (count == 1 ? " object" : " objects");
}

std::string lengthened(const fleet::ShippingReport& report) {
  return "the locks of " + objects(report.lengthened) + ", as 'retain' in [store] asks for now";
}

int tell_status(const Request& request, const fleet::ShippingReport& report, fleet::ShippingList& list) {
  const fleet::ShippingList::Totals held = list.totals();
  if (request.json) {
    print_json(json_of(report, held));
  } else {
    std::cout << "in the store   " << objects(held.objects) << ", " << format_bytes(held.bytes)
              << ", each confirmed when it was put\n";
    if (report.waiting == 0) {
      std::cout << "not there yet  nothing\n";
    } else {
      std::cout << "not there yet  " << objects(report.waiting) << ", " << format_bytes(report.waiting_bytes)
                << ", the oldest since " << format_utc(*report.waiting_since) << "\n";
    }
    for (const std::string& each : report.holds_waiting)
      std::cout << "legal hold     of case " << each << " is not confirmed by the store as the log says it\n";
    if (const auto& left = report.locks_left)
      std::cout
          << "locks          are still to be looked at, whether each lasts as 'retain' in [store] asks: "
          << objects(left->looked_at) << " so far, " << left->lengthened << " lengthened\n";
    for (const std::string& problem : report.problems) print_error("kiroku", problem);
    for (const std::string& each : report.lifted) print_error("kiroku", each);
  }
  const bool is_all_there = report.waiting == 0 && report.holds_waiting.empty() && report.lifted.empty() &&
                            !report.locks_left && report.problems.empty();
  return is_all_there ? kDone : kNoAnswer;
}

int probe(const Request& request, fleet::ObjectStore& store, const std::string& appliance) {
  const fleet::LockProbe found = fleet::probe_lock(store, appliance);
  if (request.json) {
    print_json({{"key", found.key},
                {"holds", found.fails() || found.holds() ? nlohmann::ordered_json(found.holds()) : nullptr},
                {"removes_unlocked", found.may_remove},
                {"told", !found.unlocked},
                {"removed", found.removed},
                {"replaced", found.replaced},
                {"hold_removed", found.hold_removed}});
  } else {
    const char* verdict =
        found.fails()   ? "The locks of this store DO NOT HOLD: it is no place for evidence.\n"
        : found.holds() ? "The locks of this store hold against this access key.\n"
                        : "NOT SHOWN: this store removes nothing for this access key, locked or "
                          "not. Try a key that may remove objects.\n";
    std::cout << "free      "
              << (found.may_remove ? "an object without a lock can be removed"
                                   : "an object without "
                                     "a lock was not removed either")
              << "\n"
              << "put       " << found.key << ", locked for a minute\n"
              << "told      " << (found.unlocked ? "no such lock" : "COMPLIANCE until then") << "\n"
              << "removing  " << (found.removed ? "REMOVED it" : "was refused, or removed nothing") << "\n"
              << "replacing " << (found.replaced ? "CHANGED it" : "left the first version as it was") << "\n"
              << "holding   "
              << (found.hold_removed ? "REMOVED what was under legal hold, or told of no hold"
                                     : "what was under legal hold was not removed")
              << "\n"
              << verdict;
  }
  return found.holds() ? kDone : kNoAnswer;
}

/// In the appliance log, for good.
void state_in_log(const Home& home, const std::string& case_id, const std::string& what) try {
  const crypto::SigningKey key = home.signing_key();
  open_log(home, key)->access(case_id, printable(what), user_name());
} catch (const Error& error) {
  throw Error("the appliance log does not state that 'kiroku ship' " + what + ": " + error.what());
}

/// Again and again until it is told to end; a store that is away is asked less and less often.
int follow(fleet::Shipper& shipper, const Home& home, LogPublishing& publishing) {
  std::chrono::seconds pause = kLookInterval;
  std::string told;
  do {
    std::vector<std::string> problems;
    try {
      publishing.bring_up_to_date(problems);
      const fleet::ShippingReport report = shipper.ship(home.archive(), told_to_end);
      problems.insert(problems.end(), report.problems.begin(), report.problems.end());
      for (const std::string& each : report.lifted) print_error("kiroku", each);
      if (report.sent > 0)
        std::cout << "sent " << objects(report.sent) << ", " << format_bytes(report.sent_bytes) << std::endl;
      if (report.lengthened > 0) std::cout << "lengthened " << lengthened(report) << std::endl;
      pause = kLookInterval;
    } catch (const fleet::StoreError& error) {
      problems.emplace_back(error.what());
      pause = std::max(std::min(2 * pause, kLongestPause), error.wait());
    } catch (const Error& error) {
      problems.emplace_back(error.what());
      pause = std::min(2 * pause, kLongestPause);
    }
    const std::string now = joined(problems, "; ");
    // The same trouble is told once, and that it is over.
    if (now != told) {
      if (now.empty()) {
        std::cout << "the store takes everything again" << std::endl;
      } else {
        print_error("kiroku", now + "; recording goes on, and it is tried again");
      }
    }
    told = now;
  } while (!wait_until_told(pause));
  return kDone;
}

/// What the store has of a case, compared with what this device signed, and put again out of the archive.
int mend(const Request& request, const Home& home, fleet::ObjectStore&& store, const std::string& appliance) {
  const std::string case_id = find_case(home, *request.mend).filename().string();
  const ScratchFolder scratch(request.scratch);
  const auto shared = std::make_shared<fleet::ObjectStore>(std::move(store));
  std::vector<std::unique_ptr<fleet::CaseCopy>> copies;
  copies.push_back(fleet::copy_in_archive("the appliance's archive", home.archive()));
  fleet::Mender mender(shared, std::move(copies), scratch.path() / "mending");
  const crypto::SigningKey key = home.signing_key();
  const auto log = open_log(home, key);
  StatedMending stated(home.log_folder(), case_id);
  fleet::Mending all;
  // By another ledger other files are the recorded ones: then everything is looked at once more.
  constexpr int kMostLooks = 2;
  for (int look = 0; look < kMostLooks; ++look) {
    std::filesystem::remove_all(scratch.path() / case_id);
    const fleet::FetchedCase fetched =
        fleet::fetch_case(*shared, appliance, case_id, scratch.path(), fleet::WhichVersions::kNewest,
                          fleet::UnreadableObjects::kLeaveOut);
    fleet::Mending now =
        mender.mend(appliance, case_id, {home.device()}, fetched, [&](const std::string& what) {
          if (stated.is_news(printable(what))) log->access(case_id, printable(what), user_name());
        });
    std::ranges::move(now.mended, std::back_inserter(all.mended));
    all.left = std::move(now.left);
    all.more_left = now.more_left;
    all.erased = std::move(now.erased);
    if (!now.has_other_ledger) break;
  }
  if (request.json) {
    nlohmann::ordered_json mended = nlohmann::ordered_json::array(), left = mended;
    for (const fleet::MendedFile& each : all.mended)
      mended.push_back({{"file", each.path}, {"from", each.from}, {"version", each.version}});
    for (const fleet::UnmendedFile& each : all.left)
      left.push_back({{"file", each.path}, {"why", each.told()}});
    print_json({{"case", case_id},
                {"mended", mended},
                {"not_mended", left},
                {"more_not_mended", all.more_left},
                {"erased", all.erased}});
  } else {
    for (const fleet::MendedFile& each : all.mended)
      std::cout << "mended " << printable(each.path) << " from " << each.from << "\n";
    for (const fleet::UnmendedFile& each : all.left)
      print_error("kiroku", "could not mend " + each.path + ": " + each.told());
    if (all.more_left > 0)
      print_error("kiroku", "could not mend " + std::to_string(all.more_left) + " more of its files");
    for (const std::string& each : all.erased) {
      if (std::ranges::find(all.left, each, &fleet::UnmendedFile::path) == all.left.end())
        std::cout << "erased " << printable(each)
                  << ": the store has it no longer, and it is not put again\n";
    }
    if (all.mended.empty() && all.left.empty() && all.erased.empty())
      std::cout << "The store has what was signed of " << case_id << ": nothing is to be mended.\n";
  }
  return all.left.empty() ? kDone : kNoAnswer;
}

int run(const Request& request) {
  if (int{request.follow} + int{request.status} + int{request.probe} + int{request.mend.has_value()} > 1)
    throw UsageError("give one of --follow, --status, --probe and --mend");
  if (request.scratch && !request.mend) throw UsageError("--scratch is for --mend");
  const Home home = Home::open(request.home);
  const StoreConfiguration of = store_of(home);
  const fleet::ShippingTerms terms{
      of.appliance,
      of.retain,
      home.device(),
      of.publish_log ? home.published_log() : "",
      search_notes_to_ship(
          home, of, [](const std::string& sentence) { print_error("kiroku", "warning: " + sentence); }),
      [&home] { require_same_log(home); },
      [&home](const std::string& case_id, const std::string& what) { state_in_log(home, case_id, what); },
      request.follow ? kLookedAtAgain : UINT64_MAX};
  fleet::ObjectStore store = open_store(home, of);
  if (request.probe) return probe(request, store, of.appliance);
  if (request.mend) return mend(request, home, std::move(store), of.appliance);
  fleet::ShippingList list(shipping_list_file(home, of));
  fleet::Shipper shipper(store, list, terms);
  if (request.status) return tell_status(request, shipper.look(home.archive()), list);
  list.take();
  end_when_told();
  LogPublishing publishing(home, of.publish_log);
  if (request.follow) return follow(shipper, home, publishing);
  std::vector<std::string> problems;
  publishing.bring_up_to_date(problems);
  fleet::ShippingReport report = shipper.ship(home.archive(), told_to_end);
  report.problems.insert(report.problems.end(), problems.begin(), problems.end());
  const fleet::ShippingReport left = shipper.look(home.archive());
  report.waiting = left.waiting;
  report.waiting_bytes = left.waiting_bytes;
  report.waiting_since = left.waiting_since;
  report.holds_waiting = left.holds_waiting;
  if (!request.json) {
    std::cout << "sent           " << objects(report.sent) << ", " << format_bytes(report.sent_bytes) << "\n";
    if (report.found > 0)
      std::cout << "found          " << objects(report.found) << " that were there already\n";
    if (report.lengthened > 0) std::cout << "lengthened     " << lengthened(report) << "\n";
  }
  return tell_status(request, report, list);
}

}  // namespace

void add_ship_command(Command& program) {
  Command& command = program.add_command("ship", "copies cases to a store whose locks nobody can lift");
  command.explain(
      "The store of [store] in kiroku.toml is an S3 store with Object Lock, such as Ceph. Every finished "
      "file of every "
      "case goes there while the case runs, locked for the time that [store] says, and counts once the store "
      "has told "
      "of its size, its SHA-256 and its lock. A copy of the store's prefix is an archive: kiroku-verify "
      "judges it "
      "alone. Recording never waits for the store. Where 'retain' in [store] is longer than it was, the "
      "locks "
      "of what is there are lengthened, too; none is ever shortened. What is still short is told, with exit "
      "status 3.");
  command.explain(
      "--mend is for a case that is still here and of which the store lost bytes. It reads the whole case "
      "from "
      "the store, so its access key must be let do that. The damaged version stays; the recorded bytes "
      "become a new one under the same lock. The appliance log states each object before it is put, and "
      "afterwards. Exit status 3 says that something could not be mended. So it does of what was erased "
      "here, "
      "is damaged in the store, and is still locked there: it is not put again.");
  const auto request = std::make_shared<Request>();
  command.flag("--follow", request->follow, "goes on until Ctrl-C, as kiroku-ship.service does");
  command.flag("--status", request->status,
               "only tells what is not in the store yet; asks nothing of the store");
  command.flag("--probe", request->probe,
               "only tries whether the store's locks hold, with an object of a minute");
  command.option("--mend", "CASE", request->mend,
                 "only compares what the store has of the case with what this device signed, and puts what "
                 "differs again, out of the archive");
  command.option("--scratch", "DIR", request->scratch, "where there is room for the whole case, for --mend",
                 "the folder for temporary files");
  command.writes("--scratch");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_home_option(command, request->home);
  command.example("kiroku ship", "copies what is not there yet, once");
  command.example("kiroku ship --status", "what is not away yet, and since when");
  command.example("kiroku ship --mend 20260805T091502Z-3f9c21ab",
                  "what the store's disks have lost of a case");
  command.example("kiroku ship --probe", "whether this store's locks can be relied on");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
