#include "apps/fleet/stored_judge.h"

#include <algorithm>
#include <iterator>

#include "apps/verify/judging.h"
#include "apps/verify/verify_command.h"
#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/printable.h"
#include "fleet/fetcher.h"
#include "fleet/stored_reading.h"
#include "fleet/stored_records.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::minutes kLogIsNew{1};

}  // namespace

StoredJudge::StoredJudge(const FleetConfiguration& configuration, const std::optional<std::string>& scratch,
                         Mends mends)
    : configuration_(configuration),
      store_(configuration.open_store()),
      connections_([this] { return configuration_.open_store(); }),
      scratch_(scratch) {
  if (mends == Mends::kAsConfigured && configuration.mending)
    mending_.emplace(configuration, scratch_.path() / "mending");
}

fs::path StoredJudge::log_of(const std::string& appliance, UtcTime changed) {
  const auto known = logs_.find(appliance);
  if (known != logs_.end() && changed + configuration_.settles < known->second)
    return scratch_.path() / "logs" / appliance / "log";
  return fetch_log(appliance);
}

fs::path StoredJudge::fetch_log(const std::string& appliance) {
  const fs::path into = scratch_.path() / "logs" / appliance;
  logs_.erase(appliance);
  holds_.erase(appliance);
  fs::remove_all(into);
  fs::create_directories(into);
  const UtcTime now = utc_now();
  fleet::fetch_log(store_, appliance, into);
  logs_[appliance] = now;
  return into / "log";
}

const archive::Holds& StoredJudge::holds_of(const std::string& appliance, const fs::path& device) {
  auto known = holds_.find(appliance);
  if (known == holds_.end())
    known = holds_
                .emplace(appliance, archive::read_holds(scratch_.path() / "logs" / appliance / "log",
                                                        load_device_keys(device.string()).front()))
                .first;
  return known->second;
}

/// Of a case under legal hold also what the store tells of the segments that were left there.
fleet::HoldsSeen StoredJudge::holds_seen(const std::string& appliance, const std::string& case_id,
                                         const fs::path& device, const fleet::FetchedCase& there) {
  fleet::HoldsSeen seen = there.holds;
  if (there.in_store.empty() || archive::why_held(holds_of(appliance, device), case_id).empty()) return seen;
  for (const auto& [path, version] : there.in_store) {
    const auto told = store_.look(version.key, version.version);
    if (!told) continue;
    if ((told->legal_hold ? seen.held : seen.free)++ == 0)
      (told->legal_hold ? seen.first_held : seen.first_free) = version;
    seen.are_locks_told = seen.are_locks_told || told->lock_ends || told->legal_hold;
  }
  return seen;
}

/// Nobody who comes between the two is told of a difference: 'kiroku ship' holds before the log says so, and
/// lets go after.
HoldDifference StoredJudge::hold_of(const std::string& appliance, const std::string& case_id,
                                    const fs::path& device, const fleet::FetchedCase& there) {
  try {
    fleet::HoldsSeen in_store = holds_seen(appliance, case_id, device, there);
    HoldDifference differs = compare_holds(holds_of(appliance, device), case_id, in_store);
    if (differs.text.empty()) return {};
    // The log that was fetched for an earlier case may be from before. Where a store holds every case by
    // itself, it is not fetched for each.
    if (differs.lifted || utc_now() - logs_[appliance] > kLogIsNew) {
      fetch_log(appliance);
      // By an older log segments may not have been asked for.
      if (!differs.lifted) in_store = holds_seen(appliance, case_id, device, there);
      differs = compare_holds(holds_of(appliance, device), case_id, in_store);
      if (differs.text.empty()) return {};
    }
    const auto now = store_.look(differs.of.key, differs.of.version);
    const bool was_held = !differs.lifted && in_store.are_locks_told;
    return !now || now->legal_hold == was_held ? differs : HoldDifference{};
  } catch (const fleet::StoreError&) {
    throw;
  } catch (const IoError&) {
    throw;
  } catch (const Error& error) {
    return {std::string("whether the store holds what the log says could not be told: ") + error.what(),
            false,
            {}};
  }
}

/// The case as the store has it, or has it once it was mended.
fleet::FetchedCase StoredJudge::fetched(const std::string& appliance, const std::string& case_id,
                                        const fs::path& device, fleet::SegmentBytes segments) {
  const fs::path folder = scratch_.path() / "cases";
  const auto fetch = [&](fleet::UnreadableObjects unreadable) {
    fs::remove_all(folder);
    fs::create_directories(folder);
    return fleet::fetch_case(store_, appliance, case_id, folder, fleet::WhichVersions::kNewest, unreadable,
                             mending_ ? fleet::SegmentBytes::kFetched : segments);
  };
  if (!mending_) return fetch(fleet::UnreadableObjects::kThrow);
  fleet::FetchedCase fetched = fetch(fleet::UnreadableObjects::kLeaveOut);
  done_ = mending_->mend(appliance, case_id, device, fetched);
  const auto is_settled = [&](const std::string& path) {
    return done_.erased.contains(path) ||
           std::ranges::find(done_.mended, path, &fleet::MendedFile::path) != done_.mended.end();
  };
  // By another ledger other files are the recorded ones.
  if (done_.has_other_ledger) {
    fetched = fetch(fleet::UnreadableObjects::kLeaveOut);
    fleet::Mending more = mending_->mend(appliance, case_id, device, fetched);
    std::ranges::move(more.mended, std::back_inserter(done_.mended));
    done_.left = std::move(more.left);
    done_.more_left = more.more_left;
    done_.erased = std::move(more.erased);
  }
  for (const auto& [path, why] : fetched.unreadable) {
    // What the store lists and does not give is no part of any verdict.
    if (!is_settled(path)) throw Error(why);
  }
  return fetched;
}

archive::VerificationReport StoredJudge::judge(const std::string& appliance, const std::string& case_id,
                                               UtcTime changed) {
  done_ = {};
  hold_ = {};
  // Whoever may write the catalogue's rows names no folder here.
  if (!archive::is_short_name(appliance) || !archive::is_case_id(case_id)) {
    throw UsageError("the catalogue has '" + printable(case_id) + "' of '" + printable(appliance) +
                     "', which names no case: nothing was looked at");
  }
  // Who was given both asks for both of the device's signatures.
  std::error_code ignored;
  fs::path key = configuration_.devices / (appliance + ".identity");
  if (!fs::exists(key, ignored)) key = configuration_.devices / (appliance + ".pub");
  if (!fs::exists(key, ignored)) {
    throw UsageError(key.string() + " is not there: put the device.identity, or the device.pub, of " +
                     appliance + " there, from its home");
  }
  JudgingRequest judging;
  judging.devices = {key.string()};
  for (const fs::path& each : configuration_.trust) judging.trust.push_back(each.string());
  for (const fs::path& each : configuration_.own_authority) judging.own_authority.push_back(each.string());
  if (const auto policy = configuration_.policy_file()) judging.policy = policy->string();
  fleet::FetchedCase there = fetched(appliance, case_id, key, fleet::SegmentBytes::kInStore);
  judging.log = log_of(appliance, changed).string();
  hold_ = hold_of(appliance, case_id, key, there);
  archive::VerificationReport report = judge_there(appliance, case_id, there, judging);
  // What lies in the store has no holes: a segment that begins with zeros is judged as the bytes that it is.
  const auto has_hole = [](const archive::Finding& each) { return each.code == "file-has-hole"; };
  if (!there.in_store.empty() && std::ranges::any_of(report.findings, has_hole)) {
    there = fetched(appliance, case_id, key, fleet::SegmentBytes::kFetched);
    report = judge_there(appliance, case_id, there, judging);
  }
  fs::remove_all(there.folder.parent_path());
  return report;
}

/// Segments that were left in the store are read there.
archive::VerificationReport StoredJudge::judge_there(const std::string& appliance, const std::string& case_id,
                                                     fleet::FetchedCase& there, JudgingRequest& judging) {
  const fleet::StoredReading reading(connections_, there.folder, there.in_store);
  judging.files = &reading;
  const VerifyExtras none;
  try {
    const Judge judge(judging, none);
    judge.with_rules(there.folder, [&](const evidence::JudgingRules& rules) {
      fleet::fetch_record(store_, appliance, case_id, rules, there, reading);
    });
    archive::VerificationReport report = judge.judge(there.folder).report;
    // What the store does not give says nothing of the case.
    reading.require_all_given();
    return report;
  } catch (...) {
    reading.require_all_given();
    throw;
  }
}

}  // namespace kiroku::apps
