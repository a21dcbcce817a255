#include "apps/fleet/stored_judge.h"

#include "apps/verify/judging.h"
#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/printable.h"
#include "fleet/fetcher.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

StoredJudge::StoredJudge(const FleetConfiguration& configuration, const std::optional<std::string>& scratch)
    : configuration_(configuration), store_(configuration.open_store()), scratch_(scratch) {}

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

archive::VerificationReport StoredJudge::judge(const std::string& appliance, const std::string& case_id,
                                               UtcTime changed) {
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
  const fs::path folder = scratch_.path() / "cases";
  fs::remove_all(folder);
  fs::create_directories(folder);
  const fleet::FetchedCase fetched = fleet::fetch_case(store_, appliance, case_id, folder);
  judging.log = log_of(appliance, changed).string();
  const VerifyExtras none;
  archive::VerificationReport report = Judge(judging, none).judge(fetched.folder).report;
  fs::remove_all(folder);
  return report;
}

}  // namespace kiroku::apps
