// What a log says already of a case's mending. Not thread-safe.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace kiroku::apps {

class StatedMending {
 public:
  /// `log` is the log's folder, and `case_name` what its entries call the case. Nothing is read yet.
  StatedMending(std::filesystem::path log, std::string case_name);
  /// Whether `what`, as a Mender states it, is to be entered. That a file could not be mended is not, where
  /// the newest entry about that file says the same. Throws kiroku::Error.
  [[nodiscard]] bool is_news(const std::string& what);

 private:
  void read();
  const std::filesystem::path log_;
  const std::string case_name_;
  std::optional<std::map<std::string, std::string>> newest_;  // by the file's path
};

}  // namespace kiroku::apps
