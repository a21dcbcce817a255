// Serial numbers that never repeat, also not after a crash or between processes (RFC 3161 section 2.4.2: "it
// MUST be unique for each TimeStampToken issued by a given TSA").
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>

namespace kiroku::timestamp {

/// A file holds the first number not reserved yet, in decimal. A block of numbers is reserved durably before
/// the first of them is handed out, so that only each 1,000th costs an fsync; a crash skips the rest of its
/// block. Processes exclude each other by a lock on "<file>.lock" while they reserve. Thread-safe.
class SerialCounter {
 public:
  static constexpr std::uint64_t kBlock = 1'000;

  /// A new counter that starts at 1; refuses to overwrite one.
  static void create(const std::filesystem::path& file);
  /// Continues the counter in `file`; throws kiroku::Error if it is none (it is never guessed).
  explicit SerialCounter(std::filesystem::path file);
  /// Throws kiroku::IoError if a block cannot be reserved.
  std::uint64_t next();

 private:
  void reserve_block();

  std::filesystem::path file_;
  std::mutex mutex_;
  std::uint64_t next_ = 0;  // the block in hand is [next_, end_)
  std::uint64_t end_ = 0;
};

}  // namespace kiroku::timestamp
