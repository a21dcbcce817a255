#include "archive/upkeep/age.h"

#include <algorithm>
#include <chrono>
#include <variant>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/writing/log_reading.h"

namespace kiroku::archive {

namespace {

constexpr std::chrono::hours kLongestRest{366 * 24};

}  // namespace

void OpeningTime::take(const CaseEntry& entry) {
  if (ended_) {
    return;
  }
  if (std::holds_alternative<OpenEntry>(entry.body)) {
    latest_ = entry.at.utc;
    opened_ns_ = entry.at.mono_ns;
    return;
  }
  if (std::holds_alternative<ErasedEntry>(entry.body)) {
    ended_ = true;
    return;
  }
  if (!closed_) {
    point_to(entry.at.utc, entry.at.mono_ns);
  }
  if (const auto* token = std::get_if<TokenEntry>(&entry.body)) {
    point_to(token->gen_time, entry.at.mono_ns);
    // Of tokens that came after the end the first one is the closest bound: each renewal brings later ones.
    ended_ = closed_;
  }
  closed_ = closed_ || std::holds_alternative<CloseEntry>(entry.body);
}

// Of a clock that was right all the time every entry points to the same moment.
void OpeningTime::point_to(UtcTime time, std::int64_t mono_ns) {
  const auto since = std::chrono::duration_cast<UtcTime::duration>(
      std::chrono::nanoseconds(std::max<std::int64_t>(0, mono_ns - opened_ns_)));
  latest_ = std::max(latest_, time - since);
}

LogTimes read_log_times(const std::filesystem::path& log_folder, UtcTime now) {
  LogTimes times;
  std::error_code ignored;
  if (!std::filesystem::exists(log_folder / kLedgerFile, ignored)) {
    return times;
  }
  std::optional<UtcTime> bound;
  for_each_log_line(log_folder, [&](const LogLine& line) {
    if (line.type == "case-opened" && bound) {
      const LogEntryParse parse = parse_log_entry(line.json);
      const auto* opened = parse.entry ? std::get_if<CaseOpenedEntry>(&parse.entry->body) : nullptr;
      if (opened != nullptr) {
        times.before_case.try_emplace(opened->case_id, *bound);
      }
    }
    times.newest = std::max(times.newest.value_or(line.utc), line.utc);
    if (line.utc <= now) {
      bound = std::max(bound.value_or(line.utc), line.utc);
    }
  });
  return times;
}

std::string why_clock_is_doubted(bool synchronised, UtcTime now, const LogTimes& log) {
  if (!synchronised) {
    return "the kernel does not call this machine's clock synchronised, so that nobody knows how old the "
           "case "
           "is";
  }
  if (log.newest && now - *log.newest > kLongestRest) {
    return "this machine's clock shows " + format_utc(now) +
           ", and the newest entry of the appliance log is of " + format_utc(*log.newest) +
           ", more than a year before";
  }
  return "";
}

}  // namespace kiroku::archive
