#include "recorder/daemon/kept_memory.h"

#include <algorithm>
#include <cerrno>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "crypto/hash.h"

#ifndef MFD_NOEXEC_SEAL
#define MFD_NOEXEC_SEAL 0x0008U  // NOLINT(cppcoreguidelines-macro-usage): as the kernel's header, since 6.3
#endif

namespace kiroku::recorder {
namespace {

constexpr const char* kName = "kiroku-kept";
// Generation, SHA-256 over it and the bytes, the bytes.
constexpr std::size_t kNumberBytes = sizeof(std::uint64_t);
constexpr std::size_t kHeaderBytes = kNumberBytes + std::tuple_size_v<crypto::Sha256Digest>;

Descriptor make_file() {
  Descriptor made(::memfd_create(kName, MFD_CLOEXEC | MFD_NOEXEC_SEAL));
  if (!made && errno == EINVAL) made = Descriptor(::memfd_create(kName, MFD_CLOEXEC));
  if (!made) throw IoError("make", kName, errno);
  return made;
}

using Number = std::array<std::byte, kNumberBytes>;

Number number_of(std::uint64_t generation) {
  Number number{};
  for (std::size_t i = 0; i < kNumberBytes; ++i)
    number.at(i) = static_cast<std::byte>((generation >> (8 * i)) & 0xFFU);
  return number;
}

crypto::Sha256Digest digest_of(std::uint64_t generation, ByteView bytes) {
  crypto::Sha256 hash;
  hash.update(number_of(generation));
  hash.update(bytes);
  return hash.finish();
}

struct Content {
  std::uint64_t generation = 0;
  Bytes bytes;
};

std::optional<Content> read_file(int file) {
  struct stat facts {};
  if (::fstat(file, &facts) != 0 || !S_ISREG(facts.st_mode)) return {};
  const auto size = static_cast<std::uint64_t>(facts.st_size);
  if (size < kHeaderBytes || size > kHeaderBytes + KeptMemory::kMostBytes) return {};
  Bytes all(size);
  std::size_t done = 0;
  while (done < all.size()) {
    const ssize_t count = ::pread(file, all.data() + done, all.size() - done, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return {};
    done += static_cast<std::size_t>(count);
  }
  Content content;
  for (std::size_t i = 0; i < kNumberBytes; ++i)
    content.generation |= std::to_integer<std::uint64_t>(all[i]) << (8 * i);
  crypto::Sha256Digest stated{};
  std::copy_n(all.begin() + kNumberBytes, stated.size(), stated.begin());
  all.erase(all.begin(), all.begin() + kHeaderBytes);
  content.bytes = std::move(all);
  if (digest_of(content.generation, content.bytes) != stated) return {};
  return content;
}

}  // namespace

KeptMemory::KeptMemory(std::array<Descriptor, kFiles> earlier) : files_(std::move(earlier)) {
  for (std::size_t i = 0; i < kFiles; ++i) {
    if (!files_.at(i)) files_.at(i) = make_file();
    auto content = read_file(files_.at(i).number());
    if (!content || content->generation <= generation_) continue;
    generation_ = content->generation;
    newest_ = i;
    earlier_ = std::move(content->bytes);
  }
}

std::optional<Bytes> KeptMemory::take_earlier() { return std::exchange(earlier_, {}); }

void KeptMemory::keep(ByteView bytes) {
  if (bytes.size() > kMostBytes) throw IoError("keep", kName, EFBIG);
  const std::uint64_t generation = generation_ + 1;
  const std::size_t into = (newest_ + 1) % kFiles;
  const int file = files_.at(into).number();
  Bytes all;
  all.reserve(kHeaderBytes + bytes.size());
  append(all, number_of(generation));
  append(all, digest_of(generation, bytes));
  append(all, bytes);
  if (::ftruncate(file, 0) != 0) throw IoError("keep", kName, errno);
  std::size_t done = 0;
  while (done < all.size()) {
    const ssize_t count = ::pwrite(file, all.data() + done, all.size() - done, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) throw IoError("keep", kName, count == 0 ? ENOSPC : errno);
    done += static_cast<std::size_t>(count);
  }
  generation_ = generation;
  newest_ = into;
}

}  // namespace kiroku::recorder
