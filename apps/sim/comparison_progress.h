// What a comparison that is being made is at: a line on a terminal, or for a program a JSON object a line.
// Not thread-safe.
#pragma once

#include <optional>
#include <string>

#include "apps/common/progress.h"
#include "apps/common/step_line.h"
#include "viewer/compare/comparison.h"

namespace kiroku::apps {

class ComparisonTold {
 public:
  /// `for_programs`: {"doing": "…", "share": 0.25} on standard error, share null where it is not known.
  explicit ComparisonTold(bool for_programs) : for_programs_(for_programs) {}

  compare::ComparisonProgress progress() {
    return {[this](const std::string& step) { begin(step); }, [this](double share) { update(share); }};
  }
  void begin(const std::string& step);
  void update(double share);
  void clear();

 private:
  bool for_programs_;
  std::optional<StepLine> steps_;
  std::optional<Progress> shares_;
  std::string doing_;
  int last_percent_ = 0;
};

}  // namespace kiroku::apps
