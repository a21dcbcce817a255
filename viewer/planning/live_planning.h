// Planning while others look on: deeds come over a connection, pictures go out. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/clock.h"
#include "sim/haptics/latency_histogram.h"
#include "viewer/planning/planning_table.h"

namespace kiroku::viewer {

struct PlanningMoment {
  const PlanningTable* table = nullptr;  // valid during the call, like the picture
  const sim::Picture* picture = nullptr;
  std::uint64_t number = 0;  // of the picture, from 1
  std::uint64_t input = 0;   // the newest deed that is in it, tools on their way; 0: none
  bool moves = false;        // tools are on their way to their pointers
  std::chrono::nanoseconds computing{0}, drawing{0};  // of the last time step, of this picture
};

/// What planning tells, from its own thread.
struct PlanningListener {
  std::function<void(const std::string& step)> opening;  // what is done next
  std::function<void(const PlanningTable& table)> opened;
  std::function<bool()> ready;  // for a picture: asked for, never waited for
  std::function<void(const PlanningMoment& moment)> shown;
  std::function<void(const PlanningTable& table)> steps_changed;
  std::function<void(const std::string& sentence)> told;  // why a deed could not be done, or what it came to
  std::function<void(const std::string& sentence)> failed;  // it is over
};

class LivePlanning {
 public:
  using Opening = std::function<void(const std::string& step)>;
  using MakeTable = std::function<std::unique_ptr<PlanningTable>(const Opening& opening)>;
  /// What is done with the table between two deeds: saving.
  using Task = std::function<void(PlanningTable& table)>;

  /// Runs from construction on, in a thread of its own, in which `make` is called. By `clock`, which outlives
  /// this, tools move, and pictures are made small or of full size.
  LivePlanning(MakeTable make, PlanningListener listener, const Clock& clock = Clock::system());
  /// Ends after the time step or picture that is being made.
  ~LivePlanning();
  LivePlanning(const LivePlanning&) = delete;
  LivePlanning& operator=(const LivePlanning&) = delete;

  /// Queues a deed of that number, above those before. Of views, and of pointers of which none came or went,
  /// only the newest is done. False where a thousand wait.
  bool apply(std::uint64_t number, Deed deed);
  bool run_task(std::uint64_t number, Task task);

  /// From apply() until a picture of it was taken by `shown`, so far. For the thread that calls `shown`, or
  /// once nothing runs any longer.
  [[nodiscard]] const sim::LatencyHistogram& input_to_picture() const { return input_to_picture_; }

 private:
  struct Queued {
    std::uint64_t number = 0;
    Clock::Time arrived;
    Deed deed;
    Task task;
    bool may_be_left_out = false;  // for one of its kind that comes after it
  };

  bool queue(Queued queued);
  void run();
  void plan(PlanningTable& table);
  /// Whether there is something new to see at once; pointers are seen once their tools have moved.
  bool do_all(PlanningTable& table, std::deque<Queued> queued);
  bool advance(PlanningTable& table);
  void show(PlanningTable& table, double share, bool moving);
  void tell_changes(PlanningTable& table);
  [[nodiscard]] double quick_share() const;

  MakeTable make_;
  PlanningListener listener_;
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Queued> queued_;
  PointDeed pointers_;  // that were queued last
  bool ends_ = false;

  // The thread's.
  struct Input {
    std::uint64_t number = 0;
    Clock::Time arrived;
  };
  std::uint64_t pictures_ = 0;
  Input input_;                   // the newest that the next picture shows
  std::optional<Input> awaited_;  // the newest, where that waits for the next time step
  bool timed_ = true;             // input_ is in a picture already
  Clock::Time busy_;              // when something was last done
  double full_picture_s_ = 0;     // what a coarse one of full size took lately
  std::chrono::nanoseconds computing_{0};
  std::optional<std::uint64_t> revision_told_;
  bool moves_ = false;
  sim::LatencyHistogram input_to_picture_;

  std::thread thread_;  // last, as it uses all above
};

}  // namespace kiroku::viewer
