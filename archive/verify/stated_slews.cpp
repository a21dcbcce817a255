#include "archive/verify/stated_slews.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>

#include "archive/format/ledger_entry.h"

namespace kiroku::archive {
namespace {

std::int64_t moved_ns(std::int64_t elapsed_ns, std::int64_t rate_ppb) {
  return static_cast<std::int64_t>(static_cast<double>(elapsed_ns) * static_cast<double>(rate_ppb) / 1e9);
}

}  // namespace

// An entry states the mean since the one before, but where a slew begins: there it states the rate of the
// second that showed it, which the slew began within. So the larger of the rates at both ends of a stretch
// is no less than what happened in it. Behind a beginning that nothing follows only the kernel's limit is
// known.
void StatedSlews::add(std::int64_t rate_ppb, std::int64_t mono_ns) {
  const std::int64_t limited_ppb = std::clamp(rate_ppb, -kFastestPpb, kFastestPpb);
  const std::int64_t slew_ppb = std::abs(limited_ppb) > kSlewPpb ? std::abs(limited_ppb) : 0;
  stretches_.back().rate_ppb = std::max(stated_ppb_, slew_ppb);
  const bool begins = slew_ppb > 0 && stated_ppb_ == 0;
  stated_ppb_ = slew_ppb;
  begin_stretch(mono_ns, begins ? kFastestPpb : slew_ppb);
}

void StatedSlews::cut_off(std::int64_t mono_ns) {
  stated_ppb_ = 0;
  begin_stretch(mono_ns, 0);
}

void StatedSlews::begin_stretch(std::int64_t from_ns, std::int64_t rate_ppb) {
  const Stretch& before = stretches_.back();
  const std::int64_t later_ns = std::max(before.from_ns, from_ns);  // also where somebody made times up
  stretches_.push_back({later_ns, until(later_ns), rate_ppb});
}

std::int64_t StatedSlews::until(std::int64_t mono_ns) const {
  const auto next = std::upper_bound(
      stretches_.begin(), stretches_.end(), std::max<std::int64_t>(mono_ns, 0),
      [](std::int64_t time_ns, const Stretch& stretch) { return time_ns < stretch.from_ns; });
  const Stretch& its = *std::prev(next);
  return its.moved_ns + moved_ns(std::max<std::int64_t>(mono_ns, 0) - its.from_ns, its.rate_ppb);
}

}  // namespace kiroku::archive
