// An attempt that runs while others look on and move its hand: by pointers that come over a connection.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "trainer/exclusion/exclusion_run.h"
#include "trainer/exclusion/pointer_hand.h"

namespace kiroku::trainer {

struct LiveView {
  const ExclusionView* attempt = nullptr;      // valid during the call
  std::uint64_t picture = 0;                   // from 1
  std::uint64_t input = 0;                     // the newest whose forces are in the picture; 0: none
  std::chrono::nanoseconds input_to_force{0};  // the median so far
};

struct LiveOutcome {
  Ending ending = Ending::kBrokenOff;
  ExclusionOutcome outcome;
  struct Latency {
    std::chrono::nanoseconds median{0}, of_99{0}, longest{0};
  };
  /// From point() to the first forces of a pose on the way there, and until a picture of it had been taken
  /// by `shown`.
  Latency input_to_force, input_to_picture;
  double force_rate_hz = 0, picture_rate_hz = 0;  // achieved
};

/// What an attempt tells, from its own thread: that it began, its pictures, then once that it is over or why
/// it failed.
struct LiveListener {
  std::function<void(const ExclusionBody& body)> began;
  std::function<void(const LiveView& view)> shown;
  std::function<void(const LiveOutcome& outcome)> over;
  std::function<void(const std::string& sentence)> failed;
};

/// Runs from construction on, in threads of its own: forces in one, pictures in another. Thread-safe.
class LiveAttempt {
 public:
  using Body = std::function<std::shared_ptr<const ExclusionBody>()>;

  /// `body` is asked for in the attempt's thread, since it may have to be made first. With Touch::kTrocar
  /// pointers lead the tips of as many instruments (pointer_instruments.h). kiroku::UsageError for fingers
  /// that no hand has.
  LiveAttempt(Body body, ExclusionOptions options, std::size_t fingers, LiveListener listener);
  /// Breaks off what still runs, and waits until the listener has been told.
  ~LiveAttempt();
  LiveAttempt(const LiveAttempt&) = delete;
  LiveAttempt& operator=(const LiveAttempt&) = delete;

  /// As PointerHand::point(); before the attempt has begun and after its end input is checked no further and
  /// moves nothing.
  void point(const PointerInput& input);
  void give_up() { ends_as(Ending::kGivenUp); }

 private:
  void ends_as(Ending ending);
  [[nodiscard]] std::optional<Ending> asked();
  void run();
  void attempt();
  /// When the input came, which is forgotten then with those before it; nothing where it was before.
  std::optional<PointerHand::Clock::time_point> arrival_of(std::uint64_t input);

  Body body_;
  ExclusionOptions options_;
  std::size_t fingers_;
  LiveListener listener_;
  std::mutex mutex_;
  PointerHand* hand_ = nullptr;                                      // while it may be moved
  std::map<std::uint64_t, PointerHand::Clock::time_point> arrived_;  // of input that no picture shows yet
  std::optional<Ending> asked_;
  std::thread thread_;  // last, as it uses all above
};

}  // namespace kiroku::trainer
