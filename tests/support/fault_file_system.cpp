#include "tests/support/fault_file_system.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <fstream>
#include <sstream>
#include <utility>

namespace kiroku::test {

namespace fs = std::filesystem;

/// One opened file; `path_` is what it was called then.
class FaultFileSystem::File final : public archive::WritableFile {
 public:
  File(FaultFileSystem& system, fs::path path, std::unique_ptr<archive::WritableFile> real,
       std::shared_ptr<Content> content, std::uint64_t size)
      : system_(system),
        path_(std::move(path)),
        real_(std::move(real)),
        content_(std::move(content)),
        size_(size) {}

  void write(ByteView bytes) override {
    try {
      if (system_.enter("write " + name() + " " + std::to_string(bytes.size())) == Outcome::kFail) {
        write_half(bytes);
        throw IoError("write", path_, system_.error_number_);
      }
    } catch (const Killed&) {
      if (!std::exchange(died_, true)) {
        write_half(bytes);
      }
      throw;
    }
    real_->write(bytes);
    size_ += bytes.size();
  }

  void sync() override {
    flush("sync", [&] { real_->sync(); });
  }
  void sync_all() override {
    flush("sync_all", [&] { real_->sync_all(); });
  }

  void reserve(std::uint64_t bytes) override {
    step("reserve " + name() + " " + std::to_string(bytes), "allocate space for");
    real_->reserve(bytes);
  }

  void write_behind() override {
    step("writeback " + name(), "write back");
    real_->write_behind();
  }

  void truncate(std::uint64_t size) override {
    step("truncate " + name() + " " + std::to_string(size), "change the size of");
    real_->truncate(size);
    size_ = size;
    const std::lock_guard lock(system_.mutex_);
    content_->flushed_bytes = std::min(content_->flushed_bytes, size);
  }

  bool try_lock() override {
    step("lock " + name(), "lock");
    return real_->try_lock();
  }

  bool lock(std::chrono::milliseconds patience) override {
    step("lock " + name(), "lock");
    return real_->lock(patience);
  }

  void unlock() noexcept override { real_->unlock(); }

 private:
  [[nodiscard]] std::string name() const { return system_.relative(path_); }

  void step(const std::string& call, const std::string& action) {
    if (system_.enter(call) == Outcome::kFail) {
      throw IoError(action, path_, system_.error_number_);
    }
  }

  template <typename Flush>
  void flush(const std::string& kind, Flush do_it) {
    // Bytes written before the call began are safe after it, whatever another thread adds meanwhile.
    const std::uint64_t before = size_;
    if (system_.enter(kind + " " + name()) == Outcome::kFail) {
      throw archive::SyncError("flush", path_, system_.error_number_);
    }
    do_it();
    const std::lock_guard lock(system_.mutex_);
    content_->flushed_bytes = std::max<std::uint64_t>(content_->flushed_bytes, before);
  }

  void write_half(ByteView bytes) {
    const ByteView half = bytes.first(bytes.size() / 2);
    real_->write(half);
    size_ += half.size();
  }

  FaultFileSystem& system_;
  fs::path path_;
  std::unique_ptr<archive::WritableFile> real_;
  std::shared_ptr<Content> content_;
  std::atomic<std::uint64_t> size_;
  bool died_ = false;
};

FaultFileSystem::FaultFileSystem(fs::path root)
    : root_(std::move(root)), real_(archive::real_file_system()) {}

std::vector<std::string> FaultFileSystem::calls() const {
  const std::lock_guard lock(mutex_);
  return calls_;
}

void FaultFileSystem::forget_calls() {
  const std::lock_guard lock(mutex_);
  calls_.clear();
}

void FaultFileSystem::fail(std::string prefix, int error_number, std::size_t spared, std::size_t times) {
  const std::lock_guard lock(mutex_);
  failing_prefix_ = std::move(prefix);
  error_number_ = error_number;
  spared_ = spared;
  failures_left_ = times;
}

void FaultFileSystem::kill_at(std::size_t at) {
  const std::lock_guard lock(mutex_);
  calls_until_kill_ = at;
}

void FaultFileSystem::heal() {
  const std::lock_guard lock(mutex_);
  failures_left_ = 0;
  reads_.failures_left = 0;
  calls_until_kill_.reset();
  killed_ = false;
}

std::vector<std::string> FaultFileSystem::reads() const {
  const std::lock_guard lock(mutex_);
  return reads_.calls;
}

void FaultFileSystem::forget_reads() {
  const std::lock_guard lock(mutex_);
  reads_.calls.clear();
}

void FaultFileSystem::fail_reading(std::string prefix, ReadFault fault, std::size_t spared,
                                   std::size_t times) {
  const std::lock_guard lock(mutex_);
  reads_.failing_prefix = std::move(prefix);
  reads_.fault = fault;
  reads_.spared = spared;
  reads_.failures_left = times;
  reads_.played = 0;
}

std::size_t FaultFileSystem::faults_played() const {
  const std::lock_guard lock(mutex_);
  return reads_.played;
}

std::optional<FaultFileSystem::ReadFault> FaultFileSystem::enter_reading(const std::string& call) const {
  const std::lock_guard lock(mutex_);
  reads_.calls.push_back(call);
  if (reads_.failures_left == 0 || !call.starts_with(reads_.failing_prefix)) {
    return std::nullopt;
  }
  if (reads_.spared > 0) {
    --reads_.spared;
    return std::nullopt;
  }
  --reads_.failures_left;
  ++reads_.played;
  return reads_.fault;
}

int FaultFileSystem::open_at(int folder, const std::string& name, int flags, const fs::path& path) const {
  if (enter_reading("open " + relative(path)) == ReadFault::kFails) {
    errno = EIO;
    return -1;
  }
  return FileReading::open_at(folder, name, flags, path);
}

ssize_t FaultFileSystem::read_at(int descriptor, std::uint64_t offset, std::span<std::byte> into,
                                 const fs::path& path) const {
  const std::optional<ReadFault> fault = enter_reading(
      "read " + relative(path) + " " + std::to_string(offset) + " " + std::to_string(into.size()));
  if (fault == ReadFault::kFails) {
    errno = EIO;
    return -1;
  }
  if (fault == ReadFault::kEndsEarly) {
    return 0;
  }
  const std::size_t asked = fault == ReadFault::kHalf ? (into.size() + 1) / 2 : into.size();
  return FileReading::read_at(descriptor, offset, into.first(asked), path);
}

int FaultFileSystem::status_at(int folder, const std::string& name, struct stat& status,
                               const fs::path& path) const {
  if (enter_reading("examine " + relative(path)) == ReadFault::kFails) {
    errno = EIO;
    return -1;
  }
  return FileReading::status_at(folder, name, status, path);
}

const dirent* FaultFileSystem::next_name(DIR* folder, const fs::path& path) const {
  if (enter_reading("list " + relative(path)) == ReadFault::kFails) {
    errno = EIO;
    return nullptr;
  }
  return FileReading::next_name(folder, path);
}

FaultFileSystem::Outcome FaultFileSystem::enter(const std::string& call) {
  const std::lock_guard lock(mutex_);
  if (killed_) {
    throw Killed();
  }
  if (calls_until_kill_ && (*calls_until_kill_)-- == 0) {
    killed_ = true;
    throw Killed();
  }
  calls_.push_back(call);
  if (failures_left_ > 0 && call.starts_with(failing_prefix_)) {
    if (spared_ == 0) {
      --failures_left_;
      return Outcome::kFail;
    }
    --spared_;
  }
  return Outcome::kDo;
}

std::string FaultFileSystem::relative(const fs::path& path) const {
  return path.lexically_relative(root_).generic_string();
}

std::shared_ptr<FaultFileSystem::Content> FaultFileSystem::content_of(const fs::path& file) {
  std::shared_ptr<Content>& content = contents_[file];
  if (!content) {
    content = std::make_shared<Content>();
  }
  return content;
}

std::unique_ptr<archive::WritableFile> FaultFileSystem::create(const fs::path& file) {
  if (enter("create " + relative(file)) == Outcome::kFail) {
    throw IoError("make", file, error_number_);
  }
  std::unique_ptr<archive::WritableFile> real = real_.create(file);
  const std::lock_guard lock(mutex_);
  unflushed_names_.push_back(file);
  contents_.erase(file);
  return std::make_unique<File>(*this, file, std::move(real), content_of(file), 0);
}

std::unique_ptr<archive::WritableFile> FaultFileSystem::append_to(const fs::path& file) {
  if (enter("open " + relative(file)) == Outcome::kFail) {
    throw IoError("open for writing", file, error_number_);
  }
  std::unique_ptr<archive::WritableFile> real = real_.append_to(file);
  const std::uint64_t size = fs::file_size(file);
  const std::lock_guard lock(mutex_);
  const bool known = contents_.contains(file);
  std::shared_ptr<Content> content = content_of(file);
  if (!known) {
    content->flushed_bytes = size;  // not made through here: long on the disk
  }
  return std::make_unique<File>(*this, file, std::move(real), std::move(content), size);
}

void FaultFileSystem::move_known_paths(const fs::path& from, const fs::path& to) {
  const auto moved = [&](const fs::path& path) -> std::optional<fs::path> {
    const fs::path below = path.lexically_relative(from);
    if (below.empty() || *below.begin() == "..") {
      return std::nullopt;
    }
    return below == "." ? to : to / below;
  };
  std::map<fs::path, std::shared_ptr<Content>> contents;
  for (const auto& [path, content] : contents_) {
    contents[moved(path).value_or(path)] = content;
  }
  contents_ = std::move(contents);
  for (fs::path& name : unflushed_names_) {
    name = moved(name).value_or(name);
  }
}

void FaultFileSystem::rename(const fs::path& from, const fs::path& to) {
  if (enter("rename " + relative(from) + " " + relative(to)) == Outcome::kFail) {
    throw IoError("give its final name to", from, error_number_);
  }
  std::optional<std::string> replaced;
  if (fs::is_regular_file(to)) {
    std::ostringstream text;
    text << std::ifstream(to, std::ios::binary).rdbuf();
    replaced = text.str();
  }
  real_.rename(from, to);
  const std::lock_guard lock(mutex_);
  move_known_paths(from, to);
  unflushed_renames_.push_back({from, to, std::move(replaced)});
}

void FaultFileSystem::remove(const fs::path& file) {
  if (enter("remove " + relative(file)) == Outcome::kFail) {
    throw IoError("remove", file, error_number_);
  }
  real_.remove(file);
  const std::lock_guard lock(mutex_);
  contents_.erase(file);
  std::erase(unflushed_names_, file);
}

void FaultFileSystem::make_folder(const fs::path& folder) {
  if (enter("make_folder " + relative(folder)) == Outcome::kFail) {
    throw IoError("make the folder", folder, error_number_);
  }
  real_.make_folder(folder);
  const std::lock_guard lock(mutex_);
  unflushed_names_.push_back(folder);
}

void FaultFileSystem::sync_folder(const fs::path& folder) {
  if (enter("sync_folder " + relative(folder)) == Outcome::kFail) {
    throw archive::SyncError("flush the folder", folder, error_number_);
  }
  real_.sync_folder(folder);
  const std::lock_guard lock(mutex_);
  std::erase_if(unflushed_names_, [&](const fs::path& name) { return name.parent_path() == folder; });
  std::erase_if(unflushed_renames_, [&](const Rename& each) { return each.to.parent_path() == folder; });
}

void FaultFileSystem::lose_power() {
  const std::lock_guard lock(mutex_);
  for (const auto& [path, content] : contents_) {
    if (fs::is_regular_file(path) && fs::file_size(path) > content->flushed_bytes) {
      fs::resize_file(path, content->flushed_bytes);
    }
  }
  for (auto each = unflushed_names_.rbegin(); each != unflushed_names_.rend(); ++each) {
    fs::remove_all(*each);
  }
  for (auto each = unflushed_renames_.rbegin(); each != unflushed_renames_.rend(); ++each) {
    if (fs::exists(each->to)) {
      fs::rename(each->to, each->from);
    }
    // A name that another file takes over is of one or the other, never of none.
    if (each->replaced) std::ofstream(each->to, std::ios::binary) << *each->replaced;
  }
  contents_.clear();
  unflushed_names_.clear();
  unflushed_renames_.clear();
}

}  // namespace kiroku::test
