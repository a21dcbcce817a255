// `kiroku compare`, run as a program of its own: what simulates and renders takes minutes, hundreds of
// megabytes and libraries that have no place in a server beside a recorder. It is not given identities but
// file keys, which it asks for (crypto/remote_identity.h). Functions; thread-safe.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "crypto/age_recipient.h"
#include "viewer/programs/child_program.h"

namespace kiroku::viewer {

/// What it is asked for.
struct ComparisonProgramCall {
  std::vector<std::string> arguments;  // after `kiroku compare`
  std::string input;                   // its standard input
  /// A further file, read under kFurtherFile; "" for none.
  std::string further_file;
  ChildPriority priority = ChildPriority::kBackground;
  /// Then it is ended.
  std::chrono::milliseconds limit = std::chrono::hours(6);

  static constexpr const char* kFurtherFile = "/dev/fd/4";
};

struct ComparisonProgramEnd {
  int status = 0;        // its exit status; -1 where it was killed
  std::string out;       // its standard output
  std::string problem;   // its last sentence on standard error, "" where it said none
  bool overdue = false;  // it was ended because it took longer than the limit
};

/// Runs `program compare …` and waits for its end. `stop` set by another thread, or the limit, ends it within
/// half a second, or by force within 5 s. What is being done is told by `progress`, from the thread that
/// called. kiroku::Error where it cannot be started.
ComparisonProgramEnd run_comparison_program(const std::filesystem::path& program,
                                            const ComparisonProgramCall& call,
                                            const crypto::AgeIdentities& identities,
                                            const ProgramListener::Progress& progress,
                                            const std::atomic<bool>& stop);

}  // namespace kiroku::viewer
