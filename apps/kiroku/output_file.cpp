#include "apps/kiroku/output_file.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <initializer_list>
#include <unistd.h>

#include "base/error.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

std::atomic<const char*> unfinished{nullptr};  // path that a signal handler removes

void remove_unfinished(int signal) {
  if (const char* path = unfinished.exchange(nullptr)) ::unlink(path);
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

void remove_on_signals() {
  struct sigaction action {};
  action.sa_handler = remove_unfinished;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &action, nullptr);
}

void sync_folder_of(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) throw IoError("open the folder", folder, errno);
  const int failed = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  if (failed != 0) throw IoError("make durable", folder, failed);
}

}  // namespace

void write_all(int descriptor, ByteView bytes, const fs::path& name_for_errors) {
  // Measured on ext4: a page cache filled in steps of 64 KiB takes a third of the time that steps of 1 MiB
  // take.
  constexpr std::size_t kStep = 64U << 10;
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), std::min(bytes.size(), kStep));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw IoError("write", name_for_errors, errno);
    bytes = bytes.subspan(std::size_t(written));
  }
}

OutputFile::OutputFile(fs::path name, unsigned mode) : name_(std::move(name)), part_(name_) {
  std::error_code ignored;
  const fs::file_status status = fs::status(name_, ignored);
  if (fs::is_directory(status)) throw UsageError(name_.string() + " is a folder: name a file to write");
  direct_ = fs::exists(status) && !fs::is_regular_file(status);
  part_ += ".part";
  const fs::path& target = direct_ ? name_ : part_;
  const int flags = direct_ ? O_WRONLY | O_CLOEXEC : O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC;
  descriptor_ = ::open(target.c_str(), flags, mode);
  if (descriptor_ < 0 && errno == EEXIST) {
    throw UsageError(part_.string() +
                     " is there already: another program writes it, or one was interrupted; "
                     "remove it if nothing does");
  }
  if (descriptor_ < 0) throw IoError("write", target, errno);
  if (direct_) return;
  behind_.emplace(descriptor_);
  unfinished = part_.c_str();
  remove_on_signals();
}

OutputFile::~OutputFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  if (direct_) return;
  unfinished = nullptr;
  ::unlink(part_.c_str());
}

void OutputFile::write(ByteView bytes) {
  write_all(descriptor_, bytes, name_);
  written_ += bytes.size();
  if (behind_) behind_->wrote_until(written_);
}

void OutputFile::commit(Durability durability) {
  if (!direct_) {
    if (durability == Durability::kNow && ::fsync(descriptor_) != 0)
      throw IoError("make durable", part_, errno);
    if (::rename(part_.c_str(), name_.c_str()) != 0) throw IoError("write", name_, errno);
    unfinished = nullptr;
  }
  const int descriptor = descriptor_;
  descriptor_ = -1;
  if (::close(descriptor) != 0) throw IoError("write", name_, errno);
  if (!direct_ && durability == Durability::kNow) sync_folder_of(name_);
}

}  // namespace kiroku::apps
