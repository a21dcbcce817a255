// The program's file, once a package was upgraded, and whether what lies there now would start. One thread.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <sys/types.h>
#include <vector>

namespace kiroku::apps {

/// Asks the newer program with --check before the recorder makes room for it: one that refuses the
/// configuration records nothing.
class Successor {
 public:
  /// `arguments` are those of --check but for the program's name. `tell` hears why the recorder stays.
  Successor(std::vector<std::string> arguments, std::function<void(const std::string& sentence)> tell);
  ~Successor();
  Successor(const Successor&) = delete;
  Successor& operator=(const Successor&) = delete;

  /// Whether another program lies where this one was started from, and took the configuration. Returns at
  /// once; call each second or so. One that refused is asked again each ten seconds.
  [[nodiscard]] bool is_ready();

 private:
  void ask();
  /// Tells why once.
  void refuse(const std::string& why);
  /// The exit status of the child, once it has ended.
  std::optional<int> answer();
  void end_child();

  const std::vector<std::string> arguments_;
  const std::function<void(const std::string& sentence)> tell_;
  std::filesystem::path program_;
  pid_t child_ = 0;
  std::chrono::steady_clock::time_point asked_{};
  bool refused_ = false;
};

}  // namespace kiroku::apps
