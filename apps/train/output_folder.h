// A folder that a command fills with a set of files. Not thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/bytes.h"

namespace kiroku::apps {

class OutputFolder {
 public:
  /// Makes the folder. kiroku::UsageError where one of `files`, those that the command writes, is there
  /// already and `force` is not given.
  OutputFolder(std::filesystem::path folder, std::vector<std::string> files, bool force);
  /// Whole or not at all; `name` is one of the files.
  void write(const std::string& name, ByteView bytes) const;
  void write(const std::string& name, const std::string& text) const { write(name, bytes_of(text)); }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_;
};

}  // namespace kiroku::apps
