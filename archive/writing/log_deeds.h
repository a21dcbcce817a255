// What a device says of lines of its log that are not its own: in entries `access` that it makes itself.
// Functions; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "archive/writing/unsigned_lines.h"

namespace kiroku::archive {

/// Who enters them.
inline constexpr std::string_view kItself = "kiroku";
inline constexpr std::string_view kFoundBegins = "found no signature of this device over entries ";
/// Behind it stands the SHA-256 of what was set aside, to the end.
inline constexpr std::string_view kSha256Ends = ", sha256 ";

/// Entries of these numbers, both among them.
struct Entries {
  std::uint64_t from = 0, to = 0;
};

std::string found_deed(std::uint64_t from, std::uint64_t to);
/// What stood from entry `from` on.
std::string set_aside_deed(std::uint64_t from, const SetAside& kept);
std::string left_aside_deed(std::uint64_t from, const std::string& sha256);
std::string changed_deed(std::uint64_t from, const ChangedAside& changed);
/// Over which entries a deed says that no signature was found; nothing for any other.
std::optional<Entries> entries_of_deed(std::string_view what);

}  // namespace kiroku::archive
