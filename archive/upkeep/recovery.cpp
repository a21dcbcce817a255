#include "archive/upkeep/recovery.h"

#include <algorithm>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_tail.h"
#include "archive/format/pointing_stream.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/holds.h"
#include "archive/upkeep/retention.h"
#include "archive/upkeep/standby_folder.h"
#include "archive/verify/carried_on.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/verify/found_files.h"
#include "archive/writing/appliance_log.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// Why nothing that an erasure left is removed; "" where it may go. Throws kiroku::Error where nobody can
/// tell.
std::string why_left_now(const RecoveryOptions& options, const std::string& case_id) {
  if (!options.may_erase) {
    return "the appliance log is another one, so that nobody can tell what is held";
  }
  if (options.log == nullptr) {
    return "";
  }
  const std::string held =
      why_held(read_holds(options.log->folder(), {options.device_name, options.key->public_key()}), case_id);
  return held.empty() ? why_erasure_waits(options.log->folder(), case_id) : held;
}
using std::chrono::nanoseconds;

constexpr std::string_view kHiddenPrefix = ".new-";
/// A segment lasts no longer (docs/reference/format.md, "Layout").
constexpr std::int64_t kLongestSegmentNs = 10'000'000'000;
// Lines are sealed within a second.
constexpr std::int64_t kLongestUnsealedPointingNs = 1'000'000'000;
/// How far the wall clock may carry the case clock over a crash; beyond that it was probably set wrong, and
/// integers of the format end at 104 days.
constexpr nanoseconds kLongestBridge = std::chrono::hours(24 * 30);

std::int64_t ns_between(UtcTime earlier, UtcTime later) {
  return std::chrono::duration_cast<nanoseconds>(later - earlier).count();
}

std::string count_of(std::uint64_t number, const std::string& one, const std::string& many) {
  return std::to_string(number) + " " + (number == 1 ? one : many);
}

/// What the ledger says of one stream.
struct StreamStanding {
  StreamInfo info;
  std::uint64_t next_index = 0;
  std::int64_t end_ns = 0;  // of the last segment
  std::vector<Span> gaps;
  std::uint64_t units = 0;           // frames, samples or lines that are counted
  bool uncounted = false;            // and a segment whose are not
  bool interruption_stated = false;  // by an earlier recovery, and nothing was entered since

  /// Until when segments, and gaps that join on to them, account for the stream.
  [[nodiscard]] std::int64_t accounted_until() const {
    std::int64_t until = end_ns;
    for (const Span& gap : gaps) {
      if (gap.start_ns <= until && gap.end_ns > until) {
        until = gap.end_ns;
      }
    }
    return until;
  }
};

/// What the ledger of a case says, gathered while it is read.
struct Standing {
  std::vector<StreamStanding> streams;
  std::string boot_id;  // of the machine when it was last written
  Moment opened;        // of the first entry
  Moment last;          // of the last entry
  /// Of the last entry that the recorder wrote that died, and of its machine; an earlier recovery may have
  /// been cut off as well.
  std::optional<std::pair<Moment, std::string>> cut_off;
  std::optional<std::uint64_t> close;
  std::uint64_t newest_stamped = 0;  // largest checkpoint with a token
  bool missed_after_close = false;
  std::uint64_t marks = 0;
  std::set<std::pair<std::uint64_t, std::string>> tokens;
  std::vector<ErasedEntry> erased;
  OpenEntry opening;
  crypto::Sha256Digest opening_line{};

  void take(const CaseEntry& entry) {
    const Moment before = std::exchange(last, entry.at);
    if (const auto* open = std::get_if<OpenEntry>(&entry.body)) {
      opened = entry.at;
      opening = *open;
      boot_id = open->boot_id;
      for (const StreamInfo& info : open->streams) {
        streams.emplace_back();
        streams.back().info = info;
      }
      opening_line = crypto::sha256(bytes_of(to_line(entry)));
    } else if (const auto* segment = std::get_if<SegmentEntry>(&entry.body)) {
      StreamStanding& stream = of(segment->stream);
      stream.next_index = segment->index + 1;
      stream.units += segment->frames;
      stream.uncounted = stream.uncounted || !segment->counted;
      stream.end_ns = std::max(stream.end_ns, segment->span.end_ns);
      stream.interruption_stated = false;
    } else if (const auto* gap = std::get_if<GapEntry>(&entry.body); gap != nullptr && !gap->of_sound) {
      StreamStanding& stream = of(gap->stream);
      stream.gaps.push_back(gap->span);
      stream.interruption_stated = gap->cause == GapCause::kInterrupted;
    } else if (const auto* token = std::get_if<TokenEntry>(&entry.body)) {
      tokens.emplace(token->checkpoint, token->authority);
      newest_stamped = std::max(newest_stamped, token->checkpoint);
    } else if (const auto* missed = std::get_if<TokenMissedEntry>(&entry.body)) {
      missed_after_close = missed_after_close || (close && missed->checkpoint > *close);
    } else if (std::holds_alternative<MarkEntry>(entry.body)) {
      ++marks;
    } else if (const auto* gone = std::get_if<ErasedEntry>(&entry.body)) {
      erased.push_back(*gone);
    } else if (const auto* recovered = std::get_if<RecoveredEntry>(&entry.body)) {
      if (!cut_off) {
        cut_off.emplace(before, boot_id);
      }
      boot_id = recovered->boot_id;
    } else if (std::holds_alternative<CloseEntry>(entry.body)) {
      close = entry.seq;
    }
  }

  StreamStanding& of(const std::string& name) {
    const auto found = std::find_if(streams.begin(), streams.end(),
                                    [&](const StreamStanding& each) { return each.info.name == name; });
    if (found == streams.end()) {
      throw Error("its ledger has an entry of a stream \"" + name + "\" that open does not name");
    }
    return *found;
  }
};

/// One unfinished case on its way to its end.
class Recovery {
 public:
  Recovery(FileSystem& files, const RecoveryOptions& options, fs::path folder)
      : files_(files),
        options_(options),
        folder_(std::move(folder)),
        left_to_read_(options.most_found_bytes) {
    result_.case_id = folder_.filename().string();
    result_.folder = folder_;
  }

  CaseRecovery run() {
    try {
      bring_to_its_end();
    } catch (const Error& error) {
      refuse(error);
    } catch (const fs::filesystem_error& error) {
      refuse(error);
    }
    return std::move(result_);
  }

 private:
  /// One folder that cannot be read must not keep the recorder from its start.
  void refuse(const std::exception& error) {
    result_.outcome = CaseRecovery::Outcome::kRefused;
    result_.problem = error.what();
  }

  // Step by step, each durable before the next:
  //
  //   torn last line and unsigned end cut off → recovered, found segments, gaps (one append) → found tokens →
  //   close → checkpoint → token or token-missed → last checkpoint → case-closed in the appliance log
  //
  // A case that was closed already takes it up at the tokens.
  void bring_to_its_end() {
    writer_ = CaseWriter::resume(files_, folder_, *options_.key, options_.device_name, options_.log,
                                 [this](const CaseEntry& entry) { standing_.take(entry); });
    refuse_films_without_a_case();
    make_known_to_the_log();
    remove_unfinished_files(files_, folder_);
    const bool was_closed = standing_.close.has_value();
    result_.outcome = was_closed ? CaseRecovery::Outcome::kFinished : CaseRecovery::Outcome::kRecovered;
    if (!was_closed) {
      state_what_was_found();
    } else if (const std::uint64_t cut = writer_->unsigned_bytes(); cut > 0) {
      result_.problem = count_of(cut, "byte", "bytes") +
                        " behind the end of its ledger stated an erasure that nobody had signed, and were "
                        "cut off: nothing was erased";
    }
    adopt_tokens();
    if (!was_closed) {
      const std::string reason = close_reason();
      const Moment at = now();
      standing_.close = writer_->size();
      writer_->close(reason, at);
    }
    if (standing_.newest_stamped > *standing_.close) {
      result_.stamped = true;
    } else if (!standing_.missed_after_close) {
      result_.stamped = stamp_end(*writer_, options_.stamp, [this] { return now(); });
    }
    writer_->finish(now());
    finish_erasures();
  }

  /// Segments are begun when the case's opening is signed. Behind one that nobody signed they are not the
  /// recorder's: anybody can write an `open`, and seal a film to a recipient.
  void refuse_films_without_a_case() const {
    if (writer_->opening_vouched()) {
      return;
    }
    for (const StreamStanding& stream : standing_.streams) {
      const std::vector<FoundSegment> found = found_segments(files_, folder_, stream.info, 0);
      if (!found.empty()) {
        throw Error("nobody signed that case " + result_.case_id + " was opened, and " +
                    found.front().path.lexically_relative(folder_).string() +
                    " lies in it, which no recorder left there: `kiroku verify " + folder_.string() +
                    "` says more");
      }
    }
  }

  /// A kill between a case's first entry and the log's `case-opened` leaves a case that the log does not
  /// know. With more than that first entry it never was one of ours.
  void make_known_to_the_log() {
    if (options_.log == nullptr ||
        options_.log->case_state(result_.case_id) != ApplianceLog::CaseState::kUnknown) {
      return;
    }
    if (writer_->size() > 1) {
      throw Error("the appliance log does not know case " + result_.case_id + ", which has " +
                  std::to_string(writer_->size()) + " entries: `kiroku verify " + folder_.string() +
                  "` says more");
    }
    options_.log->case_opened(result_.case_id, standing_.opening_line);
  }

  /// While nobody recorded, the wall clock carries the case clock on; after `close` it stands.
  [[nodiscard]] Moment now() const {
    const UtcTime utc = options_.now();
    if (standing_.close) {
      return {utc, standing_.last.mono_ns};
    }
    return {utc, standing_.last.mono_ns + std::clamp<std::int64_t>(ns_between(standing_.last.utc, utc), 0,
                                                                   kLongestBridge.count())};
  }

  [[nodiscard]] std::string close_reason() {
    if (!options_.carry_on) {
      return "recovered";
    }
    const crypto::VerifierKey device = crypto::verifier_key_of(options_.device_name, *options_.key);
    const Announced announced = writer_->opening_vouched()
                                    ? Announced::kYes
                                    : announced_by_earlier(folder_, standing_.opening, device, files_);
    if (announced == Announced::kNo) {
      result_.problem = "it is not carried on, since it ended before anybody signed that it was opened";
      return "recovered";
    }
    CutOffCase cut{result_.case_id, folder_, standing_.boot_id, standing_.opened, standing_.last};
    if (standing_.cut_off) {
      std::tie(cut.last, cut.boot_id) = *standing_.cut_off;
    }
    cut.brings_subject = announced == Announced::kWithOtherSubject;
    const std::string later = options_.carry_on(cut);
    return later.empty() ? "recovered" : reason_to_be_carried_on(later);
  }

  void state_what_was_found() {
    const Moment at = now();
    std::vector<CaseEntryBody> entries;
    std::vector<std::string> cut;
    if (const std::uint64_t torn = writer_->torn_bytes(); torn > 0) {
      cut.push_back(count_of(torn, "byte", "bytes") + " behind the last whole line of the ledger");
    }
    if (const std::uint64_t nobodys = writer_->unsigned_bytes(); nobodys > 0) {
      cut.push_back(count_of(nobodys, "byte", "bytes") +
                    " of the ledger, from a close or an erasure on that nobody had signed");
    }
    for (StreamStanding& stream : standing_.streams) {
      adopt_segments(stream, at, entries, cut);
      state_gap(stream, at, entries);
    }
    RecoveredEntry recovered;
    recovered.boot_id = options_.boot_id;
    recovered.after = options_.boot_id == standing_.boot_id ? "crash" : "power-loss";
    for (const std::string& each : cut) {
      recovered.truncated += (recovered.truncated.empty() ? "" : "; ") + each;
    }
    result_.after = recovered.after;
    result_.truncated = recovered.truncated;
    entries.insert(entries.begin(), recovered);
    writer_->append(entries, at);
  }

  void adopt_segments(StreamStanding& stream, const Moment& at, std::vector<CaseEntryBody>& entries,
                      std::vector<std::string>& cut) {
    std::vector<FoundSegment> all = found_segments(files_, folder_, stream.info, stream.next_index);
    leave_what_no_recorder_leaves(stream, all, cut);
    const std::uint64_t end = end_of_contents(all);
    for (const FoundSegment& found : all) {
      const std::string name = found.path.filename().string();
      if (found.index >= end) {
        files_.remove(found.path);
        cut.push_back(stream.info.name + "/" + name + ", removed because nothing was sealed in it yet");
        continue;
      }
      if (found.index != stream.next_index) {
        result_.problem = found.path.string() + " is left as it is, since the segment before it is not there";
        continue;
      }
      SegmentEntry entry;
      entry.stream = stream.info.name;
      entry.index = found.index;
      entry.span = estimated_span(stream, found, at);
      entry.complete = found.complete;
      entry.counted = false;
      entry.file = make_durable(files_, found.path);
      entry.file.file = found.whole;
      if (!found.complete) {
        entry.file.file += kPartSuffix;
        cut.push_back(stream.info.name + "/" + name + ", of which " +
                      count_of(entry.file.bytes, "byte is", "bytes are") + " there" +
                      zeros_text(look_into(files_, found.path).zeros_at_end));
        ++result_.incomplete;
      }
      ++result_.segments;
      ++stream.next_index;
      stream.uncounted = true;
      stream.end_ns = entry.span.end_ns;
      stream.interruption_stated = false;
      entries.emplace_back(std::move(entry));
    }
  }

  /// The start waits for what is read here, so that is bounded: a recorder that dies leaves a few seconds of
  /// each stream, and whoever writes to the disk as many files as they like, as long as they like, which may
  /// be holes and take no room. Nor does a recorder give its final name to what it did not seal. From the
  /// first file on that is of none the stream's are neither entered nor removed, and all of their time is a
  /// gap.
  void leave_what_no_recorder_leaves(const StreamStanding& stream, std::vector<FoundSegment>& all,
                                     std::vector<std::string>& cut) {
    const std::size_t most = stream.info.timing == "arrival" ? kMostFoundSegments : kMostFoundOfFilms;
    for (auto found = all.begin(); found != all.end();) {
      const bool is_one_too_many = found - all.begin() >= static_cast<std::ptrdiff_t>(most);
      const std::string why = is_one_too_many
                                  ? "more files lie there without an entry than a recorder that dies leaves"
                                  : why_left(stream, *found);
      if (why.empty()) {
        ++found;
        continue;
      }
      const std::string name = stream.info.name + "/" + found->path.filename().string();
      result_.problem = found->path.string() + " is left as it is: " + why;
      const auto next = std::next(found);
      // Where a part lies beside it, that is the recorder's.
      if (!is_one_too_many && next != all.end() && next->index == found->index) {
        cut.push_back(name + ", left as it is: " + why);
        found = all.erase(found);
        continue;
      }
      cut.push_back(name + " and what follows it, left as they are: " + why);
      all.erase(found, all.end());
      return;
    }
  }

  /// "" where it may be the recorder's.
  std::string why_left(const StreamStanding& stream, const FoundSegment& found) {
    std::error_code error;
    const std::uint64_t bytes = fs::file_size(found.path, error);
    if (error) return "it cannot be examined: " + error.message();
    if (bytes > kMaximumSealedBytes) {
      return "it has " + count_of(bytes, "byte", "bytes") + ", and a segment at most 1 GiB";
    }
    if (found.complete && !may_be_found_complete(files_.open_to_read(found.path), stream.info)) {
      return "it has the name of a segment that was sealed to its end, and is no sealed file";
    }
    if (bytes > left_to_read_) return "more lies there without an entry than a recorder that dies leaves";
    left_to_read_ -= bytes;
    return "";
  }

  /// One more than the last index with something sealed in its file. What lies before it is entered even if
  /// it holds nothing, so that indexes have no hole.
  [[nodiscard]] std::uint64_t end_of_contents(const std::vector<FoundSegment>& all) const {
    std::uint64_t end = 0;
    for (const FoundSegment& found : all) {
      if (found.complete || look_into(files_, found.path).holds_sealed_bytes) {
        end = std::max(end, found.index + 1);
      }
    }
    return end;
  }

  /// What was sealed ends with a zero now and then, with a disk's sector of them only where it was not
  /// flushed.
  static std::string zeros_text(std::uint64_t zeros) {
    constexpr std::uint64_t kSector = 512;
    return zeros < kSector ? "" : ", the last " + std::to_string(zeros) + " of them zeros";
  }

  /// From where the stream was accounted for to the file's last change. Of a stream that stated its own times
  /// the file's say nothing.
  [[nodiscard]] Span estimated_span(const StreamStanding& stream, const FoundSegment& found,
                                    const Moment& at) const {
    const std::int64_t start_ns = stream.accounted_until();
    if (stream.info.timing != "arrival") {
      return {start_ns, start_ns};
    }
    const std::int64_t changed_ns =
        standing_.last.mono_ns + ns_between(standing_.last.utc, found.last_change);
    const std::int64_t latest_ns = std::min(std::max(at.mono_ns, start_ns), start_ns + kLongestSegmentNs);
    return {start_ns, std::clamp(changed_ns, start_ns, latest_ns)};
  }

  /// Events have segments only where something was marked: while every mark of the ledger is sealed, nothing
  /// is missing.
  [[nodiscard]] std::int64_t lost_since(const StreamStanding& stream) const {
    if (is_pointing(stream.info)) {
      return std::max(stream.accounted_until(), standing_.last.mono_ns - kLongestUnsealedPointingNs);
    }
    const bool all_sealed =
        stream.info.kind == "events" && (stream.uncounted || standing_.marks <= stream.units);
    return all_sealed ? std::max(stream.accounted_until(), standing_.last.mono_ns) : stream.accounted_until();
  }

  void state_gap(StreamStanding& stream, const Moment& at, std::vector<CaseEntryBody>& entries) {
    if (stream.interruption_stated) {
      return;
    }
    const std::int64_t start_ns = lost_since(stream);
    GapEntry gap{stream.info.name, {start_ns, std::max(start_ns, at.mono_ns)}, GapCause::kInterrupted};
    result_.gaps.push_back(gap);
    entries.emplace_back(std::move(gap));
  }

  void adopt_tokens() {
    const CaseFolder folder = CaseFolder::open(folder_, files_);
    std::vector<TokenName> found = found_tokens(folder_, files_);
    std::erase_if(found, [&](const TokenName& name) {
      return standing_.tokens.contains({name.size, name.authority}) || name.size > writer_->size();
    });
    std::size_t left = 0;
    found = tokens_to_judge(std::move(found), folder_, files_, left);
    if (left > 0) {
      result_.problem = count_of(left, "token is", "tokens are") +
                        " not looked into: more lie there without an entry than a recorder that dies leaves";
    }
    for (const TokenName& name : found) {
      // Another form of one that was taken just now.
      if (standing_.tokens.contains({name.size, name.authority})) continue;
      const std::optional<TokenEntry> facts = token_in_folder(folder, name, options_.trust);
      if (!facts) {
        result_.problem = token_path(name.size, name.authority, name.form) +
                          " is left as it is: it is no valid token over that checkpoint";
        continue;
      }
      writer_->adopt_token(name, *facts, now());
      standing_.tokens.emplace(name.size, name.authority);
      standing_.newest_stamped = std::max(standing_.newest_stamped, name.size);
      ++result_.tokens;
    }
  }

  /// An erasure that was cut off: its entry is there, and perhaps not yet the log's.
  void finish_erasures() {
    const std::vector<fs::path> left = files_to_erase(files_, folder_, standing_.erased);
    if (left.empty()) {
      return;
    }
    const ErasingTurn turn(options_.archive);
    if (const std::string why = why_left_now(options_, result_.case_id); !why.empty()) {
      result_.problem = "what is left of an erasure that was cut off stays: " + why;
      return;
    }
    if (options_.log != nullptr) {
      options_.log->erased(result_.case_id, standing_.erased.back().stream, standing_.erased.back().policy);
    }
    remove_erased(files_, left);
    result_.erased_files = left.size();
  }

  FileSystem& files_;
  const RecoveryOptions& options_;
  fs::path folder_;
  Standing standing_;
  std::unique_ptr<CaseWriter> writer_;
  std::uint64_t left_to_read_;
  CaseRecovery result_;
};

/// Whether the case was brought to its end: closed, covered by a checkpoint, not open by the log. (One that
/// the log does not know at all came from elsewhere.)
bool is_finished(const FileReading& files, const fs::path& folder, const RecoveryOptions& options) {
  const ApplianceLog* const log = options.log;
  if (log != nullptr && log->case_state(folder.filename().string()) == ApplianceLog::CaseState::kOpened) {
    return false;
  }
  const std::optional<LedgerTail> tail = read_ledger_tail(folder, files);
  try {
    return tail && tail->closed && tail->covered &&
           (files_to_erase(files, folder, tail->erased).empty() ||
            !why_left_now(options, folder.filename().string()).empty());
  } catch (const Error&) {
    return false;  // whoever takes the case up says what cannot be read
  }
}

CaseRecovery refused(const fs::path& folder, const std::string& problem) {
  CaseRecovery result;
  result.case_id = folder.filename().string();
  result.folder = folder;
  result.outcome = CaseRecovery::Outcome::kRefused;
  result.problem = problem;
  return result;
}

CaseRecovery remove_hidden(FileSystem& files, const fs::path& folder) {
  CaseRecovery result;
  result.case_id = folder.filename().string().substr(kHiddenPrefix.size());
  result.folder = folder;
  result.outcome = CaseRecovery::Outcome::kNotBegun;
  try {
    remove_tree(files, folder);
    files.sync_folder(folder.parent_path());
  } catch (const Error& error) {
    result.outcome = CaseRecovery::Outcome::kRefused;
    result.problem = error.what();
  }
  return result;
}

}  // namespace

std::vector<CaseRecovery> recover_archive(FileSystem& files, const RecoveryOptions& options,
                                          const RecordingLock& /*lock*/) {
  std::set<fs::path> hidden;
  std::set<fs::path> unfinished;
  std::vector<CaseRecovery> results;
  for (const std::string& name : files.names_in(options.archive)) {
    const fs::path folder = options.archive / name;
    const bool is_hidden = name.starts_with(kHiddenPrefix) && is_case_id(name.substr(kHiddenPrefix.size()));
    if (!is_hidden && !is_case_id(name)) {
      continue;
    }
    try {
      if (!files.is_folder(folder)) {
        continue;
      }
    } catch (const IoError& error) {
      results.push_back(refused(folder, error.what()));
      continue;
    }
    if (is_hidden) {
      hidden.insert(folder);
    } else if (!is_excerpt(folder, files) && !is_finished(files, folder, options)) {
      unfinished.insert(folder);
    }
  }
  for (const fs::path& folder : hidden) {
    results.push_back(remove_hidden(files, folder));
  }
  const AbandonedStandby ahead = remove_abandoned_standby(files, options.archive);
  if (ahead.segments > 0 && options.log != nullptr) {
    options.log->pre_roll_discarded(ahead.segments, {});
  }
  for (const auto& [folder, problem] : ahead.left) {
    results.push_back(refused(folder, problem));
  }
  for (const fs::path& folder : unfinished) {
    results.push_back(Recovery(files, options, folder).run());
  }
  return results;
}

}  // namespace kiroku::archive
