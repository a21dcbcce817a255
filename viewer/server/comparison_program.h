// `kiroku compare`, run as a program of its own: what simulates and renders takes minutes, hundreds of
// megabytes and libraries that have no place in a server beside a recorder. It runs at the lowest priority,
// ends with the thread that runs it, and is not given identities but file keys, which it asks for
// (crypto/remote_identity.h). Functions; thread-safe.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "crypto/age_recipient.h"

namespace kiroku::viewer {

struct ComparisonProgramEnd {
  int status = 0;       // its exit status; -1 where it was killed
  std::string out;      // its standard output
  std::string problem;  // its last sentence on standard error, "" where it said none
};

/// What is being done, and its share where that is known. From the thread that runs the program.
using ComparisonProgramProgress = std::function<void(const std::string& doing, std::optional<double> share)>;

/// Runs `program compare …arguments` with `input` as its standard input, and waits for its end. `stop` set by
/// another thread ends it within half a second, or by force within 5 s. kiroku::Error where it cannot be
/// started.
ComparisonProgramEnd run_comparison_program(const std::filesystem::path& program,
                                            const std::vector<std::string>& arguments,
                                            const std::string& input, const crypto::AgeIdentities& identities,
                                            const ComparisonProgramProgress& progress,
                                            const std::atomic<bool>& stop);

}  // namespace kiroku::viewer
