#include "recorder/source/source_guard.h"

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <iostream>
#include <mutex>
#include <thread>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "recorder/source/boxed_source.h"
#include "recorder/source/sound_source.h"

namespace kiroku::recorder {
namespace {

using std::chrono::nanoseconds;

// So often whoever waits looks whether it should go on waiting.
constexpr std::chrono::milliseconds kStep{20};

std::atomic<unsigned> stuck_of_process = 0;

/// "1.5 s"
std::string in_seconds(nanoseconds time) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g s", std::chrono::duration<double>(time).count());
  return text;
}

std::unique_ptr<Source> make_source(const SourceAddress& address, const CaseClock& clock,
                                    const OpeningTerms& terms) {
  return address.kind == SourceKind::kSound ? open_sound_source(address, clock, terms)
                                            : open_captured_source(address, clock, terms);
}

std::string name_of(const SourceAddress& address) { return "source '" + address.stated + "'"; }

}  // namespace

/// What the thread and whoever waits for it share. It refers to nothing of a session or a room.
class SourceGuard::Thread : public std::enable_shared_from_this<Thread> {
 public:
  Thread(std::shared_ptr<SourceGuard> guard, SourceAddress address, const CaseClock& clock,
         const OpeningTerms& asked)
      : guard_(std::move(guard)), address_(std::move(address)), clock_(clock), terms_(asked) {
    terms_.cancelled = &must_end_;
    terms_.pulse = &pulse_;
    terms_.silence = guard_->limits_.silence;
    terms_.guard = {};
  }

  /// What the source said of itself when it was opened.
  struct Facts {
    PictureFormat format;
    Rational rate;
    std::optional<SoundFormat> sound;
    bool live = false, unboxed = false;
    SourceCoding coding;
    std::string input, remark;
    PictureTreatment treatment;
  };

  void start() {
    asked_ = true;
    thread_ = std::thread([self = shared_from_this()] { self->run(); });
  }

  /// Waits until what was asked for is done; false where it was given up. `must_end` is looked at meanwhile.
  template <typename MustEnd>
  bool answered(const char* doing, const MustEnd& must_end) {
    std::unique_lock lock(mutex_);
    return wait(
        lock, doing, [this] { return !asked_; }, must_end);
  }
  /// After answered() was false: whether the thread was given up for its silence, before it was told to end.
  [[nodiscard]] bool fell_silent() {
    const std::lock_guard guard(mutex_);
    return fell_silent_;
  }
  /// After answered(); throws what went wrong.
  Facts facts() {
    const std::lock_guard guard(mutex_);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    return facts_;
  }
  std::optional<TimedFrame> frame() {
    const std::lock_guard guard(mutex_);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    return std::exchange(frame_, std::nullopt);
  }

  void ask_to_read(const CaseClock& clock) {
    const std::lock_guard guard(mutex_);
    clock_ = clock;  // nothing of the source runs now
    asked_ = true;
    changed_.notify_all();
  }

  /// Closes the source and ends the thread, or gives it up. To be called once, by whoever waits.
  void end() {
    std::unique_lock lock(mutex_);
    if (!given_up_) {
      ending_ = true;
      changed_.notify_all();
      wait(
          lock, "closing", [this] { return ended_; }, [] { return true; });
    }
    lock.unlock();
    if (given_up_) {
      thread_.detach();
    } else {
      thread_.join();
    }
  }

 private:
  template <typename Done, typename MustEnd>
  bool wait(std::unique_lock<std::mutex>& lock, const char* doing, const Done& done,
            const MustEnd& must_end) {
    if (given_up_) return false;
    const SourceGuard::Limits& limits = guard_->limits_;
    std::uint64_t pulse = pulse_;
    nanoseconds silent{0};
    nanoseconds ending{0};
    const Clock& time = guard_->time_;
    Clock::Time before = time.now();
    while (!time.wait_for(changed_, lock, kStep, done)) {
      const Clock::Time now = time.now();
      // Where this thread was kept from running, so was the source's: that says nothing against its driver.
      const nanoseconds passed = std::min<nanoseconds>(now - before, 2 * kStep);
      before = now;
      silent = std::exchange(pulse, pulse_) == pulse ? silent + passed : nanoseconds(0);
      if (must_end()) {
        must_end_ = true;
        if (source_) source_->interrupt();
        ending += passed;
      }
      if (silent < limits.silence && ending < limits.ending) continue;
      given_up_ = ending_ = must_end_ = true;
      fell_silent_ = ending == nanoseconds(0);
      if (source_) source_->interrupt();
      guard_->give_up(name_of(address_), doing);
      return false;
    }
    return true;
  }

  void run() {
    open();
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return asked_ || ending_; });
      if (ending_ || !source_) break;
      lock.unlock();
      std::optional<TimedFrame> frame;
      std::exception_ptr failure;
      try {
        frame = source_->read();
      } catch (...) {
        failure = std::current_exception();
      }
      lock.lock();
      answer(failure, std::move(frame));
    }
    // interrupt() may not meet a source that is being destroyed.
    std::unique_ptr<Source> closing = std::move(source_);
    frame_.reset();
    lock.unlock();
    closing.reset();
    lock.lock();
    ended_ = true;
    changed_.notify_all();
    if (given_up_) guard_->came_back(name_of(address_));
  }

  void open() {
    std::unique_ptr<Source> made;
    std::exception_ptr failure;
    Facts facts;
    try {
      made = guard_->make_(address_, clock_, terms_);
      facts = {made->format(), made->frame_rate(), made->sound_format(), made->is_live(),  made->is_unboxed(),
               made->coding(), made->input(),      made->remark(),       made->treatment()};
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard guard(mutex_);
    source_ = std::move(made);
    facts_ = std::move(facts);
    answer(failure, std::nullopt);
  }

  /// With the mutex held.
  void answer(std::exception_ptr failure, std::optional<TimedFrame> frame) {
    failure_ = std::move(failure);
    frame_ = std::move(frame);
    asked_ = false;
    changed_.notify_all();
  }

  const std::shared_ptr<SourceGuard> guard_;
  const SourceAddress address_;
  CaseClock clock_;  // changed only while nothing is asked of the thread
  OpeningTerms terms_;
  std::atomic<bool> must_end_ = false;
  std::atomic<std::uint64_t> pulse_ = 0;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::unique_ptr<Source> source_;
  Facts facts_;
  std::optional<TimedFrame> frame_;
  std::exception_ptr failure_;
  bool asked_ = false, ending_ = false, ended_ = false, given_up_ = false, fell_silent_ = false;

  std::thread thread_;  // of whoever waits
};

class SourceGuard::Guarded : public Source {
 public:
  Guarded(std::shared_ptr<SourceGuard> guard, const SourceAddress& address, const CaseClock& clock,
          const OpeningTerms& terms)
      : clock_(clock),
        limits_(guard->limits_),
        name_(name_of(address)),
        thread_(std::make_shared<Thread>(std::move(guard), address, clock, terms)) {
    thread_->start();
    try {
      if (!thread_->answered("opening", [&] { return terms.cancelled != nullptr && *terms.cancelled; }))
        throw Error(name_ + " does not come back from being opened");
      facts_ = thread_->facts();
    } catch (...) {
      thread_->end();
      throw;
    }
  }
  ~Guarded() override { thread_->end(); }
  Guarded(const Guarded&) = delete;
  Guarded& operator=(const Guarded&) = delete;

  [[nodiscard]] PictureFormat format() const override { return facts_.format; }
  [[nodiscard]] Rational frame_rate() const override { return facts_.rate; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override { return facts_.sound; }
  [[nodiscard]] bool is_live() const override { return facts_.live; }
  [[nodiscard]] bool is_unboxed() const override { return facts_.unboxed; }
  [[nodiscard]] SourceCoding coding() const override { return facts_.coding; }
  [[nodiscard]] std::string input() const override { return facts_.input; }
  [[nodiscard]] std::string remark() const override { return facts_.remark; }
  [[nodiscard]] PictureTreatment treatment() const override { return facts_.treatment; }

  std::optional<TimedFrame> read() override {
    if (interrupted()) return {};
    thread_->ask_to_read(clock_);
    if (thread_->answered("reading", [this] { return interrupted(); })) return thread_->frame();
    // What was lost before the recording was told to end is lost, though it has been told by now.
    if (!thread_->fell_silent()) return {};
    throw SourceSilent(name_ + " has not answered for " + in_seconds(limits_.silence) + ": it is given up");
  }

 private:
  const CaseClock& clock_;
  const Limits limits_;
  const std::string name_;
  const std::shared_ptr<Thread> thread_;
  Thread::Facts facts_;
};

SourceGuard::SourceGuard() : SourceGuard(Limits{}) {}

SourceGuard::SourceGuard(Limits limits, Tell tell, Maker make, LookUp look_up, const Clock& time)
    : limits_(limits),
      tell_(std::move(tell)),
      make_(make ? std::move(make) : Maker(make_source)),
      look_up_(std::move(look_up)),
      time_(time) {}

SourceAddress SourceGuard::look_up(const std::string& text, Presence presence) {
  SourceAddress unseen = parse_source_address(text, Presence::kNotLookedAt);
  const std::string name = name_of(unseen);
  struct Looking {
    std::mutex mutex;  // guards what follows
    std::condition_variable changed;
    SourceAddress found;
    std::exception_ptr failure;
    bool done = false, given_up = false;
  };
  const auto looking = std::make_shared<Looking>();
  if (stuck_ < limits_.most_stuck) {
    std::thread thread([self = shared_from_this(), looking, text, presence, name] {
      SourceAddress found;
      std::exception_ptr failure;
      try {
        found = self->look_up_(text, presence);
      } catch (...) {
        failure = std::current_exception();
      }
      const std::lock_guard lock(looking->mutex);
      looking->found = std::move(found);
      looking->failure = failure;
      looking->done = true;
      looking->changed.notify_all();
      if (looking->given_up) self->came_back(name);
    });
    std::unique_lock lock(looking->mutex);
    if (time_.wait_for(looking->changed, lock, limits_.silence, [&] { return looking->done; })) {
      lock.unlock();
      thread.join();
      if (looking->failure) std::rethrow_exception(looking->failure);
      return std::move(looking->found);
    }
    looking->given_up = true;
    give_up(name, "looking it up");
    thread.detach();
  }
  if (presence == Presence::kRequired)
    throw Error(name + " cannot be looked up: its file system does not answer");
  return unseen;
}

std::unique_ptr<Source> SourceGuard::open(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms) {
  if (stuck_ >= limits_.most_stuck) {
    throw Error(name_of(address) + " cannot be opened again before one of its " + std::to_string(stuck_) +
                " stuck threads comes back from its driver; unplug it, or restart the recorder");
  }
  return std::make_unique<Guarded>(shared_from_this(), address, clock, terms);
}

void SourceGuard::give_up(const std::string& source, const char* doing) {
  ++stuck_of_process;
  ++given_up_;
  const unsigned stuck = ++stuck_;
  if (!tell_) return;
  tell_(source + " does not come back from its driver or file system (" + doing +
        "): its thread is left behind, " + std::to_string(stuck) + " of at most " +
        std::to_string(limits_.most_stuck));
}

void SourceGuard::came_back(const std::string& source) {
  if (tell_) tell_(source + ": a thread that was left behind has come back");
  --stuck_;
  --stuck_of_process;
}

unsigned stuck_source_threads() { return stuck_of_process; }

int end_process(int status) {
  if (stuck_source_threads() == 0) return status;
  std::cout.flush();
  std::cerr.flush();
  (void)std::fflush(nullptr);
  ::_exit(status);
}

}  // namespace kiroku::recorder
