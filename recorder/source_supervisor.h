// Keeps the source of a stream: reads it on a thread of its own into the queue, and opens it anew when it is
// lost. start, stop, join and what it says of itself are thread-safe.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "recorder/frame_queue.h"
#include "recorder/lane.h"
#include "recorder/microphone.h"
#include "recorder/picture_tap.h"
#include "recorder/source/source.h"
#include "recorder/source/source_guard.h"

namespace kiroku::recorder {

class SourceSupervisor {
 public:
  struct Terms {
    SourceAddress address;
    bool audio = false;                  // it is asked for its audio too
    std::shared_ptr<PictureTap> tap;     // offered every picture before it is queued; may be null
    std::shared_ptr<SourceGuard> guard;  // the source is opened through it; nothing waits longer than it says
    /// Its audio takes the place of the source's own; opened through a guard of its own, so that its driver
    /// takes nothing from the camera.
    std::optional<SourceAddress> microphone = {};
    std::shared_ptr<SourceGuard> microphone_guard = nullptr;  // null: there is no microphone
    /// Told, from the thread that reads, of each picture from which on pictures are shown otherwise than was
    /// said before, at first by the source that the supervisor was given; kMostTurns times. May be empty.
    std::function<void(const std::string& sentence)> turned = {};
  };
  static constexpr int kMostTurns = 100;

  /// `source` was opened from the address; or it is null, and is taken up when it can be opened: the queue is
  /// told that it is lost. A live one is opened anew when it is lost, after pauses that grow from one second
  /// to sixteen, until it is back (a pipe: when somebody writes to it again within ten seconds, else it has
  /// ended). The queue is finished when nothing more comes. `microphone` was opened from Terms::microphone,
  /// or is null, and is taken up likewise. `context` and `queue` must outlive the object.
  SourceSupervisor(const LaneContext& context, Terms terms, std::unique_ptr<Source> source, FrameQueue& queue,
                   std::unique_ptr<Source> microphone = nullptr);
  ~SourceSupervisor();
  SourceSupervisor(const SourceSupervisor&) = delete;
  SourceSupervisor& operator=(const SourceSupervisor&) = delete;

  /// Each picture goes into this queue too, and that the source is lost; no audio. `further` must outlive the
  /// supervisor's thread. Before start().
  void feed_also(FrameQueue& further) { further_.push_back(&further); }

  void start();
  /// Interrupts whatever source there is; returns at once.
  void stop();
  /// Waits until the threads have ended.
  void join();

  /// Pictures come.
  [[nodiscard]] bool live() const { return live_; }
  /// Nothing more comes.
  [[nodiscard]] bool ended() const { return ended_; }
  /// The source had more when LaneContext::end_ns was reached.
  [[nodiscard]] bool reached_end() const { return reached_end_; }
  /// As Source::input(), of the source there is, or was.
  [[nodiscard]] std::string input() const;
  /// As Source::is_unboxed(), likewise.
  [[nodiscard]] bool is_unboxed() const { return unboxed_; }
  /// As SourceGuard, of the source and the microphone together.
  [[nodiscard]] unsigned stuck() const;
  [[nodiscard]] std::uint64_t given_up() const;
  [[nodiscard]] const SourceAddress& address() const { return terms_.address; }

 private:
  void run();
  void read(Source& source);
  /// Once: a film may have thousands.
  void tell_of(TimeBreak time_break);
  void tell_of_turn(const TimedFrame& picture);
  void show(TimedFrame picture);
  void lose();
  void hear(TimedFrame audio);
  /// From the microphone's thread.
  void hear_of_microphone(TimedFrame audio);
  /// Tries until there is a source; false if it has ended or is stopped. A pipe that was never opened is
  /// waited for like anything else, and so is one whose decoder was lost.
  bool reopen(bool may_have_ended);
  [[nodiscard]] std::unique_ptr<Source> open_anew();
  void close();
  [[nodiscard]] archive::GapCause cause_of_loss() const;

  const LaneContext context_;
  const Terms terms_;
  FrameQueue& queue_;
  std::vector<FrameQueue*> further_;
  // Of the thread that reads:
  bool told_of_break_ = false;
  PictureTreatment stated_;
  int turns_ = 0;
  std::atomic<bool> stopping_ = false, ended_ = false, reached_end_ = false, live_ = false, unboxed_ = false;

  mutable std::mutex mutex_;  // guards what follows
  std::unique_ptr<Source> source_;
  std::string input_;

  std::unique_ptr<Microphone> microphone_;  // null: the audio is the source's own, or there is none
  bool microphone_dropped_ = false;         // the microphone's thread's: its last piece had no room
  std::thread thread_;
};

}  // namespace kiroku::recorder
