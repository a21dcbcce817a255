// What all who come to a breathing workbench share: the bench, and how many may work at once. Thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "viewer/breathing/breathing_bench.h"
#include "viewer/people/turns.h"

namespace kiroku::viewer {

class BreathingRoom {
 public:
  /// `bench` outlives it; each of `at_once` people needs about two cores while something moves. `tell` hears
  /// in one sentence of what failed inside, from several threads.
  BreathingRoom(const BreathingBench& bench, std::size_t at_once,
                std::function<void(const std::string& sentence)> tell);

  [[nodiscard]] const BreathingBench& bench() const { return bench_; }
  void tell(const std::string& sentence) const { tell_(sentence); }
  /// A place for `person` (Session::person()); the room must outlive it. Refusal 503 where all are taken. Of
  /// several places one is always left for others.
  std::unique_ptr<Turns::Turn> enter(const std::string& person);
  /// The right to compute a fit, which takes all cores: one at a time. Refusal 503 where another is computed.
  std::unique_ptr<Turns::Turn> enter_fit(const std::string& person);

 private:
  const BreathingBench& bench_;
  std::function<void(const std::string& sentence)> tell_;
  Turns places_, fits_;
};

}  // namespace kiroku::viewer
