// Verifies cases in the background, one at a time so that a recorder on the same machine keeps its cores, and
// remembers what was found. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "archive/verify/verifier.h"
#include "base/utc_time.h"

namespace kiroku::viewer {

/// How a verification is.
struct VerificationState {
  /// Null while it runs, or waits for another.
  std::shared_ptr<const archive::VerificationReport> report;
  UtcTime finished{};                             // when there is a report
  std::string problem;                            // why the case could not be read at all; "" where it could
  std::uint64_t done_bytes = 0, total_bytes = 0;  // 0 of 0 while it waits
  [[nodiscard]] bool is_done() const { return report != nullptr || !problem.empty(); }
};

class VerificationRunner {
 public:
  struct Options {
    archive::VerifyOptions verify;  // what it points to outlives the runner; its progress is not used
    /// Hears of each report, from the runner's thread.
    std::function<void(const std::filesystem::path& folder, const archive::VerificationReport& report)>
        verified;
    /// Whose policy of witnesses is asked, where it has one; empty: none.
    std::filesystem::path home = {};
    /// Verifies what lies elsewhere, and of which the ledger alone is in the folder; empty: `verify` does
    /// what lies there.
    std::function<archive::VerificationReport(const std::filesystem::path& folder)> elsewhere = {};
  };
  explicit VerificationRunner(Options options);
  /// Waits for the one that runs.
  ~VerificationRunner();
  VerificationRunner(const VerificationRunner&) = delete;
  VerificationRunner& operator=(const VerificationRunner&) = delete;

  /// Begins, unless it runs or waits already. Who waits is served in turn, person by person
  /// (Session::person()), so that nobody's many cases are before another's one. False where too many wait, or
  /// too many of this person.
  bool start(const std::filesystem::path& folder, const std::string& person);
  /// The newest; nothing if there was none since a file of the case was written, replaced, added or removed.
  [[nodiscard]] std::optional<VerificationState> state(const std::filesystem::path& folder) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::viewer
