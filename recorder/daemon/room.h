// One operating room of an unattended recorder: starts and stops cases, by command or by rule, for as long as
// it lives. Every function may be called from any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "recorder/daemon/case_subject.h"
#include "recorder/daemon/footswitch.h"
#include "recorder/daemon/resumption.h"
#include "recorder/daemon/room_rules.h"
#include "recorder/procedure/procedure_inbox.h"
#include "recorder/procedure/procedure_source.h"
#include "recorder/procedure/profile_rules.h"
#include "recorder/session.h"

namespace kiroku::recorder {

struct RoomPlan {
  std::string name;
  SessionOptions session;  // what it points to must outlive the room; no subject, no duration
  RoomRules rules;
  /// Asked for the subject of a case for which nobody gave one; null: none. What is not known when the case
  /// begins is looked for while it runs, and becomes an event of it (events_lane.h).
  std::shared_ptr<ProcedureSource> procedure;
  /// By the procedure of a case, in which form its pictures are archived; the first that matches.
  std::vector<ProfileRule> profile_rules;
  std::vector<FootswitchOptions> footswitches;  // the daemon's, which presses
  /// Told of each case before it begins and before it is ended; null: nothing is kept.
  std::shared_ptr<RunningNote> running;
  std::optional<Resumption> resume;  // the room begins with this case
  /// Where what is known of the running case's patient outlives the process, for `resume`.
  InboxMemory memory = {};
  /// Why a case that was cut off is not carried on, for the status; "": none was, or it is.
  std::string not_resumed;
};

/// kIdle: nothing is recorded. kStandby: sources are recorded ahead, no case has begun.
enum class RoomState { kIdle, kStandby, kStarting, kRecording, kClosing };
std::string_view state_name(RoomState state);

struct RoomStatus {
  std::string name;
  RoomState state = RoomState::kIdle;
  std::string case_id;                         // of the case being recorded, or of the last one known
  std::string reason;                          // why it was started, or why the last one ended
  SessionStatus session;                       // of that case
  std::string problem;                         // latest sentence a person should see, "" if none
  SubjectState subject = SubjectState::kNone;  // of that case
  std::string profile_rule;                    // the rule that chose its profile; "": none did
  std::vector<ProcedureWay> procedure;         // how the ways to procedure data are
  std::string carries_on;                      // the case that it carries on; "": none
  Clock::Time begun_at{};                      // when that case was begun
  std::uint64_t resumed = 0;                   // cases that carry on another, since the room was made
  bool not_resumed = false;                    // a case was cut off, nothing carries it on, none began since
  bool ended_by_error = false;                 // the last case was, nobody wanted it, and none began since
  bool has_plan_of_another = false;            // the case that runs says that its plan is another patient's
  bool tries_again = false;                    // a case that goes on with the last one begins by itself
  std::uint64_t cases = 0;                     // ended since the room was made
  double bytes_per_second = 0;                 // of the case being recorded, over the last minute or so
  double last_bytes_per_second = 0;            // the same of the case before, at its end
};

/// What a room tells the world; called from the room's thread, or from that of whoever ends an operation
/// between its cases. Must not call the room.
struct RoomListener {
  std::function<void(const std::string& sentence)> note;    // something happened
  std::function<void(const std::string& sentence)> warn;    // something a person should see
  std::function<void(const SessionResult& result)> closed;  // a case was closed
  std::function<void(const std::string& sentence)> left;    // a case could not be closed; a later start does
};

class Room {
 public:
  /// `time`, by which the room goes, must outlive it. A case has the machine's clock (Session).
  Room(RoomPlan plan, RoomListener listener, const Clock& time = Clock::system());
  /// As shut_down().
  ~Room();
  /// Ends a case that runs, properly, with the reason "shutdown"; none can be begun any more. The room can
  /// still be asked. From one thread.
  void shut_down();
  Room(const Room&) = delete;
  Room& operator=(const Room&) = delete;

  /// False where a case runs, is being made or closed, is asked for, or goes on with the last one by itself;
  /// else none begins any more, and start() waits, until may_begin_again(), or shut_down().
  [[nodiscard]] bool begin_no_more();
  void may_begin_again();

  [[nodiscard]] const std::string& name() const;
  /// Begins a case and returns its identifier when recording has begun. `subject` is JSON to be sealed with
  /// it, `sealed_plan` the hash of the plan that it follows, and `plan_patients` whose CT that was made on
  /// (CaseIdentity). Throws kiroku::UsageError if a case is running, kiroku::Error if none can be begun.
  std::string start(const std::string& reason, std::optional<Bytes> subject = {},
                    const std::optional<crypto::Sha256Digest>& sealed_plan = {},
                    std::vector<std::string> plan_patients = {});
  // What acts on the case that runs may say which one it means: nothing is done, and kiroku::UsageError
  // thrown, where `meant` ("": whichever runs) is not the case that it would reach. Nothing that begins
  // meanwhile is taken for it. Each returns the case that it acted on.

  /// What is known of the patient and the procedure while a case runs: JSON as start() takes it, sealed as an
  /// event of the case; what is there stays, and the last one counts. Nothing is looked for any more then.
  /// Throws kiroku::UsageError if no case runs, or for what is no JSON object.
  std::string add_subject(const Bytes& subject, const std::string& meant = "");
  /// What could be done here now, to choose from; none where nothing is configured. Returns at once.
  [[nodiscard]] std::vector<ProcedureData> procedures() const;
  /// Ends the case that runs and returns its identifier; returns when it is closed if `wait`. Inside a window
  /// of the schedule no new one is begun until the next window. Where none runs and one would go on with the
  /// last one by itself (RoomStatus::tries_again), ends the operation: none does any more, also after another
  /// start of the recorder. `meant` is that last one then. Throws kiroku::UsageError if there is neither, and
  /// kiroku::Error if it was waited for and could not be closed.
  std::string stop(const std::string& reason, bool wait, const std::string& meant = "");
  /// Marks a moment. Throws kiroku::UsageError if no case runs.
  std::string mark(const std::string& text, const std::string& meant = "");
  /// From the next picture on, streams are archived in another form. Throws as Session::change_profile(), and
  /// kiroku::UsageError if no case runs.
  std::string change_profile(const ProfileDecision& decision, const std::string& meant = "");
  /// As Session::point(); nothing as well where another case than `meant` runs.
  std::optional<std::int64_t> point(media::PointedAt at, const std::string& meant = "");
  /// The case that is being recorded; "": none. Cheap.
  [[nodiscard]] std::string running_case() const;
  [[nodiscard]] RoomStatus status() const;
  /// When the room's thread last did anything; older than a few seconds, it hangs (opening sources and
  /// closing a case count as doing something).
  [[nodiscard]] Clock::Time heartbeat() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
