// A folder of frames that ParaView opens as one film. Not thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace kiroku::apps {

/// Writes a file whole or not at all.
void write_text_file(const std::filesystem::path& file, const std::string& text);

class FrameSeries {
 public:
  /// kiroku::UsageError for a folder that is there and not empty, or no folder. With `force` what an earlier
  /// run left is taken away first and nothing else: the frames, the list, and the files called `others`.
  FrameSeries(std::filesystem::path folder, std::string name, bool force,
              const std::vector<std::string>& others);
  /// "frames/00017.vtu" below the folder, at its moment.
  void add(double time_s, const std::string& vtu);
  /// The list of frames, as NAME.pvd.
  void finish() const;
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  std::filesystem::path folder_;
  std::string name_, list_;
  std::size_t count_ = 0;
};

}  // namespace kiroku::apps
