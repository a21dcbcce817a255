#include "recorder/daemon/daemon.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <sstream>
#include <sys/statvfs.h>
#include <system_error>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "recorder/clock/clock_watch.h"
#include "recorder/control/plan_patient.h"
#include "recorder/daemon/disk_hours.h"

namespace kiroku::recorder {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

// A room that records or waits does something several times a second; opening sources and closing a case wait
// for networks, each with its own time limit.
constexpr std::chrono::seconds kLongestSilence{30};
constexpr std::chrono::minutes kLongestTransition{10};
constexpr double kNanosecondsPerMillisecond = 1e6;

struct DiskState {
  std::uint64_t free_bytes = 0, total_bytes = 0;
};

/// Nothing where it cannot be asked, with a sentence that says why: rooms are told of, started and stopped
/// all the same.
std::optional<DiskState> disk_of(const std::filesystem::path& folder, std::string* why = nullptr) {
  struct statvfs disk {};
  if (::statvfs(folder.c_str(), &disk) != 0) {
    if (why != nullptr) {
      *why = "the archive " + folder.string() +
             " cannot be looked at: " + std::generic_category().message(errno) +
             "; what is recorded may not reach it: see whether its disk is there and mounted";
    }
    return {};
  }
  return DiskState{std::uint64_t(disk.f_bavail) * disk.f_frsize,
                   std::uint64_t(disk.f_blocks) * disk.f_frsize};
}

std::optional<ConfiguredRate> configured_bytes_per_second(const RoomPlan& plan) {
  std::vector<ConfiguredVideo> videos;
  for (const StreamRequest& stream : plan.session.video) videos.push_back({stream.video, stream.source});
  return configured_bytes_per_second(videos);
}

ordered_json stream_json(const StreamStatus& stream, std::int64_t now_ns) {
  const auto milliseconds_since = [now_ns](std::int64_t then_ns) {
    return static_cast<double>(std::max<std::int64_t>(0, now_ns - then_ns)) / kNanosecondsPerMillisecond;
  };
  return {{"name", stream.name},
          {"kind", stream.is_video ? "video" : "vitals"},
          {"live", stream.live},
          {"frames", stream.frames},
          {"dropped", stream.dropped},
          {"refused", stream.refused},
          {"elsewhere", stream.elsewhere},
          {"segments", stream.segments},
          {"bytes", stream.bytes},
          {"age_ms", std::llround(milliseconds_since(stream.last_ns))},
          {"durable_age_ms", std::llround(milliseconds_since(stream.durable_ns))},
          {"input", stream.input},
          {"unboxed", stream.unboxed},
          {"profile", stream.profile},
          {"profile_to_come", stream.profile_to_come},
          {"stuck", stream.stuck},
          {"given_up", stream.given_up}};
}

/// "path" is over which the latest token came; "not_shared", why it is not one that rooms share though it
/// should be; "left_alone_ms", until it may be asked again, is 0 where it may.
ordered_json authority_json(const AuthorityStatus& authority) {
  ordered_json out{{"name", authority.name},
                   {"path", authority.path},
                   {"failures", authority.failures},
                   {"last_error", authority.last_error},
                   {"not_shared", authority.not_shared},
                   {"last_token", nullptr},
                   {"left_alone_ms", std::chrono::ceil<std::chrono::milliseconds>(authority.pause).count()}};
  if (authority.last_token) out["last_token"] = format_utc(*authority.last_token);
  return out;
}

/// Whether a case would be cut by ending now.
bool is_busy(RoomState state) { return state != RoomState::kIdle && state != RoomState::kStandby; }

/// A label's value in Prometheus' text format.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string required_text(const json& request, const char* key) {
  const auto found = request.find(key);
  if (found == request.end() || !found->is_string() || found->get_ref<const std::string&>().empty()) {
    throw UsageError(std::string("the request needs a text \"") + key + "\"");
  }
  return found->get<std::string>();
}

/// The case that a request means; "": whichever runs.
std::string meant_case(const json& request) {
  return request.contains("case") ? required_text(request, "case") : std::string();
}

/// The hash of the sealed plan that the case follows.
std::optional<crypto::Sha256Digest> sealed_plan_of(const json& request) {
  if (!request.contains("plan")) return {};
  const auto bytes = crypto::from_hex(required_text(request, "plan"));
  crypto::Sha256Digest digest{};
  if (!bytes || bytes->size() != digest.size())
    throw UsageError("\"plan\" must be the hash of a sealed plan: 64 hexadecimal digits");
  std::ranges::copy(*bytes, digest.begin());
  return digest;
}

/// Whose CT that plan was made on, as whoever has its files says.
std::vector<std::string> plan_patients_of(const json& request) {
  const auto found = request.find("plan_patients");
  if (found == request.end()) return {};
  const auto is_number = [](const json& each) {
    return each.is_string() && each.get_ref<const std::string&>().size() <= kLongestPlanPatient;
  };
  if (!found->is_array() || found->size() > kMostPlanPatients || !std::ranges::all_of(*found, is_number))
    throw UsageError("\"plan_patients\" must be the numbers of patients, each a short text");
  return found->get<std::vector<std::string>>();
}

/// What a case is about, as a request says it: the object itself, or which of the room's procedures was
/// chosen.
std::optional<Bytes> subject_of(const json& request, const Room& room) {
  if (const auto found = request.find("subject"); found != request.end()) {
    if (!found->is_object()) throw UsageError("\"subject\" must be a JSON object");
    return to_bytes(bytes_of(found->dump()));
  }
  if (!request.contains("procedure")) return {};
  const std::string key = required_text(request, "procedure");
  for (ProcedureData& data : room.procedures()) {
    if (key_of(data) != key) continue;
    const std::string by = request.value("by", std::string());
    data.chosen += "; chosen from the list" + (by.empty() ? "" : " by " + by);
    return subject_json(data);
  }
  throw UsageError(
      "this procedure is not on the list any more, or was changed there: look at the list again");
}

ProfileDecision profile_decision_of(const json& request) {
  ProfileDecision decision;
  const std::string asked = required_text(request, "profile");
  const auto profile = parse_profile(asked);
  if (!profile) throw UsageError("'" + asked + "' is no profile: it must be mpeg2, uncompressed or lossless");
  decision.profile = *profile;
  if (request.contains("stream")) decision.streams = {required_text(request, "stream")};
  if (request.contains("why")) decision.why = required_text(request, "why");
  decision.by = request.contains("by") ? required_text(request, "by") : "operator";
  return decision;
}

ordered_json procedures_json(const Room& room) {
  ordered_json all = ordered_json::array();
  for (const ProcedureData& data : room.procedures()) {
    all.push_back({{"key", key_of(data)}, {"subject", ordered_json::parse(text_of(subject_json(data)))}});
  }
  ordered_json ways = ordered_json::array();
  for (const ProcedureWay& way : room.status().procedure) {
    ways.push_back({{"name", way.name}, {"well", way.well}, {"state", way.state}});
  }
  return {{"room", room.name()}, {"procedures", std::move(all)}, {"ways", std::move(ways)}};
}

}  // namespace

struct Daemon::State {
  explicit State(DaemonOptions asked) : options(std::move(asked)), began(options.time->now()) {
    for (RoomPlan& plan : options.rooms) {
      configured.push_back(configured_bytes_per_second(plan));
      RoomListener listener;
      const std::string prefix = "room " + plan.name + ": ";
      listener.closed = options.listener.closed;
      listener.note = [this, prefix](const std::string& sentence) {
        if (options.listener.note) options.listener.note(prefix + sentence);
      };
      listener.warn = [this, prefix](const std::string& sentence) {
        if (options.listener.warn) options.listener.warn(prefix + sentence);
      };
      listener.left = [this, prefix](const std::string& sentence) {
        if (options.listener.left) options.listener.left(prefix + sentence);
      };
      const std::vector<FootswitchOptions> switches = std::move(plan.footswitches);
      rooms.push_back(std::make_unique<Room>(std::move(plan), std::move(listener), *options.time));
      for (const FootswitchOptions& one : switches) {
        Room& its_room = *rooms.back();
        const auto tell = [this, prefix](const std::string& sentence) {
          if (options.listener.warn) options.listener.warn(prefix + sentence);
        };
        footswitches.emplace_back(its_room.name(), std::make_unique<Footswitch>(
                                                       one,
                                                       [this, &its_room, one](std::chrono::nanoseconds ago) {
                                                         act_on_press(its_room, one, ago);
                                                       },
                                                       tell, *options.time));
      }
    }
    options.rooms.clear();
  }
  ~State() {
    // A press may wait for that.
    for (const std::unique_ptr<Room>& room : rooms) room->may_begin_again();
    footswitches.clear();
    close();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void close() {
    // All at once: closing waits for time-stamping authorities.
    std::vector<std::thread> closers;
    for (const std::unique_ptr<Room>& room : rooms) {
      closers.emplace_back([&room] { room->shut_down(); });
    }
    for (std::thread& closer : closers) closer.join();
  }

  /// It is for the case that ran when it was pressed, and for none that has begun since.
  void act_on_press(Room& room, const FootswitchOptions& asked, std::chrono::nanoseconds ago) const {
    const RoomStatus now = room.status();
    const bool has_case = now.state == RoomState::kRecording || now.state == RoomState::kClosing;
    const std::string meant = has_case ? now.case_id : "";
    if (has_case && options.time->now() - now.begun_at < ago) {
      throw UsageError("it was pressed before case " + now.case_id + " of room " + room.name() + " began");
    }
    const bool toggles = asked.action == PressAction::kStartStop;
    // Whoever presses at the moment when a rule begins a case wants one, and has one.
    if (toggles && now.state == RoomState::kStarting && !now.tries_again)
      throw UsageError("room " + room.name() + " is just beginning a case");
    // An operation that the recorder goes on with by itself is running as far as anybody at the table knows.
    const bool starts =
        asked.action == PressAction::kStart || (toggles && !is_busy(now.state) && !now.tries_again);
    const bool is_of_a_case = asked.action == PressAction::kMark || asked.action == PressAction::kProfile;
    // One that begins in this moment is not what was meant.
    if (is_of_a_case && !has_case) throw UsageError("room " + room.name() + " is not recording");
    if (asked.action == PressAction::kMark) {
      room.mark(asked.mark, meant);
    } else if (asked.action == PressAction::kProfile) {
      room.change_profile({asked.streams, asked.profile, "footswitch", ""}, meant);
    } else if (starts) {
      room.start("footswitch");
    } else {
      // And none that begins before that one was ended.
      room.stop("footswitch", false, meant);
    }
  }

  Room& room(const std::string& name) {
    for (const std::unique_ptr<Room>& one : rooms) {
      if (one->name() == name) return *one;
    }
    std::string known;
    for (const std::unique_ptr<Room>& one : rooms) known += (known.empty() ? "" : ", ") + one->name();
    throw UsageError("there is no room named '" + name + "'; there are: " + known);
  }
  Room& room(const json& request) {
    if (!request.contains("room") && rooms.size() == 1) return *rooms.front();
    if (!request.contains("room")) throw UsageError("there are several rooms: say which one");
    return room(required_text(request, "room"));
  }

  /// Of this moment.
  [[nodiscard]] DiskHours hours_left(const DiskState& disk) const {
    std::vector<RoomRate> rates;
    for (std::size_t i = 0; i < rooms.size(); ++i) {
      const RoomStatus status = rooms[i]->status();
      rates.push_back(
          rate_of(rooms[i]->name(), status.bytes_per_second, status.last_bytes_per_second, configured[i]));
    }
    return disk_hours(disk.free_bytes, rates);
  }

  /// What a room will write now that its profile was changed, before it is measured: where the disk is full
  /// soon, a sentence. "" where it is not, or nobody can tell.
  [[nodiscard]] std::string disk_warning(const Room& changed) const {
    double rate = 0;
    for (const std::unique_ptr<Room>& one : rooms) {
      const RoomStatus status = one->status();
      rate += one.get() == &changed ? bytes_per_second_to_come(status.session) : status.bytes_per_second;
    }
    const std::optional<DiskState> disk = disk_of(options.archive);
    if (rate <= 0 || !disk) return "";
    constexpr double kSecondsPerHour = 3600;
    const double hours = static_cast<double>(disk->free_bytes) / rate / kSecondsPerHour;
    if (hours >= options.warn_below_hours) return "";
    std::ostringstream sentence;
    sentence.precision(2);
    sentence << "with this profile the disk of " << options.archive.string() << " is full in about " << hours
             << " hours: make room, or change back in time";
    if (options.listener.warn) options.listener.warn("room " + changed.name() + ": " + sentence.str());
    return sentence.str();
  }

  /// Null where it cannot be asked, and `why`.
  [[nodiscard]] ordered_json disk_json(std::string& why) const {
    const std::optional<DiskState> disk = disk_of(options.archive, &why);
    if (!disk) return nullptr;
    ordered_json out{{"folder", options.archive.string()},
                     {"free_bytes", disk->free_bytes},
                     {"total_bytes", disk->total_bytes},
                     {"hours_left", nullptr},
                     {"hours_at_most", false},
                     {"hours_assume", ""}};
    const DiskHours left = hours_left(*disk);
    if (left.hours) out["hours_left"] = std::round(*left.hours * 10) / 10;
    out["hours_at_most"] = left.hours && left.are_at_most;
    out["hours_assume"] = left.assumes;
    return out;
  }

  static ordered_json clock_json() {
    const CaseClock now;
    const auto state = ClockWatch(now).check();
    return {{"synchronised", state->synchronised},
            {"offset_ns", state->offset_ns},
            {"error_ns", state->error_ns}};
  }

  static ordered_json room_json(const RoomStatus& status) {
    ordered_json streams = ordered_json::array();
    for (const StreamStatus& stream : status.session.streams) {
      streams.push_back(stream_json(stream, status.session.now_ns));
    }
    ordered_json authorities = ordered_json::array();
    for (const AuthorityStatus& authority : status.session.authorities) {
      authorities.push_back(authority_json(authority));
    }
    ordered_json procedure = ordered_json::array();
    for (const ProcedureWay& way : status.procedure) {
      procedure.push_back({{"name", way.name}, {"well", way.well}, {"state", way.state}});
    }
    return {{"room", status.name},
            {"state", state_name(status.state)},
            {"case", status.case_id},
            {"reason", status.reason},
            {"carries_on", status.carries_on},
            {"resumed", status.resumed},
            {"not_resumed", status.not_resumed},
            {"ended_by_error", status.ended_by_error},
            {"tries_again", status.tries_again},
            {"subject", subject_state_name(status.subject)},
            {"profile_rule", status.profile_rule},
            {"procedure", procedure},
            {"elapsed_ns", status.session.now_ns - status.session.begins_ns},
            {"now_ns", status.session.now_ns},
            {"streams", streams},
            {"tokens", status.session.tokens},
            {"missed", status.session.missed},
            {"authorities", authorities},
            {"bytes_per_second", std::llround(status.bytes_per_second)},
            {"cases", status.cases},
            {"problem", status.problem}};
  }

  [[nodiscard]] ordered_json footswitches_json(const std::string& room) const {
    ordered_json out = ordered_json::array();
    for (const auto& [its_room, footswitch] : footswitches) {
      if (its_room != room) continue;
      const FootswitchStatus status = footswitch->status();
      out.push_back({{"device", status.device},
                     {"well", status.well},
                     {"state", status.state},
                     {"presses", status.presses}});
    }
    return out;
  }

  [[nodiscard]] std::vector<std::string> problems() const {
    const std::lock_guard guard(problems_mutex);
    return options.problems;
  }

  [[nodiscard]] std::vector<std::string> remarks() const {
    const std::lock_guard guard(problems_mutex);
    return options.remarks;
  }

  [[nodiscard]] ordered_json status() const {
    ordered_json all = ordered_json::array();
    for (const std::unique_ptr<Room>& one : rooms) {
      all.push_back(room_json(one->status()));
      all.back()["footswitches"] = footswitches_json(one->name());
    }
    const std::chrono::duration<double> up = options.time->now() - began;
    std::string no_disk;
    ordered_json disk = disk_json(no_disk);
    std::vector<std::string> all_problems = problems();
    if (!no_disk.empty()) all_problems.push_back(no_disk);
    return {{"rooms", all},
            {"disk", std::move(disk)},
            {"clock", clock_json()},
            {"uptime_s", std::llround(up.count())},
            {"problems", all_problems},
            {"remarks", remarks()},
            {"hardware_silent", options.hardware_silent ? options.hardware_silent() : std::string()}};
  }

  DaemonOptions options;
  const Clock::Time began;
  std::vector<std::optional<ConfiguredRate>> configured;
  std::vector<std::unique_ptr<Room>> rooms;
  std::vector<std::pair<std::string, std::unique_ptr<Footswitch>>> footswitches;  // by room; use the rooms
  mutable std::mutex problems_mutex;  // of the options' problems and remarks
  std::mutex disk_mutex;
  bool warned_of_disk = false, told_of_no_disk = false;
};

Daemon::Daemon(DaemonOptions options) : state_(std::make_unique<State>(std::move(options))) {}
Daemon::~Daemon() = default;
void Daemon::close() { state_->close(); }

void Daemon::add_problem(const std::string& sentence) {
  const std::lock_guard guard(state_->problems_mutex);
  state_->options.problems.push_back(sentence);
}

void Daemon::remove_problem(const std::string& sentence) {
  const std::lock_guard guard(state_->problems_mutex);
  std::erase(state_->options.problems, sentence);
}

void Daemon::add_remark(const std::string& sentence) {
  const std::lock_guard guard(state_->problems_mutex);
  state_->options.remarks.push_back(sentence);
}

ordered_json Daemon::handle(const json& request) {
  const std::string what = required_text(request, "do");
  if (what == "status") return state_->status();
  Room& room = state_->room(request);
  if (what == "start") {
    if (request.contains("case"))
      throw UsageError("\"case\" names one that runs, and a start begins another: leave it out");
    std::optional<Bytes> subject = subject_of(request, room);
    const std::optional<crypto::Sha256Digest> plan = sealed_plan_of(request);
    ordered_json reply{{"room", room.name()},
                       {"case", room.start("operator", std::move(subject), plan, plan_patients_of(request))}};
    if (room.status().has_plan_of_another) reply["warning"] = kPlanOfAnother;
    return reply;
  }
  if (what == "subject") {
    const std::optional<Bytes> subject = subject_of(request, room);
    if (!subject) throw UsageError("the request needs a \"subject\" or a \"procedure\"");
    return {{"room", room.name()}, {"case", room.add_subject(*subject, meant_case(request))}};
  }
  if (what == "procedures") return procedures_json(room);
  if (what == "stop") {
    return {{"room", room.name()},
            {"case", room.stop("operator", request.value("wait", true), meant_case(request))}};
  }
  if (what == "profile") {
    ordered_json reply{{"room", room.name()},
                       {"case", room.change_profile(profile_decision_of(request), meant_case(request))}};
    if (const std::string warning = state_->disk_warning(room); !warning.empty()) reply["warning"] = warning;
    return reply;
  }
  if (what == "mark") {
    return {{"room", room.name()}, {"case", room.mark(required_text(request, "text"), meant_case(request))}};
  }
  throw UsageError(
      "'" + what +
      "' is nothing a recorder can do: status, start, stop, mark, profile, subject or procedures");
}

ordered_json Daemon::hook(const std::string& name, const std::string& action, const std::string& body,
                          const std::string& meant) {
  Room& room = state_->room(name);
  if (action == "start") {
    if (!meant.empty())
      throw UsageError("a case names one that runs, and a start begins another: leave it out");
    return {{"case", room.start("hook")}};
  }
  if (action == "stop") return {{"case", room.stop("hook", false, meant)}};
  if (body.empty()) throw UsageError("the body must hold the text of the mark");
  return {{"case", room.mark(body, meant)}};
}

std::string Daemon::running_case(const std::string& room) const { return state_->room(room).running_case(); }

std::optional<std::int64_t> Daemon::now_ns(const std::string& room) const {
  const RoomStatus status = state_->room(room).status();
  if (status.state != RoomState::kRecording) return std::nullopt;
  return status.session.now_ns;
}

std::optional<std::int64_t> Daemon::point(const std::string& room, media::PointedAt at,
                                          const std::string& meant) {
  return state_->room(room).point(std::move(at), meant);
}

std::string Daemon::metrics() const {
  std::ostringstream out;
  const auto family = [&out](const char* name, const char* type, const char* help) {
    out << "# HELP " << name << ' ' << help << "\n# TYPE " << name << ' ' << type << "\n";
  };
  std::vector<RoomStatus> rooms;
  for (const std::unique_ptr<Room>& room : state_->rooms) rooms.push_back(room->status());
  const auto per_room = [&](const char* name, const char* type, const char* help, const auto& value) {
    family(name, type, help);
    for (const RoomStatus& room : rooms)
      out << name << "{room=" << quoted(room.name) << "} " << value(room) << "\n";
  };
  const auto per_stream = [&](const char* name, const char* type, const char* help, const auto& value) {
    family(name, type, help);
    for (const RoomStatus& room : rooms) {
      for (const StreamStatus& stream : room.session.streams) {
        out << name << "{room=" << quoted(room.name) << ",stream=" << quoted(stream.name) << "} "
            << value(stream) << "\n";
      }
    }
  };
  per_room("kiroku_room_recording", "gauge", "1 while a case is recorded",
           [](const RoomStatus& room) { return room.state == RoomState::kRecording ? 1 : 0; });
  per_room("kiroku_room_cases_total", "counter", "Cases ended since the recorder started",
           [](const RoomStatus& room) { return room.cases; });
  per_room("kiroku_room_resumed_total", "counter",
           "Cases that carry on one which was cut off, since the recorder started",
           [](const RoomStatus& room) { return room.resumed; });
  per_room("kiroku_room_not_resumed", "gauge",
           "1 while a case that was cut off is not carried on, until another one begins",
           [](const RoomStatus& room) { return room.not_resumed ? 1 : 0; });
  per_room("kiroku_room_ended_by_error", "gauge",
           "1 while nothing is recorded since an error or a full disk ended the last case",
           [](const RoomStatus& room) { return room.ended_by_error ? 1 : 0; });
  per_room("kiroku_case_tokens", "gauge", "Time-stamp tokens of the newest case",
           [](const RoomStatus& room) { return room.session.tokens; });
  per_room("kiroku_case_tokens_missed", "gauge",
           "Time-stamps that an authority did not give, of the newest case",
           [](const RoomStatus& room) { return room.session.missed; });
  per_stream("kiroku_stream_live", "gauge", "1 while the source delivers",
             [](const StreamStatus& stream) { return stream.live ? 1 : 0; });
  per_stream("kiroku_stream_frames", "gauge", "Frames or samples recorded in the newest case",
             [](const StreamStatus& stream) { return stream.frames; });
  per_stream("kiroku_stream_dropped", "gauge", "Frames lost in the newest case",
             [](const StreamStatus& stream) { return stream.dropped; });
  per_stream("kiroku_stream_refused", "gauge",
             "Connections and messages refused because of who sent them, in the newest case",
             [](const StreamStatus& stream) { return stream.refused; });
  per_stream("kiroku_stream_elsewhere", "gauge",
             "Messages of other places that were not recorded, in the newest case",
             [](const StreamStatus& stream) { return stream.elsewhere; });
  per_stream("kiroku_stream_bytes", "gauge", "Sealed bytes of the newest case",
             [](const StreamStatus& stream) { return stream.bytes; });
  per_stream("kiroku_stream_unboxed", "gauge",
             "1 where the source is decoded in the recorder itself, beside the device key",
             [](const StreamStatus& stream) { return stream.unboxed ? 1 : 0; });
  per_stream("kiroku_source_threads_stuck", "gauge",
             "Threads of the source that do not come back from its driver",
             [](const StreamStatus& stream) { return stream.stuck; });
  per_stream("kiroku_source_threads_given_up_total", "counter",
             "Threads of the source that were left behind in its driver since the recorder started",
             [](const StreamStatus& stream) { return stream.given_up; });
  const std::optional<DiskState> disk = disk_of(state_->options.archive);
  family("kiroku_archive_gone", "gauge", "1 while the archive cannot be looked at");
  out << "kiroku_archive_gone " << (disk ? 0 : 1) << "\n";
  if (disk) {
    family("kiroku_disk_free_bytes", "gauge", "Free space of the archive's disk");
    out << "kiroku_disk_free_bytes " << disk->free_bytes << "\n";
    if (const auto hours = state_->hours_left(*disk).hours) {
      family("kiroku_disk_hours_left", "gauge",
             "Hours until the disk is full if every room records, at most");
      out << "kiroku_disk_hours_left " << *hours << "\n";
    }
  }
  family("kiroku_problems", "gauge", "What recording goes on without: 'kiroku status' says each");
  out << "kiroku_problems " << state_->problems().size() + (disk ? 0 : 1) << "\n";
  family("kiroku_remarks", "gauge",
         "What a person should know, and nothing is missing for: 'kiroku status' says each");
  out << "kiroku_remarks " << state_->remarks().size() << "\n";
  const CaseClock now;
  family("kiroku_clock_synchronised", "gauge", "1 while the kernel says that the wall clock is synchronised");
  out << "kiroku_clock_synchronised " << (ClockWatch(now).check()->synchronised ? 1 : 0) << "\n";
  if (state_->options.hardware_silent) {
    family("kiroku_hardware_silent", "gauge",
           "1 while the device's key in hardware does not sign, so that what is recorded is unproven");
    out << "kiroku_hardware_silent " << (state_->options.hardware_silent().empty() ? 0 : 1) << "\n";
  }
  return out.str();
}

void Daemon::watch_disk() {
  std::string why;
  const std::optional<DiskState> disk = disk_of(state_->options.archive, &why);
  const DiskHours left = disk ? state_->hours_left(*disk) : DiskHours{};
  const std::optional<double> hours = left.hours;
  const std::lock_guard guard(state_->disk_mutex);
  if (std::exchange(state_->told_of_no_disk, !disk) != !disk && state_->options.listener.warn)
    state_->options.listener.warn(disk ? "the archive can be looked at again" : why);
  if (!disk) return;
  const bool low = is_short(left, disk->free_bytes, state_->rooms.size(), state_->options.warn_below_hours);
  if (low && !state_->warned_of_disk && state_->options.listener.warn) {
    std::ostringstream sentence;
    sentence.precision(2);
    sentence << "the disk of " << state_->options.archive.string();
    if (hours) {
      sentence << " is full in " << (left.are_at_most ? "at most " : "") << *hours << " hours of recording ("
               << left.assumes << ")";
    } else {
      sentence << " has little space, and nobody knows for how long: " << left.assumes;
    }
    sentence << ": make room, or replicate and erase what may be erased";
    state_->options.listener.warn(sentence.str());
  }
  state_->warned_of_disk = low;
}

bool Daemon::healthy() const {
  const Clock& time = *state_->options.time;
  return std::all_of(state_->rooms.begin(), state_->rooms.end(), [&](const std::unique_ptr<Room>& room) {
    const RoomState state = room->status().state;
    const bool in_transition = state == RoomState::kStarting || state == RoomState::kClosing;
    const Clock::Duration silence = time.now() - room->heartbeat();
    return in_transition ? silence < kLongestTransition : silence < kLongestSilence;
  });
}

bool Daemon::begin_no_more() {
  auto kept_off = state_->rooms.begin();
  while (kept_off != state_->rooms.end() && (*kept_off)->begin_no_more()) ++kept_off;
  if (kept_off == state_->rooms.end()) return true;
  while (kept_off != state_->rooms.begin()) (*--kept_off)->may_begin_again();
  return false;
}

bool Daemon::recording() const {
  return std::any_of(state_->rooms.begin(), state_->rooms.end(), [](const std::unique_ptr<Room>& room) {
    const RoomStatus now = room->status();
    return is_busy(now.state) || now.tries_again;
  });
}

}  // namespace kiroku::recorder
