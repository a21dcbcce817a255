// What all who come to a breathing workbench share: the bench, and how many may work at once. Thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "viewer/breathing/breathing_bench.h"
#include "viewer/people/turns.h"

namespace kiroku::viewer {

/// What was made of a model that was sealed.
struct SealedModel {
  std::string file, sha256;  // the seal's name, and its hash
  struct Stamp {
    std::string authority, time, problem;  // time and problem: one is empty
    std::string kind = {};                 // whose clock the time is: "external", "self-issued"; else empty
  };
  std::vector<Stamp> stamps;
};
/// Seals a model that was saved: its seal is beside it then, and in the appliance log. Thread-safe; may take
/// as long as authorities do. kiroku::Error.
using ModelSealer = std::function<SealedModel(const std::filesystem::path& model)>;

class BreathingRoom {
 public:
  /// `bench` outlives it; each of `at_once` people needs about two cores while something moves. `tell` hears
  /// in one sentence of what failed inside, from several threads.
  BreathingRoom(const BreathingBench& bench, std::size_t at_once,
                std::function<void(const std::string& sentence)> tell, ModelSealer sealer = {},
                Clock::Duration patience = kPatienceForPlaces);

  [[nodiscard]] const BreathingBench& bench() const { return bench_; }
  void tell(const std::string& sentence) const { tell_(sentence); }
  /// Null where models are not sealed here.
  [[nodiscard]] const ModelSealer& sealer() const { return sealer_; }
  /// A place for `person` (Session::person()); the room must outlive it. Refusal 503 where all are taken;
  /// where their own are, after the room's patience, which it blocks. Of several places one is always left
  /// for others.
  std::unique_ptr<Turns::Turn> enter(const std::string& person);
  /// The right to compute a fit, which takes all cores: one at a time. Refusal 503 where another is computed.
  std::unique_ptr<Turns::Turn> enter_fit(const std::string& person);

 private:
  const BreathingBench& bench_;
  std::function<void(const std::string& sentence)> tell_;
  ModelSealer sealer_;
  Turns places_, fits_;
};

}  // namespace kiroku::viewer
