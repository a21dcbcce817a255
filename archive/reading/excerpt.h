// A verifiable part of a case (docs/reference/format.md, "Excerpts"). Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"
#include "base/utc_time.h"
#include "crypto/age_recipient.h"

namespace kiroku::archive {

struct ExcerptOptions {
  std::int64_t from_ns = 0, to_ns = 0;                // case clock, half open
  std::vector<std::string> streams;                   // empty: all
  const crypto::AgeIdentities* identities = nullptr;  // with `recipients`: re-key for a new reader
  crypto::AgeRecipients recipients;
  // What excerpt.json states of its making; nothing proves it. Left out where not given.
  std::optional<UtcTime> made_at;
  std::string made_by;
};
struct ExcerptResult {
  std::uint64_t segments = 0, bytes = 0;
  std::uint64_t first_entry = 0, last_entry = 0;
};
/// Writes `folder` (which must not exist); nothing is left there on failure. Time beyond the end of a closed
/// case is cut off. Throws kiroku::UsageError where the selected streams have nothing in that time.
ExcerptResult make_excerpt(const std::filesystem::path& case_folder, const ExcerptOptions& options,
                           const std::filesystem::path& folder, FileSystem& files = real_file_system());

}  // namespace kiroku::archive
