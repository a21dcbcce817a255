#include "recorder/microphone.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "recorder/source/sound_source.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kFirstPauseNs = 1'000'000'000;
constexpr std::int64_t kLongestPauseNs = 16'000'000'000;

}  // namespace

Microphone::Microphone(SourceAddress address, const CaseClock& clock, std::shared_ptr<SourceGuard> guard,
                       std::unique_ptr<Source> source, Listener listener)
    : address_(std::move(address)),
      clock_(clock),
      guard_(std::move(guard)),
      listener_(std::move(listener)),
      source_(std::move(source)),
      told_(source_ == nullptr) {}

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
    archive::GapCause cause = archive::GapCause::kSignalLost;
    std::string why;
    try {
      if (!source_) open();
      capture();
      return;  // it was stopped
    } catch (const SoundDeviceGone& error) {
      cause = archive::GapCause::kDeviceRemoved;
      why = error.what();
    } catch (const std::exception& error) {
      why = error.what();
    }
    close();
    if (stopping_) return;
    // Once an absence: it may be tried for hours.
    if (!std::exchange(told_, true)) {
      pause_ns = kFirstPauseNs;
      listener_.lost(cause);
      listener_.tell(why + ". Pictures are recorded without its sound until it is there");
    }
    if (!wait_until(clock_, clock_.now_ns() + pause_ns, stopping_)) return;
    pause_ns = std::min(2 * pause_ns, kLongestPauseNs);
  }
}

void Microphone::open() {
  OpeningTerms terms;
  terms.cancelled = &stopping_;
  std::unique_ptr<Source> fresh = guard_->open(address_, clock_, terms);
  const std::lock_guard guard(mutex_);
  source_ = std::move(fresh);
  if (stopping_) source_->interrupt();
}

void Microphone::capture() {
  while (std::optional<TimedFrame> sound = source_->read()) {
    if (std::exchange(told_, false))
      listener_.tell("sound '" + address_.stated + "' is back: " + source_->input());
    if (std::exchange(sound->lost_before, 0) > 0) {
      listener_.lost(archive::GapCause::kOverload);
      listener_.tell("sound '" + address_.stated + "' was not read in time; what is missing is stated");
    }
    listener_.take(std::move(*sound));
  }
}

void Microphone::close() {
  std::unique_ptr<Source> closing;
  {
    const std::lock_guard guard(mutex_);
    closing = std::move(source_);
  }
  closing.reset();  // which may take its time; stop() must not wait for it
}

}  // namespace kiroku::recorder
