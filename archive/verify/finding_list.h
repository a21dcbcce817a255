// Collects what verification finds, in bounded memory: what is beyond the limits of archive/format/limits.h
// is counted and still decides. Thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/verify/finding.h"
#include "archive/verify/finding_codes.h"

namespace kiroku::archive {

/// Where something was found.
struct Place {
  std::string file;
  std::optional<std::uint64_t> entry = std::nullopt;
  std::optional<std::uint64_t> offset = std::nullopt;
  bool of_log = false;  // beside a case; `file` begins with "log/"
};

/// A text as a finding keeps it: of one that is too long the beginning and "…", in room of its own.
std::string shortened(std::string text);

class FindingList {
 public:
  /// Where `text` quotes what it judges, that may hold anything: it is made printable (base/printable.h).
  /// Texts and file names that are too long are cut. Of each code the first is kept in any case; one that is
  /// only counted stands in a "more-findings".
  void add(CodeName code, Place place, std::string text);
  /// By which code a finding counts here; nothing: by its own.
  using Recoding = std::function<std::optional<CodeName>(const FindingCode&)>;
  /// Findings of another list, and what it only counted. With a `folder`, which is the log's beside a case,
  /// they are of the log and their files lie below it. One that counts by another code says its own in its
  /// text.
  void take_from(FindingList& other, const std::string& folder, const Recoding& recoding = {});
  /// Whether one of this code was added.
  [[nodiscard]] bool has(CodeName code) const;
  /// The gravest so far, kept also of those that were only counted.
  [[nodiscard]] Severity worst() const;
  /// All, ordered by entry (those without one last), then file, then offset. The list is empty afterwards.
  std::vector<Finding> take();

 private:
  struct OfOneCode {
    std::uint64_t kept = 0, dropped = 0;
  };
  struct Kept {
    std::size_t code = 0;  // place in kFindingCodes
    Place place;
    std::string text;
  };
  void add_locked(std::size_t code, Place place, std::string text);

  mutable std::mutex mutex_;
  std::vector<Kept> kept_;
  std::array<OfOneCode, kFindingCodes.size()> counts_{};
  std::size_t bytes_ = 0;  // of what is kept
  Severity worst_ = Severity::kNote;
};

}  // namespace kiroku::archive
