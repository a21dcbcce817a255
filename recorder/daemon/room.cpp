#include "recorder/daemon/room.h"

#include <future>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "recorder/daemon/room_state.h"

namespace kiroku::recorder {

std::string_view state_name(RoomState state) {
  switch (state) {
    case RoomState::kIdle:
      return "idle";
    case RoomState::kStandby:
      return "standby";
    case RoomState::kStarting:
      return "starting";
    case RoomState::kRecording:
      return "recording";
    case RoomState::kClosing:
      return "closing";
  }
  return "";
}

Room::State::State(RoomPlan asked, RoomListener told, const Clock& its_time)
    : plan(std::move(asked)), listener(std::move(told)), time(its_time) {
  status.name = plan.name;
  resume = plan.resume;
  note_earlier_patient();
  if (resume) {
    take_kept_patient(*resume);
  } else if (!plan.memory.earlier.empty()) {
    forget_patient();
  }
  if (resume) begin_before = time.now() + resume->within;
  status.problem = plan.not_resumed;
  status.not_resumed = !plan.not_resumed.empty();
  beat();
  thread = std::thread([this] { run(); });
}

void Room::State::shut_down() {
  if (!thread.joinable()) return;
  {
    const std::lock_guard guard(mutex);
    ending = true;
  }
  cancelled = true;
  note_end();
  {
    const std::lock_guard guard(mutex);
    if (session) session->stop("shutdown");
  }
  changed.notify_all();
  thread.join();
}

Room::Room(RoomPlan plan, RoomListener listener, const Clock& time)
    : state_(std::make_unique<State>(std::move(plan), std::move(listener), time)) {}
Room::~Room() = default;
void Room::shut_down() { state_->shut_down(); }

bool Room::begin_no_more() {
  const std::lock_guard guard(state_->mutex);
  if (!state_->is_free() || state_->request || state_->tries_again()) return false;
  state_->begins_no_more = true;
  return true;
}

void Room::may_begin_again() {
  {
    const std::lock_guard guard(state_->mutex);
    state_->begins_no_more = false;
  }
  state_->changed.notify_all();
}

const std::string& Room::name() const { return state_->plan.name; }

std::string Room::start(const std::string& reason, std::optional<Bytes> subject,
                        const std::optional<crypto::Sha256Digest>& sealed_plan,
                        std::vector<std::string> plan_patients) {
  std::future<std::string> begun;
  {
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [this] { return state_->ending || !state_->begins_no_more; });
    if (state_->ending) throw Error("the recorder is being shut down");
    if (state_->has_case())
      throw UsageError("room " + name() + " is recording already: case " + state_->status.case_id);
    if (!state_->is_free() || state_->request)
      throw UsageError("room " + name() + " is recording already: a case is just beginning");
    state_->request = std::make_unique<State::Request>();
    state_->request->reason = reason;
    state_->request->subject = std::move(subject);
    state_->request->sealed_plan = sealed_plan;
    state_->request->identity.plan_patients = std::move(plan_patients);
    begun = state_->request->begun.get_future();
  }
  state_->changed.notify_all();
  return begun.get();
}

std::string Room::stop(const std::string& reason, bool wait, const std::string& meant) {
  std::unique_lock lock(state_->mutex);
  state_->require_to_end(meant);
  if (state_->has_case()) {
    const std::string running = state_->status.case_id;
    lock.unlock();
    state_->note_end(running);
    lock.lock();
    // It may have ended while the disk took the note, and another one begun, which nobody meant.
    state_->require_to_end(running);
  }
  if (!state_->has_case()) return state_->stop_between_cases(lock, reason, wait);
  std::string id = state_->status.case_id;
  // Also while it is being closed: whatever ended it, nothing goes on with it.
  state_->end_wanted = true;
  const std::uint64_t before = state_->status.cases;
  state_->session->stop(reason);
  state_->status.state = RoomState::kClosing;
  state_->give_up_operation();
  if (wait) {
    state_->changed.wait(lock, [&] { return state_->status.cases > before; });
    // Whoever waits for the end goes on to what needs a closed case.
    if (state_->left_open.case_id == id) throw Error(state_->left_open.why);
  }
  return id;
}

std::string Room::mark(const std::string& text, const std::string& meant) {
  require_printable(text, "the text of the mark");
  const std::shared_ptr<Session> session = state_->session_of(meant, "there is nothing to mark");
  session->mark(text);
  return session->case_id();
}

std::string Room::change_profile(const ProfileDecision& decision, const std::string& meant) {
  require_printable(decision.why, "why the profile changes");
  const std::shared_ptr<Session> session = state_->session_of(
      meant, "a profile is changed while a case runs; before it, kiroku.toml says which one it begins with");
  session->change_profile(decision);
  return session->case_id();
}

std::string Room::add_subject(const Bytes& subject, const std::string& meant) {
  const std::shared_ptr<Session> session =
      state_->session_of(meant, "say whom the case is about when it begins");
  state_->give_late_subject(*session, subject);
  return session->case_id();
}

std::vector<ProcedureData> Room::procedures() const {
  if (!state_->plan.procedure) return {};
  state_->plan.procedure->hurry();
  return state_->plan.procedure->list(state_->time.utc());
}

std::optional<std::int64_t> Room::point(media::PointedAt at, const std::string& meant) {
  const std::shared_ptr<Session> session = state_->recording_session(meant);
  return session ? session->point(std::move(at)) : std::nullopt;
}

std::string Room::running_case() const {
  const std::lock_guard guard(state_->mutex);
  return state_->status.state == RoomState::kRecording ? state_->status.case_id : std::string();
}

RoomStatus Room::status() const {
  const std::lock_guard guard(state_->mutex);
  RoomStatus status = state_->status;
  status.case_id = std::string(state_->newest_case());
  status.tries_again = state_->tries_again();
  if (state_->plan.procedure) status.procedure = state_->plan.procedure->ways();
  if (state_->session) status.session = state_->session->status();
  return status;
}

Clock::Time Room::heartbeat() const { return Clock::Time(Clock::Duration(state_->heartbeat.load())); }

}  // namespace kiroku::recorder
