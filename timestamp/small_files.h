// Small files that must survive a power cut: keys, certificates, counters. Thread-safe; throws
// kiroku::IoError.
#pragma once

#include <filesystem>
#include <sys/types.h>

#include "base/bytes.h"

namespace kiroku::timestamp {

/// The whole file; refuses more than 1 MiB.
Bytes read_small_file(const std::filesystem::path& file);
/// A new file with exactly this mode; refuses to overwrite. Written, fsynced, and its folder fsynced.
void write_new_file(const std::filesystem::path& file, ByteView bytes, mode_t mode);
/// Old or new contents, never a mixture: write and fsync a neighbour (".part"), rename it over, fsync the
/// folder. Concurrent calls for one file must exclude each other.
void replace_file(const std::filesystem::path& file, ByteView bytes, mode_t mode);

}  // namespace kiroku::timestamp
