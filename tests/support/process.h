// Another program run by a test: its output, exit status and time limit, with or without a terminal.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace kiroku::test {

struct ProcessResult {
  int status = -1;  // exit status; 128 + signal if one ended it
  bool timed_out = false;
  std::string out;  // standard output; on a terminal everything
  std::string err;
};

/// A running program. Killed by the destructor if it still runs.
class Process {
 public:
  struct Options {
    std::vector<std::string> command;                               // program and arguments
    std::map<std::string, std::optional<std::string>> environment;  // set, or unset where nothing
    std::filesystem::path folder;                                   // where it runs; empty: here
    std::string input;                                              // its standard input, then the end
    bool terminal = false;                                          // a terminal instead of the three streams
  };
  explicit Process(const Options& options);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Whether standard output or error (together) held `text` within the time.
  bool wait_for(const std::string& text, std::chrono::seconds limit = std::chrono::seconds(60));
  /// What it has written so far, as far as wait_for() read it.
  [[nodiscard]] const std::string& out() const { return result_.out; }
  /// Whether it has not ended.
  [[nodiscard]] bool runs();
  void signal(int number) const;
  /// Keys on its terminal.
  void type(const std::string& text) const;
  /// Waits for the end; kills it when the time is over.
  ProcessResult wait(std::chrono::seconds limit = std::chrono::seconds(60));

 private:
  /// Reads what is there for at most `wait`; false once everything is at its end.
  bool pump(std::chrono::milliseconds wait);

  int pid_ = -1;
  int in_ = -1, out_ = -1, err_ = -1;
  std::string pending_input_;
  ProcessResult result_;
};

/// Starts, feeds, waits.
ProcessResult run_process(const Process::Options& options,
                          std::chrono::seconds limit = std::chrono::seconds(60));

}  // namespace kiroku::test
