#include "recorder/session.h"

#include <algorithm>
#include <fstream>
#include <thread>

#include "base/error.h"
#include "recorder/events_lane.h"
#include "recorder/scribe.h"
#include "recorder/video_lane.h"
#include "recorder/vitals_lane.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::milliseconds kProgressInterval{250};
constexpr std::int64_t kGraceNs = 1'000'000'000;
constexpr const char* kEventsStream = "events";

std::string boot_id() {
  std::ifstream in("/proc/sys/kernel/random/boot_id");
  std::string id;
  std::getline(in, id);
  return id;
}

std::vector<std::string> names_of(const crypto::AgeRecipients& recipients) {
  std::vector<std::string> names;
  for (const auto& recipient : recipients) names.push_back(recipient->to_string());
  return names;
}

archive::StreamInfo stream_info(const StreamRequest& request, const SourceAddress& address, bool video) {
  archive::StreamInfo info;
  info.name = request.name;
  info.kind = video ? "video" : "vitals";
  info.media = video ? std::string(request.video.media()) : "application/jsonl";
  info.source = address.stated;
  info.profile = video ? std::string(profile_name(request.video.profile)) : "jsonl";
  info.purpose = request.purpose;
  info.recipients = names_of(request.recipients);
  info.timing = address.unpaced() ? "source" : "arrival";
  return info;
}

}  // namespace

struct Session::State {
  explicit State(SessionOptions asked)
      : options(std::move(asked)),
        files(options.files == nullptr ? archive::real_file_system() : *options.files) {
    if (options.video.empty() && options.vitals.empty())
      throw UsageError("nothing to record: give at least one source");
    if (options.segment_duration < std::chrono::milliseconds(100) ||
        options.segment_duration > std::chrono::seconds(10)) {
      throw UsageError("a segment must last from 0.1 to 10 seconds");
    }
    // Sources first: what cannot be opened must not leave a case behind.
    struct OpenedVideo {
      SourceAddress address;
      std::unique_ptr<Source> source;
    };
    struct OpenedVitals {
      SourceAddress address;
      std::unique_ptr<VitalSource> source;
    };
    std::vector<OpenedVideo> videos;
    std::vector<OpenedVitals> vitals;
    archive::CaseWriter::Options writing;
    for (const StreamRequest& request : options.video) {
      OpenedVideo opened{parse_source_address(request.source), {}};
      opened.source = open_source(opened.address, clock);
      require_end(opened.address);
      // Tried once, so that a picture too large for the encoder is refused now and not in the first second.
      (void)VideoEncoder(opened.source->format(), opened.source->frame_rate(), request.video);
      writing.streams.push_back(stream_info(request, opened.address, true));
      writing.stream_recipients.push_back(request.recipients);
      videos.push_back(std::move(opened));
    }
    for (const StreamRequest& request : options.vitals) {
      OpenedVitals opened{parse_source_address(request.source), {}};
      opened.source = open_vital_source(opened.address);
      require_end(opened.address);
      writing.streams.push_back(stream_info(request, opened.address, false));
      writing.stream_recipients.push_back(request.recipients);
      vitals.push_back(std::move(opened));
    }
    archive::StreamInfo events_info;
    events_info.name = events_info.kind = kEventsStream;
    events_info.media = "application/jsonl";
    events_info.source = "operator";
    events_info.profile = "jsonl";
    events_info.purpose = "marks of the operator";
    events_info.recipients = names_of(options.event_recipients);
    writing.streams.push_back(std::move(events_info));
    writing.stream_recipients.push_back(options.event_recipients);

    writing.archive = options.archive;
    writing.key = options.key;
    writing.device_name = options.device_name;
    writing.subject = options.subject;
    writing.subject_recipients = options.event_recipients;
    writing.boot_id = boot_id();
    writing.log = options.log;
    clock.restart();
    writer = archive::CaseWriter::create(files, writing, clock.moment());

    if (options.duration) end_ns = options.duration->count();
    const LaneContext context{clock, *writer, facts, troubles, options.segment_duration, end_ns};
    const std::size_t budget = options.queue_bytes / std::max<std::size_t>(1, videos.size());
    std::size_t index = 0;
    for (OpenedVideo& opened : videos) {
      lanes.push_back(std::make_unique<VideoLane>(context, index, writing.streams[index], opened.address,
                                                  std::move(opened.source), options.video[index].video,
                                                  budget));
      ++index;
    }
    video_lanes = lanes.size();
    for (OpenedVitals& opened : vitals) {
      lanes.push_back(std::make_unique<VitalsLane>(context, index, writing.streams[index], opened.address,
                                                   std::move(opened.source)));
      ++index;
    }
    events = std::make_unique<EventsLane>(context, index, writing.streams[index]);
    stamper = std::make_unique<Stamper>(options.authorities, options.trust, facts);
    scribe = std::make_unique<Scribe>(*writer, facts, clock, troubles, *stamper, options.stamp_interval);
    all_unpaced = std::all_of(writing.streams.begin(), writing.streams.end() - 1,
                              [](const archive::StreamInfo& info) { return info.timing == "source"; });
  }

  void require_end(const SourceAddress& address) const {
    if (address.unpaced() && !options.duration &&
        (address.kind == SourceKind::kSynthetic || address.option("loop", "0") == "1")) {
      throw UsageError("source '" + address.stated +
                       "' never ends and goes as fast as it can; say when to stop with --duration");
    }
  }

  [[nodiscard]] SessionStatus status() const {
    SessionStatus status;
    status.now_ns = clock.now_ns();
    for (const auto& lane : lanes) {
      const LaneStatus l = lane->status();
      status.streams.push_back({lane->name(), l.live, l.frames, l.dropped, l.segments, l.bytes});
    }
    status.tokens = scribe->tokens();
    status.missed = scribe->missed();
    status.last_problem = troubles.latest();
    return status;
  }

  /// Why the session must end now; "" while it must not.
  [[nodiscard]] std::string reason_to_end() const {
    if (stopping) return "operator";
    if (std::string trouble = troubles.close_reason(); !trouble.empty()) return trouble;
    // Sources end by their own times at the duration; one that sends nothing is ended by the clock.
    if (end_ns && !all_unpaced && clock.now_ns() >= *end_ns + kGraceNs) return "duration";
    const std::size_t deciding = video_lanes > 0 ? video_lanes : lanes.size();
    const bool over = std::all_of(lanes.begin(), lanes.begin() + static_cast<std::ptrdiff_t>(deciding),
                                  [](const auto& lane) { return lane->ended(); });
    if (!over) return "";
    if (!end_ns) return "sources-ended";
    // The other streams go on to the duration.
    const bool all_over =
        std::all_of(lanes.begin(), lanes.end(), [](const auto& lane) { return lane->ended(); });
    const bool time_is_up = !all_unpaced && clock.now_ns() >= *end_ns;
    if (!all_over && !time_is_up) return "";
    return reached_duration() ? "duration" : "sources-ended";
  }

  [[nodiscard]] bool reached_duration() const {
    if (!all_unpaced) return clock.now_ns() >= *end_ns;
    std::int64_t last = 0;
    for (const auto& lane : lanes) last = std::max(last, lane->status().last_ns);
    return last + kGraceNs >= *end_ns;
  }

  SessionOptions options;
  archive::FileSystem& files;
  CaseClock clock;
  FactQueue facts;
  Troubles troubles;
  std::optional<std::int64_t> end_ns;
  std::unique_ptr<archive::CaseWriter> writer;
  std::vector<std::unique_ptr<Lane>> lanes;  // video first
  std::size_t video_lanes = 0;
  bool all_unpaced = false;
  std::unique_ptr<EventsLane> events;
  std::unique_ptr<Stamper> stamper;
  std::unique_ptr<Scribe> scribe;
  std::atomic<bool> stopping = false;
};

Session::Session(SessionOptions options) : state_(std::make_unique<State>(std::move(options))) {}

Session::~Session() = default;

const std::string& Session::case_id() const { return state_->writer->case_id(); }

const std::filesystem::path& Session::folder() const { return state_->writer->folder(); }

SessionResult Session::run(const std::function<void(const SessionStatus&)>& progress) {
  State& s = *state_;
  s.scribe->start();
  for (const auto& lane : s.lanes) lane->start();
  std::string reason;
  std::int64_t next_progress_ns = 0;
  std::int64_t next_events_ns = s.options.segment_duration.count();
  while ((reason = s.reason_to_end()).empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const std::int64_t now = s.clock.now_ns();
    if (now >= next_events_ns) {
      s.events->step(now);
      next_events_ns = next_boundary(now, s.options.segment_duration);
    }
    if (progress && now >= next_progress_ns) {
      progress(s.status());
      next_progress_ns = now + std::chrono::nanoseconds(kProgressInterval).count();
    }
  }
  for (const auto& lane : s.lanes) lane->stop();
  const std::int64_t close_ns = s.clock.now_ns();
  for (const auto& lane : s.lanes) lane->finish(close_ns);
  s.events->finish(close_ns);
  // A write that failed while the rest was brought in changes the reason.
  if (const std::string trouble = s.troubles.close_reason(); !trouble.empty()) reason = trouble;
  s.scribe->finish(reason);

  SessionResult result;
  result.case_id = s.writer->case_id();
  result.folder = s.writer->folder();
  result.last = s.status();
  result.close_reason = reason;
  for (const auto& lane : s.lanes) result.duration_ns = std::max(result.duration_ns, lane->status().last_ns);
  return result;
}

void Session::stop() noexcept { state_->stopping = true; }

void Session::mark(const std::string& text) { state_->events->mark(text); }

}  // namespace kiroku::recorder
