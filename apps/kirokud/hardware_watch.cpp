#include "apps/kirokud/hardware_watch.h"

#include <utility>

#include <spdlog/spdlog.h>

#include "base/printable.h"

namespace kiroku::apps {
namespace {

/// A TPM takes up to a second to sign, which checkpoints of cases wait for.
constexpr int kTicksWhileItSigns = 60;
/// Whoever puts it right looks whether it is.
constexpr int kTicksWhileSilent = 10;

}  // namespace

void HardwareWatch::look(bool recorded) {
  if (key_ == nullptr) return;
  if (ticks_left_ > 0) {
    --ticks_left_;
    return;
  }
  if (recorded && was_asked_ && silent().empty()) return;
  std::string why = crypto::why_silent(*key_);
  was_asked_ = true;
  ticks_left_ = why.empty() ? kTicksWhileItSigns : kTicksWhileSilent;
  const std::lock_guard guard(mutex_);
  if (why == silent_) return;
  if (why.empty()) {
    spdlog::info("the key in hardware signs again");
  } else {
    spdlog::error("the key in hardware does not sign: cases are recorded all the same, and are unproven: {}",
                  printable(why));
  }
  silent_ = std::move(why);
}

std::string HardwareWatch::silent() const {
  const std::lock_guard guard(mutex_);
  return silent_;
}

}  // namespace kiroku::apps
