#include "archive/writing/log_deeds.h"

#include <charconv>
#include <cstddef>

namespace kiroku::archive {

std::string found_deed(std::uint64_t from, std::uint64_t to) {
  return std::string(kFoundBegins) + std::to_string(from) + " to " + std::to_string(to);
}

std::string set_aside_deed(std::uint64_t from, const SetAside& kept) {
  const std::string what = kept.kept == kept.stood ? "what"
                                                   : std::to_string(kept.kept) + " of the " +
                                                         std::to_string(kept.stood) + " bytes that";
  return "set aside " + what + " stood from entry " + std::to_string(from) +
         " on, which this device did not sign" + std::string(kSha256Ends) + kept.sha256;
}

std::string left_aside_deed(std::uint64_t from, const std::string& sha256) {
  return "found beside the log what was set aside from entry " + std::to_string(from) +
         " on, of which no entry told" + std::string(kSha256Ends) + sha256;
}

std::string changed_deed(std::uint64_t from, const ChangedAside& changed) {
  return "set aside what stood in lines from entry " + std::to_string(from) +
         " on that this device had signed, and that are no entries any more" + std::string(kSha256Ends) +
         changed.kept.sha256;
}

std::optional<Entries> entries_of_deed(std::string_view what) {
  if (!what.starts_with(kFoundBegins)) return std::nullopt;
  what.remove_prefix(kFoundBegins.size());
  Entries entries;
  const auto first = std::from_chars(what.begin(), what.end(), entries.from);
  constexpr std::string_view kTo = " to ";
  const std::string_view rest(first.ptr, static_cast<std::size_t>(what.end() - first.ptr));
  if (first.ec != std::errc() || !rest.starts_with(kTo)) return std::nullopt;
  const auto second = std::from_chars(rest.begin() + kTo.size(), rest.end(), entries.to);
  return second.ec == std::errc() && second.ptr == rest.end() ? std::optional(entries) : std::nullopt;
}

}  // namespace kiroku::archive
