#include "recorder/daemon/room.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kRuleInterval{1};
constexpr std::chrono::seconds kFirstPause{1};
constexpr std::chrono::seconds kLongestPause{60};
constexpr std::chrono::seconds kRateWindow{60};
// Nothing came for so long: the signal has paused.
constexpr std::int64_t kSignalPauseNs = 1'000'000'000;
// Recording ahead is begun anew after so long: MPEG-TS counts time to 26.5 hours (33 bits at 90 kHz), and a
// case of a day shall fit behind it.
constexpr std::int64_t kLongestStandbyNs = 2LL * 3600 * 1'000'000'000;

/// Bytes a second over about the last minute.
class RateMeter {
 public:
  void add(Clock::Time now, std::uint64_t bytes) {
    if (!samples_.empty() && now - samples_.back().when < std::chrono::seconds(1)) return;
    samples_.push_back({now, bytes});
    while (samples_.size() > 2 && now - samples_.front().when > kRateWindow) samples_.pop_front();
  }
  [[nodiscard]] double bytes_per_second() const {
    if (samples_.size() < 2) return 0;
    const std::chrono::duration<double> span = samples_.back().when - samples_.front().when;
    return static_cast<double>(samples_.back().bytes - samples_.front().bytes) / span.count();
  }

 private:
  struct Sample {
    Clock::Time when;
    std::uint64_t bytes;
  };
  std::deque<Sample> samples_;
};

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

std::string_view subject_state_name(SubjectState state) {
  switch (state) {
    case SubjectState::kNone:
      return "none";
    case SubjectState::kGiven:
      return "given";
    case SubjectState::kFound:
      return "found";
    case SubjectState::kLate:
      return "late";
    case SubjectState::kCarriedOver:
      return "carried-over";
  }
  return "";
}

struct Room::State {
  State(RoomPlan asked, RoomListener told, const Clock& its_time)
      : plan(std::move(asked)), listener(std::move(told)), time(its_time) {
    status.name = plan.name;
    resume = plan.resume;
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
    Profiles profiles;         // of the case that it goes on with, as that ended
    std::string first_reason;  // why the operation's first case was begun
    std::promise<std::string> begun;
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

  void beat() { heartbeat = time.now().time_since_epoch().count(); }

  void run() {
    std::unique_lock lock(mutex);
    while (!ending) {
      beat();
      const bool ahead = plan.rules.pre_roll.count() > 0 && time.now() >= not_before;
      const auto is_wanted = [&] {
        return ending || request || ((resume || again) && time.now() >= not_before);
      };
      if (!ahead) time.wait_for(changed, lock, kRuleInterval, is_wanted);
      if (ending) break;
      if (ahead) {
        lock.unlock();
        record_ahead();
        lock.lock();
        continue;
      }
      if (!request && !resume && !again && schedule_wants_a_case() && time.now() >= not_before) {
        request = std::make_unique<Request>();
        request->reason = "schedule";
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

  /// With the mutex held: what a person or a rule asked for; else the case that is to be carried on, or the
  /// one after an error.
  std::unique_ptr<Request> next_request() {
    if (request) {
      // Somebody's own case takes the place of the one that would be carried on.
      resume.reset();
      again.reset();
      request->first_reason = request->reason;
      request->identity.case_id = archive::new_case_id(time.utc());
      return std::move(request);
    }
    if (time.now() < not_before) return {};
    if (!resume) return after_error();
    if (time.now() > begin_before) {
      status.not_resumed = true;
      resume.reset();
      return {};
    }
    auto taken = std::make_unique<Request>();
    taken->reason = "resumed";
    taken->first_reason = resume->reason;
    taken->sealed_plan = resume->plan;
    taken->profiles = resume->profiles;
    taken->identity = {resume->case_id, resume->earlier, resume->sealed_subject};
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
    taken->first_reason = again->first_reason;
    taken->sealed_plan = again->sealed_plan;
    taken->profiles = again->profiles;
    taken->identity.case_id = archive::new_case_id(time.utc());
    taken->identity.sealed_subject = again->sealed_subject;
    return taken;
  }

  /// A case was ended by an error or a full disk, and `lasted` so long. What follows from that, in words: ""
  /// where somebody or a rule was ending it.
  std::string take_error(const std::string& case_id, std::chrono::nanoseconds lasted) {
    const auto tell = [this](const std::string& sentence) { tell_problem(sentence); };
    std::optional<Bytes> subject = sealed_subject_of(plan.session.archive / case_id, tell);
    Profiles profiles = last_profiles_of(plan.session.archive / case_id);
    bool goes_on = false;
    {
      const std::lock_guard guard(mutex);
      if (ending || end_wanted) return "";
      status.ended_by_error = true;
      goes_on = plan.rules.resume_within || begun_for == "schedule";
      if (plan.rules.resume_within) {
        // A disk that fails each case at once is not tried for ever.
        if (!after_error_too || lasted >= ResumptionPlanner::kShortCase)
          again_before = time.now() + *plan.rules.resume_within;
        again = Again{begun_for, plan_of_case, std::move(subject), std::move(profiles)};
      }
    }
    return goes_on ? "; nothing is recorded until another one is begun" + next_try()
                   : "; nothing is recorded any more: begin another one where the operation goes on";
  }

  /// Before a case is made: a recorder that is cut off from here on knows whose case it was.
  void note_beginning(const Request& asked) {
    if (!plan.running) return;
    try {
      const auto& earlier = asked.identity.carries_on;
      plan.running->begins(
          {asked.identity.case_id, earlier ? earlier->case_id : "", asked.first_reason, false});
    } catch (const std::exception& error) {
      tell_problem("after a crash this case would not be carried on: " + std::string(error.what()));
    }
  }

  /// Before a case is ended by somebody or by a rule: a recorder that is cut off from here on carries nothing
  /// on.
  void note_end() {
    if (!plan.running) return;
    std::string id;
    {
      const std::lock_guard guard(mutex);
      id = status.case_id;
    }
    try {
      plan.running->ends(id);
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
    begun_for = asked.first_reason;
    plan_of_case = asked.sealed_plan;
    after_error_too = asked.reason == "after-error";
    end_wanted = false;
    again.reset();
    before = {};
    if (!asked.identity.carries_on) return;
    ++status.resumed;
    before = resume->recorded;
    resume.reset();
  }

  [[nodiscard]] static std::string beginning_text(const Request& asked, const std::string& id) {
    std::string text = "case " + id + " begins (" + asked.reason + ")";
    if (asked.identity.carries_on) text += " and carries on case " + asked.identity.carries_on->case_id;
    return text;
  }

  /// With the mutex held.
  [[nodiscard]] bool schedule_wants_a_case() {
    const bool in_window =
        !plan.rules.schedule.empty() && plan.rules.schedule.contains(local_time(time.utc()));
    if (!in_window) stopped_in_window = false;
    return in_window && !stopped_in_window;
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
      back_off();
      tell_problem("nothing can be recorded ahead: " + std::string(error.what()) + next_try());
      return;
    }
    {
      const std::lock_guard guard(mutex);
      session = running;
      status.state = RoomState::kStandby;
      status.session = {};
      if (ending) running->stop("shutdown");
    }
    signal_since_ns.reset();
    std::string reason;
    try {
      end(running->run([&](const SessionStatus& now) {
        if (now.begun) {
          follow(*running, now, reason);
        } else {
          reason = begin_if_wanted(*running, now);
        }
      }));
    } catch (const std::exception& error) {
      end_badly(error.what());
    }
  }

  /// Looks whether a case shall begin; why its operation was begun if it has.
  std::string begin_if_wanted(Session& running, const SessionStatus& now) {
    beat();
    std::unique_ptr<Request> taken;
    {
      const std::lock_guard guard(mutex);
      status.session = now;
      taken = next_request();
      if (!taken && !resume && !again) {
        const bool scheduled = schedule_wants_a_case(), signalled = signal_wants_a_case(now);
        // After a failure the rules wait; a person may try at once.
        if ((scheduled || signalled) && time.now() >= not_before) {
          taken = std::make_unique<Request>();
          taken->reason = taken->first_reason = scheduled ? "schedule" : "signal";
          taken->identity.case_id = archive::new_case_id(time.utc());
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
      std::optional<Bytes> subject = subject_of(*taken);
      decisions = decisions_for(*taken, subject);
      id = running.begin(std::move(subject), taken->sealed_plan, taken->identity);
    } catch (const std::exception& error) {
      back_off();
      tell_problem("no case could be begun: " + std::string(error.what()) + next_try());
      taken->begun.set_exception(std::current_exception());
      return "";
    }
    {
      const std::lock_guard guard(mutex);
      status.state = RoomState::kRecording;
      status.case_id = id;
      status.reason = taken->reason;
      take_identity(*taken);
    }
    if (listener.note) listener.note(beginning_text(*taken, id));
    // What was recorded ahead is archived as it was; from here on as decided.
    for (const ProfileDecision& decision : decisions) running.decide_profile(decision);
    state_missing_subject(running);
    taken->begun.set_value(id);
    return taken->first_reason;
  }

  /// What is known of the procedure; nothing that goes wrong with it may end a recording, or keep one from
  /// beginning.
  std::optional<Bytes> find_subject() {
    try {
      if (const auto found = plan.procedure->find(begun_at)) return subject_json(*found);
    } catch (const std::exception& error) {
      tell_problem(std::string("procedure data cannot be looked up: ") + error.what());
    }
    return {};
  }

  /// For a case that begins now: what a person gave, else what is known of the procedure.
  std::optional<Bytes> subject_of(Request& asked) {
    std::optional<Bytes> subject = std::move(asked.subject);
    SubjectState state = subject ? SubjectState::kGiven : SubjectState::kNone;
    begun_at = time.utc();
    const bool carried_over = asked.identity.sealed_subject.has_value();
    if (carried_over) state = SubjectState::kCarriedOver;
    if (!subject && !carried_over && plan.procedure) {
      subject = find_subject();
      if (subject) state = SubjectState::kFound;
    }
    look_for_subject = !subject && !carried_over && plan.procedure;
    const std::lock_guard guard(mutex);
    status.subject = state;
    return subject;
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
    if (!look_for_subject) return;
    plan.procedure->hurry();
    std::string why = "the case begins without procedure data";
    for (const ProcedureWay& way : plan.procedure->ways()) why += "; " + way.name + ": " + way.state;
    running.subject_missing(why);
    tell_problem(why);
  }

  /// Each second, until there is one.
  void look_for_late_subject(Session& running) {
    if (!look_for_subject || time.now() < next_look) return;
    next_look = time.now() + kRuleInterval;
    const std::optional<Bytes> found = find_subject();
    // A person may have given one meanwhile.
    if (!found || !look_for_subject.exchange(false)) return;
    running.late_subject(*found);
    tell_of_late_rule(running, *found);
    {
      const std::lock_guard guard(mutex);
      status.subject = SubjectState::kLate;
    }
    if (listener.note) listener.note("procedure data came while the case ran");
  }

  /// With the mutex held.
  [[nodiscard]] bool signal_wants_a_case(const SessionStatus& now) {
    for (const StreamStatus& stream : now.streams) {
      if (stream.name != plan.rules.start_on_signal) continue;
      const bool present = stream.frames > 0 && now.now_ns - stream.last_ns < kSignalPauseNs;
      if (!present) {
        signal_since_ns.reset();
        stopped_by_person = false;  // the next signal is another procedure
      } else if (!signal_since_ns) {
        signal_since_ns = now.now_ns;
      }
      return present && !stopped_by_person &&
             now.now_ns - *signal_since_ns >= plan.rules.signal_lasts.count();
    }
    return false;
  }

  void back_off() {
    pause = std::clamp<Clock::Duration>(2 * pause, kFirstPause, kLongestPause);
    not_before = time.now() + pause;
  }

  [[nodiscard]] std::string next_try() const {
    return "; the next try is in " +
           std::to_string(std::chrono::duration_cast<std::chrono::seconds>(pause).count()) + " s";
  }

  /// One case from its beginning to its end.
  void record(Request& asked) {
    set_state(RoomState::kStarting, asked.reason);
    std::shared_ptr<Session> running;
    try {
      SessionOptions options = plan.session;
      options.cancelled = &cancelled;
      options.subject = subject_of(asked);
      options.profile_decisions = decisions_for(asked, options.subject);
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
    {
      const std::lock_guard guard(mutex);
      session = running;
      status.state = RoomState::kRecording;
      status.case_id = running->case_id();
      take_identity(asked);
      if (ending) running->stop("shutdown");
    }
    if (listener.note) listener.note(beginning_text(asked, running->case_id()));
    state_missing_subject(*running);
    asked.begun.set_value(running->case_id());
    try {
      end(running->run([&](const SessionStatus& now) { follow(*running, now, asked.first_reason); }));
    } catch (const std::exception& error) {
      end_badly(error.what());
    }
  }

  void refuse_start(Request& asked, const std::string& why) {
    back_off();
    tell_problem("no case could be begun: " + why +
                 (plan.rules.schedule.empty() && asked.reason != "resumed" && asked.reason != "after-error"
                      ? ""
                      : next_try()));
    set_state(RoomState::kIdle, "");
    asked.begun.set_exception(std::current_exception());
  }

  /// The rule that ends the case now; "" while none does.
  [[nodiscard]] std::string rule_to_end(const SessionStatus& now, const std::string& first_reason) const {
    const RoomRules& rules = plan.rules;
    if (now.now_ns - now.begins_ns >= (rules.longest_case - before).count()) return "longest-case";
    const std::int64_t silent_since_ns = std::max(last_sign_of_life(now), now.decided_ns);
    if (rules.stop_after_silence && now.now_ns - silent_since_ns > rules.stop_after_silence->count()) {
      return "silence";
    }
    return first_reason == "schedule" && !rules.schedule.contains(local_time(time.utc())) ? "schedule" : "";
  }

  /// What is looked at a few times a second while a case runs. `first_reason` is why its operation was begun.
  void follow(Session& running, const SessionStatus& now, const std::string& first_reason) {
    beat();
    if (const std::string rule = rule_to_end(now, first_reason); !rule.empty()) {
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

  void want_end() {
    const std::lock_guard guard(mutex);
    end_wanted = true;
  }

  /// With the mutex held.
  void tell_new_problem(const SessionStatus& now) {
    if (now.last_problem.empty() || now.last_problem == status.problem) return;
    status.problem = now.last_problem;
    if (listener.warn) listener.warn(now.last_problem);
  }

  [[nodiscard]] std::int64_t last_sign_of_life(const SessionStatus& now) const {
    const std::size_t deciding = plan.session.video.empty() ? now.streams.size() : plan.session.video.size();
    std::int64_t last_ns = 0;
    for (std::size_t i = 0; i < std::min(deciding, now.streams.size()); ++i) {
      last_ns = std::max(last_ns, now.streams[i].last_ns);
    }
    return last_ns;
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
        back_off();
      } else {
        pause = {};
        not_before = {};
      }
    }
    // First, so that whoever waits for the end finds everything done.
    if (!result.case_id.empty()) {
      if (listener.note) {
        listener.note("case " + result.case_id + " is closed (" + result.close_reason + ")");
      }
      if (listener.closed) listener.closed(result);
      forget(result.case_id);
      if (by_itself && result.close_reason != "sources-ended") {
        const std::chrono::nanoseconds lasted(result.last.now_ns - result.last.begins_ns);
        if (const std::string follows = take_error(result.case_id, lasted); !follows.empty())
          tell_problem("case " + result.case_id + " ended by itself (" + result.close_reason + ")" + follows);
      }
    }
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

  void end_badly(const std::string& why) {
    std::string sentence, ended;
    std::chrono::nanoseconds lasted{0};
    {
      const std::lock_guard guard(mutex);
      // What was recorded ahead is no case, and the case before it was closed.
      if (status.state != RoomState::kStandby) ended = status.case_id;
      lasted = std::chrono::nanoseconds(status.session.now_ns - status.session.begins_ns);
      back_off();
    }
    if (ended.empty()) {
      sentence = "recording ahead ended: " + why + next_try();
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
  [[nodiscard]] std::shared_ptr<Session> recording_session() const {
    const std::lock_guard guard(mutex);
    return status.state == RoomState::kRecording ? session : nullptr;
  }

  void set_state(RoomState state, const std::string& reason) {
    beat();
    const std::lock_guard guard(mutex);
    status.state = state;
    if (!reason.empty()) status.reason = reason;
  }

  const RoomPlan plan;
  const RoomListener listener;
  const Clock& time;
  std::atomic<Clock::Duration::rep> heartbeat{0};

  mutable std::mutex mutex;  // guards what follows, but for the last ones, which only the room's thread uses
  std::condition_variable changed;
  std::atomic<bool> cancelled = false;  // as SessionOptions::cancelled, of each session
  bool ending = false;
  bool stopped_in_window = false;  // by a person, so that the schedule rests
  bool stopped_by_person = false;  // so that the signal that is there begins no other case
  std::unique_ptr<Request> request;
  std::optional<Resumption> resume;  // until that case has begun
  /// What the case after an error takes over.
  struct Again {
    std::string first_reason;
    std::optional<crypto::Sha256Digest> sealed_plan;
    std::optional<Bytes> sealed_subject;
    Profiles profiles;
  };
  std::optional<Again> again;  // until that case has begun
  Clock::Time again_before{};
  // Of the case that runs: why its operation was begun, its plan, whether an error ended the one before it,
  // whether somebody or a rule ends it.
  std::string begun_for;
  std::optional<crypto::Sha256Digest> plan_of_case;
  bool after_error_too = false, end_wanted = false;
  std::shared_ptr<Session> session;  // while a case runs
  RoomStatus status;
  RateMeter rate;

  std::optional<std::int64_t> signal_since_ns;  // on the clock of the session
  UtcTime begun_at{};                           // of the case that runs
  std::atomic<bool> look_for_subject = false;   // of that case: nobody gave one, none was known
  std::chrono::nanoseconds before{0};           // recorded by the operation's earlier cases
  Clock::Time next_look{};
  Clock::Duration pause{};
  Clock::Time not_before{};
  Clock::Time begin_before{};  // the case that is to be carried on
  std::thread thread;
};

Room::Room(RoomPlan plan, RoomListener listener, const Clock& time)
    : state_(std::make_unique<State>(std::move(plan), std::move(listener), time)) {}
Room::~Room() = default;
void Room::shut_down() { state_->shut_down(); }

const std::string& Room::name() const { return state_->plan.name; }

std::string Room::start(const std::string& reason, std::optional<Bytes> subject,
                        const std::optional<crypto::Sha256Digest>& sealed_plan) {
  std::future<std::string> begun;
  {
    const std::lock_guard guard(state_->mutex);
    if (state_->ending) throw Error("the recorder is being shut down");
    const bool free = state_->status.state == RoomState::kIdle || state_->status.state == RoomState::kStandby;
    if (!free || state_->request) {
      throw UsageError("room " + name() + " is recording already: case " + state_->status.case_id);
    }
    state_->request = std::make_unique<State::Request>();
    state_->request->reason = reason;
    state_->request->subject = std::move(subject);
    state_->request->sealed_plan = sealed_plan;
    begun = state_->request->begun.get_future();
  }
  state_->changed.notify_all();
  return begun.get();
}

std::string Room::stop(const std::string& reason, bool wait) {
  if (!running_case().empty()) state_->note_end();
  std::unique_lock lock(state_->mutex);
  if (state_->status.state != RoomState::kRecording) throw UsageError("room " + name() + " is not recording");
  std::string id = state_->status.case_id;
  state_->end_wanted = true;
  const std::uint64_t before = state_->status.cases;
  state_->session->stop(reason);
  state_->status.state = RoomState::kClosing;
  state_->stopped_in_window = true;
  state_->stopped_by_person = true;
  if (wait) state_->changed.wait(lock, [&] { return state_->status.cases > before; });
  return id;
}

void Room::mark(const std::string& text) {
  require_printable(text, "the text of the mark");
  const std::shared_ptr<Session> session = state_->recording_session();
  if (!session) throw UsageError("room " + name() + " is not recording: there is nothing to mark");
  session->mark(text);
}

void Room::change_profile(const ProfileDecision& decision) {
  require_printable(decision.why, "why the profile changes");
  const std::shared_ptr<Session> session = state_->recording_session();
  if (!session) {
    throw UsageError("room " + name() +
                     " is not recording: a profile is changed while a case runs; before it, kiroku.toml says "
                     "which one it begins with");
  }
  session->change_profile(decision);
}

void Room::add_subject(const Bytes& subject) {
  const std::shared_ptr<Session> session = state_->recording_session();
  if (!session) {
    throw UsageError("room " + name() + " is not recording: say whom the case is about when it begins");
  }
  session->late_subject(subject);
  state_->tell_of_late_rule(*session, subject);
  state_->look_for_subject = false;
  const std::lock_guard guard(state_->mutex);
  state_->status.subject = SubjectState::kLate;
}

std::vector<ProcedureData> Room::procedures() const {
  if (!state_->plan.procedure) return {};
  state_->plan.procedure->hurry();
  return state_->plan.procedure->list(state_->time.utc());
}

std::optional<std::int64_t> Room::point(media::PointedAt at) {
  const std::shared_ptr<Session> session = state_->recording_session();
  return session ? session->point(std::move(at)) : std::nullopt;
}

std::string Room::running_case() const {
  const std::lock_guard guard(state_->mutex);
  return state_->status.state == RoomState::kRecording ? state_->status.case_id : std::string();
}

RoomStatus Room::status() const {
  const std::lock_guard guard(state_->mutex);
  RoomStatus status = state_->status;
  if (state_->plan.procedure) status.procedure = state_->plan.procedure->ways();
  if (state_->session) status.session = state_->session->status();
  return status;
}

Clock::Time Room::heartbeat() const { return Clock::Time(Clock::Duration(state_->heartbeat.load())); }

}  // namespace kiroku::recorder
