// Room on the disk for what people make by the network, beside what a recorder may need: everybody's files
// lie on its disk. Function; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>

namespace kiroku::viewer {

/// What is always left to a recorder.
inline constexpr std::uint64_t kLeftToRecorder = std::uint64_t{2} << 30;

/// Refusal 507 where less than `left` bytes would be free in `folder` after `bytes` more; `advice` ends the
/// sentence: "choose a shorter time". Refusal 500 where the disk does not say how much is free.
void require_disk_room(const std::filesystem::path& folder, std::uint64_t bytes, const char* advice,
                       std::uint64_t left = kLeftToRecorder);

}  // namespace kiroku::viewer
