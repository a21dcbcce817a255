#include "apps/common/file.h"

#include <cerrno>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

Descriptor open_to_read(const std::filesystem::path& file, const std::string& what) {
  Descriptor opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (!opened) throw IoError("read " + what, file, errno);
  return opened;
}

}  // namespace

Bytes read_small_file(const std::filesystem::path& file, const std::string& what, std::size_t most_bytes) {
  const Descriptor descriptor = open_to_read(file, what);
  Bytes bytes;
  Bytes block(64U << 10);
  for (;;) {
    const ssize_t got = ::read(descriptor.number(), block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw IoError("read " + what, file, errno);
    if (got == 0) return bytes;
    append(bytes, ByteView(block).first(std::size_t(got)));
    if (bytes.size() > most_bytes) {
      throw UsageError(what + " " + file.string() + " is larger than " + std::to_string(most_bytes >> 20U) +
                       " MiB: is it the right file?");
    }
  }
}

bool is_open_to_others(const std::filesystem::path& file) {
  struct stat facts {};
  if (::stat(file.c_str(), &facts) != 0) throw IoError("look at", file, errno);
  return (facts.st_mode & (S_IRWXG | S_IRWXO)) != 0;
}

MappedFile::MappedFile(const std::filesystem::path& file) {
  const Descriptor descriptor = open_to_read(file, "the file");
  struct stat facts {};
  if (::fstat(descriptor.number(), &facts) != 0) throw IoError("look at", file, errno);
  if (!S_ISREG(facts.st_mode)) throw UsageError(file.string() + " is not a regular file: give one");
  if (facts.st_size == 0) return;
  void* data = ::mmap(nullptr, std::size_t(facts.st_size), PROT_READ, MAP_PRIVATE, descriptor.number(), 0);
  if (data == MAP_FAILED) throw IoError("read", file, errno);
  data_ = static_cast<const std::byte*>(data);
  size_ = std::size_t(facts.st_size);
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(const_cast<std::byte*>(data_), size_);
}

}  // namespace kiroku::apps
