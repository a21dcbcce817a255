// What stands at the end of the appliance log behind the newest checkpoint of its device, and what may be
// left there. Functions; thread-safe.
//
// A writer appends the entries that must come first (a boot, keys, a cut made good, damage), then one line,
// then signs a checkpoint. A start of the machine and a change of its configuration wait for the next line's
// checkpoint. So a crash or a power cut leaves any number of such attending entries, and one line behind
// them. Whatever else stands there, somebody else put there, or took checkpoints away.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "archive/format/log_entry.h"

namespace kiroku::archive {

class FileReading;
class FileSystem;

/// Of the device whose log it is, as its entries state them; "" for keys that it does not have.
struct LogKeys {
  std::string device, ml_dsa, hardware, attestation;
};

struct UnsignedLine {
  enum class Kind {
    kAttends,    // no checkpoint need follow it at once
    kStatement,  // its checkpoint follows at once: one that lacks it counts for nothing
    kKept,       // the same, and the device stands on it: a case's opening, its key
    kForeign     // no writer of this device leaves it
  };
  Kind kind = Kind::kForeign;
  std::uint64_t offset = 0;               // of its first byte
  std::optional<CaseOpenedEntry> opened;  // of a case that no line before it opens
};

/// The lines from number `from` on, and their kinds: of keys the own ones alone, of damage only `damage`.
/// Throws kiroku::Error where the file cannot be read.
std::vector<UnsignedLine> unsigned_lines(const FileReading& files, const std::filesystem::path& file,
                                         std::uint64_t from, const LogKeys& own,
                                         const std::optional<LogDamageEntry>& damage);

/// Writes what stands in `file` from byte `offset` on durably into a file of its own below `folder`, which is
/// made unless it is there. The file's name is the number of the first line and the SHA-256 of what is in it.
struct SetAside {
  std::filesystem::path file;
  std::string sha256;  // in hexadecimal
};
/// Throws kiroku::IoError, and leaves nothing then.
SetAside set_aside(FileSystem& files, const std::filesystem::path& file, std::uint64_t line,
                   std::uint64_t offset, const std::filesystem::path& folder);

}  // namespace kiroku::archive
