// Recording one procedure from its sources into one case. A Session is driven by one thread; it has its own
// inside.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/search/note_writer.h"
#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer.h"
#include "base/clock.h"
#include "crypto/age_recipient.h"
#include "crypto/signing_key.h"
#include "media/pointing_line.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/picture_tap.h"
#include "recorder/source/source_guard.h"
#include "recorder/stamper.h"
#include "recorder/vitals/patient_number.h"
#include "recorder/vitals_tap.h"
#include "timestamp/client.h"
#include "timestamp/token_verifier.h"

namespace kiroku::recorder {

/// One asked-for stream.
struct StreamRequest {
  std::string name;    // "endoscope", "room", "vitals"
  std::string source;  // SRC of the command line
  std::string purpose;
  VideoProfile video;  // ignored for vitals
  crypto::AgeRecipients recipients;
  /// An unattended recorder begins without a source that is not there, states the gap, and takes it up when
  /// it comes; a person at a keyboard would rather be told (the default).
  bool may_be_absent = false;
  /// Is offered every picture as it is captured, over all cases; null: nobody. Video only.
  std::shared_ptr<PictureTap> tap = nullptr;
  /// Is offered every vital sign as it is recorded, likewise.
  std::shared_ptr<VitalsTap> vitals_tap = nullptr;
  /// Through which its source is looked up and, of video, opened, over all cases of whoever keeps the
  /// request.
  std::shared_ptr<SourceGuard> guard = std::make_shared<SourceGuard>();
  /// Where the audio beside its pictures comes from, in the place of the source's own: "alsa:hw:1,0"; "":
  /// from the source, if video.audio. Video only.
  std::string microphone = {};
  /// As `guard`, of the microphone.
  std::shared_ptr<SourceGuard> microphone_guard = std::make_shared<SourceGuard>();
  /// The name of a stream before it in SessionOptions::video whose pictures it archives a second time, in
  /// another form and without audio; "": it has a source of its own. Where it is given, what stands here of a
  /// source says nothing, and a change of the profile that names no stream leaves it as it is.
  std::string second_of = {};
};

/// What archives the pictures of `first` a second time, for the same recipients; it stands behind `first`.
StreamRequest second_of(const StreamRequest& first, Profile profile);

/// A case whose identifier is known before it is made, and that may carry on an earlier one
/// (archive/verify/carried_on.h).
struct CaseIdentity {
  std::string case_id;  // "": a new one
  std::optional<archive::CarriedOn> carries_on;
  /// The earlier case's subject file, as it is; then no other subject may be given.
  std::optional<Bytes> sealed_subject;
  /// Of whom the case is about, beside those that a subject in the clear states: monitors may name them so.
  std::vector<PatientNumber> patient_numbers = {};
  /// Patient IDs that the CT of the case's plan states (recorder/control/plan_patient.h); none: not known.
  std::vector<std::string> plan_patients = {};
  /// By what the case can be found (SessionOptions::search): what its subject says; absent: what a subject in
  /// the clear does.
  std::optional<search::SearchWords> search_words = {};
  /// The case whose subject `sealed_subject` is: by what that one can be found.
  std::string subject_of = {};
};

/// What is said, in the case and to people, where that CT is of somebody else than the case is about.
inline constexpr const char* kPlanOfAnother =
    "the CT of the sealed plan states another patient's number (Patient ID) than the case is about: see "
    "whether it "
    "is this patient's plan, and whether the case has the right patient";

/// In which form pictures are archived, and who or what decided so: sealed as an event of the case.
struct ProfileDecision {
  std::vector<std::string> streams;  // of pictures; none: all that have a source of their own
  Profile profile = Profile::kMpeg2;
  std::string by;   // who: "operator", "footswitch", a user of the viewer; "rule"
  std::string why;  // a sentence, "" if nobody gave one; may tell of the patient
};

/// States the decision's profile in the requests that it is about, for a case that has not begun.
void apply_decision(const ProfileDecision& decision, std::vector<StreamRequest>& streams);

struct SessionOptions {
  std::filesystem::path archive;
  const crypto::SigningKey* key = nullptr;
  std::string device_name;
  std::vector<StreamRequest> video;
  std::vector<StreamRequest> vitals;
  crypto::AgeRecipients event_recipients;     // for the events stream and the subject
  bool pointing = false;                      // whether people may point on live pictures
  crypto::AgeRecipients pointing_recipients;  // of where they do; none: those of events
  std::optional<Bytes> subject;
  /// Why streams of `video` have the profiles that they have; events where a case begins at once.
  std::vector<ProfileDecision> profile_decisions;
  std::optional<crypto::Sha256Digest> plan;  // of a sealed plan, for the case's first entry
  CaseIdentity identity;
  std::vector<NamedAuthority> authorities;
  const timestamp::TrustStore* trust = nullptr;  // a token that does not hold under it is token-missed
  StampingQueue* queue = nullptr;                // remembers tokens that did not come; may be null
  archive::ApplianceLog* log = nullptr;
  std::shared_ptr<search::NoteWriter> search;  // null: no case can be found by its patient or procedure
  archive::FileSystem* files = nullptr;        // null: the real one
  std::chrono::nanoseconds segment_duration = std::chrono::seconds(2);
  std::chrono::nanoseconds stamp_interval = std::chrono::seconds(60);
  std::optional<std::chrono::nanoseconds> duration;
  /// Given: sources are recorded, but a case exists only from Session::begin() on; it then holds what was
  /// recorded up to so long before.
  std::optional<std::chrono::nanoseconds> pre_roll;
  std::size_t queue_bytes = 120U << 20;  // frames waiting for an encoder, all streams together
  const Clock* time = &Clock::system();  // what the case clock counts; must outlive the session
  /// Once it is true, no source is waited for any more: the constructor throws. May be null; from any thread
  /// or a signal handler. Must outlive the constructor.
  const std::atomic<bool>* cancelled = nullptr;
};

struct StreamStatus {
  std::string name;
  bool live = false;
  // Of the case; before it has begun, of what it would begin with. Not what was discarded of a pre-roll.
  std::uint64_t frames = 0, dropped = 0, segments = 0, bytes = 0;
  std::int64_t last_ns = 0;     // case-clock end of what came last
  std::int64_t durable_ns = 0;  // case-clock end of what is safely on the disk and in the ledger
  std::uint64_t refused = 0;    // connections and messages of senders who may not send (VitalSource::refused)
  unsigned stuck = 0;           // threads of its source that do not come back from its driver
  std::uint64_t given_up = 0;   // such threads since the recorder started, come back or not
  std::string input;            // what comes: "640x480 yuyv422, 30 a second, RTSP over UDP"; "" if not known
  bool is_video = true;         // else of vital signs
  bool unboxed = false;         // decoded in this process, beside its keys
  std::string profile;          // of pictures: in which form they are archived now
  std::string profile_to_come;  // was asked for, and begins with the next picture; "": none
  double raw_bytes_per_second = 0;  // of its pictures as they come, uncompressed; 0 before the first
  std::uint64_t elsewhere = 0;      // messages of other places, which are not recorded
};
struct SessionStatus {
  std::int64_t now_ns = 0;
  bool begun = false;           // there is a case
  std::int64_t begins_ns = 0;   // where it begins on the case clock
  std::int64_t decided_ns = 0;  // when begin() was called
  std::vector<StreamStatus> streams;
  std::uint64_t tokens = 0, missed = 0;
  std::vector<AuthorityStatus> authorities;
  std::string last_problem;  // latest sentence a person should see, "" if none
};

struct SessionResult {
  std::string case_id;  // "": no case had begun, what was recorded is discarded
  std::filesystem::path folder;
  std::int64_t duration_ns = 0;
  std::string close_reason;
  SessionStatus last;
};

class Session {
 public:
  /// Opens every source and probes it, then makes the case (with SessionOptions::pre_roll: a folder for what
  /// may become one). Throws kiroku::Error (source absent, picture wider than the encoder can, …); no case is
  /// left behind then.
  explicit Session(SessionOptions options);
  ~Session();
  /// Of the case, once there is one.
  [[nodiscard]] std::string case_id() const;
  [[nodiscard]] std::filesystem::path folder() const;
  /// With SessionOptions::pre_roll, while run() runs: makes a case of what is recorded and returns its
  /// identifier. `subject` is JSON to be sealed with it, `plan` and `identity` as in SessionOptions. From any
  /// thread. Throws UsageError if there is one already, kiroku::Error if it cannot be made: then recording
  /// ahead goes on.
  std::string begin(std::optional<Bytes> subject, const std::optional<crypto::Sha256Digest>& plan = {},
                    const CaseIdentity& identity = {});
  /// With SessionOptions::pre_roll: what was recorded ahead before `since_boot` (Clock::since_boot()) becomes
  /// part of no case; segments end there. Returns at once; is_forgotten() once nothing open reaches back
  /// before the last of these: a case that begins sooner loses what follows in the segments that do. The case
  /// and the appliance log state what is left out. By the thread that calls begin().
  void forget_before(Clock::Duration since_boot);
  [[nodiscard]] bool is_forgotten() const;
  /// Records until stop(), the duration, or the end of the sources (of all video; of the vital signs where
  /// there is no video); closes the case properly; returns. `progress` about four times a second.
  /// `closing` once, when that is over: what follows waits for disks and for authorities.
  SessionResult run(const std::function<void(const SessionStatus&)>& progress = {},
                    const std::function<void()>& closing = {});
  /// From any thread or a signal handler; the close reason is "operator".
  void stop() noexcept;
  /// The same with another close reason. From any thread; the first reason stands.
  void stop(const std::string& reason);
  /// Whether the case says that its plan is another patient's (kPlanOfAnother). From any thread.
  [[nodiscard]] bool has_plan_of_another() const;
  /// What run() tells its `progress`. From any thread.
  [[nodiscard]] SessionStatus status() const;
  /// An operator's mark: sealed in the events stream, committed to in the ledger. From any thread. Throws
  /// kiroku::Error before a case has begun and after it has ended.
  void mark(const std::string& text);
  /// Somebody points on a live picture (pointing_lane.h). From any thread; never waits for a disk. The time
  /// it has in the case; nothing where no case runs, or SessionOptions::pointing was not asked for.
  std::optional<std::int64_t> point(media::PointedAt at);
  /// The same for what is known of the patient and the procedure only after the case had begun: JSON as of
  /// SessionOptions::subject, and a sentence on why nothing is known (nothing of a patient in it).
  void late_subject(const Bytes& json, std::vector<PatientNumber> patient_numbers = {});
  void subject_missing(const std::string& why);
  /// Something names another patient than the case is about; a sentence without anything of a patient.
  void patient_differs(const std::string& how);
  /// From the next picture on, with which a segment begins, streams are archived in another form; no picture
  /// is lost or stands there twice. Where that form cannot hold a stream's pictures it goes on as it was,
  /// which is told (SessionStatus::last_problem) and an event. From any thread. Throws kiroku::UsageError for
  /// a stream that is none of pictures, or where each has that form already; kiroku::Error before a case has
  /// begun and after it has ended.
  void change_profile(const ProfileDecision& decision);
  /// The same, and also where nothing changes: then the decision is an event alone.
  void decide_profile(const ProfileDecision& decision);
  /// A decision that changes nothing, as an event: `why` says what it would have been.
  void profile_unchanged(const std::string& why);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
