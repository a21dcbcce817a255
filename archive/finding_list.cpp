#include "archive/finding_list.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "base/printable.h"

namespace kiroku::archive {

void FindingList::add(CodeName code, Place place, const std::string& text) {
  const std::lock_guard lock(mutex_);
  add_locked({std::string(code.code().name), code.code().severity, std::move(place.file), place.entry,
              place.offset, printable(text)});
}

void FindingList::add_locked(Finding finding) {
  worst_ = std::max(worst_, finding.severity);
  if (++counts_[finding.code] <= kMostOfOneCode) {
    findings_.push_back(std::move(finding));
  }
}

void FindingList::take_from(FindingList& other, const std::string& folder) {
  std::vector<Finding> taken = other.take();
  const std::lock_guard lock(mutex_);
  for (Finding& finding : taken) {
    finding.file = folder + "/" + finding.file;
    add_locked(std::move(finding));
  }
}

Severity FindingList::worst() const {
  const std::lock_guard lock(mutex_);
  return worst_;
}

std::vector<Finding> FindingList::take() {
  const std::lock_guard lock(mutex_);
  const auto place = [](const Finding& finding) {
    constexpr std::uint64_t kLast = std::numeric_limits<std::uint64_t>::max();
    return std::tuple(finding.entry.value_or(kLast), std::string_view(finding.file),
                      finding.offset.value_or(0), std::string_view(finding.code));
  };
  std::sort(findings_.begin(), findings_.end(),
            [&](const Finding& a, const Finding& b) { return place(a) < place(b); });
  const FindingCode& more = CodeName("more-findings").code();
  for (const auto& [code, count] : counts_) {
    if (count > kMostOfOneCode) {
      findings_.push_back(
          {std::string(more.name),
           more.severity,
           {},
           {},
           {},
           "there are " + std::to_string(count - kMostOfOneCode) + " more findings of code " + code});
    }
  }
  counts_.clear();
  return std::exchange(findings_, {});
}

}  // namespace kiroku::archive
