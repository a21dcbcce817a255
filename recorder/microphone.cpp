#include "recorder/microphone.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kFirstPauseNs = 1'000'000'000;
constexpr std::int64_t kLongestPauseNs = 16'000'000'000;

}  // namespace

Microphone::Microphone(SourceAddress address, const CaseClock& clock, std::shared_ptr<SourceGuard> guard,
                       Take take, Tell tell)
    : address_(std::move(address)),
      clock_(clock),
      guard_(std::move(guard)),
      take_(std::move(take)),
      tell_(std::move(tell)) {}

Microphone::~Microphone() {
  stop();
  join();
}

void Microphone::join() {
  if (thread_.joinable()) thread_.join();
}

void Microphone::start() {
  thread_ = std::thread([this] { run(); });
}

void Microphone::stop() {
  stopping_ = true;
  const std::lock_guard guard(mutex_);
  if (source_) source_->interrupt();
}

void Microphone::run() {
  std::int64_t pause_ns = kFirstPauseNs;
  while (!stopping_) {
    try {
      capture();
      return;
    } catch (const std::exception& error) {
      // Once an absence: it may be tried for hours.
      if (!std::exchange(told_, true)) {
        pause_ns = kFirstPauseNs;
        tell_(std::string(error.what()) + ". Pictures are recorded without its sound until it is there");
      }
    }
    if (!wait_until(clock_, clock_.now_ns() + pause_ns, stopping_)) return;
    pause_ns = std::min(2 * pause_ns, kLongestPauseNs);
  }
}

void Microphone::capture() {
  OpeningTerms terms;
  terms.cancelled = &stopping_;
  std::unique_ptr<Source> fresh = guard_->open(address_, clock_, terms);
  {
    const std::lock_guard guard(mutex_);
    source_ = std::move(fresh);
    if (stopping_) source_->interrupt();
  }
  const auto close = [this] {
    std::unique_ptr<Source> closing;
    const std::lock_guard guard(mutex_);
    closing = std::move(source_);
    return closing;  // outside the mutex, as closing may take its time
  };
  try {
    while (std::optional<TimedFrame> sound = source_->read()) {
      if (std::exchange(told_, false)) tell_("sound '" + address_.stated + "' is back: " + source_->input());
      take_(std::move(*sound));
    }
  } catch (...) {
    close();
    throw;
  }
  close();
}

}  // namespace kiroku::recorder
