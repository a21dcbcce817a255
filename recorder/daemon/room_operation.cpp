#include <exception>
#include <utility>

#include "base/error.h"
#include "recorder/daemon/room_state.h"

namespace kiroku::recorder {

namespace {

constexpr std::chrono::seconds kRuleInterval{1};
// So long after an error what a rule begins is taken for the same operation: as long as `resume` goes on
// where nothing else is said.
constexpr std::chrono::minutes kSameOperation{10};

}  // namespace

bool Room::State::may_try() const { return retry.may_try(time.now()); }

void Room::State::run() {
  std::unique_lock lock(mutex);
  while (!ending) {
    beat();
    const bool ahead = plan.rules.pre_roll.count() > 0 && may_try();
    const auto is_wanted = [&] { return ending || request || ((resume || again) && may_try()); };
    if (!ahead) time.wait_for(changed, lock, kRuleInterval, is_wanted);
    if (ending) break;
    if (ahead) {
      lock.unlock();
      record_ahead();
      lock.lock();
      continue;
    }
    if (!request && !resume && !again && !begins_no_more && start_rules.schedule_wants_a_case(time.utc()) &&
        may_try()) {
      request = std::make_unique<Request>();
      request->reason = "schedule";
      take_over_after_error(*request);
    }
    const std::unique_ptr<Request> taken = next_request();
    if (!taken) continue;
    lock.unlock();
    record(*taken);
    lock.lock();
  }
  if (request) {
    request->begun.set_exception(std::make_exception_ptr(Error("the recorder is being shut down")));
  }
}

std::unique_ptr<Room::State::Request> Room::State::next_request() {
  std::unique_ptr<Request> taken = wanted_request();
  if (taken) take(*taken);
  return taken;
}

void Room::State::take(const Request& taken) {
  status.state = RoomState::kStarting;
  starts_by_itself = taken.is_by_itself();
  stopped_meanwhile.clear();
}

std::unique_ptr<Room::State::Request> Room::State::wanted_request() {
  if (request) {
    // Somebody's own case takes the place of the one that would be carried on.
    resume.reset();
    again.reset();
    request->first_reason = request->reason;
    request->identity.case_id = archive::new_case_id(time.utc());
    return std::move(request);
  }
  if (!may_try()) return {};
  if (!resume) return after_error();
  if (time.now() > begin_before) {
    status.not_resumed = true;
    resume.reset();
    return {};
  }
  auto taken = std::make_unique<Request>();
  taken->reason = "resumed";
  taken->goes_on = true;
  taken->first_reason = resume->reason;
  taken->sealed_plan = resume->plan;
  taken->profiles = resume->profiles;
  taken->identity = {resume->case_id, resume->earlier, resume->sealed_subject, resume->patient_numbers,
                     resume->plan_patients};
  taken->identity.subject_of = resume->earlier.case_id;
  taken->is_subject_withheld = resume->is_subject_withheld;
  taken->about = resume->about;
  taken->before = resume->recorded;
  return taken;
}

std::unique_ptr<Room::State::Request> Room::State::after_error() {
  if (!again) return {};
  if (time.now() > again_before) {
    again.reset();
    return {};
  }
  auto taken = std::make_unique<Request>();
  taken->reason = "after-error";
  taken->goes_on = true;
  taken->first_reason = again->first_reason;
  taken->sealed_plan = again->sealed_plan;
  taken->profiles = again->profiles;
  taken->identity.case_id = archive::new_case_id(time.utc());
  taken->identity.sealed_subject = again->sealed_subject;
  taken->identity.patient_numbers = again->patient_numbers;
  taken->identity.plan_patients = again->plan_patients;
  taken->identity.subject_of = status.case_id;
  return taken;
}

void Room::State::take_over_after_error(Request& asked) const {
  if (!status.ended_by_error || time.now() > same_operation_before) return;
  asked.goes_on = true;
  if (asked.reason != "schedule" || begun_for != "schedule") {
    asked.is_subject_withheld = newest_subject.has_value();
    return;
  }
  asked.identity.sealed_subject = newest_subject;
  asked.identity.patient_numbers = newest_numbers;
  asked.identity.subject_of = status.case_id;
  asked.profiles = newest_profiles;
}

std::string Room::State::take_error(const std::string& case_id, std::chrono::nanoseconds lasted) {
  Profiles profiles = last_profiles_of(plan.session.archive / case_id);
  bool goes_on = false;
  {
    // A subject that is just being given is still that operation's.
    const std::lock_guard order(late_mutex);
    const std::lock_guard guard(mutex);
    if (ending || end_wanted) return "";
    status.ended_by_error = true;
    newest_profiles = profiles;
    same_operation_before = time.now() + kSameOperation;
    goes_on = plan.rules.resume_within || begun_for == "schedule";
    if (plan.rules.resume_within) {
      // A disk that fails each case at once is not tried for ever.
      if (!after_error_too || lasted >= ResumptionPlanner::kShortCase)
        again_before = time.now() + *plan.rules.resume_within;
      again =
          Again{begun_for, plan_of_case, newest_subject, newest_numbers, plan_patients, std::move(profiles)};
    }
  }
  return goes_on ? "; nothing is recorded until another one is begun" + retry.next_try()
                 : "; nothing is recorded any more: begin another one where the operation goes on";
}

void Room::State::note_beginning(const Request& asked) {
  if (!plan.running) return;
  try {
    const auto& earlier = asked.identity.carries_on;
    RunningCase running{asked.identity.case_id, earlier ? earlier->case_id : "", asked.first_reason, false};
    // Should the case not come to be, the operation's newest is the one that the error ended.
    if (asked.reason == "after-error") running.carries_on = last_case();
    running.suspended = time.since_boot() - time.now().time_since_epoch();
    plan.running->begins(running);
  } catch (const std::exception& error) {
    tell_problem("after a crash this case would not be carried on: " + std::string(error.what()));
  }
}

std::string Room::State::last_case() const {
  const std::lock_guard guard(mutex);
  return status.case_id;
}

void Room::State::note_end() { note_end(last_case()); }

void Room::State::note_end(const std::string& case_id) {
  if (!plan.running) return;
  try {
    plan.running->ends(case_id);
  } catch (const std::exception& error) {
    tell_problem("if the recorder crashes now, the case that is being ended is carried on: " +
                 std::string(error.what()));
  }
}

std::string Room::State::clear_note() const {
  if (!plan.running) return "";
  try {
    if (const auto noted = plan.running->read()) plan.running->clear(noted->case_id);
  } catch (const std::exception& error) {
    return "if the recorder starts again now, the operation that was ended may be carried on: " +
           std::string(error.what());
  }
  return "";
}

void Room::State::clear_note_if_stopped_meanwhile() {
  const bool stopped = [this] {
    const std::lock_guard guard(mutex);
    return !stopped_meanwhile.empty();
  }();
  if (!stopped) return;
  if (const std::string trouble = clear_note(); !trouble.empty()) tell_problem(trouble);
}

bool Room::State::is_unfinished_operation(const std::string& close_reason) const {
  const std::lock_guard guard(mutex);
  return again || close_reason == "shutdown";
}

void Room::State::forget(const std::string& case_id) {
  if (!plan.running) return;
  try {
    plan.running->clear(case_id);
  } catch (const Error&) {  // NOLINT(bugprone-empty-catch): see above
  }
}

bool Room::State::tries_again() {
  return resume || again || (status.ended_by_error && start_rules.schedule_wants_a_case(time.utc()));
}

void Room::State::give_up_operation() {
  resume.reset();
  again.reset();
  status.ended_by_error = false;
  start_rules.stopped_by_person();
}

std::string Room::State::stop_between_cases(std::unique_lock<std::mutex>& lock, const std::string& reason,
                                            bool wait) {
  status.case_id = std::string(newest_case());
  std::string id = status.case_id;
  const bool starting = status.state == RoomState::kStarting;
  give_up_operation();
  if (starting) stopped_meanwhile = reason;
  // Where nothing is being begun the note goes before anybody else can begin a case, whose note it would
  // be.
  std::string trouble = starting ? "" : clear_note();
  lock.unlock();
  if (starting) trouble = clear_note();
  if (!trouble.empty()) tell_problem(trouble);
  if (listener.note && !id.empty())
    listener.note("the operation of case " + id + " is ended: no case carries it on");
  lock.lock();
  if (!wait) return id;
  changed.wait(lock, [this] { return is_free(); });
  if (starting) id = status.case_id;
  if (!id.empty() && left_open.case_id == id) {
    throw Error("no case begins by itself any more, but case " + id +
                " could not be closed: the recorder's next start brings it to its end");
  }
  return id;
}

void Room::State::require_to_end(const std::string& meant) {
  const bool starting = status.state == RoomState::kStarting;
  if (meant.empty()) {
    if (!has_case() && !(starting ? starts_by_itself : tries_again()))
      throw UsageError("room " + plan.name + " is not recording");
    return;
  }
  const bool goes_on = tries_again() && (!starting || starts_by_itself);
  if (meant != newest_case() || !(has_case() || goes_on)) throw_not_recording(meant);
}

void Room::State::throw_not_recording(const std::string& meant) const {
  if (has_case() && status.case_id != meant) {
    throw UsageError("room " + plan.name + " is recording case " + status.case_id + ", and not case " +
                     meant + ": nothing was done");
  }
  throw UsageError("room " + plan.name + " is not recording case " + meant + ": nothing was done");
}

const std::string& Room::State::newest_case() const {
  return resume && status.case_id.empty() ? resume->earlier.case_id : status.case_id;
}

void Room::State::end_if_stopped_meanwhile(Session& running) {
  std::string reason;
  {
    const std::lock_guard guard(mutex);
    reason = std::exchange(stopped_meanwhile, "");
  }
  if (reason.empty()) return;
  want_end();
  note_end();
  running.stop(reason);
}

void Room::State::want_end() {
  const std::lock_guard guard(mutex);
  end_wanted = true;
  if (status.state == RoomState::kRecording) status.state = RoomState::kClosing;
}

}  // namespace kiroku::recorder
