#include "archive/reading/case_reader.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/folder_name.h"
#include "archive/format/line_reader.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "base/near_miss.h"
#include "base/time_text.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

/// Visits the entries in order; a torn last line is not an entry yet.
void read_entries(const std::filesystem::path& path,
                  const std::function<void(CaseEntry&&, std::string_view line)>& visit) {
  const CaseFolder folder = CaseFolder::open(path);
  const FileOpening opening = folder.open_file(kLedgerFile);
  if (!opening.file) {
    if (is_excerpt(folder)) {
      throw UsageError(path.string() + " is an excerpt, not a case: give the folder of the case");
    }
    if (opening.problem == FileProblem::kMissing) {
      throw UsageError(path.string() + " is no case: there is no " + std::string(kLedgerFile) +
                       " in it; give the folder of a case");
    }
    throw Error("cannot read " + (path / kLedgerFile).string() + ": it " + opening.explanation);
  }
  LineReader reader(*opening.file);
  LedgerLine line;
  std::uint64_t number = 0;
  while (reader.next(line) && !line.torn) {
    EntryParse parse =
        line.too_long ? EntryParse{std::nullopt, "the line is too long", {}} : parse_case_entry(line.text);
    if (!parse.entry) {
      throw Error("cannot read entry " + std::to_string(number) + " of " + (path / kLedgerFile).string() +
                  ": " + parse.problem + "; see what `kiroku verify` says of the case");
    }
    visit(std::move(*parse.entry), line.text);
    ++number;
  }
}

/// Whoever asked for the case of the folder's name would be shown another one: its patient, its film.
void require_case_of_name(const std::filesystem::path& folder, const std::string& case_id) {
  const std::string name = folder_name(folder);
  if (name == case_id || !is_case_id(name)) {
    return;
  }
  throw Error("the folder is called by the identifier of case " + name + ", and what lies in it is case " +
              case_id + ": nothing here is of " + name + "; call the folder " + case_id +
              " to read it as that case");
}

}  // namespace

CaseReader CaseReader::open(const std::filesystem::path& folder) {
  CaseReader reader;
  reader.folder_ = folder;
  bool first = true;
  crypto::MerkleFrontier tree;
  std::vector<WallClock::Step> steps;
  read_entries(folder, [&](CaseEntry&& entry, std::string_view line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (first) {
      auto* opening = std::get_if<OpenEntry>(&entry.body);
      if (opening == nullptr) {
        throw Error("cannot read " + (folder / kLedgerFile).string() + ": entry 0 is not `open`");
      }
      reader.opening_ = std::move(*opening);
      reader.opened_at_ = entry.at;
      reader.opening_sha256_ = crypto::sha256(bytes_of(line));
      require_case_of_name(folder, reader.opening_.case_id);
      first = false;
    } else if (auto* segment = std::get_if<SegmentEntry>(&entry.body)) {
      reader.segments_.push_back(std::move(*segment));
    } else if (auto* closing = std::get_if<CloseEntry>(&entry.body)) {
      reader.closing_ = std::move(*closing);
    } else if (auto* gap = std::get_if<GapEntry>(&entry.body)) {
      reader.gaps_.push_back(std::move(*gap));
    } else if (auto* erased = std::get_if<ErasedEntry>(&entry.body)) {
      reader.erased_.push_back(std::move(*erased));
    } else if (auto* token = std::get_if<TokenEntry>(&entry.body)) {
      reader.tokens_.push_back({entry.seq, entry.at.mono_ns, std::move(*token)});
    } else if (const auto* clock = std::get_if<ClockEntry>(&entry.body)) {
      steps.push_back({entry.at.mono_ns, clock->step_ns});
    }
    reader.entry_times_.push_back(entry.at.mono_ns);
  });
  if (first) {
    throw Error("cannot read " + (folder / kLedgerFile).string() + ": it holds no whole entry");
  }
  reader.lines_root_ = tree.root();
  reader.wall_clock_ = WallClock(reader.opened_at_, std::move(steps));
  return reader;
}

const StreamInfo& CaseReader::stream(const std::string& name) const {
  std::string names;
  std::vector<std::string> known;
  for (const StreamInfo& stream : opening_.streams) {
    if (stream.name == name) {
      return stream;
    }
    names += (names.empty() ? "" : ", ") + stream.name;
    known.push_back(stream.name);
  }
  throw UsageError("case " + opening_.case_id + " has no stream \"" + name + "\"; it has " +
                   (names.empty() ? "none" : names) + did_you_mean(name, known));
}

std::vector<SegmentEntry> CaseReader::segments(const std::string& stream, std::int64_t from_ns,
                                               std::int64_t to_ns) const {
  std::vector<SegmentEntry> found;
  std::copy_if(segments_.begin(), segments_.end(), std::back_inserter(found),
               [&](const SegmentEntry& segment) {
                 return segment.stream == stream && meets(segment.span, from_ns, to_ns);
               });
  return found;
}

std::vector<GapEntry> CaseReader::gaps(const std::string& stream) const {
  std::vector<GapEntry> found;
  std::copy_if(gaps_.begin(), gaps_.end(), std::back_inserter(found),
               [&](const GapEntry& gap) { return gap.stream == stream && !gap.of_sound; });
  return found;
}

std::vector<GapEntry> CaseReader::sound_gaps(const std::string& stream) const {
  std::vector<GapEntry> found;
  std::copy_if(gaps_.begin(), gaps_.end(), std::back_inserter(found),
               [&](const GapEntry& gap) { return gap.stream == stream && gap.of_sound; });
  return found;
}

const ErasedEntry* CaseReader::erasure_of(const SegmentEntry& segment) const {
  const auto found = std::find_if(erased_.rbegin(), erased_.rend(), [&](const ErasedEntry& erased) {
    return erased.stream == segment.stream && erased.first_index <= segment.index &&
           segment.index <= erased.last_index;
  });
  return found == erased_.rend() ? nullptr : &*found;
}

std::int64_t CaseReader::duration_ns() const {
  std::int64_t end = 0;
  for (const SegmentEntry& segment : segments_) {
    end = std::max(end, segment.span.end_ns);
  }
  return (segments_.empty() ? entry_times_.back() : end) - opening_.begins_ns;
}

void CaseReader::for_each(const std::function<void(const CaseEntry&)>& visit) const {
  read_entries(folder_, [&](CaseEntry&& entry, std::string_view) { visit(entry); });
}

std::int64_t CaseReader::parse_time(const std::string& text, const std::string& what) const {
  if (const std::optional<std::int64_t> offset = parse_time_text(text)) {
    return opening_.begins_ns + *offset;
  }
  const std::optional<UtcTime> utc = parse_utc(text);
  if (!utc) {
    throw UsageError(what + " is '" + text + "', which is no time: write " + std::string(kTimeForms) +
                     " from the start of the case, or UTC such as " + format_utc(opened_at_.utc));
  }
  return time_of_utc(*utc, what + " is " + text);
}

std::int64_t CaseReader::time_of_utc(UtcTime utc, const std::string& named) const {
  std::vector<std::int64_t> times = wall_clock_.case_times(utc);
  const auto in_case = [this](std::int64_t time_ns) { return case_time_text(time_ns, opening_.begins_ns); };
  if (const WallClock::Step* const step = times.empty() ? wall_clock_.step_over(utc) : nullptr) {
    const auto [before, behind] = wall_clock_.around(*step);
    throw UsageError(named + ", which the recorder's clock never showed: it was set from " +
                     format_utc(before) + " to " + format_utc(behind) + " at " + in_case(step->mono_ns) +
                     " of the case; write the time from the start of the case, such as " +
                     in_case(step->mono_ns));
  }
  // What lies outside the case is meant by nobody where another time lies in it.
  const std::int64_t ends_ns = opening_.begins_ns + duration_ns();
  const auto lies_outside = [&](std::int64_t time_ns) {
    return time_ns < opening_.begins_ns || time_ns > ends_ns;
  };
  const bool some_within = !std::ranges::all_of(times, lies_outside);
  if (some_within) std::erase_if(times, lies_outside);
  if (some_within && times.size() > 1) {
    std::string all;
    for (const std::int64_t time_ns : times) all += (all.empty() ? "" : " and ") + in_case(time_ns);
    throw UsageError(named + ", which the recorder's clock showed several times, since it was set back: at " +
                     all + " of the case; write which of them is meant, from the start of the case");
  }
  if (times.empty() || times.front() < opening_.begins_ns) {
    throw UsageError(named + ", before the case begins; it was opened at " + format_utc(opened_at_.utc));
  }
  return times.front();
}

Span CaseReader::parse_stretch(const std::optional<std::string>& from,
                               const std::optional<std::string>& to) const {
  Span stretch{opening_.begins_ns, INT64_MAX};
  if (from) stretch.start_ns = parse_time(*from, "--from");
  if (to) stretch.end_ns = parse_time(*to, "--to");
  require_stretch(stretch, {"--from", from.value_or("the start")}, {"--to", to.value_or("the end")});
  return stretch;
}

void CaseReader::require_stretch(const Span& stretch, const StatedTime& from, const StatedTime& to) const {
  const std::string start = from.name + " (" + from.text + ")", end = to.name + " (" + to.text + ")";
  const std::int64_t ends_ns = opening_.begins_ns + duration_ns();
  const auto refuse_beyond = [&](const std::string& which) {
    throw UsageError(which + " is beyond the end of the case, which is " +
                     case_time_text(ends_ns, opening_.begins_ns) + " long");
  };
  if (stretch.start_ns > opening_.begins_ns && stretch.start_ns >= ends_ns) refuse_beyond(start);
  if (stretch.end_ns != INT64_MAX && stretch.end_ns > ends_ns) refuse_beyond(end);
  if (stretch.end_ns < stretch.start_ns) {
    throw UsageError(start + " is after " + end + ": exchange the two");
  }
  if (stretch.end_ns == stretch.start_ns) {
    throw UsageError("nothing lies between " + start + " and " + end + ", which are the same moment");
  }
}

std::string case_time_text(std::int64_t time_ns, std::int64_t begins_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000, kMinute = 60;
  const std::int64_t since = std::max<std::int64_t>(0, time_ns - begins_ns), seconds = since / kSecond;
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%02lld:%02lld:%02lld.%09lld",
                static_cast<long long>(seconds / kMinute / kMinute),
                static_cast<long long>(seconds / kMinute % kMinute),
                static_cast<long long>(seconds % kMinute), static_cast<long long>(since % kSecond));
  std::string result = text.data();
  while (result.back() == '0') result.pop_back();
  if (result.back() == '.') result.pop_back();
  return result;
}

}  // namespace kiroku::archive
