// Makes comparisons in the background, one at a time, so that a recorder on the same machine keeps its cores.
// Thread-safe.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "viewer/people/session.h"
#include "viewer/programs/comparison_program.h"

namespace kiroku::viewer {

/// What shall be made.
struct ComparisonJob {
  std::string case_id;
  std::filesystem::path seal_file;  // the sealed plan
  std::string name;                 // what it will be called
  std::string by_hand;              // docs/explanation/comparison.md, "By hand"
  /// Further arguments of the program, and what it reads under ComparisonProgramCall::kFurtherFile.
  std::vector<std::string> more;
  std::string further_file;
  std::string made_by;             // a user
  std::string asked_by;            // as the appliance log shall say it
  Session::Identities identities;  // not null; kept until it is made
};

/// How the latest one is.
struct ComparisonMakingState {
  enum class State { kRunning, kDone, kFailed };
  State state = State::kRunning;
  std::string case_id, name, made_by;
  std::string doing;            // while it runs
  std::optional<double> share;  // of that
  std::string problem;          // one sentence, where it failed
};

class ComparisonMaker {
 public:
  struct Options {
    std::filesystem::path program;      // kiroku-full
    std::filesystem::path home;         // whose archive and plans
    std::filesystem::path comparisons;  // where what a program leaves when it is stopped is removed
    std::function<void(const std::string& sentence)> tell;
    /// Then one is ended, so that others can be made.
    std::chrono::milliseconds limit = std::chrono::hours(6);
  };
  explicit ComparisonMaker(Options options);
  /// Stops the one that is being made.
  ~ComparisonMaker();
  ComparisonMaker(const ComparisonMaker&) = delete;
  ComparisonMaker& operator=(const ComparisonMaker&) = delete;

  /// False while another is being made.
  bool start(ComparisonJob job);
  /// Of the latest; nothing where none was asked for since the server began.
  [[nodiscard]] std::optional<ComparisonMakingState> state() const;
  /// Whatever is being made ends without a trace; waits for that.
  void stop();

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace kiroku::viewer
