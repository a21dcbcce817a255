// What the appliance log says of a case's plan and comparisons. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
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
};
/// One pass over the log of `device`. kiroku::Error where it cannot be read.
LogOfCase read_log_of_case(const std::filesystem::path& log_folder, const archive::OpenEntry& open,
                           const crypto::VerifierKey& device);

/// Whether the log held the seal before the case began. "order": the case's first entry states the log's size
/// and root as they were then. It comes before the first picture, unless a room recorded ahead of the case;
/// for that "ahead" compares the seal's line with what was recorded first, both by the machine's clock.
/// `device`: whose log it is; `opened`: of the case's first entry.
std::vector<Check> check_sealed_before(const LogOfCase& log, const std::string& device,
                                       const archive::OpenEntry& open, const archive::Moment& opened,
                                       const crypto::Sha256Digest& seal);

}  // namespace kiroku::compare
