#include "recorder/vitals/assumed_zone.h"

#include <ctime>

namespace kiroku::recorder {
namespace {

std::chrono::seconds offset_at(UtcTime time) {
  const std::time_t seconds = std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
  std::tm here{};
  if (::localtime_r(&seconds, &here) == nullptr) return std::chrono::seconds(0);
  return std::chrono::seconds(here.tm_gmtoff);
}

}  // namespace

// Not by mktime(): of a time that is shown twice it gives whichever its last call was nearer to.
std::chrono::seconds AssumedZone::at(UtcTime local, std::optional<UtcTime> near) const {
  if (fixed_) return *fixed_;
  constexpr std::chrono::hours kDay{24};  // no zone changes twice within it
  const std::chrono::seconds before = offset_at(local - kDay), after = offset_at(local + kDay);
  const bool by_before = offset_at(local - before) == before, by_after = offset_at(local - after) == after;
  if (by_before && by_after && before != after) {
    const UtcTime meant = near ? *near : utc_now();
    const auto distance = [&](std::chrono::seconds offset) {
      return std::chrono::abs(local - offset - meant);
    };
    return distance(before) <= distance(after) ? before : after;
  }
  return by_after ? after : before;
}

}  // namespace kiroku::recorder
