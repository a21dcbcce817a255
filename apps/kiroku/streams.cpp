#include "apps/kiroku/streams.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "apps/common/terminal.h"
#include "base/error.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

InputStream::InputStream(const std::string& name)
    : name_(name == "-" ? "standard input" : name),
      descriptor_(name == "-" ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3)
                              : ::open(name.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_ < 0) throw IoError("read", name_, errno);
  struct stat facts {};
  if (::fstat(descriptor_, &facts) != 0) throw IoError("look at", name_, errno);
  if (S_ISDIR(facts.st_mode)) {
    ::close(descriptor_);
    throw UsageError(name_.string() + " is a folder: name a file (tar packs a folder into one)");
  }
  regular_ = S_ISREG(facts.st_mode) && name != "-";
  if (S_ISREG(facts.st_mode)) size_ = std::uint64_t(facts.st_size);
}

InputStream::~InputStream() { ::close(descriptor_); }

std::size_t InputStream::read_some(std::span<std::byte> into) {
  std::size_t done = 0;
  while (done < into.size()) {
    const ssize_t got = ::read(descriptor_, into.data() + done, into.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw IoError("read", name_, errno);
    if (got == 0) break;
    done += std::size_t(got);
  }
  return done;
}

std::size_t InputStream::read(std::span<std::byte> into) {
  const std::size_t taken = std::min(ahead_.size(), into.size());
  std::copy_n(ahead_.begin(), taken, into.begin());
  ahead_.erase(ahead_.begin(), ahead_.begin() + std::ptrdiff_t(taken));
  return taken + read_some(into.subspan(taken));
}

ByteView InputStream::peek(std::size_t most) {
  if (ahead_.size() < most) {
    const std::size_t before = ahead_.size();
    ahead_.resize(most);
    ahead_.resize(before + read_some(std::span(ahead_).subspan(before)));
  }
  return ByteView(ahead_).first(std::min(most, ahead_.size()));
}

OutputStream::OutputStream(const std::optional<std::string>& name, const InputStream& input, bool binary) {
  if (name && *name != "-") {
    std::error_code ignored;
    if (input.is_regular_file() && fs::equivalent(*name, input.file(), ignored)) {
      throw UsageError("input and output are the same file " + *name + ": name another output");
    }
    file_ = std::make_unique<OutputFile>(*name);
    return;
  }
  if (!name && binary && output_is_terminal()) {
    throw UsageError("the output is no text for a terminal: name a file with -o FILE, or insist with -o -");
  }
}

void OutputStream::write(ByteView bytes) {
  if (file_) {
    file_->write(bytes);
  } else {
    write_all(STDOUT_FILENO, bytes, "standard output");
  }
}

void OutputStream::commit(OutputFile::Durability durability) {
  if (file_) file_->commit(durability);
}

}  // namespace kiroku::apps
