#include "trainer/exclusion/live_attempt.h"

#include <iterator>
#include <utility>

#include "base/error.h"
#include "trainer/exclusion/pointer_instruments.h"

namespace kiroku::trainer {
namespace {

LiveOutcome::Latency latency_of(const sim::LatencyHistogram& times) {
  return {times.percentile(0.5), times.percentile(0.99), times.longest()};
}

}  // namespace

LiveAttempt::LiveAttempt(Body body, ExclusionOptions options, std::size_t fingers, LiveListener listener)
    : body_(std::move(body)),
      options_(std::move(options)),
      fingers_(side_by_side_m(fingers).size()),
      listener_(std::move(listener)),
      thread_([this] { run(); }) {}

LiveAttempt::~LiveAttempt() {
  ends_as(Ending::kBrokenOff);
  thread_.join();
}

void LiveAttempt::ends_as(Ending ending) {
  const std::lock_guard guard(mutex_);
  if (!asked_) asked_ = ending;
}

std::optional<Ending> LiveAttempt::asked() {
  const std::lock_guard guard(mutex_);
  return asked_;
}

void LiveAttempt::point(const PointerInput& input) {
  const auto arrived = PointerHand::Clock::now();
  const std::lock_guard guard(mutex_);
  if (hand_ == nullptr) return;
  hand_->point(input, arrived);
  arrived_[input.number] = arrived;
}

std::optional<PointerHand::Clock::time_point> LiveAttempt::arrival_of(std::uint64_t input) {
  const std::lock_guard guard(mutex_);
  const auto found = arrived_.find(input);
  if (found == arrived_.end()) return {};
  const auto arrived = found->second;
  arrived_.erase(arrived_.begin(), std::next(found));
  return arrived;
}

void LiveAttempt::run() {
  try {
    attempt();
  } catch (const std::exception& error) {
    listener_.failed(error.what());
  }
}

void LiveAttempt::attempt() {
  const std::shared_ptr<const ExclusionBody> body = body_();
  ExclusionRunner runner(*body, options_);
  PointerHand hand(*body, camera_of(body->task(), options_.width, options_.height), fingers_,
                   1 / options_.force_rate_hz);
  std::optional<PointerInstruments> instruments;
  if (options_.touch == Touch::kTrocar) {
    instruments.emplace(hand, trocars_of(body->task(), fingers_), 1 / options_.force_rate_hz);
  }
  sim::HapticDevice& device = instruments ? static_cast<sim::HapticDevice&>(*instruments) : hand;
  const auto may_be_moved = [this](PointerHand* moved) {
    const std::lock_guard guard(mutex_);
    hand_ = moved;
  };
  listener_.began(*body);
  may_be_moved(&hand);
  sim::LatencyHistogram input_to_picture;
  std::uint64_t pictures = 0;
  LiveOutcome over;
  try {
    over.outcome = runner.run_in_real_time(device, [&](const ExclusionView& view) {
      hand.see(view.displacement_m);
      const std::uint64_t input = hand.felt_by(view.looked_at);
      listener_.shown({&view, ++pictures, input, hand.input_to_force().percentile(0.5)});
      if (const auto arrived = arrival_of(input)) input_to_picture.add(PointerHand::Clock::now() - *arrived);
      return !asked();
    });
  } catch (...) {
    may_be_moved(nullptr);
    throw;
  }
  may_be_moved(nullptr);
  over.ending = over.outcome.score.done ? Ending::kDone : asked().value_or(Ending::kTimeOver);
  over.input_to_force = latency_of(hand.input_to_force());
  over.input_to_picture = latency_of(input_to_picture);
  if (over.outcome.elapsed_s > 0) {
    over.force_rate_hz = static_cast<double>(over.outcome.force_loop->steps) / over.outcome.elapsed_s;
    over.picture_rate_hz = static_cast<double>(over.outcome.pictures) / over.outcome.elapsed_s;
  }
  listener_.over(over);
}

}  // namespace kiroku::trainer
