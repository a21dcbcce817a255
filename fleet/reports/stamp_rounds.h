// Rounds of one authority: hashes of many appliances are collected for a while, and one token over all of
// them is asked for. What is collected lies in memory alone: whoever ends this process loses the open round
// and those whose tokens were not fetched, and appliances then ask the authority themselves. Thread-safe.
//
//   enter ──→ open round ──(its end)──→ stamped over one hash tree ──→ fetch, for a few rounds more
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/bytes.h"
#include "base/clock.h"
#include "evidence/renewal.h"
#include "evidence/shared_stamps.h"

namespace kiroku::fleet {

struct RoundLimits {
  /// Hashes of one appliance in a round: as many as it may report rooms. So one that is hostile has its own
  /// places alone.
  std::size_t of_appliance = 64;
  /// Hashes in a round: 256 appliances with all their places. Each takes some 400 bytes.
  std::size_t of_round = 16'384;
  /// Rounds that are over and kept, so that their tokens can be fetched.
  std::size_t kept = 3;
};

class StampRounds {
 public:
  /// A round ends each `every` and is not asked for where it is empty. `stamp` is called by a thread of this
  /// object, and is judged by whoever gives it. `tell` is told why a round has no token, and that the next
  /// one has; may be empty. All must outlive the object.
  struct Options {
    evidence::Stamp stamp;
    std::chrono::nanoseconds every = std::chrono::seconds(60);
    RoundLimits limits{};
    std::function<void(const std::string&)> tell{};
    const Clock* clock = &Clock::system();
  };
  explicit StampRounds(Options options);
  /// Waits for a request that is under way.
  ~StampRounds();
  StampRounds(const StampRounds&) = delete;
  StampRounds& operator=(const StampRounds&) = delete;

  enum class Refusal { kTooManyOfAppliance, kFull };
  struct Entered {
    evidence::SharedStamps::Place place;
    std::optional<Refusal> refused;  // then there is no place
  };
  /// Takes a SHA-256 and a nonce, 32 bytes each, of an appliance into the open round.
  Entered enter(const std::string& appliance, ByteView digest, ByteView nonce);

  struct Fetched {
    enum class State { kUnknown, kWaiting, kFailed, kReady };
    State state = State::kUnknown;
    std::chrono::milliseconds ready_in{0};  // of kWaiting: until its round ends
    std::string why;                        // of kFailed
    Bytes record;                           // of kReady: the shared token
  };
  /// What became of a place; unknown to every other appliance, and once some rounds have gone by.
  [[nodiscard]] Fetched fetch(const std::string& appliance, const std::string& ticket) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::fleet
