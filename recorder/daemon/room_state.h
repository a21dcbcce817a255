// What a Room holds: shared by its parts (room.cpp, room_operation.cpp, room_subject.cpp,
// room_recording.cpp), of no use to anybody else. Where nothing else is said its functions take the mutex
// themselves; run() and what it calls belong to the room's thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "crypto/hash.h"
#include "recorder/daemon/rate_meter.h"
#include "recorder/daemon/retry_pause.h"
#include "recorder/daemon/room.h"
#include "recorder/session_request.h"

namespace kiroku::recorder {

struct Room::State {
  State(RoomPlan asked, RoomListener told, const Clock& its_time);
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
    std::optional<ProcedureData> about;  // whom an earlier process's case was about, if it goes on with that
    std::promise<std::string> begun;
    /// Nobody asked for it: a rule begins it, or the recorder goes on with an operation.
    [[nodiscard]] bool is_by_itself() const {
      return reason == "schedule" || reason == "signal" || reason == "resumed" || reason == "after-error";
    }
  };

  void shut_down();

  // Which case begins next, and that an operation is over (room_operation.cpp).
  [[nodiscard]] bool may_try() const;
  void run();
  /// With the mutex held: what is to begin now, as wanted_request() says. From here on the room is starting:
  /// a start that came while this one is carried out would begin a case by itself when this one has ended.
  std::unique_ptr<Request> next_request();
  /// With the mutex held.
  void take(const Request& taken);
  /// With the mutex held: what a person or a rule asked for; else the case that is to be carried on, or the
  /// one after an error.
  std::unique_ptr<Request> wanted_request();
  /// With the mutex held: another case where the last one was ended by an error and the room's rules let the
  /// operation go on.
  std::unique_ptr<Request> after_error();
  /// With the mutex held: a case that a rule begins soon after an error ended one goes on with that
  /// operation, also in a room without RoomRules::resume_within. A window of the schedule is still the same;
  /// whose signal it is nobody knows.
  void take_over_after_error(Request& asked) const;
  /// A case was ended by an error or a full disk, and `lasted` so long. What follows from that, in words: ""
  /// where somebody or a rule was ending it.
  std::string take_error(const std::string& case_id, std::chrono::nanoseconds lasted);
  /// Before a case is made: a recorder that is cut off from here on knows whose case it was.
  void note_beginning(const Request& asked);
  [[nodiscard]] std::string last_case() const;
  /// Before a case is ended by somebody or by a rule: a recorder that is cut off from here on carries nothing
  /// on.
  void note_end();
  void note_end(const std::string& case_id);
  /// Of whatever case the room's note tells, the next start of the recorder carries nothing on. A sentence
  /// for tell_problem() where that failed, else "".
  [[nodiscard]] std::string clear_note() const;
  /// The case that was being made did not come to be, and somebody had ended its operation.
  void clear_note_if_stopped_meanwhile();
  /// Nobody wanted the case ended, so that a recorder that starts again soon tells of it
  /// (ResumptionPlanner::of).
  [[nodiscard]] bool is_unfinished_operation(const std::string& close_reason) const;
  /// A closed case is never carried on, whatever the note says: a note that cannot be removed does no harm.
  void forget(const std::string& case_id);
  /// With the mutex held: whether the operation whose case was cut off, or was ended by an error, goes on
  /// with another case by itself.
  [[nodiscard]] bool tries_again();
  /// With the mutex held: no case begins by itself any more in the place of the one that ended.
  void give_up_operation();
  /// Ends an operation between its cases. `lock` holds the mutex.
  std::string stop_between_cases(std::unique_lock<std::mutex>& lock, const std::string& reason, bool wait);
  /// With the mutex held: throws where a stop that means case `meant` ("": whichever) would end nothing, or
  /// something else: the case that runs, or the operation that goes on by itself with another one.
  void require_to_end(const std::string& meant);
  /// With the mutex held.
  [[noreturn]] void throw_not_recording(const std::string& meant) const;
  /// With the mutex held: that of the status, or the one that the recorder's last run left to be carried on.
  [[nodiscard]] const std::string& newest_case() const;
  /// Somebody ended the operation while its next case was being made.
  void end_if_stopped_meanwhile(Session& running);
  /// Closing is counted from here on, which may take longer than a room that records may be silent.
  void want_end();

  // Whom a case is about, and in which form its pictures are archived (room_subject.cpp).
  /// What the recorder's last process knew of the case that is to be carried on; of another one nothing.
  void take_kept_patient(Resumption& resumed) const;
  /// The last process's case was cut off with it.
  void note_earlier_patient();
  [[nodiscard]] static std::string hash_of(const Bytes& sealed);
  /// For the recorder's next process: whom the case that runs is about by now.
  void keep_patient();
  /// Nothing goes on with the operation.
  void forget_patient();
  /// What is known of the subject now, where that is more than the sealed one of an earlier case. It is
  /// sealed here, since a case after an error takes it over as it is.
  std::optional<Bytes> seal_subject(Request& asked);
  /// Those of a subject, and by which else messages name the patient whom the room's procedure data found.
  std::vector<PatientNumber> known_numbers(const Bytes& subject) const;
  /// In which form pictures of a case that begins now are archived: as those of the case with which it goes
  /// on, else by the room's rules; none where nothing decides.
  std::vector<ProfileDecision> decisions_for(const Request& asked, const std::optional<Bytes>& subject);
  static std::string name_of(const ProfileRule& rule);
  /// A subject that came while the case ran changes no picture by itself: people are told, and decide.
  void tell_of_late_rule(Session& running, const Bytes& subject);
  /// In the case and to people; recording does not wait for it.
  void state_missing_subject(Session& running);
  /// A person says whom the case is about: nothing that is found by itself comes after it.
  void give_late_subject(Session& running, const Bytes& subject);
  void look_for_late_subject(Session& running);
  /// In the case and to people; it stays about whom it was.
  void look_for_contradiction(Session& running);
  /// With late_mutex held: whom the case is about from now on, for a case that goes on with its operation in
  /// this process or in the recorder's next one.
  void keep_late_subject(const Session& running, const Bytes& subject,
                         const std::vector<PatientNumber>& further);
  [[nodiscard]] bool is_of_now(const Session& running) const;
  /// With late_mutex held. What cannot be written is told, and tried again while the case runs.
  void note_newest_subject();

  // One case from its beginning to its end (room_recording.cpp).
  void beat();
  [[nodiscard]] static std::string beginning_text(const Request& asked, const std::string& id);
  /// Records without a case until one begins, and that one to its end.
  void record_ahead();
  /// What was recorded ahead of the last change of who is in the room is somebody else's. Whether a case may
  /// begin: for a moment after a change, what is being written reaches back before it.
  bool leave_out_others(Session& running);
  /// Looks whether a case shall begin; why its operation was begun if it has.
  std::string begin_if_wanted(Session& running, const SessionStatus& now);
  /// One case from its beginning to its end.
  void record(Request& asked);
  void refuse_start(Request& asked, const std::string& why);
  /// What is looked at a few times a second while a case runs. `first_reason` is why its operation was begun.
  void follow(Session& running, const SessionStatus& now, const std::string& first_reason);
  /// Recording is over, for whatever reason. What was recorded ahead is no case, and is discarded.
  void closes();
  /// With the mutex held.
  void tell_new_problem(const SessionStatus& now);
  void end(const SessionResult& result);
  void end_badly(const std::string& why);
  void tell_problem(const std::string& sentence);
  void tell_problem(const std::string& sentence, const std::function<void(const std::string&)>& tell);
  /// A case has begun. With the mutex held.
  void take_identity(const Request& asked);
  /// Null while no case is recorded.
  [[nodiscard]] std::shared_ptr<Session> recording_session(const std::string& meant = "") const;
  /// The same, of case `meant` ("": whichever): it has one case, so that nothing done to it reaches another
  /// that begins meanwhile. Throws where that case is not recorded; `instead` says what one does while none
  /// is.
  [[nodiscard]] std::shared_ptr<Session> session_of(const std::string& meant, const char* instead) const;
  void set_state(RoomState state, const std::string& reason);
  [[nodiscard]] bool is_free() const;
  /// Of a case that records or is being closed.
  [[nodiscard]] bool has_case() const;

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
  std::shared_ptr<Session> session;  // while a case runs, or is recorded ahead
  std::string problem_of_session;    // the last one of it that was told
  RoomStatus status;
  RateMeter rate;

  std::chrono::nanoseconds before{0};  // recorded by the operation's earlier cases
  RetryPause retry;
  Clock::Time begin_before{};                     // the case that is to be carried on
  std::optional<Clock::Duration> left_out_until;  // since boot: what was recorded ahead before
  std::optional<Clock::Time> left_out_by;         // a case is kept waiting no longer for that
  std::thread thread;
};

}  // namespace kiroku::recorder
