#include "apps/kiroku/recovering.h"

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/standby_folder.h"
#include "base/error.h"
#include "base/number_text.h"
#include "recorder/checkpoint_stamper.h"

namespace kiroku::apps {
namespace {

using archive::CaseRecovery;

void tell_catalogue(const Home& home, const std::filesystem::path& folder) {
  try {
    refresh_catalogue(home, folder);
  } catch (const Error& error) {
    print_error("kiroku", std::string("warning: the catalogue does not know this case yet: ") + error.what());
  }
}

std::string outcome_text(const CaseRecovery& recovery) {
  switch (recovery.outcome) {
    case CaseRecovery::Outcome::kRecovered:
      return "was cut off by a " + std::string(recovery.after == "crash" ? "crash" : "loss of power") +
             " and is closed now";
    case CaseRecovery::Outcome::kFinished:
      return "was closed, and is stamped and signed to its end now";
    case CaseRecovery::Outcome::kNotBegun:
      return "was cut off before it began: nothing was recorded, what was left of it is removed";
    case CaseRecovery::Outcome::kRefused:
      break;
  }
  return "was not recovered and is left as it is";
}

std::string found_text(const CaseRecovery& recovery) {
  std::string out = "found " + counted(recovery.segments, "segment", "segments") + " without an entry";
  if (recovery.incomplete > 0) out += ", " + std::to_string(recovery.incomplete) + " of them cut off";
  if (recovery.tokens > 0) out += "; " + counted(recovery.tokens, "time-stamp", "time-stamps");
  return out;
}

}  // namespace

std::vector<CaseRecovery> recover_home(const WritableHome& writable,
                                       const std::vector<recorder::NamedAuthority>& authorities,
                                       const archive::RecordingLock& lock, const RecoveryWishes& wishes) {
  const Home& home = writable.home;
  archive::RecoveryOptions options;
  options.archive = home.archive();
  options.key = &writable.key;
  options.device_name = home.device().name();
  options.boot_id = archive::kernel_boot_id();
  options.log = writable.log.get();
  options.may_erase = writable.another_log.empty();
  options.carry_on = wishes.carry_on;
  options.trust = &writable.trust;
  options.stamp = wishes.stamp_later && writable.queue
                      ? recorder::later_stamper(authorities, *writable.queue)
                      : recorder::checkpoint_stamper(authorities, &writable.trust, writable.queue.get());
  std::vector<CaseRecovery> recovered = archive::recover_archive(archive::real_file_system(), options, lock);
  for (const CaseRecovery& each : recovered) {
    if (each.outcome == CaseRecovery::Outcome::kRecovered || each.outcome == CaseRecovery::Outcome::kFinished)
      tell_catalogue(home, each.folder);
  }
  return recovered;
}

std::string recovery_text(const CaseRecovery& recovery) {
  const bool is_ahead = recovery.case_id.starts_with(archive::kStandbyPrefix);
  std::string out = is_ahead ? "what was recorded ahead in " + printable(recovery.case_id) +
                                   " could not be removed and is left as it is\n"
                             : "case " + printable(recovery.case_id) + " " + outcome_text(recovery) + "\n";
  const auto line = [&out](const std::string& text) { out += "  " + printable(text) + "\n"; };
  if (recovery.segments > 0 || recovery.tokens > 0) line(found_text(recovery));
  if (!recovery.truncated.empty()) line("cut off: " + recovery.truncated);
  for (const archive::GapEntry& gap : recovery.gaps) {
    line("nothing of " + gap.stream + " from " + format_duration(gap.span.start_ns) + " on");
  }
  if (recovery.erased_files > 0)
    line("removed " + counted(recovery.erased_files, "file", "files") +
         " that an erasure had left which was cut off: what was to go is in its ledger");
  const bool ended = recovery.outcome == CaseRecovery::Outcome::kRecovered ||
                     recovery.outcome == CaseRecovery::Outcome::kFinished;
  if (ended && !recovery.stamped) line("its end has no time-stamp: no authority gave one");
  if (!recovery.problem.empty()) line(recovery.problem);
  return out;
}

}  // namespace kiroku::apps
