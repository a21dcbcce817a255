// Whether the recorder may end for a newer program, where a start would forget who is on the table.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "base/clock.h"

namespace kiroku::apps {

/// Where nobody holds what messages said from one start to the next, the newer program waits until nothing
/// of it is about a room, and never longer than a day: it may mend what matters more. From one thread.
class UpgradeWait {
 public:
  static constexpr std::chrono::hours kLongest{24};

  struct Questions {
    std::function<bool()> is_kept;   // whether a start forgets nothing; asked once for each wait
    std::function<bool()> is_known;  // whether messages tell of a patient of a room now
    std::function<void(const std::string& sentence)> tell;  // that it waits
  };
  UpgradeWait(Questions questions, const Clock& clock) : questions_(std::move(questions)), clock_(&clock) {}

  /// Ask each second or so while the newer program is ready and nothing is recorded.
  [[nodiscard]] bool is_over() {
    if (!began_) {
      began_ = clock_->now();
      is_kept_ = questions_.is_kept();
    }
    if (is_kept_ || !questions_.is_known() || clock_->now() - *began_ >= kLongest) return true;
    if (!std::exchange(is_told_, true)) {
      questions_.tell(
          "a newer version was installed, and takes over once no HL7 message tells of a patient of these "
          "rooms any more, within a day: a start would forget them, as nothing keeps them "
          "(FileDescriptorStoreMax= of the unit)");
    }
    return false;
  }

 private:
  Questions questions_;
  const Clock* clock_;
  std::optional<Clock::Time> began_;
  bool is_kept_ = false, is_told_ = false;
};

}  // namespace kiroku::apps
