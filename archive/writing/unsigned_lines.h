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
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/log_entry.h"
#include "crypto/hash.h"

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
  std::uint64_t number = 0;
  std::uint64_t offset = 0;  // of its first byte
};

/// Of constant size, however many lines stand there.
struct UnsignedLines {
  std::optional<crypto::Sha256Digest> root_before;  // of the lines before them; nothing where there are fewer
  std::uint64_t end = 0;                            // the number behind the last line
  crypto::Sha256Digest root{};                      // of all lines
  std::uint64_t demanding = 0;          // lines before the first foreign one that a checkpoint must follow
  std::optional<UnsignedLine> first;    // of these
  std::optional<UnsignedLine> foreign;  // the first one
  std::uint64_t demanding_behind = 0;   // of it and the lines behind it those that do not attend
  bool opens_here = false;              // whether one of these opens a case that `is_here` knows
};

/// The lines from number `from` on, and their kinds: of keys the own ones alone, of damage only `damage`.
/// `is_here` is asked of a case that no line before opens. Throws kiroku::Error where the file cannot be
/// read.
UnsignedLines unsigned_lines(const FileReading& files, const std::filesystem::path& file, std::uint64_t from,
                             const LogKeys& own, const std::optional<LogDamageEntry>& damage,
                             const std::function<bool(const CaseOpenedEntry&)>& is_here);

/// What a file beside the log is called, behind its name, until an entry tells of it.
inline constexpr std::string_view kUntoldSuffix = ".untold";

/// So much of what is set aside is kept: whoever adds lines fills no disk by it.
inline constexpr std::uint64_t kMostBytesAside = std::uint64_t{16} << 20U;

struct SetAside {
  std::filesystem::path file;  // as it is called without kUntoldSuffix
  std::string sha256;          // in hexadecimal
  std::uint64_t stood = 0;     // bytes that stood there
  std::uint64_t kept = 0;      // bytes of them in the file
};
/// Whether an entry is to tell of the file.
enum class Telling { kNone, kFollows };
/// Writes what stands in `file` from byte `offset` on durably into a file of its own in log-aside/ of
/// `archive`, which is made unless it is there: the first kMostBytesAside of it, without holes, which take no
/// room on the disk. Where that is no folder, or nothing can be written into it,
/// another one beside it is taken, at last one whose name nobody can know before. The file's name is the
/// number of the first line and the SHA-256 of what is in it. Throws kiroku::IoError, and leaves nothing then
/// but folders.
SetAside set_aside(FileSystem& files, const std::filesystem::path& file, std::uint64_t line,
                   std::uint64_t offset, const std::filesystem::path& archive, Telling telling);

/// How much of a file from byte `offset` on set_aside() keeps, about: where the last of it is short and lies
/// between holes, somewhat more. Throws kiroku::IoError.
std::uint64_t bytes_to_keep(const FileReading& files, const std::filesystem::path& file,
                            std::uint64_t offset);

/// Lines that the device signed, and that are none of the format any more.
struct ChangedAside {
  /// What stands in their place now, one behind the other; no entry tells of it yet. Empty where there are
  /// none.
  SetAside kept;
  std::uint64_t lines = 0;  // so many of them; none where the last one only lost its end
  /// All lines from the first of them on, with a mark in the place of each of them. Another file that is
  /// called as if no entry told of it, until somebody puts these lines into the log, and removes it.
  std::filesystem::path instead;
  struct Rest {
    std::uint64_t number = 0, offset = 0;
  };
  std::optional<Rest> rest;  // from there on nothing of the file is among these lines
};
/// Writes both beside the log as set_aside() does, of `file` from byte `offset` on, where line number `line`
/// begins. `covered` lines are signed. Where one behind them is none of the format, or all that stands behind
/// them is longer than kMostBytesAside, the rest begins. Throws kiroku::Error, and leaves nothing then but
/// folders.
ChangedAside set_changed_aside(FileSystem& files, const std::filesystem::path& file, std::uint64_t line,
                               std::uint64_t offset, std::uint64_t covered,
                               const std::filesystem::path& archive);

/// A file of which, by its name, no entry tells yet. Whoever can write to the archive makes such files, too.
struct UntoldAside {
  std::uint64_t line = 0;
  SetAside kept;
};
/// In log-aside/ of `archive` and those beside it; no more than `most`. Throws kiroku::IoError.
std::vector<UntoldAside> untold_asides(const FileReading& files, const std::filesystem::path& archive,
                                       std::size_t most);
/// An entry tells of it from now on. Where something is in the way of its name it gets another one, which
/// nobody can know before. Throws kiroku::IoError.
void name_as_told(FileSystem& files, const SetAside& kept);

}  // namespace kiroku::archive
