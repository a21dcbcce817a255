#include "viewer/people/deed_pace.h"

#include <algorithm>

namespace kiroku::viewer {

std::chrono::seconds DeedPace::take(const std::string& person, Clock::Time now) {
  const std::lock_guard guard(mutex_);
  std::erase_if(forgotten_, [now](const auto& each) { return each.second <= now; });
  const auto known = forgotten_.find(person);
  const Clock::Time from = known == forgotten_.end() ? now : known->second;
  const Clock::Time next = from + limits_.each;
  const Clock::Time soonest = next - limits_.each * static_cast<std::int64_t>(limits_.at_once);
  if (soonest > now) return std::chrono::ceil<std::chrono::seconds>(soonest - now);
  forgotten_[person] = next;
  return std::chrono::seconds(0);
}

}  // namespace kiroku::viewer
