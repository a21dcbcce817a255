#include "fleet/reports/request_budget.h"

namespace kiroku::fleet {

RequestBudget::RequestBudget(std::size_t most, Clock::Duration window, std::size_t names, const Clock& clock)
    : most_(most), names_(names), window_(window), clock_(clock), ends_(clock.now() + window) {}

bool RequestBudget::take(const std::string& who) {
  const std::lock_guard guard(mutex_);
  if (const Clock::Time now = clock_.now(); now >= ends_) {
    taken_.clear();
    ends_ = now + window_;
  }
  auto found = taken_.find(who);
  if (found == taken_.end()) {
    if (taken_.size() >= names_) return false;
    found = taken_.emplace(who, 0).first;
  }
  if (found->second >= most_) return false;
  ++found->second;
  return true;
}

}  // namespace kiroku::fleet
