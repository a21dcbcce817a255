// What a program and a box that does jobs for it (boxed_jobs.h, job_box.h) say to each other.
#pragma once

#include <cstddef>
#include <cstdint>

namespace kiroku::media {

/// Where plaintext is handed over: four chunks of age's payload, as media::SegmentInput reads.
inline constexpr std::size_t kWindowBytes = 4 * 64 * 1024;

enum class ToJobBox : std::uint32_t {
  kJob = 1,  // JSON: "what", "with"
  kOpened,   // SegmentSize
  kRead,     // SegmentCount; as many bytes are in the window
  kRefused,  // JSON: "kind", "text"
};
enum class FromJobBox : std::uint32_t {
  kReady = 1,  // once: the box is closed
  kOpen,       // SegmentNumber
  kRead,       // SegmentRead
  kClose,      // SegmentNumber, a handle
  kBytes,      // more of the result
  kDone,       // JSON: the answer
  kFailed,     // JSON: "kind", "text"
};

struct SegmentNumber {
  std::uint64_t number = 0;  // of the job's segments, or a handle
};
struct SegmentSize {
  std::uint64_t handle = 0, size = 0;
};
struct SegmentRead {
  std::uint64_t handle = 0, offset = 0, bytes = 0;
};
struct SegmentCount {
  std::uint64_t bytes = 0;
};

/// Kinds of errors that mean something to whoever catches them.
inline constexpr const char* kMediaFailure = "media";
inline constexpr const char* kUsageFailure = "usage";
inline constexpr const char* kAgeFailure = "age";
inline constexpr const char* kOtherFailure = "other";

}  // namespace kiroku::media
