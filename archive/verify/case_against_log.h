// Whether a case on the disk is the one that the appliance log beside it knows, as far as it knows it: asked
// before the recorder signs anything more of that case. It is no verification: whoever can write both can
// take away the end of both.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "archive/format/file_reading.h"
#include "crypto/hash.h"
#include "crypto/merkle_tree.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// Takes the lines of one case's ledger in their order. Copies are independent. Not thread-safe.
class CaseAgainstLog {
 public:
  /// Reads the log; the case may be written meanwhile. Lines that stand there while the log names another
  /// device than `device`, and which `device` did not sign before another line followed, count for nothing:
  /// whoever has a copy of the log can carry it on so. Throws kiroku::Error where it cannot be read.
  CaseAgainstLog(const std::string& case_id, const std::filesystem::path& log_folder,
                 const crypto::VerifierKey& device, const FileReading& files = real_reading());

  void take(std::string_view line);
  /// One sentence if the log states another first line, another root at some size, or more entries than there
  /// are; or a checkpoint beyond `signed_size`, the size of the newest one that lies in the case, for a
  /// recorder logs none before it lies there. With `signed_size` 0 also if the case was recorded on behind
  /// its first line, and `device` did not sign `case-opened` in the log before another line followed there:
  /// nothing then shows that the case is the device's. (Where only what a recovery writes of an empty case
  /// follows, power failed right after the opening and again in the recovery.) Nothing if it fits, or if the
  /// log does not know the case.
  [[nodiscard]] std::optional<std::string> problem(std::uint64_t signed_size) const;
  /// Whether `device` signed `case-opened` in the log before another line followed.
  [[nodiscard]] bool opening_signed() const { return opening_signed_; }

 private:
  std::optional<crypto::Sha256Digest> opening_line_;
  bool opening_signed_ = false;
  std::multimap<std::uint64_t, crypto::Sha256Digest> roots_;  // by size
  crypto::MerkleFrontier tree_;
  std::optional<std::string> differs_;
  bool recorded_ = false;  // on from the opening
};

/// Whether the note of this size in a case or log is there, and signed by `device` of just this. Throws
/// kiroku::Error if it is there and cannot be read.
bool is_signed(const std::filesystem::path& folder, const crypto::Checkpoint& wanted,
               const crypto::VerifierKey& device, const FileReading& files = real_reading());
/// Calls `take` with every whole line of the ledger of a case or log. Throws kiroku::Error if it cannot be
/// read to its end.
void for_each_whole_line(const std::filesystem::path& folder,
                         const std::function<void(std::string_view)>& take,
                         const FileReading& files = real_reading());

}  // namespace kiroku::archive
