#include "recorder/daemon/resumption.h"

#include <algorithm>
#include <ctime>
#include <set>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "archive/format/segment_media.h"
#include "archive/verify/found_files.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "crypto/merkle_tree.h"
#include "crypto/signed_note.h"
#include "recorder/clock/clock_watch.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using std::chrono::nanoseconds;

constexpr std::size_t kLargestSubject = 16U << 20U;
constexpr std::chrono::seconds kBetweenReadings{1};

nanoseconds read_clock(clockid_t which) {
  timespec time{};
  ::clock_gettime(which, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

std::string in_words(nanoseconds time) {
  const auto seconds = std::chrono::ceil<std::chrono::seconds>(time).count();
  return seconds < 120 ? std::to_string(seconds) + " s" : std::to_string(seconds / 60) + " min";
}

bool is_there(const fs::path& folder) {
  std::error_code error;
  return fs::symlink_status(folder, error).type() == fs::file_type::directory;
}

/// By the device of the case that `open` begins.
bool is_signed_by_its_device(const NewestSubject& subject, const archive::OpenEntry& open) {
  try {
    return is_signed(subject, crypto::VerifierKey::parse(open.device).key());
  } catch (const Error&) {
    return false;
  }
}

/// Whether the subject that a case begins with is what the note says of the case before.
bool is_newest_of_earlier(const RunningCase& running, const archive::OpenEntry& open) {
  return running.subject && open.subject && running.subject->case_id == running.carries_on &&
         crypto::sha256(running.subject->sealed) == open.subject->sha256 &&
         is_signed_by_its_device(*running.subject, open);
}

bool may_tell_of(std::string_view line, std::string_view type) {
  return line.find("\"" + std::string(type) + "\"") != std::string_view::npos;
}

/// Nobody wanted the case ended, and no rule did: somebody restarted the recorder, or an error ended it.
bool is_unwanted_end(const std::string& close_reason) {
  return close_reason == "shutdown" || close_reason == "disk-full" || close_reason.starts_with("error: ");
}

}  // namespace

MachineTime machine_time() {
  return {utc_now(), read_clock(CLOCK_MONOTONIC), read_clock(CLOCK_BOOTTIME),
          read_kernel_clock().synchronised};
}

TimeSinceCut time_since(const archive::CutOffCase& cut, const MachineTime& now, const std::string& boot_id,
                        const KnownOpening& opening) {
  if (cut.boot_id == boot_id && opening.logged) {
    const nanoseconds in_this_boot = std::max(nanoseconds(0), now.since_boot - now.monotonic);
    const nanoseconds recorded(cut.last.mono_ns - cut.opened.mono_ns);
    const nanoseconds awake = now.monotonic - *opening.logged;
    // The two clocks are read one after the other.
    const bool is_known = opening.suspended && *opening.suspended >= -kBetweenReadings &&
                          *opening.suspended <= in_this_boot + kBetweenReadings;
    if (is_known || in_this_boot <= kBetweenReadings) {
      const nanoseconds before = is_known ? *opening.suspended : nanoseconds(0);
      // The case clock goes on in suspension, too.
      return {std::max(nanoseconds(0), awake + (in_this_boot - before) - recorded), "by the monotonic clock"};
    }
    return {std::max(nanoseconds(0), awake - recorded) + in_this_boot,
            "by the monotonic clock, when the machine slept is not known", true};
  }
  const auto elapsed = std::chrono::duration_cast<nanoseconds>(now.utc - cut.last.utc);
  // Another boot began after the cut. A wall clock that says otherwise was set back, or lost its time.
  const nanoseconds at_least = cut.boot_id == boot_id ? nanoseconds(0) : now.since_boot;
  if (elapsed < at_least) {
    return {std::nullopt, "the wall clock shows " + format_utc(now.utc) +
                              " and the case was recorded until " + format_utc(cut.last.utc) +
                              ", so that how long ago that was is not known"};
  }
  return {elapsed,
          now.is_synchronised ? "by the wall clock" : "by the wall clock, which nobody has synchronised"};
}

/// What of a case's ledger decides.
struct ResumptionPlanner::Facts {
  archive::OpenEntry open;
  archive::CutOffCase cut;
  std::string close_reason;  // "": it is not closed
  archive::CarriedOn named;  // as a later case names it
  [[nodiscard]] nanoseconds duration() const {
    return nanoseconds(std::max<std::int64_t>(0, cut.last.mono_ns - open.begins_ns));
  }
};

std::optional<ResumptionPlanner::Facts> ResumptionPlanner::facts_of(const fs::path& folder) {
  try {
    const archive::FileOpening ledger = archive::CaseFolder::open(folder).open_file(archive::kLedgerFile);
    if (!ledger.file) return {};
    Facts facts;
    facts.named.case_id = facts.cut.case_id = folder.filename().string();
    facts.cut.folder = folder;
    const std::uint64_t covered = archive::newest_note(folder);
    crypto::MerkleFrontier tree;
    archive::LineReader reader(*ledger.file);
    archive::LedgerLine line;
    std::string before, newest;
    bool cut_off = false;
    const auto set_end = [&](const std::string& text) {
      if (const auto parse = archive::parse_case_entry(text); parse.entry) facts.cut.last = parse.entry->at;
    };
    while (reader.next(line) && !line.torn && !line.too_long) {
      before = std::exchange(newest, std::string(line.text));
      tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
      if (tree.size() == covered) {
        facts.named.size = covered;
        facts.named.root = tree.root();
      }
      if (tree.size() > 1 && !may_tell_of(newest, "recovered") && !may_tell_of(newest, "close")) continue;
      const archive::EntryParse parse = archive::parse_case_entry(newest);
      if (!parse.entry) return {};
      if (const auto* open = std::get_if<archive::OpenEntry>(&parse.entry->body)) {
        facts.open = *open;
        facts.cut.boot_id = open->boot_id;
        facts.cut.opened = facts.cut.last = parse.entry->at;
      } else if (std::holds_alternative<archive::RecoveredEntry>(parse.entry->body) && !cut_off) {
        cut_off = true;
        set_end(before);
      } else if (const auto* close = std::get_if<archive::CloseEntry>(&parse.entry->body)) {
        facts.close_reason = close->reason;
        if (!cut_off) facts.cut.last = parse.entry->at;
        cut_off = true;
      }
    }
    if (tree.size() == 0) return {};
    if (!cut_off) set_end(newest);
    return facts;
  } catch (const Error&) {
    return {};
  }
}

ResumptionPlanner::ResumptionPlanner(Context context, std::vector<ResumeRule> rules)
    : context_(std::move(context)), rules_(std::move(rules)) {}

void ResumptionPlanner::tell(const std::string& room, const std::string& sentence) const {
  if (context_.tell) context_.tell(room, sentence);
}

std::optional<RunningCase> ResumptionPlanner::newest_of(const ResumeRule& rule) const {
  std::optional<RunningCase> running = rule.note->read();
  if (!running) return {};
  // The note is written before the case is made, and cut off in between the earlier one is the newest.
  if (!is_there(context_.archive / running->case_id)) {
    running->case_id = running->carries_on;
    running->suspended.reset();
  }
  if (running->case_id.empty() || !is_there(context_.archive / running->case_id)) return {};
  return running;
}

std::optional<nanoseconds> ResumptionPlanner::logged_opening(const std::string& case_id) const {
  std::optional<nanoseconds> opened;
  bool this_boot = false;
  const auto visit = [&](const archive::LogLine& line) {
    if (line.type != "boot" && (line.type != "case-opened" || !may_tell_of(line.json, case_id))) return;
    const archive::LogEntryParse parse = archive::parse_log_entry(line.json);
    if (!parse.entry) return;
    if (const auto* boot = std::get_if<archive::BootEntry>(&parse.entry->body)) {
      this_boot = boot->boot_id == context_.boot_id;
    } else if (this_boot) {
      opened = nanoseconds(parse.entry->at.mono_ns);
    }
  };
  try {
    archive::for_each_log_line(context_.archive / "log", visit);
  } catch (const Error&) {
    return {};  // a boot may stand in the line that cannot be read; the wall clock decides
  }
  return opened;
}

std::string ResumptionPlanner::refusal_by_history(const ResumeRule& rule, const Facts& newest,
                                                  nanoseconds& recorded) const {
  int short_cases = 0;
  bool only_short = true;
  std::set<std::string> seen;
  recorded = nanoseconds(0);
  std::optional<Facts> facts = newest;
  while (facts && seen.insert(facts->cut.case_id).second) {
    recorded += facts->duration();
    only_short = only_short && facts->duration() < kShortCase;
    if (only_short) ++short_cases;
    const auto earlier = archive::carried_on_by(facts->open);
    facts = earlier ? facts_of(context_.archive / earlier->case_id) : std::nullopt;
  }
  if (short_cases >= kMostShortCases) {
    return "the last " + std::to_string(short_cases) + " cases were each cut off within " +
           in_words(kShortCase) + ": the recorder seems to die as soon as it records";
  }
  if (recorded >= rule.longest) {
    return "it was recorded for " + in_words(recorded) + ", and longest_case is " + in_words(rule.longest);
  }
  return "";
}

TimeSinceCut ResumptionPlanner::since(const RunningCase& running, const archive::CutOffCase& cut) const {
  return time_since(cut, context_.now(), context_.boot_id, {logged_opening(cut.case_id), running.suspended});
}

std::string ResumptionPlanner::refusal(const ResumeRule& rule, const RunningCase& running,
                                       const archive::CutOffCase& cut, const Facts& facts) const {
  const TimeSinceCut since = this->since(running, cut);
  if (!since.elapsed) return since.why;
  if (*since.elapsed >= rule.within) {
    return "it was cut off " +
           (since.is_bound ? "at most " + in_words(std::chrono::ceil<std::chrono::minutes>(*since.elapsed))
                           : in_words(*since.elapsed)) +
           " ago " + since.why + ", and resume_within is " + in_words(rule.within);
  }
  nanoseconds recorded{0};
  return refusal_by_history(rule, facts, recorded);
}

std::string ResumptionPlanner::carry_on(const archive::CutOffCase& cut) {
  for (const ResumeRule& rule : rules_) {
    const auto running = newest_of(rule);
    if (!running || running->case_id != cut.case_id) continue;
    if (running->ending) return "";  // somebody had ended it
    std::string why = "its ledger cannot be read";
    if (const auto facts = facts_of(cut.folder)) {
      why =
          cut.brings_subject && !is_newest_of_earlier(*running, facts->open)
              ? "it ended before anybody signed that it was opened, and its subject is not that of the case "
                "before"
              : refusal(rule, *running, cut, *facts);
    }
    if (!why.empty()) {
      decided_[cut.case_id] = "";
      tell(rule.room, "case " + cut.case_id + " was cut off and is not carried on: " + why +
                          ". Begin a case by hand where the operation goes on");
      return "";
    }
    return decided_[cut.case_id] = archive::new_case_id(context_.now().utc);
  }
  return "";
}

void ResumptionPlanner::tell_of_end(const ResumeRule& rule, const RunningCase& running,
                                    const Facts& facts) const {
  const TimeSinceCut since = this->since(running, facts.cut);
  if (since.elapsed && *since.elapsed >= rule.within) return;
  tell(rule.room, "case " + facts.cut.case_id + " was ended (" + facts.close_reason +
                      ") while its operation went on, and is not carried on. Begin a case by hand where the "
                      "operation goes on");
}

std::optional<Resumption> ResumptionPlanner::of(const std::string& room) {
  const auto rule =
      std::find_if(rules_.begin(), rules_.end(), [&](const ResumeRule& each) { return each.room == room; });
  if (rule == rules_.end()) return {};
  const auto running = newest_of(*rule);
  if (!running) return {};
  const auto facts = facts_of(context_.archive / running->case_id);
  if (facts && is_unwanted_end(facts->close_reason)) {
    tell_of_end(*rule, *running, *facts);
    return {};
  }
  if (running->ending) return {};
  if (!facts || facts->close_reason.empty() || facts->named.size == 0) {
    tell(room, "case " + running->case_id +
                   " was cut off and is not carried on, since it could not be brought to its end. Begin a "
                   "case by hand where the operation goes on");
    return {};
  }
  const auto later = archive::announced_by(facts->close_reason);
  if (!later || is_there(context_.archive / *later)) return {};
  Resumption resumption;
  if (const auto decided = decided_.find(running->case_id);
      decided == decided_.end() || decided->second != *later) {
    // An earlier start announced it and was cut off itself.
    if (const std::string why = refusal(*rule, *running, facts->cut, *facts); !why.empty()) {
      tell(room, "case " + running->case_id + " was to be carried on and is not: " + why +
                     ". Begin a case by hand where the operation goes on");
      return {};
    }
  }
  static_cast<void>(refusal_by_history(*rule, *facts, resumption.recorded));
  resumption.case_id = *later;
  resumption.earlier = facts->named;
  resumption.plan = facts->open.plan;
  resumption.profiles = last_profiles_of(facts->cut.folder);
  resumption.reason = running->reason;
  resumption.within = rule->within;
  resumption.sealed_subject = newest_subject_of(room, *running, *facts);
  const bool had_one =
      facts->open.subject || (running->subject && running->subject->case_id == facts->cut.case_id);
  resumption.is_subject_withheld = had_one && !resumption.sealed_subject;
  return resumption;
}

std::optional<Bytes> ResumptionPlanner::newest_subject_of(const std::string& room, const RunningCase& running,
                                                          const Facts& facts) const {
  const auto& newest = running.subject;
  if (!newest || newest->case_id != facts.cut.case_id) {
    return sealed_subject_of(facts.cut.folder, facts.open,
                             [&](const std::string& sentence) { tell(room, sentence); });
  }
  if (is_signed_by_its_device(*newest, facts.open)) return newest->sealed;
  // Not the one at the beginning in its place: that may be the one which it corrected.
  tell(room, "the subject of case " + facts.cut.case_id +
                 " cannot be carried over: the room's note is not as this device signed it");
  return {};
}

std::optional<Bytes> sealed_subject_of(const fs::path& folder, const archive::OpenEntry& open,
                                       const std::function<void(const std::string& sentence)>& tell) {
  if (!open.subject) return {};
  const archive::FileOpening file = archive::CaseFolder::open(folder).open_file(archive::kSubjectFile);
  const auto sealed = file.file ? archive::read_small(*file.file, kLargestSubject) : std::nullopt;
  if (sealed && crypto::sha256(bytes_of(*sealed)) == open.subject->sha256) return to_bytes(bytes_of(*sealed));
  tell("the subject of case " + folder.filename().string() +
       " cannot be carried over: " + std::string(archive::kSubjectFile) + " is not as its ledger states it");
  return {};
}

Profiles last_profiles_of(const fs::path& folder) {
  Profiles profiles;
  std::map<std::string, archive::StreamInfo> streams;
  try {
    const archive::FileOpening ledger = archive::CaseFolder::open(folder).open_file(archive::kLedgerFile);
    if (!ledger.file) return {};
    archive::LineReader reader(*ledger.file);
    archive::LedgerLine line;
    while (reader.next(line) && !line.torn && !line.too_long) {
      if (!streams.empty() && !may_tell_of(line.text, "segment")) continue;
      const archive::EntryParse parse = archive::parse_case_entry(line.text);
      if (!parse.entry) return {};
      if (const auto* open = std::get_if<archive::OpenEntry>(&parse.entry->body)) {
        for (const archive::StreamInfo& stream : open->streams) streams[stream.name] = stream;
      } else if (const auto* segment = std::get_if<archive::SegmentEntry>(&parse.entry->body)) {
        const auto profile = parse_profile(archive::profile_of(streams[segment->stream], *segment));
        if (profile && streams[segment->stream].kind == "video") profiles[segment->stream] = *profile;
      }
    }
  } catch (const Error&) {
    return {};
  }
  return profiles;
}

}  // namespace kiroku::recorder
