// Which codes a display that follows a ledger can have shown, and when: what pictures are compared with. What
// the ledger says may be an attacker's; time and memory are bounded. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "crypto/merkle_tree.h"

namespace kiroku::light {

/// A code as light_code() makes it of `second` and the first `entries` lines.
struct LedgerCode {
  std::uint64_t code = 0;
  std::int64_t second = 0;  // Unix time
  std::uint64_t entries = 0;
};

class LedgerLights {
 public:
  /// How much later than its newest entry a display may show a code: it looks for new entries less often than
  /// they are written.
  static constexpr std::int64_t kLatestSeconds = 4;
  /// A recorder writes an entry each minute at least: after so long nothing is made of the newest one.
  static constexpr std::int64_t kLongestSilence = 600;

  /// Reads a case's ledger. Throws kiroku::Error, in one sentence, where it cannot be read, has a line that
  /// is no entry, or too many entries for codes to be made of all.
  static LedgerLights of(const std::filesystem::path& case_folder);

  /// The next line, without LF; all lines come before codes(). Throws kiroku::Error as of() does.
  void add_line(std::string_view line);
  /// Makes the codes.
  void finish();

  /// All of them, ordered by second.
  [[nodiscard]] std::span<const LedgerCode> codes() const { return codes_; }
  /// Those of the seconds [first, last].
  [[nodiscard]] std::span<const LedgerCode> codes_of(std::int64_t first, std::int64_t last) const;
  /// UTC in nanoseconds of a moment of the case clock, by the recorder's wall clock: of the last entry that
  /// was written before it. Nothing without an entry. `case_ns` within 25 years of 0.
  [[nodiscard]] std::optional<std::int64_t> utc_ns_at(std::int64_t case_ns) const;

 private:
  struct Written {
    std::int64_t utc_us = 0, mono_ns = 0;
  };
  std::vector<Written> written_;
  crypto::MerkleTree tree_;
  std::vector<LedgerCode> codes_;
};

}  // namespace kiroku::light
