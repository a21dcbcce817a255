#include "recorder/vitals_tap.h"

#include <atomic>
#include <new>
#include <optional>
#include <variant>

#include <boost/lockfree/spsc_queue.hpp>

namespace kiroku::recorder {

struct VitalsTap::State {
  /// Nothing: a session begins.
  using Item = std::optional<media::VitalLine>;
  boost::lockfree::spsc_queue<Item, boost::lockfree::capacity<kMostWaiting>> waiting;
  bool begins = false;  // of the thread that offers: said before the next line
  std::atomic<std::uint64_t> lost = 0;

  bool push(Item item) noexcept {
    try {
      return waiting.push(item);
    } catch (const std::bad_alloc&) {
      return false;
    }
  }
};

VitalsTap::VitalsTap() : state_(std::make_unique<State>()) {}
VitalsTap::~VitalsTap() = default;

void VitalsTap::begin() noexcept { state_->begins = !state_->push(std::nullopt); }

void VitalsTap::offer(const media::VitalLine& line) noexcept {
  if (!std::holds_alternative<media::VitalSample>(line) && !std::holds_alternative<media::DeviceAlarm>(line))
    return;
  // Lines of two clocks are never mixed.
  if (state_->begins) state_->begins = !state_->push(std::nullopt);
  bool kept = false;
  try {
    kept = !state_->begins && state_->push(line);
  } catch (const std::bad_alloc&) {
    // Counted as lost.
  }
  if (!kept) ++state_->lost;
}

std::size_t VitalsTap::take(const std::function<void(const media::VitalLine* line)>& visit) {
  std::size_t count = 0;
  State::Item item;
  while (state_->waiting.pop(item)) {
    ++count;
    visit(item ? &*item : nullptr);
  }
  return count;
}

std::size_t VitalsTap::waiting() const { return kMostWaiting - state_->waiting.write_available(); }

std::uint64_t VitalsTap::lost() const { return state_->lost; }

}  // namespace kiroku::recorder
