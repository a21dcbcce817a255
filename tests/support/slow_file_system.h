// The real file system with a disk that takes its time: each write to a file whose name contains a text
// waits, and each flush of one that is finished.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "archive/storage/file_system.h"

namespace kiroku::test {

class SlowFileSystem final : public archive::FileSystem {
 public:
  SlowFileSystem(std::string part_of_name, std::chrono::milliseconds write_delay,
                 std::chrono::milliseconds flush_delay = {})
      : part_of_name_(std::move(part_of_name)), write_delay_(write_delay), flush_delay_(flush_delay) {}
  /// Each sync of such a file takes so long from now on.
  void delay_syncs(std::chrono::milliseconds by) { sync_delay_ = by; }
  /// The most such files that were open at once.
  [[nodiscard]] int most_open() const { return most_open_; }

  std::unique_ptr<archive::WritableFile> create(const std::filesystem::path& file) override {
    auto made = archive::real_file_system().create(file);
    if (file.string().find(part_of_name_) == std::string::npos) return made;
    return std::make_unique<File>(std::move(made), *this);
  }
  std::unique_ptr<archive::WritableFile> append_to(const std::filesystem::path& file) override {
    auto opened = archive::real_file_system().append_to(file);
    if (file.string().find(part_of_name_) == std::string::npos) return opened;
    return std::make_unique<File>(std::move(opened), *this);
  }
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override {
    archive::real_file_system().rename(from, to);
  }
  void remove(const std::filesystem::path& file) override { archive::real_file_system().remove(file); }
  void make_folder(const std::filesystem::path& folder) override {
    archive::real_file_system().make_folder(folder);
  }
  void sync_folder(const std::filesystem::path& folder) override {
    archive::real_file_system().sync_folder(folder);
  }

 private:
  class File final : public archive::WritableFile {
   public:
    File(std::unique_ptr<archive::WritableFile> real, SlowFileSystem& files)
        : real_(std::move(real)), files_(files) {
      files_.most_open_ = std::max(files_.most_open_.load(), ++files_.open_);
    }
    ~File() override { --files_.open_; }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    void write(ByteView bytes) override {
      std::this_thread::sleep_for(files_.write_delay_);
      real_->write(bytes);
    }
    void sync() override {
      std::this_thread::sleep_for(files_.sync_delay_.load());
      real_->sync();
    }
    void sync_all() override {
      std::this_thread::sleep_for(files_.flush_delay_);
      real_->sync_all();
    }
    void reserve(std::uint64_t bytes) override { real_->reserve(bytes); }
    void write_behind() override { real_->write_behind(); }
    void truncate(std::uint64_t size) override { real_->truncate(size); }
    bool try_lock() override { return real_->try_lock(); }
    bool lock(std::chrono::milliseconds patience) override { return real_->lock(patience); }
    void unlock() noexcept override { real_->unlock(); }

   private:
    std::unique_ptr<archive::WritableFile> real_;
    SlowFileSystem& files_;
  };

  std::string part_of_name_;
  std::chrono::milliseconds write_delay_, flush_delay_;
  std::atomic<std::chrono::milliseconds> sync_delay_{};
  std::atomic<int> open_{0}, most_open_{0};
};

}  // namespace kiroku::test
