#include "timestamp/small_files.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::timestamp {
namespace {

constexpr std::size_t kLargest = 1 << 20;

Descriptor open_or_throw(const std::filesystem::path& path, int flags, mode_t mode, const char* action) {
  Descriptor opened(::open(path.c_str(), flags | O_CLOEXEC, mode));
  if (!opened) throw IoError(action, path, errno);
  return opened;
}

void sync_folder_of(const std::filesystem::path& file) {
  const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  const Descriptor descriptor = open_or_throw(folder, O_RDONLY | O_DIRECTORY, 0, "open the folder");
  if (::fsync(descriptor.number()) != 0) throw IoError("sync the folder", folder, errno);
}

void write_and_sync(const std::filesystem::path& file, ByteView bytes, int flags, mode_t mode) {
  const Descriptor descriptor = open_or_throw(file, O_WRONLY | O_CREAT | flags, mode, "create");
  // The umask may have taken bits away, and a file that was there keeps its mode.
  if (::fchmod(descriptor.number(), mode) != 0) throw IoError("set the mode of", file, errno);
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor.number(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw IoError("write", file, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  if (::fsync(descriptor.number()) != 0) throw IoError("sync", file, errno);
}

}  // namespace

Bytes read_small_file(const std::filesystem::path& file) {
  const Descriptor descriptor = open_or_throw(file, O_RDONLY, 0, "open");
  Bytes out;
  std::array<std::byte, 16'384> piece{};
  while (true) {
    const ssize_t got = ::read(descriptor.number(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw IoError("read", file, errno);
    if (got == 0) return out;
    append(out, ByteView(piece).first(static_cast<std::size_t>(got)));
    if (out.size() > kLargest) throw IoError("read", file, EFBIG);
  }
}

void write_new_file(const std::filesystem::path& file, ByteView bytes, mode_t mode) {
  write_and_sync(file, bytes, O_EXCL, mode);
  sync_folder_of(file);
}

void replace_file(const std::filesystem::path& file, ByteView bytes, mode_t mode) {
  const std::filesystem::path part = file.string() + ".part";
  write_and_sync(part, bytes, O_TRUNC, mode);
  if (::rename(part.c_str(), file.c_str()) != 0) throw IoError("rename into place", file, errno);
  sync_folder_of(file);
}

}  // namespace kiroku::timestamp
