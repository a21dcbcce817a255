// Copies of cases on another disk, which the site makes with a program of its own (rsync, a backup): whether
// one holds what is about to be erased here. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace kiroku::archive {

/// Nothing if `replica`, a copy of `case_folder`, holds every segment of the stream that the case still has,
/// with the size and the hash that the ledger states, and a ledger that is this one's, as far as it goes,
/// with `close` in it. Else the first reason why not: "segments/room/ 00000003.ts.age is not there". Reads
/// all of these segments. Throws kiroku::Error if the case itself cannot be read.
std::optional<std::string> why_not_replicated(const std::filesystem::path& case_folder,
                                              const std::string& stream,
                                              const std::filesystem::path& replica);

}  // namespace kiroku::archive
