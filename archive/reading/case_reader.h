// Reading a case: its entries and, with an identity, its segments. Immutable after open(); thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/reading/wall_clock.h"
#include "crypto/hash.h"

namespace kiroku::archive {

/// The ledger of a case, parsed (not verified: see verifier.h).
class CaseReader {
 public:
  /// Throws kiroku::Error naming the folder if it is no case or is called by another case's identifier, or
  /// the line that cannot be read.
  static CaseReader open(const std::filesystem::path& folder);
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] const OpenEntry& opening() const { return opening_; }
  [[nodiscard]] const Moment& opened_at() const { return opened_at_; }
  /// What the machine's wall clock showed in the case, as the ledger states it: its own word.
  [[nodiscard]] const WallClock& wall_clock() const { return wall_clock_; }
  /// SHA-256 of the first line, as the appliance log states it of the case.
  [[nodiscard]] const crypto::Sha256Digest& opening_sha256() const { return opening_sha256_; }
  [[nodiscard]] std::optional<CloseEntry> closing() const { return closing_; }
  /// Root (RFC 6962) over the lines that were read: VerificationReport::lines_root of a verification of the
  /// same ledger.
  [[nodiscard]] const crypto::Sha256Digest& lines_root() const { return lines_root_; }
  [[nodiscard]] const StreamInfo& stream(
      const std::string& name) const;  // throws UsageError that lists the streams there are
  /// Segments of a stream whose span meets [from_ns, to_ns), in order.
  [[nodiscard]] std::vector<SegmentEntry> segments(const std::string& stream, std::int64_t from_ns,
                                                   std::int64_t to_ns) const;
  /// Those of every stream, and all stated gaps, in the ledger's order.
  [[nodiscard]] const std::vector<SegmentEntry>& segments() const { return segments_; }
  [[nodiscard]] const std::vector<GapEntry>& gaps() const { return gaps_; }
  struct StatedToken {
    std::uint64_t seq = 0;
    std::int64_t mono_ns = 0;  // of the entry
    TokenEntry entry;
  };
  [[nodiscard]] const std::vector<StatedToken>& tokens() const { return tokens_; }
  /// When each entry was written, on the case clock; by its number.
  [[nodiscard]] const std::vector<std::int64_t>& entry_times() const { return entry_times_; }
  /// Stated gaps of a stream, in the ledger's order; of the sound beside its pictures alone.
  [[nodiscard]] std::vector<GapEntry> gaps(const std::string& stream) const;
  [[nodiscard]] std::vector<GapEntry> sound_gaps(const std::string& stream) const;
  /// The last entry by which retention removed the segment's bytes; null if they were left.
  [[nodiscard]] const ErasedEntry* erasure_of(const SegmentEntry& segment) const;
  [[nodiscard]] bool is_erased(const SegmentEntry& segment) const { return erasure_of(segment) != nullptr; }
  /// From the case's beginning to the end of its last segment; without segments, to its last entry.
  [[nodiscard]] std::int64_t duration_ns() const;
  /// Every entry in order, read from the file again. A last line without LF is not an entry yet.
  void for_each(const std::function<void(const CaseEntry&)>& visit) const;
  /// Case-clock time of what a person wrote: from the start of the case (base/time_text.h), or UTC (RFC
  /// 3339) as the recorder's clock showed it (wall_clock()). Throws UsageError, in which `what` names it
  /// ("--at"), also where that clock was set so that it never showed the time, or showed it several times.
  [[nodiscard]] std::int64_t parse_time(const std::string& text, const std::string& what = "the time") const;
  /// What lies between the values of --from and --to; absent ones are the start, and INT64_MAX for the end.
  /// Throws UsageError as parse_time() and require_stretch().
  [[nodiscard]] Span parse_stretch(const std::optional<std::string>& from,
                                   const std::optional<std::string>& to) const;
  /// A time as its giver knows it: "--from" and what was written there.
  struct StatedTime {
    std::string name, text;
  };
  /// Throws UsageError where nothing lies between the two, or one of them, INT64_MAX apart, lies beyond the
  /// end of the case, whose length it tells.
  void require_stretch(const Span& stretch, const StatedTime& from, const StatedTime& to) const;

 private:
  [[nodiscard]] std::int64_t time_of_utc(UtcTime utc, const std::string& named) const;

  std::filesystem::path folder_;
  OpenEntry opening_;
  Moment opened_at_;
  WallClock wall_clock_;
  crypto::Sha256Digest opening_sha256_{};
  std::optional<CloseEntry> closing_;
  std::vector<SegmentEntry> segments_;
  std::vector<GapEntry> gaps_;
  std::vector<ErasedEntry> erased_;
  std::vector<StatedToken> tokens_;
  std::vector<std::int64_t> entry_times_;
  crypto::Sha256Digest lines_root_{};
};

/// "00:01:02.345678901" since a case began, without zeros at the end; what CaseReader::parse_time() reads
/// back.
std::string case_time_text(std::int64_t time_ns, std::int64_t begins_ns);

}  // namespace kiroku::archive
