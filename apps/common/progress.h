// A progress line on standard error: only on a terminal, only once two seconds have passed. Used by one
// thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace kiroku::apps {

class Progress {
 public:
  /// `doing` begins the line: "verifying".
  explicit Progress(std::string doing);
  ~Progress();  // clears the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// Bytes done of all; total 0 where unknown.
  void update(std::uint64_t done, std::uint64_t total);
  /// Clears the line so that something else can be printed; the next update draws it again.
  void clear();

 private:
  std::string doing_;
  std::chrono::steady_clock::time_point start_, last_;
  bool wanted_, drawn_ = false;
};

/// The line's text: "verifying  42 %  1.2 GB/s  0:07 left".
std::string progress_text(const std::string& doing, std::uint64_t done, std::uint64_t total,
                          std::chrono::duration<double> elapsed);

}  // namespace kiroku::apps
