#include "viewer/planning/live_planning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <variant>

#include "base/error.h"

namespace kiroku::viewer {
namespace {

using std::chrono::duration;
using std::chrono::milliseconds;

constexpr std::size_t kMostQueued = 1000;
/// Pictures while something moves are coarse, and so small that they take no longer; the last one is fine and
/// of full size.
constexpr double kQuickPictureSeconds = 0.05;
constexpr std::array kShares{1.0, 0.75, 0.5, 0.35};
constexpr milliseconds kStill{200};
/// How often a browser that is behind is asked again.
constexpr milliseconds kAskAgain{4};

bool same_pointers(const PointDeed& one, const PointDeed& other) {
  return one.use == other.use &&
         std::ranges::equal(one.pointers, other.pointers, {}, &PlanPointer::id, &PlanPointer::id);
}

}  // namespace

LivePlanning::LivePlanning(MakeTable make, PlanningListener listener, const Clock& clock)
    : make_(std::move(make)), listener_(std::move(listener)), clock_(clock), thread_([this] { run(); }) {}

LivePlanning::~LivePlanning() {
  {
    const std::lock_guard guard(mutex_);
    ends_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

bool LivePlanning::apply(std::uint64_t number, Deed deed) {
  return queue({number, clock_.now(), std::move(deed), {}, false});
}

bool LivePlanning::run_task(std::uint64_t number, Task task) {
  return queue({number, clock_.now(), {}, std::move(task), false});
}

bool LivePlanning::queue(Queued queued) {
  const std::lock_guard guard(mutex_);
  if (const auto* point = std::get_if<PointDeed>(&queued.deed)) {
    // Where a pointer comes down and goes up counts.
    queued.may_be_left_out = same_pointers(*point, pointers_);
    pointers_ = *point;
  } else {
    queued.may_be_left_out = !queued.task && std::holds_alternative<ViewDeed>(queued.deed);
  }
  if (!queued_.empty() && queued.may_be_left_out && queued_.back().may_be_left_out &&
      queued.deed.index() == queued_.back().deed.index()) {
    queued_.back() = std::move(queued);
  } else {
    if (queued_.size() >= kMostQueued) return false;
    queued_.push_back(std::move(queued));
  }
  wake_.notify_all();
  return true;
}

void LivePlanning::run() {
  try {
    const std::unique_ptr<PlanningTable> table = make_(listener_.opening);
    listener_.opened(*table);
    plan(*table);
  } catch (const std::exception& error) {
    listener_.failed(error.what());
  }
}

void LivePlanning::plan(PlanningTable& table) {
  tell_changes(table);
  bool stale = true, quick = false;
  auto next_step = clock_.now();
  const auto time_step =
      std::chrono::duration_cast<Clock::Duration>(duration<double>(table.session().plan().time_step_s));
  for (;;) {
    std::deque<Queued> queued;
    {
      std::unique_lock lock(mutex_);
      const auto until = moves_  ? next_step
                         : stale ? clock_.now() + kAskAgain
                         : quick ? busy_ + kStill
                                 : Clock::Time::max();
      const auto called = [this] { return ends_ || !queued_.empty(); };
      if (!stale || !listener_.ready()) {
        if (until == Clock::Time::max()) {
          wake_.wait(lock, called);
        } else {
          clock_.wait_until(wake_, lock, until, called);
        }
      }
      if (ends_) return;
      queued.swap(queued_);
    }
    if (!queued.empty()) {
      if (do_all(table, std::move(queued))) stale = true;
    }
    // Tools are moved as fast as it is planned, and slower where that cannot be computed so fast.
    if (clock_.now() >= next_step) {
      const bool moved = std::exchange(moves_, advance(table));
      if (awaited_) {
        input_ = *std::exchange(awaited_, {});
        timed_ = false;
        stale = true;
      }
      stale = stale || moves_ || moved;
      next_step = moves_ ? std::max(next_step + time_step, clock_.now()) : clock_.now();
    }
    const bool is_still = !moves_ && clock_.now() - busy_ >= kStill;
    if (!stale && !(quick && is_still)) continue;
    if (!listener_.ready()) continue;
    const double share = is_still ? 1 : quick_share();
    show(table, share, !is_still);
    stale = false;
    quick = !is_still;
  }
}

bool LivePlanning::do_all(PlanningTable& table, std::deque<Queued> queued) {
  const std::uint64_t before = table.session().revision();
  bool seen = false;
  for (Queued& one : queued) {
    try {
      if (one.task) {
        one.task(table);
      } else {
        table.apply(one.deed);
      }
    } catch (const Error& refused) {
      listener_.told(refused.what());
    }
    const bool points = !one.task && std::holds_alternative<PointDeed>(one.deed);
    seen = seen || !points;
    // Whatever comes after a pointer is not in a picture before it.
    if (points || awaited_) {
      awaited_ = Input{one.number, one.arrived};
    } else {
      input_ = {one.number, one.arrived};
      timed_ = false;
    }
  }
  busy_ = clock_.now();
  tell_changes(table);
  return seen || table.session().revision() != before;
}

bool LivePlanning::advance(PlanningTable& table) {
  const auto begin = clock_.now();
  bool moved = false;
  try {
    moved = table.advance();
  } catch (const Error& refused) {
    listener_.told(refused.what());
  }
  if (moved) {
    busy_ = clock_.now();
    computing_ = busy_ - begin;
  }
  tell_changes(table);
  return moved;
}

void LivePlanning::tell_changes(PlanningTable& table) {
  for (const std::string& remark : table.take_remarks()) listener_.told(remark);
  if (revision_told_ == table.session().revision()) return;
  revision_told_ = table.session().revision();
  listener_.steps_changed(table);
}

double LivePlanning::quick_share() const {
  for (const double share : kShares) {
    // Rays and their cross-sections.
    if (full_picture_s_ * std::pow(share, 3) <= kQuickPictureSeconds) return share;
  }
  return kShares.back();
}

void LivePlanning::show(PlanningTable& table, double share, bool moving) {
  const auto begin = clock_.now();
  const sim::Picture picture = table.picture(share, moving);
  PlanningMoment moment{&table, &picture,   ++pictures_,         input_.number,
                        moves_, computing_, clock_.now() - begin};
  if (moving) full_picture_s_ = duration<double>(moment.drawing).count() / std::pow(share, 3);
  listener_.shown(moment);
  if (!std::exchange(timed_, true)) input_to_picture_.add(clock_.now() - input_.arrived);
}

}  // namespace kiroku::viewer
