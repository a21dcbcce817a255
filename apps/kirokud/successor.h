// The program's file, once a package was upgraded, and whether what lies there now would start. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <sys/types.h>
#include <vector>

#include "base/clock.h"

namespace kiroku::apps {

/// Asks the newer program with --check before the recorder makes room for it: one that refuses the
/// configuration records nothing.
class Successor {
 public:
  struct Questions {
    /// What this process was started from, as /proc/self/exe has it: it ends in " (deleted)" once another
    /// file lies in its place.
    std::function<std::string()> own_file = own_file_of_process;
    std::function<void(const std::string& sentence)> tell;  // why the recorder stays
  };
  /// `arguments` are those of --check but for the program's name.
  Successor(std::vector<std::string> arguments, Questions questions, const Clock& clock = Clock::system());
  ~Successor();
  Successor(const Successor&) = delete;
  Successor& operator=(const Successor&) = delete;

  /// Whether another program lies where this one was started from, and took the configuration when it was
  /// asked: each program once, however long the recorder then has to wait. Returns at once; call each second
  /// or so. One that refused is asked again each ten seconds.
  [[nodiscard]] bool is_there() { return look(false); }
  /// Whether it takes the configuration of now: what was answered long ago, as while a case ran, is asked
  /// again. Ask right before the recorder ends for it.
  [[nodiscard]] bool is_ready() { return look(true); }

 private:
  /// Of a program's file: device, inode, size, and when it was changed.
  using Identity = std::array<std::int64_t, 5>;

  static std::string own_file_of_process();
  [[nodiscard]] std::optional<Identity> candidate() const;
  bool look(bool of_now);
  void ask();
  /// Tells why once.
  void refuse(const std::string& why);
  /// The exit status of the child, once it has ended.
  std::optional<int> answer();
  void end_child();

  const std::vector<std::string> arguments_;
  const Questions questions_;
  const Clock* const clock_;
  std::filesystem::path program_;
  std::optional<Identity> candidate_;  // that was asked
  pid_t child_ = 0;
  Clock::Time asked_{};
  bool taken_ = false, refused_ = false;  // what it answered last
};

}  // namespace kiroku::apps
