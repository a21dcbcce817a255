// A program that the server starts and ends. Where the server, or the thread that started it, ends without a
// word, the program ends too. An object belongs to one thread.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <sys/types.h>
#include <vector>

#include "base/descriptor.h"

namespace kiroku::viewer {

/// Both ends of a pipe or a pair of sockets; kiroku::Error where there is none.
struct DescriptorPair {
  Descriptor ours, theirs;
};
DescriptorPair make_pipe();  // theirs is written to
DescriptorPair make_socket_pair();
/// A file without a name that holds `text`, to be read from its beginning: a pipe would have to be filled
/// while the program reads. kiroku::Error where there is no memory for it.
Descriptor file_of_text(std::string_view text);

/// Niceness (nice(2)) of a program: below all that records.
enum class ChildPriority {
  kAnswering = 10,   // somebody waits for it
  kBackground = 19,  // it may take its time
};

class ChildProgram {
 public:
  /// Starts it. `given` become its descriptors 0, 1, 2, …; it has no other.
  /// kiroku::Error where there is no process; one that cannot be started ends with kNotStarted.
  ChildProgram(const std::filesystem::path& program, const std::vector<std::string>& arguments,
               std::vector<Descriptor> given, ChildPriority priority);
  /// Ends it by force where it has not ended.
  ~ChildProgram();
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  void ask_to_end() const;
  void end_by_force() const;
  /// Its exit status once it has ended, -1 where a signal ended it; by force where it does not within
  /// `patience`.
  int wait(std::chrono::milliseconds patience);

  static constexpr int kNotStarted = 127;
  static constexpr std::size_t kMostDescriptors = 8;

 private:
  pid_t process_ = -1;
};

/// What a program said on its standard error as lines: progress ({"doing": "…", "share": 0.5}, share null
/// where it is not known), and the last sentence that is neither that nor a warning.
class ProgramListener {
 public:
  using Progress = std::function<void(const std::string& doing, std::optional<double> share)>;
  explicit ProgramListener(Progress progress) : progress_(std::move(progress)) {}
  void take(std::string_view bytes);
  /// "" where it said none.
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  void line();

  Progress progress_;
  std::string line_, problem_;
};

/// Hands what can be read now to `take`; false at the end.
bool drain(int descriptor, const std::function<void(std::string_view)>& take);

}  // namespace kiroku::viewer
