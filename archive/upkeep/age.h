// How old a case is, for whoever erases by age: a wall clock that was behind once, or is ahead now, must not
// make a new case old. Values and functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "archive/format/ledger_entry.h"
#include "base/utc_time.h"

namespace kiroku::archive {

/// When a case was opened, by all that its ledger says of time: the latest moment that any entry or token of
/// its recording points to. What was entered since its first erasure says nothing of that.
class OpeningTime {
 public:
  /// Call for each entry, in order.
  void take(const CaseEntry& entry);
  [[nodiscard]] UtcTime at() const { return latest_; }

 private:
  void point_to(UtcTime time, std::int64_t mono_ns);

  UtcTime latest_;
  std::int64_t opened_ns_ = 0;
  bool closed_ = false, ended_ = false;
};

/// What the appliance log says of time.
struct LogTimes {
  /// Of each case the newest time that was entered before it was opened: it is no older than that.
  std::map<std::string, UtcTime> before_case;
  std::optional<UtcTime> newest;  // of all entries
};
/// A log that is not there says nothing. Entries that are ahead of `now` are no bound of a case: the clock
/// was ahead when they were written, and each later case would be kept until then. Throws kiroku::Error for
/// one that cannot be read.
LogTimes read_log_times(const std::filesystem::path& log_folder, UtcTime now);

/// Why nobody knows by the wall clock how old a case is, a sentence; "" where it is believed: the kernel
/// calls it synchronised, and it is not more than a year ahead of the log's newest entry. A recorder stands
/// still for a summer, and not for years.
std::string why_clock_is_doubted(bool synchronised, UtcTime now, const LogTimes& log);

}  // namespace kiroku::archive
