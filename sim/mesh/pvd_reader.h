// Lists of frames over time as ParaView keeps them (.pvd: VTK XML, "Collection"), as 'kiroku sim respire' and
// 'kiroku plan run' write them. Functions are pure but for the file they open, and thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::sim {

struct ListedFrame {
  double time_s = 0;
  std::filesystem::path file;
};

/// One at least, in the order of their times, which all differ; files are below the list's folder.
/// kiroku::Error with the file's name for no such list, times that are no numbers or go back, and files that
/// lie elsewhere. kiroku::IoError.
std::vector<ListedFrame> read_pvd(const std::filesystem::path& file);
/// `name` stands in errors, and its folder before each file.
std::vector<ListedFrame> parse_pvd(std::string_view text, const std::filesystem::path& name);

}  // namespace kiroku::sim
