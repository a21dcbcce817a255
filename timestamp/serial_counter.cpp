#include "timestamp/serial_counter.h"

#include <cerrno>
#include <charconv>
#include <fcntl.h>
#include <limits>
#include <string>
#include <sys/file.h>
#include <unistd.h>
#include <utility>

#include "base/bytes.h"
#include "base/error.h"
#include "timestamp/small_files.h"

namespace kiroku::timestamp {
namespace {

constexpr mode_t kMode = 0600;

/// Holds the lock file exclusively until destruction.
class FileLock {
 public:
  explicit FileLock(const std::filesystem::path& path)
      : descriptor_(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kMode)) {
    if (descriptor_ < 0) throw IoError("open the lock", path, errno);
    int status = 0;
    do {
      status = ::flock(descriptor_, LOCK_EX);
    } while (status != 0 && errno == EINTR);
    if (status != 0) {
      const int error_number = errno;
      ::close(descriptor_);
      throw IoError("lock", path, error_number);
    }
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock() { ::close(descriptor_); }

 private:
  int descriptor_;
};

std::string text_for(std::uint64_t number) { return std::to_string(number) + "\n"; }

std::uint64_t read_counter(const std::filesystem::path& file) {
  const Bytes bytes = read_small_file(file);
  const std::string_view text = text_of(bytes);
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max() - SerialCounter::kBlock;
  if (error != std::errc() || number == 0 || number > kMost || text != text_for(number)) {
    throw Error("the serial counter " + file.string() + " is damaged (" + std::to_string(end - text.data()) +
                " of " + std::to_string(text.size()) +
                " bytes are a number): make a new authority, for its serial numbers must never repeat");
  }
  return number;
}

}  // namespace

void SerialCounter::create(const std::filesystem::path& file) {
  const std::string first = text_for(1);
  write_new_file(file, bytes_of(first), kMode);
}

SerialCounter::SerialCounter(std::filesystem::path file) : file_(std::move(file)) { read_counter(file_); }

std::uint64_t SerialCounter::next() {
  const std::lock_guard guard(mutex_);
  if (next_ == end_) reserve_block();
  return next_++;
}

void SerialCounter::reserve_block() {
  const FileLock lock(file_.string() + ".lock");
  const std::uint64_t first = read_counter(file_);
  const std::string after = text_for(first + kBlock);
  replace_file(file_, bytes_of(after), kMode);
  next_ = first;
  end_ = first + kBlock;
}

}  // namespace kiroku::timestamp
