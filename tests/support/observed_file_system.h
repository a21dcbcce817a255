// The operating system's files, and somebody who acts when one of them is made.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <utility>

#include "archive/storage/file_system.h"

namespace kiroku::test {

class ObservedFileSystem final : public archive::FileSystem {
 public:
  /// `on_create` is called before a file is made.
  explicit ObservedFileSystem(std::function<void(const std::filesystem::path& file)> on_create)
      : on_create_(std::move(on_create)) {}
  std::unique_ptr<archive::WritableFile> create(const std::filesystem::path& file) override {
    on_create_(file);
    return real_.create(file);
  }
  std::unique_ptr<archive::WritableFile> append_to(const std::filesystem::path& file) override {
    return real_.append_to(file);
  }
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override {
    real_.rename(from, to);
  }
  void remove(const std::filesystem::path& file) override { real_.remove(file); }
  void make_folder(const std::filesystem::path& folder) override { real_.make_folder(folder); }
  void sync_folder(const std::filesystem::path& folder) override { real_.sync_folder(folder); }

 private:
  std::function<void(const std::filesystem::path& file)> on_create_;
  archive::FileSystem& real_ = archive::real_file_system();
};

}  // namespace kiroku::test
