#include "light/ledger_lights.h"

#include <algorithm>
#include <string>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "base/error.h"
#include "light/light_code.h"

namespace kiroku::light {
namespace {

/// Of ten days with four streams there are half as many.
constexpr std::size_t kMostEntries = 4'000'000;
/// Seconds of eleven days, and those that each entry's code may be shown later. A ledger whose entries stand
/// minutes apart, each time, is of no recording, and would take hundreds of codes a line.
constexpr std::size_t kMostSeconds = 1'000'000, kMostOfAnEntry = LedgerLights::kLatestSeconds + 2;
/// The year 2223, either way: what a ledger states beyond it does not fit into nanoseconds.
constexpr std::int64_t kFurthestUs = 8'000'000'000'000'000;

std::int64_t second_of(std::int64_t utc_us) {
  constexpr std::int64_t kSecond = 1'000'000;
  return utc_us / kSecond - (utc_us % kSecond < 0 ? 1 : 0);
}

}  // namespace

LedgerLights LedgerLights::of(const std::filesystem::path& case_folder) {
  const auto folder = archive::CaseFolder::open(case_folder);
  const archive::FileOpening opening = folder.open_file(archive::kLedgerFile);
  const std::string name = (case_folder / archive::kLedgerFile).string();
  if (!opening.file) {
    throw Error("cannot compare light with " + name + ": it " +
                (opening.problem == archive::FileProblem::kMissing ? "is not there" : opening.explanation) +
                "; give the folder of a case");
  }
  LedgerLights lights;
  archive::LineReader reader(*opening.file);
  archive::LedgerLine line;
  while (reader.next(line) && !line.torn) {
    if (line.too_long)
      throw Error("cannot compare light with " + name + ": entry " + std::to_string(lights.written_.size()) +
                  " is too long; see what 'kiroku verify' says of the case");
    lights.add_line(line.text);
  }
  lights.finish();
  return lights;
}

void LedgerLights::add_line(std::string_view line) {
  const std::string where = "cannot compare light with the ledger: entry " + std::to_string(written_.size());
  if (written_.size() >= kMostEntries) throw Error(where + " is one more than codes are made of");
  archive::EntryParse parse = archive::parse_case_entry(line);
  if (!parse.entry)
    throw Error(where + " cannot be read: " + parse.problem + "; see what 'kiroku verify' says of the case");
  tree_.append(crypto::merkle_leaf_hash(bytes_of(line)));
  written_.push_back(
      {std::clamp<std::int64_t>(parse.entry->at.utc.time_since_epoch().count(), -kFurthestUs, kFurthestUs),
       parse.entry->at.mono_ns});
}

void LedgerLights::finish() {
  codes_.clear();
  for (std::size_t i = 0; i < written_.size(); ++i) {
    const std::uint64_t entries = i + 1;
    // While it was the newest entry, and a little longer. A wall clock that was set back changes nothing.
    const std::int64_t from = second_of(written_[i].utc_us);
    const std::int64_t until = i + 1 < written_.size() ? second_of(written_[i + 1].utc_us) : from;
    const std::int64_t last = std::clamp(until, from, from + kLongestSilence) + kLatestSeconds;
    const crypto::Sha256Digest root = tree_.root(entries);
    for (std::int64_t second = from; second <= last; ++second) {
      if (codes_.size() >= kMostSeconds + kMostOfAnEntry * written_.size())
        throw Error(
            "cannot compare light with the ledger: it has more codes than any recording; see what 'kiroku "
            "verify' says of the case");
      codes_.push_back({light_code(entries, root, second), second, entries});
    }
  }
  std::stable_sort(codes_.begin(), codes_.end(),
                   [](const LedgerCode& a, const LedgerCode& b) { return a.second < b.second; });
}

std::span<const LedgerCode> LedgerLights::codes_of(std::int64_t first, std::int64_t last) const {
  const auto begin =
      std::lower_bound(codes_.begin(), codes_.end(), first,
                       [](const LedgerCode& code, std::int64_t second) { return code.second < second; });
  const auto end =
      std::upper_bound(begin, codes_.end(), last,
                       [](std::int64_t second, const LedgerCode& code) { return second < code.second; });
  return {begin, end};
}

std::optional<std::int64_t> LedgerLights::utc_ns_at(std::int64_t case_ns) const {
  if (written_.empty()) return std::nullopt;
  auto after = std::upper_bound(written_.begin(), written_.end(), case_ns,
                                [](std::int64_t ns, const Written& entry) { return ns < entry.mono_ns; });
  const Written& entry = after == written_.begin() ? *after : *(after - 1);
  return entry.utc_us * 1'000 + (case_ns - entry.mono_ns);
}

}  // namespace kiroku::light
