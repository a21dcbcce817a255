// A breathing workbench while somebody looks on: deeds come over a connection, pictures go out, and
// radiographs are measured while nothing else is asked for. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/clock.h"
#include "sim/haptics/latency_histogram.h"
#include "viewer/breathing/breathing_table.h"

namespace kiroku::viewer {

struct BreathingMoment {
  const BreathingTable::Shown* shown = nullptr;  // valid during the call
  std::uint64_t number = 0;                      // of the picture, from 1
  std::uint64_t input = 0;                       // the newest deed that is in it; 0: none
  std::uint64_t revision = 0;                    // of the motion
  std::chrono::nanoseconds drawing{0};
};

/// What is told, from the workbench's own thread.
struct BreathingListener {
  std::function<bool()> ready;  // for a picture: asked for, never waited for
  std::function<void(const BreathingMoment& moment)> shown;
  /// Where the tumour goes by a motion: before the first picture of it.
  std::function<void(const BreathingTable& table)> moved;
  /// More radiographs were measured, or none is any more.
  std::function<void(const BreathingTable& table)> measured;
  std::function<void(const std::string& sentence)> told;  // why a task could not be done
  /// Why a motion could not be shown; that of the table stands. `input`: the newest deed that was heard by
  /// then.
  std::function<void(const std::string& sentence, std::uint64_t input, const BreathingTable& table)> refused;
  std::function<void(const std::string& sentence)> failed;  // it is over
};

class LiveBreathing {
 public:
  using Task = std::function<void()>;

  /// Runs from construction on, in a thread of its own. `bench` and `clock` outlive it.
  LiveBreathing(const BreathingBench& bench, BreathingListener listener,
                const Clock& clock = Clock::system());
  /// Ends after the picture that is being made.
  ~LiveBreathing();
  LiveBreathing(const LiveBreathing&) = delete;
  LiveBreathing& operator=(const LiveBreathing&) = delete;

  /// Does the deed of that number, above those before. Of each kind only the newest is done.
  void apply(std::uint64_t number, const MotionDeed& deed);
  void apply(std::uint64_t number, const MomentDeed& deed);
  void apply(std::uint64_t number, const LookDeed& deed);
  /// Called by the workbench's thread, what it throws is told; false where eight wait.
  bool run_task(Task task);

  /// From apply() until a picture of it was taken by `shown`, so far. For the thread that calls `shown`, or
  /// once nothing runs any longer.
  [[nodiscard]] const sim::LatencyHistogram& input_to_picture() const { return input_to_picture_; }

 private:
  struct Wanted {
    std::optional<MotionDeed> motion;
    std::optional<MomentDeed> moment;
    std::optional<LookDeed> look;
    std::uint64_t number = 0;
    Clock::Time arrived;
    std::deque<Task> tasks;
    [[nodiscard]] bool any() const { return motion || moment || look || !tasks.empty(); }
  };

  template <typename Deed>
  void want(std::uint64_t number, std::optional<Deed> Wanted::*kind, const Deed& deed);
  void run();
  void work();
  /// Whether there is something new to see.
  bool do_all(BreathingTable& table, Wanted wanted);
  void show(BreathingTable& table, std::size_t factor);
  void measure(BreathingTable& table);
  [[nodiscard]] std::size_t quick_factor() const;

  const BreathingBench& bench_;
  BreathingListener listener_;
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable wake_;
  Wanted wanted_;
  bool ends_ = false;

  // The thread's.
  std::uint64_t pictures_ = 0, input_ = 0, revision_told_ = 0;
  std::optional<Clock::Time> untimed_;  // when what the next picture shows first arrived
  Clock::Time busy_;                    // when something was last done
  double full_picture_s_ = 0;           // what one of full size took lately
  bool measuring_ = true;
  std::size_t untold_ = 0;  // measured radiographs
  sim::LatencyHistogram input_to_picture_;

  std::thread thread_;  // last, as it uses all above
};

}  // namespace kiroku::viewer
