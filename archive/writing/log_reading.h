// Reading an appliance log without opening it for writing, and what its device signed of it. Functions;
// thread-safe, also while another process appends.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// One line of the log for listing.
struct LogLine {
  std::uint64_t seq = 0;  // which line it is, from 0; what it states of itself is not believed
  UtcTime utc;
  std::string type;
  std::string json;  // the exact line
};

/// Calls `visit` with each line of a log, in order, without opening it for writing; a torn last line is left
/// out. Throws kiroku::Error naming the line that cannot be read.
void for_each_log_line(const std::filesystem::path& folder, const std::function<void(const LogLine&)>& visit);
/// The same for whoever goes on where a line is damaged: it is left out. Why the first of them cannot be
/// read, naming it; "" where all can.
std::string for_each_readable_log_line(const std::filesystem::path& folder,
                                       const std::function<void(const LogLine&)>& visit);
/// Whether `device` signed the log when its newest entry was number `seq`: its own checkpoint, over `root`,
/// the tree's root then. Each entry but `boot` and `config-changed` has one. An entry without was cut off in
/// that moment, or made up by somebody who can write to the disk; what is signed later covers both. False
/// where the checkpoint cannot be read.
bool is_signed_entry(const std::filesystem::path& folder, const crypto::VerifierKey& device,
                     std::uint64_t seq, const crypto::Sha256Digest& root);
/// The most lines over which the device signed a checkpoint that lies there, whether they are there or not;
/// 0: none. Files of others count for nothing: whoever can write to the disk makes them. Throws
/// kiroku::IoError.
std::uint64_t newest_signed_size(const std::filesystem::path& folder, const crypto::VerifierKey& device);
/// What an entry `damage-found` of number `entry` says of how many lines.
struct DamageClaim {
  std::uint64_t entry = 0, size = 0;
};
/// The first of these that is not refuted. One is where before it stood as many lines as it names, and a
/// checkpoint that the device signed over them, or more of them, fits: whoever can write to the disk could
/// have made the entry up. `claims` ascend by entry. Reads the log once, and each note once at most. Throws
/// kiroku::IoError.
std::optional<DamageClaim> first_that_stands(const std::filesystem::path& folder,
                                             const crypto::VerifierKey& device,
                                             std::span<const DamageClaim> claims);
/// The tree's root over the first `size` lines. kiroku::Error if there are fewer, or one cannot be read.
crypto::Sha256Digest root_of_log(const std::filesystem::path& folder, std::uint64_t size);
/// All of them.
std::vector<LogLine> read_log(const std::filesystem::path& folder);

}  // namespace kiroku::archive
