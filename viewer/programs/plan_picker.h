// Asks `kiroku plan pick`, which has carried a plan out and shows it from any side: solvers and renderers
// have no place in a server beside a recorder. The program runs by itself, stays while it is asked, and is of
// one plan at a time. Thread-safe.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.h"

namespace kiroku::viewer {

struct PickingAnswer {
  bool ready = false;
  // While the plan is still carried out:
  std::string doing;
  std::optional<double> share;
  // Then:
  std::string text;  // a JSON object, as docs/reference/viewer.md has it
};

class PlanPicker {
 public:
  struct Options {
    std::filesystem::path program;  // kiroku-full
    std::chrono::milliseconds to_prepare = std::chrono::minutes(15);
    std::chrono::milliseconds to_answer = std::chrono::seconds(30);
    /// The program ends when nobody asked for so long.
    std::chrono::milliseconds idle = std::chrono::minutes(5);
    /// So long after somebody's last question nobody else may take it for another plan.
    std::chrono::milliseconds reserved = std::chrono::minutes(1);
    const Clock* clock = &Clock::system();  // by which all of these pass
  };
  explicit PlanPicker(Options options);
  /// Ends the program.
  ~PlanPicker();
  PlanPicker(const PlanPicker&) = delete;
  PlanPicker& operator=(const PlanPicker&) = delete;

  /// Asks `question`, a JSON object without line breaks, about the sealed plan; begins to prepare it where
  /// that was not done, and returns at once until it is. Refusal: 409 while another person picks on another
  /// plan, 422 where the program says that the plan cannot be shown, 503 where others' questions, or those
  /// of the same person, are too many or take too long, 504 where it took too long itself; then the program
  /// was ended, and the next question begins anew.
  PickingAnswer ask(const std::filesystem::path& seal_file, const std::string& who,
                    const std::string& question);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace kiroku::viewer
