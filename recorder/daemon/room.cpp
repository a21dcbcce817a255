#include "recorder/daemon/room.h"

#include <algorithm>
#include <condition_variable>
#include <future>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "base/printable.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "recorder/daemon/kept_memory.h"
#include "recorder/daemon/kept_patient.h"
#include "recorder/daemon/rate_meter.h"
#include "recorder/daemon/retry_pause.h"
#include "recorder/session_request.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kRuleInterval{1};
constexpr std::chrono::seconds kNoteInterval{30};  // between tries to write whom a case is about
// So long after an error what a rule begins is taken for the same operation: as long as `resume` goes on
// where nothing else is said.
constexpr std::chrono::minutes kSameOperation{10};
// Recording ahead is begun anew after so long: MPEG-TS counts time to 26.5 hours (33 bits at 90 kHz), and a
// case of a day shall fit behind it.
constexpr std::int64_t kLongestStandbyNs = 2LL * 3600 * 1'000'000'000;

std::uint64_t total_bytes(const SessionStatus& status) {
  std::uint64_t bytes = 0;
  for (const StreamStatus& stream : status.streams) bytes += stream.bytes;
  return bytes;
}

}  // namespace

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

struct Room::State {
  State(RoomPlan asked, RoomListener told, const Clock& its_time)
      : plan(std::move(asked)), listener(std::move(told)), time(its_time) {
    status.name = plan.name;
    resume = plan.resume;
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
  ~State() { shut_down(); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  struct Request {
    std::string reason;
    std::optional<Bytes> subject;
    std::optional<crypto::Sha256Digest> sealed_plan;
    CaseIdentity identity;
    Profiles profiles;                   // of the case that it goes on with, as that ended
    std::string first_reason;            // why the operation's first case was begun
    std::chrono::nanoseconds before{0};  // recorded by the operation's earlier cases
    bool goes_on = false;                // with an operation that another case began
    bool is_subject_withheld = false;    // that operation's, which then is not in `identity`
    std::promise<std::string> begun;
    /// Nobody asked for it: a rule begins it, or the recorder goes on with an operation.
    [[nodiscard]] bool is_by_itself() const {
      return reason == "schedule" || reason == "signal" || reason == "resumed" || reason == "after-error";
    }
  };

  void shut_down() {
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

  [[nodiscard]] bool may_try() const { return retry.may_try(time.now()); }

  void beat() { heartbeat = time.now().time_since_epoch().count(); }

  void run() {
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

  /// With the mutex held: what is to begin now, as wanted_request() says. From here on the room is starting:
  /// a start that came while this one is carried out would begin a case by itself when this one has ended.
  std::unique_ptr<Request> next_request() {
    std::unique_ptr<Request> taken = wanted_request();
    if (taken) take(*taken);
    return taken;
  }

  /// With the mutex held.
  void take(const Request& taken) {
    status.state = RoomState::kStarting;
    starts_by_itself = taken.is_by_itself();
    stopped_meanwhile.clear();
  }

  /// With the mutex held: what a person or a rule asked for; else the case that is to be carried on, or the
  /// one after an error.
  std::unique_ptr<Request> wanted_request() {
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
    taken->before = resume->recorded;
    return taken;
  }

  /// With the mutex held: another case where the last one was ended by an error and the room's rules let the
  /// operation go on.
  std::unique_ptr<Request> after_error() {
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

  /// With the mutex held: a case that a rule begins soon after an error ended one goes on with that
  /// operation, also in a room without RoomRules::resume_within. A window of the schedule is still the same;
  /// whose signal it is nobody knows.
  void take_over_after_error(Request& asked) const {
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

  /// A case was ended by an error or a full disk, and `lasted` so long. What follows from that, in words: ""
  /// where somebody or a rule was ending it.
  std::string take_error(const std::string& case_id, std::chrono::nanoseconds lasted) {
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
        again = Again{begun_for,      plan_of_case,  newest_subject,
                      newest_numbers, plan_patients, std::move(profiles)};
      }
    }
    return goes_on ? "; nothing is recorded until another one is begun" + retry.next_try()
                   : "; nothing is recorded any more: begin another one where the operation goes on";
  }

  /// Before a case is made: a recorder that is cut off from here on knows whose case it was.
  void note_beginning(const Request& asked) {
    if (!plan.running) return;
    try {
      const auto& earlier = asked.identity.carries_on;
      RunningCase running{asked.identity.case_id, earlier ? earlier->case_id : "", asked.first_reason, false};
      // Should the case not come to be, the operation's newest is the one that the error ended.
      if (asked.reason == "after-error") running.carries_on = last_case();
      plan.running->begins(running);
    } catch (const std::exception& error) {
      tell_problem("after a crash this case would not be carried on: " + std::string(error.what()));
    }
  }

  [[nodiscard]] std::string last_case() const {
    const std::lock_guard guard(mutex);
    return status.case_id;
  }

  /// Before a case is ended by somebody or by a rule: a recorder that is cut off from here on carries nothing
  /// on.
  void note_end() { note_end(last_case()); }
  void note_end(const std::string& case_id) {
    if (!plan.running) return;
    try {
      plan.running->ends(case_id);
    } catch (const std::exception& error) {
      tell_problem("if the recorder crashes now, the case that is being ended is carried on: " +
                   std::string(error.what()));
    }
  }

  /// A case has begun. With the mutex held.
  void take_identity(const Request& asked) {
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

  /// What the recorder's last process knew of the case that is to be carried on; of another one nothing.
  void take_kept_patient(Resumption& resumed) const {
    KeptPatient kept = read_kept_patient(plan.memory.earlier);
    if (kept.case_id.empty() || kept.case_id != resumed.earlier.case_id) return;
    resumed.plan_patients = std::move(kept.plan_patients);
    // Whom another subject is about they do not say.
    if (resumed.sealed_subject && kept.sealed_subject == hash_of(*resumed.sealed_subject))
      resumed.patient_numbers = std::move(kept.numbers);
  }

  [[nodiscard]] static std::string hash_of(const Bytes& sealed) {
    return crypto::to_hex(crypto::sha256(sealed));
  }

  /// For the recorder's next process: whom the case that runs is about by now.
  void keep_patient() {
    if (!plan.memory.keep) return;
    const std::lock_guard order(memory_mutex);
    KeptPatient kept;
    {
      const std::lock_guard guard(mutex);
      kept = {status.case_id, newest_subject ? hash_of(*newest_subject) : "", newest_numbers, plan_patients};
    }
    plan.memory.keep(kept_bytes(kept));
  }

  /// Nothing goes on with the operation.
  void forget_patient() {
    if (!plan.memory.keep) return;
    const std::lock_guard order(memory_mutex);
    // What was kept before the last time is there until it is written over.
    for (std::size_t file = 0; file < KeptMemory::kFiles; ++file) plan.memory.keep({});
  }

  [[nodiscard]] static std::string beginning_text(const Request& asked, const std::string& id) {
    std::string text = "case " + id + " begins (" + asked.reason + ")";
    if (asked.identity.carries_on) text += " and carries on case " + asked.identity.carries_on->case_id;
    return text;
  }

  /// Records without a case until one begins, and that one to its end.
  void record_ahead() {
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

  /// What was recorded ahead of the last change of who is in the room is somebody else's. Whether a case may
  /// begin: for a moment after a change, what is being written reaches back before it.
  bool leave_out_others(Session& running) {
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

  /// Looks whether a case shall begin; why its operation was begun if it has.
  std::string begin_if_wanted(Session& running, const SessionStatus& now) {
    beat();
    const bool may_begin = leave_out_others(running);
    std::unique_ptr<Request> taken;
    {
      const std::lock_guard guard(mutex);
      status.session = now;
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

  /// What is known of the subject now, where that is more than the sealed one of an earlier case. It is
  /// sealed here, since a case after an error takes it over as it is.
  std::optional<Bytes> seal_subject(Request& asked) {
    GoesOn goes_on = GoesOn::kNo;
    if (asked.goes_on) {
      goes_on = asked.identity.sealed_subject ? GoesOn::kWithSubject
                : asked.is_subject_withheld   ? GoesOn::kSubjectWithheld
                                              : GoesOn::kWithoutSubject;
    }
    CaseSubject::Found found = case_subject.at_beginning(time.utc(), std::move(asked.subject), goes_on);
    if (found.json) {
      asked.identity.sealed_subject = crypto::seal_bytes(*found.json, plan.session.event_recipients);
      asked.identity.patient_numbers = known_numbers(*found.json);
      asked.identity.search_words = search::words_of_subject(*found.json);
    }
    const std::lock_guard guard(mutex);
    status.subject = found.state;
    return std::move(found.json);
  }

  /// Those of a subject, and by which else messages name the patient whom the room's procedure data found.
  std::vector<PatientNumber> known_numbers(const Bytes& subject) const {
    std::vector<PatientNumber> numbers = numbers_of_subject(subject);
    // A person may have given another patient.
    if (numbers.empty() || share_a_number(numbers, case_subject.numbers()))
      add_numbers(numbers, case_subject.numbers());
    return numbers;
  }

  /// In which form pictures of a case that begins now are archived: as those of the case with which it goes
  /// on, else by the room's rules; none where nothing decides.
  std::vector<ProfileDecision> decisions_for(const Request& asked, const std::optional<Bytes>& subject) {
    std::vector<ProfileDecision> decisions;
    std::string rule;
    if (!asked.profiles.empty()) {
      for (const auto& [stream, profile] : asked.profiles)
        decisions.push_back({{stream}, profile, "recorder", "as the case ended with which this one goes on"});
    } else if (const auto choice = subject ? choose_profile(plan.profile_rules, *subject) : std::nullopt) {
      rule = choice->rule.name;
      decisions.push_back(
          {choice->rule.streams, choice->rule.profile, "rule " + choice->rule.name, choice->why});
      if (listener.note) listener.note("rule " + rule + " archives pictures as " + name_of(choice->rule));
    }
    std::erase_if(decisions, [this](const ProfileDecision& each) {
      return std::ranges::any_of(each.streams, [this](const std::string& name) {
        return std::ranges::none_of(plan.session.video, [&](const auto& one) { return one.name == name; });
      });
    });
    const std::lock_guard guard(mutex);
    status.profile_rule = rule;
    return decisions;
  }

  static std::string name_of(const ProfileRule& rule) { return std::string(profile_name(rule.profile)); }

  /// A subject that came while the case ran changes no picture by itself: people are told, and decide.
  void tell_of_late_rule(Session& running, const Bytes& subject) {
    const auto choice = choose_profile(plan.profile_rules, subject);
    if (!choice) return;
    const SessionStatus now = running.status();
    const auto is_meant = [&](const std::string& name) {
      const auto& streams = choice->rule.streams;
      return streams.empty() || std::ranges::find(streams, name) != streams.end();
    };
    const bool differs = std::ranges::any_of(now.streams, [&](const StreamStatus& stream) {
      const std::string& profile = stream.profile_to_come.empty() ? stream.profile : stream.profile_to_come;
      return stream.is_video && is_meant(stream.name) && profile != name_of(choice->rule);
    });
    if (!differs) return;
    const std::string sentence = "the procedure became known while the case ran: rule " + choice->rule.name +
                                 " would archive pictures as " + name_of(choice->rule) +
                                 ", and they go on as they are";
    running.profile_unchanged(sentence + " (" + choice->why + ")");
    tell_problem(sentence + "; 'kiroku case profile " + name_of(choice->rule) + "' changes it");
  }

  /// In the case and to people; recording does not wait for it.
  void state_missing_subject(Session& running) {
    const std::optional<std::string> why = case_subject.why_missing();
    if (!why) return;
    running.subject_missing(*why);
    tell_problem(*why);
  }

  /// A person says whom the case is about: nothing that is found by itself comes after it.
  void give_late_subject(Session& running, const Bytes& subject) {
    {
      const std::lock_guard order(late_mutex);
      running.late_subject(subject);
      // The case after it has a patient of its own, whom the recorder may still look for.
      if (is_of_now(running)) {
        case_subject.given_while_running(subject);
        keep_late_subject(running, subject, {});
      }
    }
    tell_of_late_rule(running, subject);
  }

  void look_for_late_subject(Session& running) {
    std::optional<Bytes> found;
    {
      const std::lock_guard order(late_mutex);
      if (not_noted && time.now() >= note_again) note_newest_subject();
      found = case_subject.late(time.now());
      if (!found) return;
      running.late_subject(*found, case_subject.numbers());
      keep_late_subject(running, *found, case_subject.numbers());
    }
    tell_of_late_rule(running, *found);
    if (listener.note) listener.note("procedure data came while the case ran");
  }

  /// With late_mutex held: whom the case is about from now on, for a case that goes on with its operation in
  /// this process or in the recorder's next one.
  void keep_late_subject(const Session& running, const Bytes& subject,
                         const std::vector<PatientNumber>& further) {
    Bytes sealed = crypto::seal_bytes(subject, plan.session.event_recipients);
    if (plan.running && plan.session.key != nullptr) {
      not_noted = sign_newest_subject(running.case_id(), sealed, *plan.session.key);
      note_newest_subject();
    }
    {
      const std::lock_guard guard(mutex);
      if (session.get() != &running) return;
      status.subject = SubjectState::kLate;
      newest_subject = std::move(sealed);
      newest_numbers = numbers_of_subject(subject);
      add_numbers(newest_numbers, further);
    }
    keep_patient();
  }

  [[nodiscard]] bool is_of_now(const Session& running) const {
    const std::lock_guard guard(mutex);
    return session.get() == &running;
  }

  /// With late_mutex held. What cannot be written is told, and tried again while the case runs.
  void note_newest_subject() {
    try {
      plan.running->newest_subject(*not_noted);
      not_noted.reset();
      not_noted_why.clear();
    } catch (const std::exception& error) {
      note_again = time.now() + kNoteInterval;
      const std::string why = error.what();
      if (std::exchange(not_noted_why, why) != why)
        tell_problem("after a crash the operation would go on with the subject of before: " + why);
    }
  }

  /// One case from its beginning to its end.
  void record(Request& asked) {
    set_state(RoomState::kStarting, asked.reason);
    std::shared_ptr<Session> running;
    try {
      SessionOptions options = plan.session;
      options.cancelled = &cancelled;
      options.profile_decisions = decisions_for(asked, seal_subject(asked));
      for (const ProfileDecision& decision : options.profile_decisions)
        apply_decision(decision, options.video);
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

  void refuse_start(Request& asked, const std::string& why) {
    retry.failed(time.now());
    tell_problem("no case could be begun: " + why +
                 (plan.rules.schedule.empty() && asked.reason != "resumed" && asked.reason != "after-error"
                      ? ""
                      : retry.next_try()));
    clear_note_if_stopped_meanwhile();
    set_state(RoomState::kIdle, "");
    asked.begun.set_exception(std::current_exception());
  }

  /// What is looked at a few times a second while a case runs. `first_reason` is why its operation was begun.
  void follow(Session& running, const SessionStatus& now, const std::string& first_reason) {
    beat();
    const CaseSoFar so_far{now, first_reason == "schedule", before, plan.session.video.size()};
    if (const std::string rule = rule_to_end(plan.rules, so_far, time.utc()); !rule.empty()) {
      want_end();
      note_end();
      running.stop(rule);
    }
    look_for_late_subject(running);
    const std::lock_guard guard(mutex);
    rate.add(time.now(), total_bytes(now));
    status.bytes_per_second = rate.bytes_per_second();
    status.session = now;
    tell_new_problem(now);
  }

  /// Closing is counted from here on, which may take longer than a room that records may be silent.
  void want_end() {
    const std::lock_guard guard(mutex);
    end_wanted = true;
    if (status.state == RoomState::kRecording) status.state = RoomState::kClosing;
  }

  /// Recording is over, for whatever reason. What was recorded ahead is no case, and is discarded.
  void closes() {
    beat();
    const std::lock_guard guard(mutex);
    if (status.state == RoomState::kRecording) status.state = RoomState::kClosing;
  }

  /// Somebody ended the operation while its next case was being made.
  void end_if_stopped_meanwhile(Session& running) {
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

  /// With the mutex held: whether the operation whose case was cut off, or was ended by an error, goes on
  /// with another case by itself.
  [[nodiscard]] bool tries_again() {
    return resume || again || (status.ended_by_error && start_rules.schedule_wants_a_case(time.utc()));
  }

  /// With the mutex held: no case begins by itself any more in the place of the one that ended.
  void give_up_operation() {
    resume.reset();
    again.reset();
    status.ended_by_error = false;
    start_rules.stopped_by_person();
  }

  /// Of whatever case the room's note tells, the next start of the recorder carries nothing on. A sentence
  /// for tell_problem() where that failed, else "".
  [[nodiscard]] std::string clear_note() const {
    if (!plan.running) return "";
    try {
      if (const auto noted = plan.running->read()) plan.running->clear(noted->case_id);
    } catch (const std::exception& error) {
      return "if the recorder starts again now, the operation that was ended may be carried on: " +
             std::string(error.what());
    }
    return "";
  }

  /// With the mutex held.
  void tell_new_problem(const SessionStatus& now) {
    if (now.last_problem.empty() || now.last_problem == status.problem) return;
    status.problem = now.last_problem;
    if (listener.warn) listener.warn(now.last_problem);
  }

  /// A closed case is never carried on, whatever the note says: a note that cannot be removed does no harm.
  void forget(const std::string& case_id) {
    if (!plan.running) return;
    try {
      plan.running->clear(case_id);
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): see above
    }
  }

  void end(const SessionResult& result) {
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

  /// The case that was being made did not come to be, and somebody had ended its operation.
  void clear_note_if_stopped_meanwhile() {
    const bool stopped = [this] {
      const std::lock_guard guard(mutex);
      return !stopped_meanwhile.empty();
    }();
    if (!stopped) return;
    if (const std::string trouble = clear_note(); !trouble.empty()) tell_problem(trouble);
  }

  /// Nobody wanted the case ended, so that a recorder that starts again soon tells of it
  /// (ResumptionPlanner::of).
  [[nodiscard]] bool is_unfinished_operation(const std::string& close_reason) const {
    const std::lock_guard guard(mutex);
    return again || close_reason == "shutdown";
  }

  void end_badly(const std::string& why) {
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

  void tell_problem(const std::string& sentence) { tell_problem(sentence, listener.warn); }

  void tell_problem(const std::string& sentence, const std::function<void(const std::string&)>& tell) {
    {
      const std::lock_guard guard(mutex);
      status.problem = sentence;
    }
    if (tell) tell(sentence);
  }

  /// Null while no case is recorded.
  [[nodiscard]] std::shared_ptr<Session> recording_session(const std::string& meant = "") const {
    const std::lock_guard guard(mutex);
    const bool is_meant = meant.empty() || status.case_id == meant;
    return status.state == RoomState::kRecording && is_meant ? session : nullptr;
  }

  /// The same, of case `meant` ("": whichever): it has one case, so that nothing done to it reaches another
  /// that begins meanwhile. Throws where that case is not recorded; `instead` says what one does while none
  /// is.
  [[nodiscard]] std::shared_ptr<Session> session_of(const std::string& meant, const char* instead) const {
    const std::lock_guard guard(mutex);
    const bool records = status.state == RoomState::kRecording;
    if (!meant.empty() && !(records && status.case_id == meant)) throw_not_recording(meant);
    if (!records) throw UsageError("room " + plan.name + " is not recording: " + instead);
    return session;
  }

  /// With the mutex held: throws where a stop that means case `meant` ("": whichever) would end nothing, or
  /// something else: the case that runs, or the operation that goes on by itself with another one.
  void require_to_end(const std::string& meant) {
    const bool starting = status.state == RoomState::kStarting;
    if (meant.empty()) {
      if (!has_case() && !(starting ? starts_by_itself : tries_again()))
        throw UsageError("room " + plan.name + " is not recording");
      return;
    }
    const bool goes_on = tries_again() && (!starting || starts_by_itself);
    if (meant != newest_case() || !(has_case() || goes_on)) throw_not_recording(meant);
  }

  /// With the mutex held.
  [[noreturn]] void throw_not_recording(const std::string& meant) const {
    if (has_case() && status.case_id != meant) {
      throw UsageError("room " + plan.name + " is recording case " + status.case_id + ", and not case " +
                       meant + ": nothing was done");
    }
    throw UsageError("room " + plan.name + " is not recording case " + meant + ": nothing was done");
  }

  /// With the mutex held: that of the status, or the one that the recorder's last run left to be carried on.
  [[nodiscard]] const std::string& newest_case() const {
    return resume && status.case_id.empty() ? resume->earlier.case_id : status.case_id;
  }

  void set_state(RoomState state, const std::string& reason) {
    beat();
    {
      const std::lock_guard guard(mutex);
      status.state = state;
      if (!reason.empty()) status.reason = reason;
    }
    changed.notify_all();
  }

  [[nodiscard]] bool is_free() const {
    return status.state == RoomState::kIdle || status.state == RoomState::kStandby;
  }
  /// Of a case that records or is being closed.
  [[nodiscard]] bool has_case() const {
    return status.state == RoomState::kRecording || status.state == RoomState::kClosing;
  }

  /// Ends an operation between its cases. `lock` holds the mutex.
  std::string stop_between_cases(std::unique_lock<std::mutex>& lock, const std::string& reason, bool wait) {
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

  const RoomPlan plan;
  const RoomListener listener;
  const Clock& time;
  CaseSubject case_subject{plan.procedure, [this](const std::string& sentence) { tell_problem(sentence); }};
  std::atomic<Clock::Duration::rep> heartbeat{0};

  /// Of subjects that come while a case runs; held from before one is sealed until the search for one is
  /// over, so that the last one sealed is the last one said. Taken before the other one.
  std::mutex late_mutex;
  std::optional<NewestSubject> not_noted;  // guarded by it, as are
  std::string not_noted_why;
  Clock::Time note_again{};

  std::mutex memory_mutex;  // of RoomPlan::memory: taken between the other two

  mutable std::mutex mutex;  // guards what follows, but for the last ones, which only the room's thread uses
  std::condition_variable changed;
  std::atomic<bool> cancelled = false;  // as SessionOptions::cancelled, of each session
  bool ending = false, begins_no_more = false;
  StartRules start_rules{plan.rules};
  std::unique_ptr<Request> request;
  std::optional<Resumption> resume;  // until that case has begun
  /// What the case after an error takes over.
  struct Again {
    std::string first_reason;
    std::optional<crypto::Sha256Digest> sealed_plan;
    std::optional<Bytes> sealed_subject;
    std::vector<PatientNumber> patient_numbers;
    std::vector<std::string> plan_patients;
    Profiles profiles;
  };
  std::optional<Again> again;  // until that case has begun
  Clock::Time again_before{};
  struct LeftOpen {
    std::string case_id, why;
  };
  LeftOpen left_open;  // the last case that could not be closed
  // Of the case that runs: why its operation was begun, its plan, whether an error ended the one before it,
  // whether somebody or a rule ends it.
  std::string begun_for;
  std::optional<crypto::Sha256Digest> plan_of_case;
  Profiles newest_profiles;                   // of the case that an error ended
  std::optional<Bytes> newest_subject;        // of that case, or of the last one: sealed
  std::vector<PatientNumber> newest_numbers;  // of the same
  std::vector<std::string> plan_patients;     // of the case's plan
  Clock::Time same_operation_before{};  // a case that a rule begins after the error that ended the last one
  bool after_error_too = false, end_wanted = false;
  // Of the case that is being made: whether nobody asked for it, and why it is to end as soon as it has
  // begun.
  bool starts_by_itself = false;
  std::string stopped_meanwhile;
  std::shared_ptr<Session> session;  // while a case runs
  RoomStatus status;
  RateMeter rate;

  std::chrono::nanoseconds before{0};  // recorded by the operation's earlier cases
  RetryPause retry;
  Clock::Time begin_before{};                     // the case that is to be carried on
  std::optional<Clock::Duration> left_out_until;  // since boot: what was recorded ahead before
  std::optional<Clock::Time> left_out_by;         // a case is kept waiting no longer for that
  std::thread thread;
};

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
