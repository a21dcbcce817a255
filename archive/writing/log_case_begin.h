// Whether the case that a line of the appliance log opens began beside this log. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

struct LogState {
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
};
/// What of a case is known of a line that opens it.
struct CaseBegin {
  bool is_here = false;
  std::optional<LogState> log;  // it is here if the log went on from this
};

/// Whether the case that was opened so lies in `archive`, is of the device that `device` states, and began
/// beside this log: its line is not put aside. The device signed it, of whatever other keys it has by
/// `by_ed25519`: whoever can write to the archive makes a folder that fits any line.
CaseBegin begin_of_case(const FileReading& files, const std::filesystem::path& archive,
                        const std::string& device, const crypto::VerifierKey& by_ed25519,
                        const CaseOpenedEntry& opened);

/// Whoever can write to the archive brings these errors (errno) about there. Any other one shows nothing of
/// what lies there.
bool is_cause_in_the_folder(int error);

}  // namespace kiroku::archive
