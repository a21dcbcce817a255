#include "recorder/session.h"

#include <algorithm>
#include <future>
#include <map>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "recorder/events_lane.h"
#include "recorder/ledger_writer.h"
#include "recorder/pointing_lane.h"
#include "recorder/session_request.h"
#include "recorder/video_lane.h"
#include "recorder/vitals/awaited_source.h"
#include "recorder/vitals/patient_watch.h"
#include "recorder/vitals_lane.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::milliseconds kProgressInterval{250};
constexpr std::int64_t kOtherPatientEveryNs = 60'000'000'000;
constexpr std::int64_t kGraceNs = 1'000'000'000;
// Nobody waits long for what may be absent: it is tried again while the rest is recorded.
constexpr std::chrono::seconds kPatienceWithAbsent{2};
// Lines fill an age chunk in minutes, and one that is not full dies with the program: so their segments are
// shorter, and at most a second is lost.
constexpr std::chrono::nanoseconds kLongestSegmentOfLines = std::chrono::milliseconds(900);

/// So that a picture too large for the encoder is refused now and not in the first second.
void try_encoder(const Source& source, const StreamRequest& request) {
  const VideoEncoder tried(source.format(), source.frame_rate(), request.video);
}

}  // namespace

struct Session::State {
  /// What was asked for, checked and opened, before there is a case.
  struct OpenedVideo {
    SourceAddress address;
    std::unique_ptr<Source> source;      // null: absent, or another stream's
    std::unique_ptr<Source> microphone;  // null: absent, or none was asked for
  };
  explicit State(SessionOptions asked);
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void open(OpenedVideo& opened, const StreamRequest& request);
  void open_microphone(OpenedVideo& opened, const StreamRequest& request);
  void identify(const CaseIdentity& identity) {
    writing.case_id = identity.case_id;
    writing.carries_on = identity.carries_on;
    writing.sealed_subject = identity.sealed_subject;
    plan_patients = identity.plan_patients;
    search_words = identity.search_words;
    subject_of = identity.subject_of;
  }
  /// By what the case that has begun can be found, where that is known and wanted. Recording waits for none
  /// of it: what cannot be is told.
  void note_for_search();
  void note_for_search(const std::function<void(search::NoteWriter&, const std::string& case_id)>& write);
  /// Makes the case, which begins at `from_ns` of its clock.
  void make_case(std::int64_t from_ns);
  /// Says in the case, and in the appliance log, that segments recorded ahead are left out.
  void state_forgotten(const PreRoll::Amount& left_out);
  /// The case is about whoever its subject names, and these numbers.
  void expect_patient(const std::optional<Bytes>& subject, std::vector<PatientNumber> more);
  /// Says so, in the case and to people, where its plan was made on another one's CT.
  void tell_of_plan();
  /// Likewise, where monitors speak of another one.
  void tell_of_others(std::int64_t now_ns, bool at_the_end = false);
  /// Pictures of a stream are shown otherwise from now on than its first one. From any thread.
  void state_turn(const std::string& stream, const std::string& sentence);
  /// What became of them before there was a case.
  void state_turns_ahead();
  /// There was none: what was recorded ahead is discarded, and stated.
  void discard();
  LedgerWriter::Ended finish_lanes();
  [[nodiscard]] EventsLane& begun_events() const {
    if (!begun) throw UsageError("no case has begun: there is nothing to mark");
    return *events;
  }
  /// Those that a decision is about. Throws kiroku::UsageError.
  [[nodiscard]] std::vector<VideoLane*> lanes_of(const ProfileDecision& decision) const;

  [[nodiscard]] SessionStatus status() const {
    SessionStatus status;
    status.now_ns = clock.now_ns();
    const std::vector<archive::StreamTotal> gone =
        pre_roll ? pre_roll->gone() : std::vector<archive::StreamTotal>(writing.streams.size());
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      const LaneStatus l = lanes[i]->status();
      const auto kept = [](std::uint64_t all, std::uint64_t discarded) {
        return all - std::min(all, discarded);
      };
      status.streams.push_back({lanes[i]->name(), l.live, kept(l.frames, gone[i].frames),
                                kept(l.dropped, gone[i].dropped), kept(l.segments, gone[i].segments),
                                kept(l.bytes, gone[i].bytes), l.last_ns, l.durable_ns, l.refused, l.stuck,
                                l.given_up, l.input, i < video_lanes, l.unboxed, l.profile, l.profile_to_come,
                                l.raw_bytes_per_second, l.elsewhere});
    }
    status.begun = begun;
    status.begins_ns = begins_ns;
    status.decided_ns = decided_ns;
    status.tokens = ledger_writer->tokens();
    status.missed = ledger_writer->missed();
    if (begun) status.authorities = stamper->status();
    status.last_problem = problems.latest();
    return status;
  }

  /// Why the session must end now; "" while it must not.
  [[nodiscard]] std::string reason_to_end() const {
    if (stopping) {
      const std::lock_guard guard(stop_mutex);
      return stop_reason;
    }
    if (std::string trouble = problems.close_reason(); !trouble.empty()) return trouble;
    const auto has_ended = [](const auto& lane) { return lane->ended(); };
    if (!end_ns) {
      const std::size_t deciding = video_lanes > 0 ? video_lanes : lanes.size();
      const auto last = lanes.begin() + static_cast<std::ptrdiff_t>(deciding);
      return std::all_of(lanes.begin(), last, has_ended) ? "sources-ended" : "";
    }
    // Sources end by their own times when the duration is over; one that is silent is ended by the clock.
    const bool overdue = clock.now_ns() >= *end_ns + kGraceNs;
    const bool over = std::all_of(lanes.begin(), lanes.end(), [&](const auto& lane) {
      return lane->ended() || (overdue && !lane->is_unpaced());
    });
    if (!over) return "";
    const bool to_the_end = std::any_of(lanes.begin(), lanes.end(), [&](const auto& lane) {
      return lane->reached_end() || (overdue && !lane->is_unpaced());
    });
    return to_the_end ? "duration" : "sources-ended";
  }

  SessionOptions options;
  archive::FileSystem& files;
  CaseClock clock;
  SleepWatch sleeps{clock};
  FactQueue facts;
  ProblemLog problems;
  std::optional<std::int64_t> end_ns;
  archive::CaseWriter::Options writing;
  std::mutex begin_mutex;  // guards the making of the case: the next three
  std::unique_ptr<archive::CaseWriter> writer;
  std::unique_ptr<Stamper> stamper;
  std::unique_ptr<archive::StandbyFolder> standby;  // null: there is a case from the start
  std::unique_ptr<PreRoll> pre_roll;
  std::unique_ptr<SegmentStore> store;
  std::atomic<bool> begun = false;
  std::atomic<std::int64_t> begins_ns = 0, decided_ns = 0;
  std::int64_t not_before_ns = INT64_MIN;  // of what was recorded ahead
  std::uint64_t forgotten = 0;             // segments of it that were still being written then
  const std::shared_ptr<PatientWatch> patients = std::make_shared<PatientWatch>();
  std::optional<std::int64_t> others_told_ns;
  std::mutex turn_mutex;                           // guards the next
  std::map<std::string, std::string> turns_ahead;  // by stream: the last one told before the case
  std::vector<std::string> plan_patients;          // since before the case began
  std::optional<search::SearchWords> search_words;
  std::string subject_of;
  std::atomic<bool> has_plan_of_another = false;
  std::vector<std::unique_ptr<Lane>> lanes;  // video first
  std::vector<VideoLane*> of_pictures;       // of these
  std::size_t video_lanes = 0;
  std::unique_ptr<EventsLane> events;
  std::unique_ptr<PointingLane> pointing;  // null: not asked for
  std::unique_ptr<LedgerWriter> ledger_writer;
  std::atomic<bool> stopping = false;
  mutable std::mutex stop_mutex;
  std::string stop_reason = "operator";
  bool closed = false;
};

namespace {

struct OpenedVitals {
  SourceAddress address;
  std::unique_ptr<VitalSource> source;
};

}  // namespace

Session::State::State(SessionOptions asked)
    : options(std::move(asked)),
      files(options.files == nullptr ? archive::real_file_system() : *options.files),
      clock(*options.time) {
  require_valid(options);
  const auto declare = [&](archive::StreamInfo info, const crypto::AgeRecipients& recipients) {
    writing.streams.push_back(std::move(info));
    writing.stream_recipients.push_back(recipients);
  };
  // Sources first: what cannot be opened must not leave a case behind.
  std::vector<OpenedVideo> videos;
  std::vector<OpenedVitals> vitals;
  // All at once, so that slow ones do not add up.
  std::vector<std::future<OpenedVideo>> opening;
  for (const StreamRequest& request : options.video) {
    opening.push_back(std::async(std::launch::async, [this, &request] {
      if (!request.second_of.empty()) return OpenedVideo{};
      OpenedVideo opened{checked_address(request, options), {}, {}};
      open(opened, request);
      open_microphone(opened, request);
      return opened;
    }));
  }
  const auto is_cancelled = [&] { return options.cancelled != nullptr && *options.cancelled; };
  const auto require_wanted = [&] {
    if (is_cancelled()) throw Error("it was ended before its sources were open: nothing is recorded");
  };
  for (std::size_t i = 0; i < opening.size(); ++i) {
    try {
      videos.push_back(opening[i].get());
    } catch (const Error&) {
      require_wanted();
      throw;
    }
    const StreamRequest& request = options.video[i];
    if (!request.second_of.empty()) {
      const std::size_t first = index_of(options.video, request.second_of);
      videos.back().address = videos[first].address;
      try {
        if (videos[first].source) try_encoder(*videos[first].source, request);
      } catch (const Error& error) {
        if (!request.may_be_absent) throw;
        problems.report(error.what());
      }
    }
    archive::StreamInfo info = stream_info(request, videos.back().address, true);
    if (videos.back().source) info.source += ledger_text(videos.back().source->treatment());
    declare(std::move(info), request.recipients);
  }
  require_wanted();
  for (const StreamRequest& request : options.vitals) {
    OpenedVitals opened{checked_address(request, options), {}};
    try {
      opened.source = open_vital_source(opened.address, clock);
    } catch (const Error& error) {
      if (!request.may_be_absent) throw;
      problems.report(error.what());
      opened.source = await_vital_source(opened.address, clock, error.what());
    }
    opened.source->hear_patients(patients);
    declare(stream_info(request, opened.address, false), request.recipients);
    vitals.push_back(std::move(opened));
  }
  declare(events_info(options.event_recipients), options.event_recipients);
  if (options.pointing) {
    const crypto::AgeRecipients& of_pointing =
        options.pointing_recipients.empty() ? options.event_recipients : options.pointing_recipients;
    declare(pointing_info(of_pointing), of_pointing);
  }

  writing.archive = options.archive;
  writing.key = options.key;
  writing.device_name = options.device_name;
  writing.subject = options.subject;
  writing.plan = options.plan;
  identify(options.identity);
  writing.subject_recipients = options.event_recipients;
  writing.boot_id = archive::kernel_boot_id();
  writing.log = options.log;
  clock.restart();
  if (options.pre_roll) {
    standby = std::make_unique<archive::StandbyFolder>(files, options.archive, writing.streams,
                                                       writing.stream_recipients);
    pre_roll = std::make_unique<PreRoll>(*standby, writing.streams.size(), *options.pre_roll);
  }
  store = std::make_unique<SegmentStore>(standby.get(), writing.streams.size());
  ledger_writer =
      std::make_unique<LedgerWriter>(facts, clock, problems, pre_roll.get(), options.stamp_interval);
  if (!options.pre_roll) {
    make_case(0);
    expect_patient(options.subject, options.identity.patient_numbers);
  }

  if (options.duration) end_ns = options.duration->count();
  const LaneContext context{clock, sleeps, *store, facts, problems, options.segment_duration, end_ns};
  const std::chrono::nanoseconds of_lines = std::min(options.segment_duration, kLongestSegmentOfLines);
  const LaneContext lines{clock, sleeps, *store, facts, problems, of_lines, end_ns};
  const std::size_t budget = options.queue_bytes / std::max<std::size_t>(1, videos.size());
  std::size_t index = 0;
  for (OpenedVideo& opened : videos) {
    const StreamRequest& stream = options.video[index];
    std::unique_ptr<VideoLane> lane;
    if (stream.second_of.empty()) {
      lane = std::make_unique<VideoLane>(
          context, index, writing.streams[index],
          SourceSupervisor::Terms{
              opened.address, stream.video.audio, stream.tap, stream.guard, microphone_of(stream),
              stream.microphone_guard,
              [this, name = stream.name](const std::string& sentence) { state_turn(name, sentence); }},
          std::move(opened.source), stream.video, budget, std::move(opened.microphone));
    } else {
      lane = std::make_unique<VideoLane>(context, index, writing.streams[index],
                                         *of_pictures[index_of(options.video, stream.second_of)],
                                         stream.video, budget);
    }
    lane->on_profile_refused([this](const std::string& refusing, Profile wanted, const std::string& why) {
      if (begun) {
        nlohmann::ordered_json refusal;
        refusal["streams"] = nlohmann::ordered_json::array({refusing});
        refusal["refused"] = profile_name(wanted);
        refusal["why"] = why;
        events->profile(refusal);
      }
    });
    of_pictures.push_back(lane.get());
    lanes.push_back(std::move(lane));
    ++index;
  }
  video_lanes = lanes.size();
  for (OpenedVitals& opened : vitals) {
    lanes.push_back(std::make_unique<VitalsLane>(lines, index, writing.streams[index], opened.address,
                                                 std::move(opened.source),
                                                 options.vitals[index - video_lanes].vitals_tap));
    ++index;
  }
  events = std::make_unique<EventsLane>(context, index, writing.streams[index]);
  if (options.pointing) {
    ++index;
    pointing = std::make_unique<PointingLane>(context, index, writing.streams[index]);
    if (begun) pointing->begin(begins_ns);
  }
  if (begun) {
    tell_of_plan();
    for (const ProfileDecision& decision : options.profile_decisions)
      events->profile(json_of(decision, options.video));
  }
}

std::vector<VideoLane*> Session::State::lanes_of(const ProfileDecision& decision) const {
  std::vector<VideoLane*> chosen;
  if (decision.streams.empty()) {
    std::ranges::copy_if(of_pictures, std::back_inserter(chosen),
                         [](const VideoLane* lane) { return !lane->is_second(); });
  }
  for (const std::string& name : decision.streams) {
    const auto found =
        std::ranges::find_if(of_pictures, [&](const VideoLane* lane) { return lane->name() == name; });
    if (found == of_pictures.end()) {
      std::string known;
      for (const VideoLane* lane : of_pictures) known += (known.empty() ? "" : ", ") + lane->name();
      throw UsageError("'" + name + "' is no stream of pictures of this case; there are: " + known);
    }
    chosen.push_back(*found);
  }
  return chosen;
}

void Session::State::make_case(std::int64_t from_ns) {
  writing.begins_ns = from_ns;
  auto made = archive::CaseWriter::create(files, writing, clock.moment());
  Stamper::Context context{options.trust, options.queue, made->case_id(),
                           [this](const std::string& sentence) { problems.report(sentence); }};
  stamper = std::make_unique<Stamper>(options.authorities, std::move(context), facts);
  writer = std::move(made);
  std::vector<std::uint64_t> discarded(writing.streams.size());
  if (pre_roll) {
    const std::vector<archive::StreamTotal> gone = pre_roll->gone();
    for (std::size_t i = 0; i < gone.size(); ++i) discarded[i] = gone[i].segments;
  }
  forgotten = store->enter(*writer, discarded, not_before_ns);
  if (events) events->begin(from_ns);
  if (pointing) pointing->begin(from_ns);
  ledger_writer->begin_case(*writer, *stamper);
  begins_ns = from_ns;
  for (const auto& lane : lanes) lane->case_begins(from_ns);
  note_for_search();  // before a later subject can come
  begun = true;
}

void Session::State::note_for_search() {
  if (!search_words && writing.subject) search_words = search::words_of_subject(*writing.subject);
  if (search_words) {
    note_for_search(
        [&](search::NoteWriter& notes, const std::string& id) { notes.write(id, *search_words); });
  } else if (writing.sealed_subject && !subject_of.empty()) {
    note_for_search(
        [&](search::NoteWriter& notes, const std::string& id) { notes.carry_over(id, subject_of); });
  }
}

void Session::State::note_for_search(
    const std::function<void(search::NoteWriter&, const std::string& case_id)>& write) {
  if (!options.search) return;
  const std::string case_id = writer->case_id();
  try {
    write(*options.search, case_id);
  } catch (const std::exception& error) {
    problems.report("case " + case_id + " cannot be found by its patient or procedure: " + error.what());
  }
}

void Session::State::state_forgotten(const PreRoll::Amount& left_out) {
  const auto ago = std::chrono::nanoseconds(clock.now_ns() - not_before_ns);
  const UtcTime since = clock.time().utc() - std::chrono::duration_cast<UtcTime::duration>(ago);
  events->ahead_left_out("what was recorded ahead before " + format_utc(since) +
                         " is not part of the case: by then somebody came to the room, left it, or was done "
                         "with there, as messages say");
  try {
    if (options.log != nullptr) options.log->pre_roll_discarded(left_out.segments, left_out.duration_ns);
  } catch (const Error& error) {
    problems.report(std::string("the appliance log does not state what was recorded ahead of case ") +
                    writer->case_id() + " and left out: " + error.what());
  }
}

void Session::State::expect_patient(const std::optional<Bytes>& subject, std::vector<PatientNumber> more) {
  if (subject) add_numbers(more, numbers_of_subject(*subject));
  has_plan_of_another = is_ct_of_another(plan_patients, more);
  patients->expect(std::move(more), begins_ns);
}

void Session::State::state_turn(const std::string& stream, const std::string& sentence) {
  problems.report(sentence);
  const std::lock_guard guard(turn_mutex);
  turns_ahead[stream] = sentence;
  if (begun) state_turns_ahead();
}

void Session::State::state_turns_ahead() {
  for (const auto& [stream, sentence] : turns_ahead) events->picture_turn(stream, sentence);
  turns_ahead.clear();
}

void Session::State::tell_of_plan() {
  if (!has_plan_of_another) return;
  events->patient_differs(kPlanOfAnother);
  problems.report(kPlanOfAnother);
}

void Session::State::tell_of_others(std::int64_t now_ns, bool at_the_end) {
  const bool is_soon = others_told_ns && now_ns - *others_told_ns < kOtherPatientEveryNs;
  if (!begun || (is_soon && !at_the_end)) return;
  if (patients->take_others() == 0) return;
  others_told_ns = now_ns;
  const std::string sentence =
      "a monitor's messages name another patient (PID-3) than the case is about: see whether it is this "
      "room's monitor, and whether the case has the right patient";
  events->patient_differs(sentence);
  problems.report(sentence);
}

void Session::State::discard() {
  ledger_writer->abandon();
  const PreRoll::Amount amount = pre_roll->amount();
  if (options.log != nullptr) options.log->pre_roll_discarded(amount.segments, amount.duration_ns);
}

void Session::State::open_microphone(OpenedVideo& opened, const StreamRequest& request) {
  const std::optional<SourceAddress> address = microphone_of(request);
  if (!address) return;
  try {
    OpeningTerms terms;
    terms.guard = request.microphone_guard;
    terms.cancelled = options.cancelled;
    opened.microphone = open_source(*address, clock, terms);
  } catch (const UsageError&) {
    throw;
  } catch (const Error& error) {
    if (!request.may_be_absent) throw;
    problems.report(std::string(error.what()) +
                    ". Pictures are recorded without its sound until it is there");
  }
}

void Session::State::open(OpenedVideo& opened, const StreamRequest& request) {
  OpeningTerms terms;
  terms.sound = request.video.audio && request.microphone.empty();
  terms.guard = request.guard;
  terms.cancelled = options.cancelled;
  if (request.may_be_absent) terms.patience = kPatienceWithAbsent;
  try {
    opened.source = open_source(opened.address, clock, terms);
    try_encoder(*opened.source, request);
    if (const std::string remark = opened.source->remark(); !remark.empty()) problems.report(remark);
  } catch (const Error& error) {
    if (!request.may_be_absent) throw;
    problems.report(error.what());
  }
}

Session::State::~State() {
  if (closed || !ledger_writer) return;
  // Never run, or run() was left by an error: the case is still closed properly.
  try {
    const LedgerWriter::Ended ended = finish_lanes();
    if (!begun) {
      discard();
      return;
    }
    ledger_writer->finish("error: the recording was abandoned", ended);
  } catch (const std::exception&) {
    // The ledger cannot be written any more; verification says "incomplete".
    return;
  }
}

LedgerWriter::Ended Session::State::finish_lanes() {
  for (const auto& lane : lanes) lane->stop();
  const std::int64_t close_ns = clock.now_ns();
  for (const auto& lane : lanes) lane->finish(close_ns);
  tell_of_others(close_ns, true);
  events->finish(close_ns);
  if (pointing) pointing->finish(close_ns);
  LedgerWriter::Ended ended{{}, close_ns};
  for (const archive::StreamInfo& stream : writing.streams) {
    if (stream.kind != "events" && stream.timing == "arrival") ended.streams.push_back(stream.name);
  }
  return ended;
}

StreamRequest second_of(const StreamRequest& first, Profile profile) {
  StreamRequest second{second_name(first.name, profile),
                       "",
                       first.purpose,
                       first.video,
                       first.recipients,
                       first.may_be_absent};
  second.video.profile = profile;
  second.video.audio = false;
  second.second_of = first.name;
  return second;
}

void apply_decision(const ProfileDecision& decision, std::vector<StreamRequest>& streams) {
  for (StreamRequest& stream : streams) {
    const bool meant = decision.streams.empty()
                           ? stream.second_of.empty()
                           : std::ranges::find(decision.streams, stream.name) != decision.streams.end();
    if (meant) stream.video.profile = decision.profile;
  }
}

Session::Session(SessionOptions options) : state_(std::make_unique<State>(std::move(options))) {}

Session::~Session() = default;

std::string Session::case_id() const {
  const std::lock_guard guard(state_->begin_mutex);
  return state_->writer ? state_->writer->case_id() : "";
}

std::filesystem::path Session::folder() const {
  const std::lock_guard guard(state_->begin_mutex);
  return state_->writer ? state_->writer->folder() : std::filesystem::path();
}

std::string Session::begin(std::optional<Bytes> subject, const std::optional<crypto::Sha256Digest>& plan,
                           const CaseIdentity& identity) {
  State& s = *state_;
  const std::lock_guard guard(s.begin_mutex);
  if (s.writer) throw UsageError("case " + s.writer->case_id() + " has begun already");
  s.writing.subject = std::move(subject);
  s.writing.plan = plan;
  s.identify(identity);
  s.decided_ns = s.clock.now_ns();
  try {
    s.make_case(s.pre_roll->decide(s.decided_ns, s.not_before_ns));
  } catch (const std::exception&) {
    s.pre_roll->reconsider();
    throw;
  }
  s.expect_patient(s.writing.subject, identity.patient_numbers);
  s.tell_of_plan();
  {
    const std::lock_guard turns(s.turn_mutex);
    s.state_turns_ahead();
  }
  PreRoll::Amount left_out = s.pre_roll->left_out();
  left_out.segments += s.forgotten;
  if (left_out.segments > 0) s.state_forgotten(left_out);
  return s.writer->case_id();
}

void Session::forget_before(Clock::Duration since_boot) {
  State& s = *state_;
  const std::int64_t not_before_ns = s.clock.at_ns(since_boot);
  if (not_before_ns <= 0 || not_before_ns <= s.not_before_ns) return;
  s.not_before_ns = not_before_ns;
  for (const auto& lane : s.lanes) lane->split_at(not_before_ns);
}

bool Session::is_forgotten() const {
  const std::int64_t not_before_ns = state_->not_before_ns;
  return std::ranges::all_of(state_->lanes,
                             [&](const auto& lane) { return lane->is_split_at(not_before_ns); });
}

SessionResult Session::run(const std::function<void(const SessionStatus&)>& progress,
                           const std::function<void()>& closing) {
  State& s = *state_;
  s.ledger_writer->start();
  for (const auto& lane : s.lanes) lane->start();
  std::string reason;
  std::int64_t next_progress_ns = 0;
  const auto events_duration = std::min(s.options.segment_duration, kLongestSegmentOfLines);
  std::int64_t next_events_ns = events_duration.count();
  while ((reason = s.reason_to_end()).empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const std::int64_t now = s.clock.now_ns();
    if (now >= next_events_ns) {
      s.events->step(now);
      if (s.pointing) s.pointing->step(now);
      next_events_ns = next_boundary(now, events_duration);
      s.tell_of_others(now);
    }
    if (progress && now >= next_progress_ns) {
      progress(s.status());
      next_progress_ns = now + std::chrono::nanoseconds(kProgressInterval).count();
    }
  }
  if (closing) closing();
  const LedgerWriter::Ended ended = s.finish_lanes();
  // A write that failed while the rest was brought in changes the reason.
  if (const std::string trouble = s.problems.close_reason(); !trouble.empty()) reason = trouble;
  s.closed = true;
  SessionResult result;
  {
    // Nothing begins any more.
    const std::lock_guard guard(s.begin_mutex);
    if (s.begun) {
      s.ledger_writer->finish(reason, ended);
      result.case_id = s.writer->case_id();
      result.folder = s.writer->folder();
    } else {
      s.discard();
    }
  }
  result.last = s.status();
  result.close_reason = reason;
  for (const auto& lane : s.lanes) {
    result.duration_ns = std::max(result.duration_ns, lane->status().last_ns - s.begins_ns);
  }
  return result;
}

void Session::stop() noexcept { state_->stopping = true; }

void Session::stop(const std::string& reason) {
  const std::lock_guard guard(state_->stop_mutex);
  if (state_->stopping) return;
  state_->stop_reason = reason;
  state_->stopping = true;
}

bool Session::has_plan_of_another() const { return state_->has_plan_of_another; }

SessionStatus Session::status() const { return state_->status(); }

void Session::mark(const std::string& text) { state_->begun_events().mark(text); }

std::optional<std::int64_t> Session::point(media::PointedAt at) {
  return state_->pointing ? state_->pointing->add(std::move(at)) : std::nullopt;
}

void Session::late_subject(const Bytes& json, std::vector<PatientNumber> patient_numbers) {
  state_->begun_events().late_subject(json);
  state_->expect_patient(json, std::move(patient_numbers));
  state_->note_for_search([&](search::NoteWriter& notes, const std::string& case_id) {
    notes.write(case_id, search::words_of_subject(json));
  });
  state_->tell_of_plan();
}

void Session::change_profile(const ProfileDecision& decision) {
  static_cast<void>(state_->begun_events());
  ProfileDecision changing = decision;
  changing.streams.clear();
  for (const VideoLane* lane : state_->lanes_of(decision)) {
    if (lane->wanted_profile() != decision.profile) changing.streams.push_back(lane->name());
  }
  if (changing.streams.empty()) {
    throw UsageError("nothing changes: pictures are archived as " +
                     std::string(profile_name(decision.profile)) + " already");
  }
  decide_profile(changing);
}

void Session::decide_profile(const ProfileDecision& decision) {
  EventsLane& events = state_->begun_events();
  const std::vector<VideoLane*> lanes = state_->lanes_of(decision);
  // Before any picture is another.
  events.profile(json_of(decision, state_->options.video));
  for (VideoLane* lane : lanes) lane->change_profile(decision.profile);
}

void Session::profile_unchanged(const std::string& why) {
  nlohmann::ordered_json unchanged;
  unchanged["unchanged"] = true;
  unchanged["why"] = why;
  state_->begun_events().profile(unchanged);
}

void Session::subject_missing(const std::string& why) { state_->begun_events().subject_missing(why); }

void Session::patient_differs(const std::string& how) { state_->begun_events().patient_differs(how); }

}  // namespace kiroku::recorder
