#include "apps/fleet/stored_judge.h"

#include <algorithm>
#include <iterator>
#include <string_view>

#include "apps/verify/judging.h"
#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/printable.h"
#include "fleet/fetcher.h"
#include "fleet/stored_records.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

StoredJudge::StoredJudge(const FleetConfiguration& configuration, const std::optional<std::string>& scratch,
                         Mends mends)
    : configuration_(configuration), store_(configuration.open_store()), scratch_(scratch) {
  if (mends == Mends::kAsConfigured && configuration.mending)
    mending_.emplace(configuration, scratch_.path() / "mending");
}

fs::path StoredJudge::log_of(const std::string& appliance, UtcTime changed) {
  const fs::path into = scratch_.path() / "logs" / appliance;
  const auto known = logs_.find(appliance);
  if (known != logs_.end() && changed + configuration_.settles < known->second) return into / "log";
  logs_.erase(appliance);
  fs::remove_all(into);
  fs::create_directories(into);
  const UtcTime now = utc_now();
  fleet::fetch_log(store_, appliance, into);
  logs_[appliance] = now;
  return into / "log";
}

/// The case as the store has it, or has it once it was mended.
fleet::FetchedCase StoredJudge::fetched(const std::string& appliance, const std::string& case_id,
                                        const fs::path& device) {
  const fs::path folder = scratch_.path() / "cases";
  const auto fetch = [&](fleet::UnreadableObjects unreadable) {
    fs::remove_all(folder);
    fs::create_directories(folder);
    return fleet::fetch_case(store_, appliance, case_id, folder, fleet::WhichVersions::kNewest, unreadable);
  };
  if (!mending_) return fetch(fleet::UnreadableObjects::kThrow);
  fleet::FetchedCase fetched = fetch(fleet::UnreadableObjects::kLeaveOut);
  done_ = mending_->mend(appliance, case_id, device, fetched);
  const auto is_mended = [&](std::string_view path) {
    return std::ranges::find(done_.mended, path, &fleet::MendedFile::path) != done_.mended.end();
  };
  // By another ledger other files are the recorded ones.
  if (done_.has_other_ledger) {
    fetched = fetch(fleet::UnreadableObjects::kLeaveOut);
    fleet::Mending more = mending_->mend(appliance, case_id, device, fetched);
    std::ranges::move(more.mended, std::back_inserter(done_.mended));
    done_.left = std::move(more.left);
    done_.more_left = more.more_left;
  }
  for (const auto& [path, why] : fetched.unreadable) {
    // What the store lists and does not give is no part of any verdict.
    if (!is_mended(path)) throw Error(why);
  }
  return fetched;
}

archive::VerificationReport StoredJudge::judge(const std::string& appliance, const std::string& case_id,
                                               UtcTime changed) {
  done_ = {};
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
  const VerifyExtras none;
  const Judge judge(judging, none);
  fleet::FetchedCase there = fetched(appliance, case_id, key);
  judge.with_rules(there.folder, [&](const evidence::JudgingRules& rules) {
    fleet::fetch_record(store_, appliance, case_id, rules, there);
  });
  judging.log = log_of(appliance, changed).string();
  archive::VerificationReport report = judge.judge(there.folder).report;
  fs::remove_all(there.folder.parent_path());
  return report;
}

}  // namespace kiroku::apps
