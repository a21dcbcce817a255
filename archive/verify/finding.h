// What verification finds, as data.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace kiroku::archive {

enum class Severity {
  kNote,        // worth knowing, changes nothing
  kGap,         // stated gap, missed token, erased or recovered part: intact-with-gaps
  kUnproven,    // could not be checked: no trusted key, no authority, no token
  kIncomplete,  // still recorded, or never closed
  kTampered,    // does not hold
};

/// One fact. `code` is stable and listed in docs/reference/format.md; `text` is one sentence for people.
struct Finding {
  std::string code;
  Severity severity = Severity::kNote;
  std::string file;                     // relative to the case folder, empty if none
  std::optional<std::uint64_t> entry;   // ledger seq
  std::optional<std::uint64_t> offset;  // byte offset in `file`
  std::string text;
  bool of_log = false;  // about the appliance log beside the case, or what it says; `file` begins with "log/"
};

}  // namespace kiroku::archive
