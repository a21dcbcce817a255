#include "archive/reading/excerpt.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "archive/format/age_layout.h"
#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/format/sealed_file.h"
#include "archive/storage/file_system.h"
#include "archive/verify/authority_files.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/folder_names.h"
#include "base/error.h"
#include "base/near_miss.h"
#include "base/printable.h"
#include "crypto/age_file.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCopyBytes = 1U << 20U;

/// What an excerpt needs to know of the whole ledger.
struct Survey {
  OpenEntry opening;
  std::int64_t opened_ns = 0;
  crypto::MerkleTree tree;
  std::map<std::uint64_t, TokenEntry> tokens;  // by entry
  std::vector<std::pair<std::uint64_t, SegmentEntry>> segments;
  std::vector<std::pair<std::uint64_t, GapEntry>> gaps;        // of the streams themselves,
  std::vector<std::pair<std::uint64_t, GapEntry>> sound_gaps;  // and of their sound
  std::map<std::uint64_t, bool> rates;  // clock entries that state one; whether it is a slew
  std::vector<std::uint64_t> recovered;
  std::optional<std::uint64_t> close;
  std::uint64_t last_before = 0;  // the last entry that was written before the selected time
  std::int64_t end_ns = 0;        // latest time that an entry states
};

[[noreturn]] void refuse_line(const CaseFolder& folder, std::uint64_t number, const std::string& problem) {
  throw Error("cannot take an excerpt of " + folder.path().string() + ": entry " + std::to_string(number) +
              " cannot be read: " + problem + "; see what `kiroku verify` says of the case");
}

ReadableFile open_or_refuse(const CaseFolder& folder, const std::string& file) {
  FileOpening opening = folder.open_file(file);
  if (!opening.file) {
    throw UsageError("cannot take an excerpt of " + folder.path().string() + ": " + file + " " +
                     opening.explanation + "; see what `kiroku verify` says of the case");
  }
  return std::move(*opening.file);
}

Survey survey(const CaseFolder& folder, const ReadableFile& ledger, std::int64_t from_ns) {
  Survey result;
  LineReader reader(ledger);
  LedgerLine line;
  while (reader.next(line) && !line.torn) {
    const std::uint64_t number = result.tree.size();
    EntryParse parse =
        line.too_long ? EntryParse{std::nullopt, "its line is too long", {}} : parse_case_entry(line.text);
    if (!parse.entry) {
      refuse_line(folder, number, parse.problem);
    }
    result.tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    CaseEntryBody& body = parse.entry->body;
    result.last_before = parse.entry->at.mono_ns <= from_ns ? number : result.last_before;
    result.end_ns = std::max(result.end_ns, parse.entry->at.mono_ns);
    if (number == 0) {
      if (!std::holds_alternative<OpenEntry>(body)) {
        refuse_line(folder, 0, "it is not `open`");
      }
      result.opening = std::get<OpenEntry>(std::move(body));
      result.opened_ns = parse.entry->at.mono_ns;
    } else if (auto* segment = std::get_if<SegmentEntry>(&body)) {
      result.end_ns = std::max(result.end_ns, segment->span.end_ns);
      result.segments.emplace_back(number, std::move(*segment));
    } else if (auto* gap = std::get_if<GapEntry>(&body)) {
      (gap->of_sound ? result.sound_gaps : result.gaps).emplace_back(number, std::move(*gap));
    } else if (const auto* clock = std::get_if<ClockEntry>(&body); clock != nullptr && clock->rate_ppb) {
      result.rates.emplace(number, std::abs(*clock->rate_ppb) > kSlewPpb);
    } else if (std::holds_alternative<RecoveredEntry>(body)) {
      result.recovered.push_back(number);
    } else if (auto* token = std::get_if<TokenEntry>(&body)) {
      result.tokens.emplace(number, std::move(*token));
    } else if (std::holds_alternative<CloseEntry>(body)) {
      result.close = number;
    }
  }
  if (result.tree.size() == 0) {
    refuse_line(folder, 0, "there is none");
  }
  return result;
}

std::vector<std::string> selected_streams(const OpenEntry& opening, const std::vector<std::string>& asked) {
  std::vector<std::string> names;
  std::string listed;
  std::vector<std::string> known;
  for (const StreamInfo& stream : opening.streams) {
    listed += (listed.empty() ? "" : ", ") + stream.name;
    known.push_back(stream.name);
    if (asked.empty() || std::find(asked.begin(), asked.end(), stream.name) != asked.end()) {
      names.push_back(stream.name);
    }
  }
  for (const std::string& name : asked) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      throw UsageError("case " + opening.case_id + " has no stream \"" + name + "\"; it has " + listed +
                       did_you_mean(name, known));
    }
  }
  return names;
}

/// The first entry that shows what a stream, which is recorded as it comes and has no segment yet as the time
/// begins, has until its first one: its first gap, or nothing from `open` on.
std::uint64_t first_of_beginning(const Survey& ledger, const std::string& stream, std::int64_t begins_ns) {
  for (const auto& [entry, gap] : ledger.gaps) {
    if (gap.stream == stream && gap.span.start_ns < begins_ns) {
      return entry;
    }
  }
  return 1;
}

/// Entries that must be among the lines: those of the segments wanted, and for each stream enough around them
/// to show that nothing of the selected time is left out.
std::pair<std::uint64_t, std::uint64_t> needed_entries(const Survey& ledger,
                                                       const ExcerptDocument& document) {
  std::uint64_t first = ledger.tree.size() - 1;
  std::uint64_t last = 0;
  if (ledger.opening.begins_ns > 0 && document.from_ns < ledger.opened_ns) {
    first = 1;  // of the time before `open` the case's oldest stream tells, whichever that is
  }
  for (const std::string& stream : document.streams) {
    std::optional<std::uint64_t> before;
    std::optional<std::uint64_t> after;
    std::int64_t begins_ns = INT64_MAX;
    for (const auto& [entry, segment] : ledger.segments) {
      if (segment.stream != stream) {
        continue;
      }
      begins_ns = std::min(begins_ns, segment.span.start_ns);
      if (!before || segment.span.start_ns <= document.from_ns) {
        before = entry;
      }
      if (!after && segment.span.end_ns >= document.to_ns) {
        after = entry;
      }
    }
    // Of a stream without a segment only entries from before the time show that it had none until then; of
    // one that states its own times, all entries.
    const auto info = std::find_if(ledger.opening.streams.begin(), ledger.opening.streams.end(),
                                   [&](const StreamInfo& each) { return each.name == stream; });
    first = std::min(first, before.value_or(info->timing == "arrival" ? ledger.last_before : 1));
    const bool of_marks = info->kind == "events" && info->media == kLinesMedia;
    if (begins_ns > document.from_ns && !of_marks && info->timing == "arrival") {
      first = std::min(first, first_of_beginning(ledger, stream, begins_ns));
    }
    last = std::max(last, after.value_or(ledger.close.value_or(ledger.tree.size() - 1)));
  }
  return {std::min(first, last), last};
}

/// The first entry that says why streams pause between the segments that are among the lines from `first` on,
/// or why nobody counted one. A gap may be entered before the segment in front of it. `first` where all such
/// entries are among the lines.
std::uint64_t first_explanation(const Survey& ledger, std::uint64_t first) {
  std::map<std::string, std::int64_t> shown_until;  // by stream: the end of the first segment that is shown
  std::optional<std::uint64_t> uncounted;
  for (const auto& [entry, segment] : ledger.segments) {
    if (entry >= first) {
      shown_until.emplace(segment.stream, segment.span.end_ns);
      uncounted = segment.counted || uncounted ? uncounted : entry;
    }
  }
  std::uint64_t earliest = first;
  for (const auto& [entry, gap] : ledger.gaps) {
    const auto shown = shown_until.find(gap.stream);
    if (shown != shown_until.end() && gap.span.end_ns > shown->second) {
      earliest = std::min(earliest, entry);
    }
  }
  if (uncounted) {
    const auto behind = std::upper_bound(ledger.recovered.begin(), ledger.recovered.end(), *uncounted);
    earliest = behind == ledger.recovered.begin() ? earliest : std::min(earliest, *std::prev(behind));
  }
  return earliest;
}

/// The clock entry that states a slew which may still go on at `first`: without it the case clock would seem
/// to go on by another time than the authorities' clocks.
std::optional<std::uint64_t> slew_at(const Survey& ledger, std::uint64_t first) {
  const auto next = ledger.rates.lower_bound(first);
  if (next == ledger.rates.begin() || !std::prev(next)->second) {
    return std::nullopt;
  }
  return std::prev(next)->first;
}

/// The last entry that says of the selected time and streams that their sound is missing. It may follow a
/// minute later.
std::uint64_t last_sound_gap(const Survey& ledger, const ExcerptDocument& document) {
  std::uint64_t last = 0;
  for (const auto& [entry, gap] : ledger.sound_gaps) {
    const bool selected =
        std::find(document.streams.begin(), document.streams.end(), gap.stream) != document.streams.end();
    if (selected && meets(gap.span, document.from_ns, document.to_ns)) {
      last = entry;
    }
  }
  return last;
}

/// Chooses the lines: from the token before to the checkpoint that covers the token after, of each authority
/// that has one, since only a verifier knows which of them are outside ones.
void choose_lines(const Survey& ledger, const std::vector<std::uint64_t>& notes, ExcerptDocument& document) {
  auto [first, last] = needed_entries(ledger, document);
  last = std::max(last, last_sound_gap(ledger, document));
  std::map<std::string, std::uint64_t> after;
  for (const auto& [entry, token] : ledger.tokens) {
    if (token.checkpoint > last) {
      after.emplace(token.authority, entry);
    }
  }
  for (;;) {
    document.first_entry = 0;
    std::map<std::string, std::uint64_t> before;
    for (auto each = ledger.tokens.begin(); each != ledger.tokens.end() && each->first < first; ++each) {
      before[each->second.authority] = each->first;
    }
    if (!before.empty()) {
      document.first_entry = first;
    }
    for (const auto& [authority, entry] : before) {
      document.first_entry = std::min(document.first_entry, entry);
    }
    const std::uint64_t explained = first_explanation(ledger, document.first_entry);
    if (explained >= document.first_entry) {
      break;
    }
    first = explained;
  }
  if (const auto slew = slew_at(ledger, document.first_entry); slew && document.first_entry > 0) {
    document.first_entry = std::min(*slew, first_explanation(ledger, *slew));
  }
  const auto covering = [&](std::uint64_t entry) -> std::optional<std::uint64_t> {
    const auto note = std::find_if(notes.begin(), notes.end(), [&](std::uint64_t size) {
      return size > entry && size <= ledger.tree.size();
    });
    return note == notes.end() ? std::nullopt : std::optional(*note);
  };
  std::optional<std::uint64_t> size = covering(last);
  for (const auto& [authority, entry] : after) {
    size = std::max(size, covering(entry));
  }
  if (!size) {
    throw UsageError("no checkpoint covers that part of case " + ledger.opening.case_id +
                     " yet: take the excerpt when the case is closed");
  }
  document.size = *size;
}

/// Writes the files of one excerpt below a folder that gets its name only when all is there.
class ExcerptFolder {
 public:
  ExcerptFolder(FileSystem& files, fs::path folder) : files_(files), folder_(std::move(folder)) {
    if (fs::exists(fs::symlink_status(folder_))) {
      throw UsageError("there is a " + folder_.string() + " already; give a folder that does not exist yet");
    }
    const fs::path parent = fs::absolute(folder_).parent_path();
    if (!fs::is_directory(parent)) {
      throw UsageError("there is no folder " + parent.string() + " to make the excerpt in");
    }
    temporary_ = parent / ("." + folder_.filename().string() + std::string(kPartSuffix));
    fs::remove_all(temporary_);
    make(temporary_);
  }
  ExcerptFolder(const ExcerptFolder&) = delete;
  ExcerptFolder& operator=(const ExcerptFolder&) = delete;
  ~ExcerptFolder() {
    if (!finished_) {
      std::error_code ignored;
      fs::remove_all(temporary_, ignored);
    }
  }

  std::unique_ptr<WritableFile> create(const std::string& file) {
    const fs::path path = temporary_ / file;
    for (fs::path below = temporary_; const fs::path& part : fs::path(file).parent_path()) {
      below /= part;
      if (!fs::exists(below)) {
        make(below);
      }
    }
    return files_.create(path);
  }
  void write(const std::string& file, ByteView bytes) {
    const auto written = create(file);
    written->write(bytes);
    written->sync();
  }
  void finish() {
    for (const fs::path& each : made_) {
      files_.sync_folder(each);
    }
    files_.rename(temporary_, folder_);
    finished_ = true;
    files_.sync_folder(temporary_.parent_path());
  }

 private:
  void make(const fs::path& folder) {
    files_.make_folder(folder);
    made_.push_back(folder);
  }

  FileSystem& files_;
  fs::path folder_, temporary_;
  std::vector<fs::path> made_;
  bool finished_ = false;
};

void copy_small(const CaseFolder& from, const std::string& file, ExcerptFolder& to) {
  const ReadableFile source = open_or_refuse(from, file);
  const std::optional<std::string> text = read_small(source, kMaximumExcerptBytes);
  if (!text) {
    throw Error("cannot take an excerpt of " + from.path().string() + ": " + file + " is far too long");
  }
  to.write(file, bytes_of(*text));
}

/// The token's file where that is a token's and this one's. Whoever can change one line could have any file
/// of the case copied to an outsider else: nothing was verified here.
const std::string& require_token_path(const TokenEntry& token) {
  const std::optional<TokenName> name = token_of_path(token.file);
  if (!name || name->size != token.checkpoint || name->authority != token.authority) {
    throw Error("cannot take an excerpt: the ledger names '" + printable(token.file) +
                "' as a token, which is none of its names; 'kiroku verify' tells more");
  }
  return token.file;
}

/// Copies the lines that the proof is about; a ledger that changed since they were surveyed is refused.
void copy_lines(const ReadableFile& ledger, const crypto::Sha256Digest& root, const ExcerptDocument& document,
                ExcerptFolder& to) {
  crypto::MerkleFrontier copied;
  const auto part = to.create(std::string(kExcerptLinesFile));
  LineReader reader(ledger);
  LedgerLine line;
  for (std::uint64_t number = 0; number < document.size && reader.next(line); ++number) {
    const std::string text = std::string(line.text) + "\n";
    copied.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    if (number == 0) {
      to.write(std::string(kExcerptOpenFile), bytes_of(text));
    }
    if (number >= document.first_entry) {
      part->write(bytes_of(text));
    }
  }
  if (copied.size() != document.size || copied.root() != root) {
    throw Error("cannot take an excerpt of case " + document.case_id +
                ": its ledger changed while it was read; find out what writes to it, and try again");
  }
  part->sync();
}

/// Copies one segment, re-keyed if asked; the bytes are hashed on the way, each read once.
void copy_segment(const CaseFolder& from, const SegmentEntry& segment, const ExcerptOptions& options,
                  ExcerptFolder& to) {
  const ReadableFile source = open_or_refuse(from, segment.file.file);
  if (const auto why = why_not_sealed(source, segment)) {
    throw Error("cannot take an excerpt of " + from.path().string() + ": " + segment.file.file + " " + *why +
                "; see what `kiroku verify` says of the case");
  }
  const auto copy = to.create(segment.file.file);
  std::vector<std::byte> buffer(kCopyBytes);
  crypto::Sha256 hash;
  std::uint64_t at = 0;
  if (options.identities != nullptr && !options.recipients.empty()) {
    const std::optional<Bytes> original = age_header_text(source);
    if (!original) {
      throw Error("cannot take an excerpt of " + from.path().string() + ": " + segment.file.file +
                  " is no age file; see what `kiroku verify` says of the case");
    }
    copy->write(
        crypto::rekey_header(*crypto::memory_source(*original), *options.identities, options.recipients, at));
    hash.update(*original);
    to.write(segment.file.file + std::string(kOriginalHeaderSuffix), *original);
  }
  while (const std::size_t got = source.read_at(at, buffer)) {
    const ByteView piece = std::span(buffer).first(got);
    hash.update(piece);
    copy->write(piece);
    at += got;
  }
  if (hash.finish() != segment.file.sha256) {
    throw Error("cannot take an excerpt of " + from.path().string() + ": " + segment.file.file +
                " is not the file whose hash the ledger states; see what `kiroku verify` says of the case");
  }
  copy->sync();
}

void copy_conveniences(const CaseFolder& from, const std::vector<ListedFile>& listing, ExcerptFolder& to) {
  for (const ListedFile& file : listing) {
    const bool device = file.path == kDeviceFile && file.kind == ListedFile::Kind::kRegular;
    if (device || is_authority_file(from, file)) {
      copy_small(from, file.path, to);
    }
  }
}

}  // namespace

ExcerptResult make_excerpt(const fs::path& case_folder, const ExcerptOptions& options, const fs::path& folder,
                           FileSystem& files) {
  if (options.to_ns <= options.from_ns) {
    throw UsageError("an excerpt must end after it begins");
  }
  if ((options.identities == nullptr) != options.recipients.empty()) {
    throw UsageError(
        "re-keying an excerpt takes both an identity that opens the case and a recipient to seal it to");
  }
  const CaseFolder from = CaseFolder::open(case_folder);
  const std::vector<ListedFile> listing = from.list();
  const ReadableFile ledger_file = open_or_refuse(from, std::string(kLedgerFile));
  const Survey ledger = survey(from, ledger_file, options.from_ns);
  if (options.from_ns < ledger.opening.begins_ns) {
    throw UsageError("an excerpt cannot begin before its case: give a later beginning");
  }

  ExcerptDocument document;
  document.case_id = ledger.opening.case_id;
  document.from_ns = options.from_ns;
  document.to_ns =
      ledger.close ? std::min(options.to_ns, std::max(ledger.end_ns, options.from_ns + 1)) : options.to_ns;
  document.made_utc = options.made_at;
  document.made_by = options.made_by;
  document.streams = selected_streams(ledger.opening, options.streams);
  std::vector<const SegmentEntry*> wanted;
  for (const auto& [entry, segment] : ledger.segments) {
    const bool selected =
        std::find(document.streams.begin(), document.streams.end(), segment.stream) != document.streams.end();
    if (selected && meets(segment.span, document.from_ns, document.to_ns)) {
      wanted.push_back(&segment);
    }
  }
  if (wanted.empty()) {
    throw UsageError("nothing was recorded in that time in case " + document.case_id);
  }
  choose_lines(ledger, note_sizes(listing), document);
  document.open_proof = ledger.tree.inclusion_proof(0, document.size);
  document.left = ledger.tree.range_proof(document.first_entry, document.size, document.size);

  ExcerptFolder to(files, folder);
  std::set<std::uint64_t> notes{document.size};
  for (const auto& [entry, token] : ledger.tokens) {
    if (entry >= document.first_entry && entry < document.size) {
      copy_small(from, require_token_path(token), to);
      notes.insert(token.checkpoint);
    }
  }
  // What was signed when a recorder died, and what it signed as it came back: else nobody could tell the two.
  const std::vector<std::uint64_t> all_notes = note_sizes(listing);
  for (const std::uint64_t recovered : ledger.recovered) {
    if (recovered < document.first_entry || recovered >= document.size) continue;
    const auto behind = std::upper_bound(all_notes.begin(), all_notes.end(), recovered);
    if (behind != all_notes.begin()) notes.insert(*std::prev(behind));
  }
  for (const std::uint64_t size : notes) {
    copy_small(from, note_path(size), to);
    if (size <= document.first_entry) {
      document.earlier.push_back({size, ledger.tree.consistency_proof(size, document.size)});
    }
  }
  to.write(std::string(kExcerptFile), bytes_of(to_text(document)));
  copy_lines(ledger_file, ledger.tree.root(document.size), document, to);
  copy_conveniences(from, listing, to);
  ExcerptResult result;
  for (const SegmentEntry* segment : wanted) {
    copy_segment(from, *segment, options, to);
    ++result.segments;
    result.bytes += segment->file.bytes;
  }
  to.finish();
  result.first_entry = document.first_entry;
  result.last_entry = document.size - 1;
  return result;
}

}  // namespace kiroku::archive
