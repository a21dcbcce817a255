#include <exception>
#include <utility>

#include "base/error.h"
#include "recorder/daemon/room_state.h"

namespace kiroku::recorder {

namespace {

// Recording ahead is begun anew after so long: MPEG-TS counts time to 26.5 hours (33 bits at 90 kHz), and a
// case of a day shall fit behind it.
constexpr std::int64_t kLongestStandbyNs = 2LL * 3600 * 1'000'000'000;

std::uint64_t total_bytes(const SessionStatus& status) {
  std::uint64_t bytes = 0;
  for (const StreamStatus& stream : status.streams) bytes += stream.bytes;
  return bytes;
}

}  // namespace

void Room::State::beat() { heartbeat = time.now().time_since_epoch().count(); }

std::string Room::State::beginning_text(const Request& asked, const std::string& id) {
  std::string text = "case " + id + " begins (" + asked.reason + ")";
  if (asked.identity.carries_on) text += " and carries on case " + asked.identity.carries_on->case_id;
  return text;
}

void Room::State::record_ahead() {
  std::shared_ptr<Session> running;
  try {
    SessionOptions options = plan.session;
    options.cancelled = &cancelled;
    options.pre_roll = plan.rules.pre_roll;
    running = std::make_shared<Session>(std::move(options));
  } catch (const std::exception& error) {
    retry.failed(time.now());
    tell_problem("nothing can be recorded ahead: " + std::string(error.what()) + retry.next_try());
    return;
  }
  left_out_until.reset();
  left_out_by.reset();
  {
    const std::lock_guard guard(mutex);
    session = running;
    problem_of_session.clear();
    status.state = RoomState::kStandby;
    status.session = {};
    start_rules.forget_signal();
    if (ending) running->stop("shutdown");
  }
  std::string reason;
  try {
    end(running->run(
        [&](const SessionStatus& now) {
          if (now.begun) {
            follow(*running, now, reason);
          } else {
            reason = begin_if_wanted(*running, now);
          }
        },
        [this] { closes(); }));
  } catch (const std::exception& error) {
    end_badly(error.what());
  }
}

bool Room::State::leave_out_others(Session& running) {
  constexpr std::chrono::seconds kPatience{2};
  if (!plan.procedure) return true;
  const std::optional<Clock::Duration> change = plan.procedure->changed_at();
  if (!change) return true;
  if (change != left_out_until) {
    left_out_until = change;
    running.forget_before(*change);
  }
  if (running.is_forgotten()) {
    left_out_by.reset();
    return true;
  }
  if (!left_out_by) left_out_by = time.now() + kPatience;
  return time.now() >= *left_out_by;
}

std::string Room::State::begin_if_wanted(Session& running, const SessionStatus& now) {
  beat();
  const bool may_begin = leave_out_others(running);
  std::unique_ptr<Request> taken;
  {
    const std::lock_guard guard(mutex);
    status.session = now;
    tell_new_problem(now);
    if (may_begin) taken = next_request();
    if (may_begin && !taken && !resume && !again && !begins_no_more) {
      const bool scheduled = start_rules.schedule_wants_a_case(time.utc()),
                 signalled = start_rules.signal_wants_a_case(now);
      // After a failure the rules wait; a person may try at once.
      if ((scheduled || signalled) && may_try()) {
        taken = std::make_unique<Request>();
        taken->reason = taken->first_reason = scheduled ? "schedule" : "signal";
        taken->identity.case_id = archive::new_case_id(time.utc());
        take_over_after_error(*taken);
        take(*taken);
      }
    }
  }
  if (!taken) {
    if (now.now_ns > kLongestStandbyNs) running.stop("renewal");
    return "";
  }
  std::string id;
  note_beginning(*taken);
  std::vector<ProfileDecision> decisions;
  try {
    decisions = decisions_for(*taken, seal_subject(*taken));
    id = running.begin({}, taken->sealed_plan, taken->identity);
  } catch (const std::exception& error) {
    retry.failed(time.now());
    tell_problem("no case could be begun: " + std::string(error.what()) + retry.next_try());
    clear_note_if_stopped_meanwhile();
    set_state(RoomState::kStandby, "");
    taken->begun.set_exception(std::current_exception());
    return "";
  }
  beat();
  {
    const std::lock_guard guard(mutex);
    status.state = RoomState::kRecording;
    status.case_id = id;
    status.reason = taken->reason;
    status.has_plan_of_another = running.has_plan_of_another();
    take_identity(*taken);
  }
  keep_patient();
  if (listener.note) listener.note(beginning_text(*taken, id));
  end_if_stopped_meanwhile(running);
  // What was recorded ahead is archived as it was; from here on as decided.
  for (const ProfileDecision& decision : decisions) running.decide_profile(decision);
  state_missing_subject(running);
  taken->begun.set_value(id);
  return taken->first_reason;
}

void Room::State::record(Request& asked) {
  set_state(RoomState::kStarting, asked.reason);
  std::shared_ptr<Session> running;
  try {
    SessionOptions options = plan.session;
    options.cancelled = &cancelled;
    options.profile_decisions = decisions_for(asked, seal_subject(asked));
    for (const ProfileDecision& decision : options.profile_decisions) apply_decision(decision, options.video);
    options.plan = asked.sealed_plan;
    options.identity = asked.identity;
    note_beginning(asked);
    running = std::make_shared<Session>(std::move(options));
  } catch (const std::exception& error) {
    refuse_start(asked, error.what());
    return;
  }
  beat();
  {
    const std::lock_guard guard(mutex);
    session = running;
    problem_of_session.clear();
    status.state = RoomState::kRecording;
    status.case_id = running->case_id();
    status.has_plan_of_another = running->has_plan_of_another();
    take_identity(asked);
    if (ending) running->stop("shutdown");
  }
  keep_patient();
  if (listener.note) listener.note(beginning_text(asked, running->case_id()));
  end_if_stopped_meanwhile(*running);
  state_missing_subject(*running);
  asked.begun.set_value(running->case_id());
  try {
    end(running->run([&](const SessionStatus& now) { follow(*running, now, asked.first_reason); },
                     [this] { closes(); }));
  } catch (const std::exception& error) {
    end_badly(error.what());
  }
}

void Room::State::refuse_start(Request& asked, const std::string& why) {
  retry.failed(time.now());
  tell_problem("no case could be begun: " + why +
               (plan.rules.schedule.empty() && asked.reason != "resumed" && asked.reason != "after-error"
                    ? ""
                    : retry.next_try()));
  clear_note_if_stopped_meanwhile();
  set_state(RoomState::kIdle, "");
  asked.begun.set_exception(std::current_exception());
}

void Room::State::follow(Session& running, const SessionStatus& now, const std::string& first_reason) {
  beat();
  const CaseSoFar so_far{now, first_reason == "schedule", before, plan.session.video.size()};
  if (const std::string rule = rule_to_end(plan.rules, so_far, time.utc()); !rule.empty()) {
    want_end();
    note_end();
    running.stop(rule);
  }
  look_for_late_subject(running);
  look_for_contradiction(running);
  const std::lock_guard guard(mutex);
  rate.add(time.now(), total_bytes(now));
  status.bytes_per_second = rate.bytes_per_second();
  status.session = now;
  tell_new_problem(now);
}

void Room::State::closes() {
  beat();
  const std::lock_guard guard(mutex);
  if (status.state == RoomState::kRecording) status.state = RoomState::kClosing;
}

void Room::State::tell_new_problem(const SessionStatus& now) {
  // What was told since, as of the patient, stays the latest.
  if (now.last_problem.empty() || now.last_problem == problem_of_session) return;
  problem_of_session = status.problem = now.last_problem;
  if (listener.warn) listener.warn(now.last_problem);
}

void Room::State::end(const SessionResult& result) {
  const bool by_itself = result.close_reason == "disk-full" || result.close_reason.starts_with("error: ") ||
                         result.close_reason == "sources-ended";
  {
    // What went wrong after the case was looked at for the last time.
    const std::lock_guard guard(mutex);
    tell_new_problem(result.last);
    // A case that ends again and again as soon as it has begun must not fill the archive with beginnings.
    if (by_itself) {
      retry.failed(time.now());
    } else {
      retry.succeeded();
    }
  }
  // First, so that whoever waits for the end finds everything done.
  if (!result.case_id.empty()) {
    if (listener.note) {
      listener.note("case " + result.case_id + " is closed (" + result.close_reason + ")");
    }
    if (listener.closed) listener.closed(result);
    if (!by_itself && result.close_reason != "shutdown") case_subject.ended(time.utc());
    if (by_itself && result.close_reason != "sources-ended") {
      const std::chrono::nanoseconds lasted(result.last.now_ns - result.last.begins_ns);
      if (const std::string follows = take_error(result.case_id, lasted); !follows.empty())
        tell_problem("case " + result.case_id + " ended by itself (" + result.close_reason + ")" + follows);
    }
    if (!is_unfinished_operation(result.close_reason)) {
      forget(result.case_id);
      forget_patient();
    }
  }
  beat();
  {
    const std::lock_guard guard(mutex);
    session.reset();
    status.state = RoomState::kIdle;
    if (status.bytes_per_second > 0) status.last_bytes_per_second = status.bytes_per_second;
    status.bytes_per_second = 0;
    if (!result.case_id.empty()) {
      status.reason = result.close_reason;
      status.session = result.last;
      ++status.cases;
    }
    rate = {};
  }
  changed.notify_all();
  if (result.case_id.empty() && by_itself) tell_problem("recording ahead ended: " + result.close_reason);
}

void Room::State::end_badly(const std::string& why) {
  std::string sentence, ended;
  std::chrono::nanoseconds lasted{0};
  {
    const std::lock_guard guard(mutex);
    // What was recorded ahead is no case, and the case before it was closed.
    if (status.state != RoomState::kStandby) ended = status.case_id;
    lasted = std::chrono::nanoseconds(status.session.now_ns - status.session.begins_ns);
    retry.failed(time.now());
  }
  if (ended.empty()) {
    sentence = "recording ahead ended: " + why + retry.next_try();
  } else {
    sentence = "case " + ended +
               " could not be closed; the recorder's next start brings it to its end: " + why +
               take_error(ended, lasted);
  }
  // First, so that whoever waits for the end finds everything told.
  tell_problem(sentence, ended.empty() ? listener.warn : listener.left);
  {
    const std::lock_guard guard(mutex);
    session.reset();
    status.state = RoomState::kIdle;
    if (!ended.empty()) {
      status.reason = "error: " + why;
      left_open = {ended, sentence};
      ++status.cases;
    }
  }
  changed.notify_all();
}

void Room::State::tell_problem(const std::string& sentence) { tell_problem(sentence, listener.warn); }

void Room::State::tell_problem(const std::string& sentence,
                               const std::function<void(const std::string&)>& tell) {
  {
    const std::lock_guard guard(mutex);
    status.problem = sentence;
  }
  if (tell) tell(sentence);
}

void Room::State::take_identity(const Request& asked) {
  status.carries_on = asked.identity.carries_on ? asked.identity.carries_on->case_id : "";
  status.not_resumed = false;
  status.ended_by_error = false;
  status.begun_at = time.now();
  begun_for = asked.first_reason;
  plan_of_case = asked.sealed_plan;
  newest_subject = asked.identity.sealed_subject;
  newest_numbers = asked.identity.patient_numbers;
  plan_patients = asked.identity.plan_patients;
  after_error_too = asked.reason == "after-error";
  end_wanted = false;
  again.reset();
  before = {};
  if (!asked.identity.carries_on) return;
  ++status.resumed;
  before = asked.before;
  resume.reset();
}

std::shared_ptr<Session> Room::State::recording_session(const std::string& meant) const {
  const std::lock_guard guard(mutex);
  const bool is_meant = meant.empty() || status.case_id == meant;
  return status.state == RoomState::kRecording && is_meant ? session : nullptr;
}

std::shared_ptr<Session> Room::State::session_of(const std::string& meant, const char* instead) const {
  const std::lock_guard guard(mutex);
  const bool records = status.state == RoomState::kRecording;
  if (!meant.empty() && !(records && status.case_id == meant)) throw_not_recording(meant);
  if (!records) throw UsageError("room " + plan.name + " is not recording: " + instead);
  return session;
}

void Room::State::set_state(RoomState state, const std::string& reason) {
  beat();
  {
    const std::lock_guard guard(mutex);
    status.state = state;
    if (!reason.empty()) status.reason = reason;
  }
  changed.notify_all();
}

bool Room::State::is_free() const {
  return status.state == RoomState::kIdle || status.state == RoomState::kStandby;
}

bool Room::State::has_case() const {
  return status.state == RoomState::kRecording || status.state == RoomState::kClosing;
}

}  // namespace kiroku::recorder
