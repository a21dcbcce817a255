// The inside of a box that does jobs (boxed_jobs.h): what the program kiroku-decoder does as "segments".
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "crypto/byte_source.h"

namespace kiroku::media {

/// What a job may ask of the other end. An object belongs to the process's first thread.
class JobSegments {
 public:
  virtual ~JobSegments() = default;
  /// Plaintext of the segment that the asker knows by this number; it is decrypted as it is read. Throws what
  /// the other end says, as crypto::AgeError, MediaError, kiroku::UsageError or kiroku::Error.
  virtual std::unique_ptr<crypto::ByteSource> open(std::uint64_t segment) = 0;
  /// Adds to what the job makes.
  virtual void give(ByteView bytes) = 0;
};

using Job = std::function<nlohmann::json(const nlohmann::json& with, JobSegments& segments)>;
using Jobs = std::map<std::string, Job, std::less<>>;

inline constexpr unsigned kMostProcessorSeconds = 600;

/// Closes the box, then does what is asked, one job after the other, until the other end goes; then the
/// process ends, as it does after so many seconds of a processor (0: any). The channel and the memory are
/// where child.h says.
[[noreturn]] void run_job_box(const Jobs& jobs, unsigned processor_seconds = kMostProcessorSeconds);

}  // namespace kiroku::media
