// Processes that another one has started and that have not ended. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <sys/types.h>
#include <unistd.h>
#include <vector>

namespace kiroku::test {

/// Of all threads of `process`. Needs a kernel with CONFIG_PROC_CHILDREN, as Debian's.
inline std::vector<pid_t> child_processes(pid_t process = ::getpid()) {
  std::vector<pid_t> found;
  std::error_code gone;
  const std::filesystem::path tasks = "/proc/" + std::to_string(process) + "/task";
  for (const auto& task : std::filesystem::directory_iterator(tasks, gone)) {
    std::ifstream children(task.path() / "children");
    for (pid_t child = 0; children >> child;) found.push_back(child);
  }
  return found;
}

/// The line of /proc/PROCESS/FILE that begins with `name`, without it; "" where there is none.
inline std::string line_of_process(pid_t process, const std::string& file, const std::string& name) {
  std::ifstream lines("/proc/" + std::to_string(process) + "/" + file);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(name)) continue;
    const std::size_t text = line.find_first_not_of(" \t", name.size());
    return text == std::string::npos ? "" : line.substr(text);
  }
  return "";
}

}  // namespace kiroku::test
