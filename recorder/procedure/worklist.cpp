#include "recorder/procedure/worklist.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "recorder/procedure/window.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kLeastInterval{5};
constexpr std::chrono::minutes kLongestInterval{5};
// NTP corrects less than that, and no two procedures begin so near to each other.
constexpr std::chrono::minutes kSmallestStep{1};
// For so long one question may go on (ask_worklist()).
constexpr std::chrono::minutes kLongestQuestion{1};

Standing standing_of(const WorklistItem& item, const StandingOf& standing) {
  return standing && !item.is_left_out ? standing(item.data, item.planned) : Standing::kOpen;
}

/// The nearest of those that are not done with.
NearestPlan nearest_plan(const WorklistAnswer& answer, UtcTime at, std::chrono::nanoseconds window,
                         const StandingOf& standing) {
  std::vector<std::optional<UtcTime>> times;
  times.reserve(answer.items.size());
  for (const WorklistItem& item : answer.items) times.push_back(item.planned);
  NearestPlan plan = nearest(times, at, window);
  for (bool is_changed = true; is_changed && plan.index;) {
    is_changed = false;
    for (const std::size_t each : plan.equally_near) {
      if (standing_of(answer.items[each], standing) != Standing::kDone) continue;
      times[each].reset();
      is_changed = true;
    }
    if (is_changed) plan = nearest(times, at, window);
  }
  return plan;
}

/// Whether nobody can tell whose the nearest step is.
bool is_anybodys(const WorklistAnswer& answer, const NearestPlan& plan) {
  const WorklistItem& chosen = answer.items[*plan.index];
  return std::ranges::any_of(plan.equally_near, [&](std::size_t each) {
    const WorklistItem& item = answer.items[each];
    return item.is_left_out || (each != *plan.index && !may_be_same_patient(item.data, chosen.data));
  });
}

/// Whether a step of another patient whose time cannot be read may be as near.
bool is_unclear(const WorklistAnswer& answer, const NearestPlan& plan, UtcTime at,
                std::chrono::nanoseconds window, const StandingOf& standing) {
  const WorklistItem* const chosen = plan.index ? &answer.items[*plan.index] : nullptr;
  return std::ranges::any_of(answer.items, [&](const WorklistItem& item) {
    if (item.planned) return false;
    const UtcTime::duration least = least_distance(item.within, at);
    if (!is_within(least, window) || (chosen != nullptr && least > std::chrono::abs(*chosen->planned - at)))
      return false;
    if (chosen != nullptr && !item.is_left_out && may_be_same_patient(item.data, chosen->data)) return false;
    return standing_of(item, standing) != Standing::kDone;
  });
}

/// Whether a step of another patient, planned before, was not recorded: the room may be late, and they may be
/// there. Whoever does not know what was recorded asks no one.
bool is_another_open(const WorklistAnswer& answer, const WorklistItem& chosen, UtcTime at,
                     std::chrono::nanoseconds window, const StandingOf& standing) {
  return standing && std::ranges::any_of(answer.items, [&](const WorklistItem& item) {
           const bool is_before =
               item.planned && *item.planned < *chosen.planned && is_within(*item.planned, at, window);
           return is_before && (item.is_left_out || !may_be_same_patient(item.data, chosen.data)) &&
                  standing_of(item, standing) == Standing::kOpen;
         });
}

struct StepChoice {
  std::optional<std::size_t> index;
  Doubt doubt = Doubt::kNone;
};
StepChoice choose_step(const WorklistAnswer& answer, UtcTime at, std::chrono::nanoseconds window,
                       const StandingOf& standing) {
  const NearestPlan plan = nearest_plan(answer, at, window, standing);
  if (is_unclear(answer, plan, at, window, standing)) return {{}, Doubt::kTimeUnclear};
  if (!plan.index) return {};
  if (is_anybodys(answer, plan))
    return {{}, plan.equally_near.size() > 1 ? Doubt::kTwoPlanned : Doubt::kNone};
  if (answer.is_cut) return {};
  if (plan.is_far_ahead) return {{}, Doubt::kTooEarly};
  if (standing_of(answer.items[*plan.index], standing) == Standing::kDoubtful)
    return {{}, Doubt::kLeftAlready};
  if (is_another_open(answer, answer.items[*plan.index], at, window, standing))
    return {{}, Doubt::kEarlierOpen};
  return {plan.index};
}

}  // namespace

std::string left_out_of(const WorklistAnswer& answer) {
  std::string text;
  const auto add = [&text](const std::string& sentence) { text += (text.empty() ? "" : "; ") + sentence; };
  if (const auto count = std::ranges::count(answer.items, true, &WorklistItem::is_left_out); count > 0) {
    add(std::to_string(count) + (count == 1 ? " step says" : " steps say") +
        " more of a patient and a procedure than is kept, and cannot be chosen");
  }
  if (const auto count = std::ranges::count(
          answer.items, false, [](const WorklistItem& item) { return item.planned.has_value(); });
      count > 0) {
    add(std::to_string(count) + (count == 1 ? " step states" : " steps state") +
        " no time, or one that cannot be read: no other is taken that is not nearer");
  }
  if (answer.not_asked_for > 0) {
    add(std::to_string(answer.not_asked_for) +
        (answer.not_asked_for == 1 ? " step of another station or modality was"
                                   : " steps of other stations or modalities were") +
        " listed, too, and cannot be chosen");
  }
  if (answer.is_cut) {
    add("it lists more than " + std::to_string(kMostWorklistItems) +
        " steps: a person must choose, as the nearest one may be among those that were not read");
  }
  return text;
}

std::optional<ProcedureData> nearest_step(const WorklistAnswer& answer, UtcTime asked, UtcTime at,
                                          std::chrono::nanoseconds window, const StandingOf& standing) {
  const std::optional<std::size_t> chosen = choose_step(answer, at, window, standing).index;
  if (!chosen) return {};
  ProcedureData data = answer.items[*chosen].data;
  data.chosen = "the worklist's step nearest to the beginning, of " + std::to_string(answer.items.size()) +
                " that it listed at " + format_utc(asked);
  return data;
}

Doubt doubt_of(const WorklistAnswer& answer, UtcTime at, std::chrono::nanoseconds window,
               const StandingOf& standing) {
  return choose_step(answer, at, window, standing).doubt;
}

struct Worklist::State {
  State(WorklistOptions asked, Tell told, const Clock& by)
      : options(std::move(asked)), tell(std::move(told)), clock(by), thread([this] { run(); }) {}
  ~State() {
    cancelled = true;
    {
      const std::lock_guard guard(mutex);
      ending = true;
    }
    changed.notify_all();
    thread.join();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void run() {
    std::unique_lock lock(mutex);
    while (!ending) {
      hurried = false;
      lock.unlock();
      const UtcTime now = clock.utc();
      const Clock::Duration begin = wall_clock_at_boot(), begun = clock.since_boot();
      WorklistAnswer answer = ask(now);
      const Clock::Time asked = clock.now();
      lock.lock();
      if (answer.problem.empty()) {
        answered_by = begin;
        answered_at = begun;
      }
      const std::string news = take(std::move(answer), now);
      if (!news.empty() && tell) {
        lock.unlock();
        tell(news);
        lock.lock();
      }
      const auto next = asked + pause();
      // Whoever is in a hurry waits a little, too: a room that begins a case each second asks no oftener.
      const auto soonest = asked + kLeastInterval;
      while (!ending && clock.now() < (hurried ? std::min(soonest, next) : next)) {
        clock.wait_until(changed, lock, hurried ? std::min(soonest, next) : next);
      }
    }
  }

  [[nodiscard]] Clock::Duration wall_clock_at_boot() const {
    return clock.utc().time_since_epoch() - clock.since_boot();
  }

  /// With the mutex held. Whether the newest answer says something of a case that began at `at`. One that was
  /// asked for around another time, since when the wall clock was set, may lack the nearest step.
  [[nodiscard]] bool tells_of(UtcTime at) {
    if (!answered || std::chrono::abs(at - *answered) > options.window) return false;
    if (std::chrono::abs(wall_clock_at_boot() - answered_by) <= kSmallestStep) return true;
    hurried = true;
    changed.notify_all();
    return false;
  }

  /// With the mutex held. How old the newest answer is, whoever set the wall clock, and also while the
  /// machine slept.
  [[nodiscard]] Clock::Duration age() const { return clock.since_boot() - answered_at; }
  [[nodiscard]] std::string age_text() const {
    return std::to_string(std::chrono::floor<std::chrono::minutes>(age()).count()) + " min";
  }

  /// With the mutex held. Whether the newest answer is too old to choose from: what was called off since,
  /// nobody told.
  [[nodiscard]] bool is_stale() const {
    if (!answered) return false;
    const auto bearable = kMostRefreshes * std::chrono::duration_cast<Clock::Duration>(options.refresh);
    return age() > (failures > 0 ? bearable : bearable + kLongestQuestion);
  }

  /// With the mutex held. Whether a step may be chosen by itself.
  [[nodiscard]] bool may_choose(UtcTime at) {
    if (!tells_of(at)) return false;
    if (!is_stale()) return true;
    if (failures == 0) {  // the machine slept: it is asked as soon as may be
      hurried = true;
      changed.notify_all();
    }
    return false;
  }

  /// Whatever goes wrong with it, nothing else ends.
  [[nodiscard]] WorklistAnswer ask(UtcTime now) const {
    try {
      return ask_worklist(options, now, &cancelled);
    } catch (const std::exception& error) {
      WorklistAnswer none;
      none.problem = std::string("the worklist cannot be asked: ") + error.what();
      return none;
    }
  }

  /// With the mutex held. Until the next question: after failures twice as long each time.
  [[nodiscard]] Clock::Duration pause() const {
    const auto refresh = std::chrono::duration_cast<Clock::Duration>(options.refresh);
    if (failures == 0) return refresh;
    const auto first = std::max<Clock::Duration>(refresh, kLeastInterval);
    const auto longest = std::max<Clock::Duration>(refresh, kLongestInterval);
    return std::min<Clock::Duration>(first * (1U << std::min(failures - 1, 6U)), longest);
  }

  /// With the mutex held. The sentence that a person should see, if any.
  std::string take(WorklistAnswer answer, UtcTime now) {
    const std::string before = std::exchange(problem, answer.problem);
    if (!answer.problem.empty()) {
      ++failures;
      return before.empty() ? answer.problem + "; it is asked again" : "";
    }
    failures = 0;
    const std::string left_out_before = left_out_of(newest);
    newest = std::move(answer);
    answered = now;
    const std::string left_out = left_out_of(newest), who = "the worklist of " + options.called_ae;
    if (!left_out.empty() && left_out != left_out_before) return who + ": " + left_out;
    return before.empty() ? "" : who + " answers again";
  }

  const WorklistOptions options;
  const Tell tell;
  const Clock& clock;
  std::atomic<bool> cancelled = false;
  mutable std::mutex mutex;
  std::condition_variable changed;
  bool ending = false, hurried = false;
  unsigned failures = 0;
  WorklistAnswer newest;  // that was no failure
  std::optional<UtcTime> answered;
  Clock::Duration answered_by{0};  // wall_clock_at_boot() of then
  Clock::Duration answered_at{0};  // since boot
  std::string problem;
  std::thread thread;
};

Worklist::Worklist(WorklistOptions options, Tell tell, const Clock& clock)
    : state_(std::make_unique<State>(std::move(options), std::move(tell), clock)) {}

Worklist::~Worklist() = default;

std::optional<ProcedureData> Worklist::find(UtcTime at, const StandingOf& standing) const {
  const std::lock_guard guard(state_->mutex);
  const auto window = state_->options.window;
  if (!state_->may_choose(at)) return {};
  return nearest_step(state_->newest, *state_->answered, at, window, standing);
}

Doubt Worklist::doubt(UtcTime at, const StandingOf& standing) const {
  const std::lock_guard guard(state_->mutex);
  if (!state_->may_choose(at)) return Doubt::kNone;
  return doubt_of(state_->newest, at, state_->options.window, standing);
}

std::vector<ProcedureData> Worklist::list(UtcTime at) const {
  const std::lock_guard guard(state_->mutex);
  const auto window = state_->options.window;
  std::vector<ProcedureData> all;
  if (!state_->tells_of(at)) return all;
  const std::string old =
      state_->is_stale() ? ", " + state_->age_text() + " before, and has not answered since" : "";
  for (const WorklistItem& item : state_->newest.items) {
    if (item.is_left_out) continue;
    if (item.planned && !is_within(at, *item.planned, window)) continue;
    all.push_back(item.data);
    all.back().chosen = "a step that the worklist listed at " + format_utc(*state_->answered) + old;
  }
  return all;
}

void Worklist::hurry() {
  {
    const std::lock_guard guard(state_->mutex);
    state_->hurried = true;
  }
  state_->changed.notify_all();
}

ProcedureWay Worklist::way() const {
  const std::lock_guard guard(state_->mutex);
  const std::string name = "worklist";
  if (state_->is_stale()) {
    return {name, false,
            "nothing is chosen from the list of " + format_utc(*state_->answered) + ", which is " +
                state_->age_text() +
                " old: " + (state_->problem.empty() ? "it is asked again" : state_->problem)};
  }
  if (!state_->problem.empty()) return {name, false, state_->problem};
  if (!state_->answered) return {name, true, "is being asked for the first time"};
  const std::string left_out = left_out_of(state_->newest);
  return {name, true,
          state_->options.called_ae + " listed " + std::to_string(state_->newest.items.size()) +
              " steps at " + format_utc(*state_->answered) + (left_out.empty() ? "" : "; " + left_out)};
}

}  // namespace kiroku::recorder
