// A folder that appears under its name only when it is whole. An object belongs to one thread.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace kiroku::media {

/// Made as `<name>.part`, readable by its owner alone, since what is exported is a patient's.
class OutputFolder {
 public:
  /// Says why a folder that is there may not be replaced; "" where it may.
  using WhyKept = std::function<std::string(const std::filesystem::path& folder)>;
  /// `overwrite`: a folder that is there is replaced when the new one is whole, if `why_kept` lets it. Throws
  /// kiroku::UsageError where it is there and may not be replaced, or its .part is there, kiroku::IoError
  /// where it cannot be made.
  OutputFolder(std::filesystem::path folder, bool overwrite, WhyKept why_kept);
  /// What was not committed is removed.
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where its files are written until then.
  [[nodiscard]] const std::filesystem::path& path() const { return part_; }
  /// Gives it its name in one step, also where another folder has it, which is removed afterwards. Throws
  /// kiroku::IoError, kiroku::UsageError where a folder came to be there meanwhile.
  void commit();

 private:
  void require_replaceable() const;

  std::filesystem::path folder_, part_;
  bool overwrite_;
  WhyKept why_kept_;
  bool committed_ = false;
};

}  // namespace kiroku::media
