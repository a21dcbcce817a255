#include "archive/verify/finding_list.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "archive/format/limits.h"
#include "base/printable.h"

namespace kiroku::archive {

namespace {

bool goes_on_a_character(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

}  // namespace

std::string shortened(std::string text) {
  if (text.size() <= kMaximumFindingText) {
    return text;
  }
  constexpr std::string_view kMore = "…";
  constexpr std::size_t kLongestCharacter = 4;
  const std::size_t most = kMaximumFindingText - kMore.size();
  std::size_t end = most;
  while (goes_on_a_character(text[end]) && most - end < kLongestCharacter) {
    --end;
  }
  return text.substr(0, end).append(kMore);  // a copy, so that the long text's room is given back
}

void FindingList::add(CodeName code, Place place, std::string text) {
  const std::lock_guard lock(mutex_);
  add_locked(code.index(), std::move(place), printable(shortened(std::move(text))));
}

void FindingList::add_locked(std::size_t code, Place place, std::string text) {
  worst_ = std::max(worst_, kFindingCodes[code].severity);
  OfOneCode& count = counts_[code];
  const bool full = count.kept >= kMostFindingsOfOneCode || bytes_ >= kMaximumFindingBytes;
  if (full && count.kept > 0) {
    ++count.dropped;
    return;
  }
  place.file = shortened(std::move(place.file));
  text = shortened(std::move(text));
  ++count.kept;
  bytes_ += sizeof(Kept) + place.file.size() + text.size();
  kept_.push_back({code, std::move(place), std::move(text)});
}

void FindingList::take_from(FindingList& other, const std::string& folder, const Recoding& recoding) {
  const std::scoped_lock lock(mutex_, other.mutex_);
  const auto code_here = [&](std::size_t code) {
    const std::optional<CodeName> counts_as = recoding ? recoding(kFindingCodes[code]) : std::nullopt;
    return counts_as ? counts_as->index() : code;
  };
  for (Kept& each : other.kept_) {
    if (!folder.empty()) {
      each.place.file.insert(0, folder + "/");
      each.place.of_log = true;
    }
    const std::size_t code = code_here(each.code);
    if (code != each.code) each.text.insert(0, std::string(kFindingCodes[each.code].name) + ": ");
    add_locked(code, std::move(each.place), std::move(each.text));
  }
  for (std::size_t code = 0; code < counts_.size(); ++code) {
    if (other.counts_[code].dropped > 0) counts_[code_here(code)].dropped += other.counts_[code].dropped;
  }
  other.kept_.clear();
  other.counts_ = {};
  other.bytes_ = 0;
}

bool FindingList::has(CodeName code) const {
  const std::lock_guard lock(mutex_);
  return counts_[code.index()].kept > 0;
}

Severity FindingList::worst() const {
  const std::lock_guard lock(mutex_);
  return worst_;
}

std::vector<Finding> FindingList::take() {
  const std::lock_guard lock(mutex_);
  const auto place = [](const Kept& each) {
    constexpr std::uint64_t kLast = std::numeric_limits<std::uint64_t>::max();
    return std::tuple(each.place.entry.value_or(kLast), std::string_view(each.place.file),
                      each.place.offset.value_or(0), kFindingCodes[each.code].name);
  };
  std::sort(kept_.begin(), kept_.end(), [&](const Kept& a, const Kept& b) { return place(a) < place(b); });
  std::vector<Finding> findings;
  for (Kept& each : kept_) {
    const FindingCode& code = kFindingCodes[each.code];
    findings.push_back({std::string(code.name), code.severity, std::move(each.place.file), each.place.entry,
                        each.place.offset, std::move(each.text), each.place.of_log});
  }
  const FindingCode& more = kFindingCodes[CodeName("more-findings").index()];
  for (std::size_t code = 0; code < counts_.size(); ++code) {
    if (counts_[code].dropped > 0) {
      findings.push_back({std::string(more.name),
                          more.severity,
                          {},
                          {},
                          {},
                          "there are " + std::to_string(counts_[code].dropped) + " more findings of code " +
                              std::string(kFindingCodes[code].name)});
    }
  }
  kept_.clear();
  counts_ = {};
  bytes_ = 0;
  return findings;
}

}  // namespace kiroku::archive
