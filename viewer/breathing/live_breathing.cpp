#include "viewer/breathing/live_breathing.h"

#include <utility>

#include "base/error.h"

namespace kiroku::viewer {
namespace {

using std::chrono::duration;
using std::chrono::milliseconds;

constexpr std::size_t kMostTasks = 8;
/// Pictures while something moves are made of so few pixels that they take no longer; the last is of all.
constexpr double kQuickPictureSeconds = 0.04;
constexpr milliseconds kStill{200};
/// How often a browser that is behind is asked again.
constexpr milliseconds kAskAgain{4};
/// So many radiographs are measured between two messages about them.
constexpr std::size_t kTellEvery = 8;

}  // namespace

LiveBreathing::LiveBreathing(const BreathingBench& bench, BreathingListener listener, const Clock& clock)
    : bench_(bench), listener_(std::move(listener)), clock_(clock), thread_([this] { run(); }) {}

LiveBreathing::~LiveBreathing() {
  {
    const std::lock_guard guard(mutex_);
    ends_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

template <typename Deed>
void LiveBreathing::want(std::uint64_t number, std::optional<Deed> Wanted::*kind, const Deed& deed) {
  {
    const std::lock_guard guard(mutex_);
    if (!wanted_.motion && !wanted_.moment && !wanted_.look) wanted_.arrived = clock_.now();
    wanted_.*kind = deed;
    wanted_.number = number;
  }
  wake_.notify_all();
}

void LiveBreathing::apply(std::uint64_t number, const MotionDeed& deed) {
  want(number, &Wanted::motion, deed);
}
void LiveBreathing::apply(std::uint64_t number, const MomentDeed& deed) {
  want(number, &Wanted::moment, deed);
}
void LiveBreathing::apply(std::uint64_t number, const LookDeed& deed) { want(number, &Wanted::look, deed); }

bool LiveBreathing::run_task(Task task) {
  {
    const std::lock_guard guard(mutex_);
    if (wanted_.tasks.size() >= kMostTasks) return false;
    wanted_.tasks.push_back(std::move(task));
  }
  wake_.notify_all();
  return true;
}

void LiveBreathing::run() {
  try {
    work();
  } catch (const std::exception& error) {
    listener_.failed(error.what());
  }
}

void LiveBreathing::work() {
  BreathingTable table(bench_);
  bool stale = true, quick = false;
  busy_ = clock_.now() - kStill;
  for (;;) {
    Wanted wanted;
    {
      std::unique_lock lock(mutex_);
      const auto called = [this] { return ends_ || wanted_.any(); };
      if (stale && !listener_.ready()) {
        clock_.wait_until(wake_, lock, clock_.now() + kAskAgain, called);
      } else if (!stale && quick) {
        clock_.wait_until(wake_, lock, busy_ + kStill, called);
      } else if (!stale && !measuring_) {
        wake_.wait(lock, called);
      }
      if (ends_) return;
      wanted = std::exchange(wanted_, {});
    }
    if (wanted.any() && do_all(table, std::move(wanted))) stale = true;
    const bool is_still = clock_.now() - busy_ >= kStill;
    if (stale || (quick && is_still)) {
      if (!listener_.ready()) continue;
      const std::size_t factor = is_still ? 1 : quick_factor();
      show(table, factor);
      stale = false;
      quick = factor > 1;
    } else if (measuring_ && !quick) {
      measure(table);
    }
  }
}

bool LiveBreathing::do_all(BreathingTable& table, Wanted wanted) {
  const bool seen = wanted.motion || wanted.moment || wanted.look;
  const auto guarded = [&](const auto& act) {
    try {
      act();
    } catch (const Error& refused) {
      listener_.told(refused.what());
    }
  };
  if (wanted.motion) {
    try {
      table.apply(*wanted.motion);
    } catch (const Error& refused) {
      listener_.refused(refused.what(), wanted.number, table);
    }
    measuring_ = bench_.has_radiographs();
    untold_ = 0;
  }
  if (wanted.moment) table.apply(*wanted.moment);
  if (wanted.look) table.apply(*wanted.look);
  for (const Task& task : wanted.tasks) guarded(task);
  if (!seen) return false;
  input_ = wanted.number;
  if (!untimed_) untimed_ = wanted.arrived;
  busy_ = clock_.now();
  return true;
}

std::size_t LiveBreathing::quick_factor() const {
  std::size_t factor = 1;
  while (factor < BreathingBench::kFactors &&
         full_picture_s_ / static_cast<double>(factor * factor) > kQuickPictureSeconds)
    ++factor;
  return factor;
}

void LiveBreathing::show(BreathingTable& table, std::size_t factor) {
  if (revision_told_ != table.revision()) {
    revision_told_ = table.revision();
    listener_.moved(table);
  }
  const auto begin = clock_.now();
  const BreathingTable::Shown shown = table.picture(factor);
  BreathingMoment moment{&shown, ++pictures_, input_, table.revision(), clock_.now() - begin};
  listener_.shown(moment);
  const auto end = clock_.now();
  full_picture_s_ = duration<double>(end - begin).count() * static_cast<double>(factor * factor);
  if (untimed_) input_to_picture_.add(end - *std::exchange(untimed_, {}));
}

void LiveBreathing::measure(BreathingTable& table) {
  measuring_ = table.measure_one();
  if (measuring_) ++untold_;
  if (untold_ == 0 || (measuring_ && untold_ % kTellEvery != 0)) return;
  listener_.measured(table);
  if (!measuring_) untold_ = 0;
}

}  // namespace kiroku::viewer
