// Where a command may write what a person names. A file that its ledger does not name makes a case read as
// tampered, and one that takes a ledger's place is the end of the case. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <string>

namespace kiroku::apps {

/// What comes to lie where an option or an argument says.
enum class Writes {
  kNothing,
  kOutput,  // a file or a folder of a person's
  kCases,   // folders of cases, which an archive may hold
};

/// Throws kiroku::UsageError where `named` lies in a case, an excerpt or an appliance log (a folder with a
/// ledger or an excerpt's document, at any depth below it), in the archive of a home or among the keys of its
/// authority, or is a file that a home consists of: links resolved. `option` is what names it: "--output".
void require_output_place(const std::filesystem::path& named, const std::string& option, Writes what);
/// The same of what a command writes beside `input`, which a person named, without being asked where to.
void require_place_beside(const std::filesystem::path& input, const std::filesystem::path& output);

}  // namespace kiroku::apps
