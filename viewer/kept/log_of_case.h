// What the appliance log says of a case's plan and comparisons. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "base/check.h"
#include "base/utc_time.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::compare {

/// What the `access` entry of a comparison says was done.
std::string comparison_deed(const crypto::Sha256Digest& document);

/// A case's first entry, with the hash of its line.
struct CaseOpening {
  const archive::OpenEntry& open;
  archive::Moment at;
  crypto::Sha256Digest sha256{};
};

struct LogOfCase {
  struct Record {
    std::uint64_t seq = 0;   // of the entry
    UtcTime utc;             // the machine's opinion
    std::string who;         // of a comparison
    bool is_signed = false;  // by the log's device, when it was written
  };
  /// By what was entered; of entries that say the same, the first that is signed.
  std::map<crypto::Sha256Digest, Record> sealed_plans, comparisons;
  /// Whether the log still begins with what the case's first entry states of it.
  bool case_began_under_it = false;
  /// What the log states of that entry; the first that is signed, where the case was opened twice.
  struct Opening {
    crypto::Sha256Digest sha256{};
    bool is_signed = false;
  };
  std::optional<Opening> opening;
};
/// One pass over the log of `device`. kiroku::Error where it cannot be read.
LogOfCase read_log_of_case(const std::filesystem::path& log_folder, const archive::OpenEntry& open,
                           const crypto::VerifierKey& device);

/// Whether the log held the seal before the case began. Nobody has verified the case: that its first entry is
/// the recorded one, the log's own entry of the case says ("opening", where it does not). "order": that entry
/// states the log's size and root as they were then. It comes before the first picture, unless a room
/// recorded ahead of the case; for that "ahead" compares the seal's line with what was recorded first, both
/// by the machine's clock. `device`: whose log it is.
std::vector<Check> check_sealed_before(const LogOfCase& log, const std::string& device,
                                       const CaseOpening& opening, const crypto::Sha256Digest& seal);

}  // namespace kiroku::compare
