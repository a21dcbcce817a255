// Collects what verification finds. Thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/finding.h"
#include "archive/finding_codes.h"

namespace kiroku::archive {

/// Where something was found.
struct Place {
  std::string file;
  std::optional<std::uint64_t> entry = std::nullopt;
  std::optional<std::uint64_t> offset = std::nullopt;
};

class FindingList {
 public:
  /// At most this many of one code are kept; the rest is counted in one "more-findings".
  static constexpr std::uint64_t kMostOfOneCode = 1'000;

  /// Where `text` quotes what it judges, that may hold anything: it is made printable (base/printable.h).
  void add(CodeName code, Place place, const std::string& text);
  /// Findings of another list, their files below `folder`.
  void take_from(FindingList& other, const std::string& folder);
  /// The gravest so far, kept also of those that were only counted.
  [[nodiscard]] Severity worst() const;
  /// All, ordered by entry (those without one last), then file, then offset. The list is empty afterwards.
  std::vector<Finding> take();

 private:
  void add_locked(Finding finding);

  mutable std::mutex mutex_;
  std::vector<Finding> findings_;
  std::map<std::string, std::uint64_t> counts_;
  Severity worst_ = Severity::kNote;
};

}  // namespace kiroku::archive
