#include <algorithm>
#include <atomic>
#include <csignal>
#include <initializer_list>
#include <iostream>
#include <memory>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/case_recording.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/recording_display.h"
#include "apps/kiroku/recording_setup.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "recorder/control/plan_patient.h"
#include "recorder/procedure/worklist.h"
#include "recorder/session.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> home, endoscope, room, fluoroscopy, vitals, profile, duration, subject, segment,
      stamp_every, bit_rate, chroma, plan, worklist, microphone;
  std::vector<std::string> authorities, recipients_for, also;
  bool audio = false, deinterlace = false, json = false;
};

// --- Ctrl-C: once closes the case, twice ends at once. The handler may touch nothing but these.
std::atomic<recorder::Session*> running{nullptr};
std::atomic<int> stops{0};
std::atomic<bool> must_stop{false};  // as SessionOptions::cancelled

/// Which session the handler may stop.
struct Running {
  explicit Running(recorder::Session& session) { running = &session; }
  ~Running() { running = nullptr; }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
};

void write_from_handler(std::string_view text) { (void)!::write(STDERR_FILENO, text.data(), text.size()); }

void on_stop(int /*signal*/) {
  constexpr int kInterrupted = 130;
  if (stops.fetch_add(1) > 0) ::_exit(kInterrupted);
  write_from_handler("\nkiroku: closing the case; Ctrl-C again ends at once and leaves it unclosed\n");
  must_stop = true;
  if (recorder::Session* session = running.load()) session->stop();
}

void catch_stops() {
  struct sigaction stop {};
  stop.sa_handler = on_stop;
  stop.sa_flags = SA_RESTART;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &stop, nullptr);
  // A recording must not die because nobody reads its messages any more.
  ::signal(SIGPIPE, SIG_IGN);
}

recorder::VideoProfile video_profile(const Request& request, const Configuration& configuration) {
  recorder::VideoProfile video = default_video_profile(configuration);
  if (request.profile) video.profile = *recorder::parse_profile(*request.profile);
  if (request.bit_rate) video.bit_rate = parse_bit_rate(*request.bit_rate, "--bitrate");
  if (request.chroma) video.chroma_422 = *request.chroma == "422";
  if (request.deinterlace) video.deinterlace = true;
  if (request.audio) video.audio = true;
  return video;
}

Bytes load_subject(const std::string& file) {
  Bytes bytes = read_small_file(file, "the subject");
  const auto parsed = parse_foreign_json(text_of(bytes));
  if (!parsed.is_object()) {
    throw UsageError("the subject " + file +
                     " is no JSON object: write {\"patient\": {...}, \"procedure\": \"...\"}");
  }
  return bytes;
}

/// [room.procedure.worklist] of one [[room]].
const recorder::WorklistOptions& worklist_of(const Configuration& configuration, const std::string& room) {
  std::string with_worklist;
  for (const RoomConfiguration& each : configuration.rooms) {
    if (!each.procedure.worklist) continue;
    if (each.name == room) return *each.procedure.worklist;
    with_worklist += (with_worklist.empty() ? "" : ", ") + each.name;
  }
  throw UsageError("--worklist is '" + room +
                   "', and no [[room]] of that name has a [room.procedure.worklist] in kiroku.toml" +
                   (with_worklist.empty() ? "" : ": these have one: " + with_worklist));
}

/// What the person in front of the terminal compares with the patient on the table.
std::string in_words(const recorder::ProcedureData& data) {
  std::string text = data.patient.as_sent;
  for (const auto& [label, value] : {std::pair{"born ", &data.birth_date},
                                     {"number ", &data.patient_id},
                                     {"", &data.description},
                                     {"planned ", &data.planned}}) {
    if (!value->empty()) text += (text.empty() ? "" : ", ") + std::string(label) + *value;
  }
  return text;
}

/// The step of the worklist that is to be done now, as a subject. A worklist that does not answer holds up no
/// recording.
std::optional<Bytes> listed_subject(const recorder::WorklistOptions& worklist) {
  const UtcTime now = utc_now();
  const recorder::WorklistAnswer answer = recorder::ask_worklist(worklist, now);
  std::string problem = answer.problem;
  if (problem.empty()) {
    if (const auto data = recorder::nearest_step(answer, now, now, worklist.window)) {
      std::cerr << "from the worklist: " << printable(in_words(*data)) << std::endl;
      return recorder::subject_json(*data);
    }
    const std::string left_out = recorder::left_out_of(answer);
    const recorder::Doubt doubt = recorder::doubt_of(answer, now, worklist.window);
    problem =
        (doubt == recorder::Doubt::kTwoPlanned ? "the worklist lists two patients equally near to now ("
         : doubt == recorder::Doubt::kTooEarly
             ? "the worklist lists nothing before more than an hour from now ("
         : doubt == recorder::Doubt::kTimeUnclear
             ? "the worklist may plan a patient for now whose time it does not state, or not so that it "
               "can be read ("
             : "the worklist lists nothing that can be taken for now (") +
        std::to_string(answer.items.size()) + " steps of these days" +
        (left_out.empty() ? "" : "; " + left_out) + ")";
  }
  print_error("kiroku", "warning: " + problem + "; recording without patient and procedure");
  return {};
}

/// By the rules of kiroku.toml that are for every room.
void choose_profile(recorder::SessionOptions& options, const Configuration& configuration) {
  std::vector<std::string> names;
  for (const recorder::StreamRequest& stream : options.video) names.push_back(stream.name);
  const auto choice = recorder::choose_profile(profile_rules_for(configuration, "", names), *options.subject);
  if (!choice) return;
  const recorder::ProfileRule& rule = choice->rule;
  options.profile_decisions = {{rule.streams, rule.profile, "rule " + rule.name, choice->why}};
  apply_decision(options.profile_decisions.front(), options.video);
  std::cerr << "rule " << rule.name << " archives pictures as " << recorder::profile_name(rule.profile)
            << std::endl;
}

/// `text` is --also STREAM=PROFILE.
void add_second(std::vector<recorder::StreamRequest>& streams, const std::string& text) {
  const std::size_t split = text.find('=');
  const auto first = std::ranges::find(streams, text.substr(0, split), &recorder::StreamRequest::name);
  if (split == std::string::npos || first == streams.end() || !first->second_of.empty()) {
    throw UsageError("--also is '" + text +
                     "': write which pictures, of those that are recorded, and in which form: "
                     "endoscope=lossless");
  }
  const auto profile = recorder::parse_profile(text.substr(split + 1));
  if (!profile) {
    throw UsageError("--also is '" + text + "': the form must be mpeg2, uncompressed or lossless");
  }
  if (first->video.profile == *profile) {
    throw UsageError("--also is '" + text + "', as which these pictures are archived already");
  }
  recorder::StreamRequest second = recorder::second_of(*first, *profile);
  if (std::ranges::find(streams, second.name, &recorder::StreamRequest::name) != streams.end()) {
    throw UsageError("--also is '" + text + "' twice");
  }
  streams.push_back(std::move(second));
}

recorder::SessionOptions session_options(const Request& request, const Home& home,
                                         const Configuration& configuration) {
  recorder::SessionOptions options;
  RecipientChoice recipients(home, configuration, request.recipients_for);
  const recorder::VideoProfile video = video_profile(request, configuration);
  const auto add = [&](std::vector<recorder::StreamRequest>& to, const char* name,
                       const std::optional<std::string>& source) {
    if (!source) return;
    to.push_back({name, *source, name, video, recipients.of(name)});
    to.back().guard =
        guard_for(configuration, [](const std::string& sentence) { print_error("kiroku", sentence); });
  };
  add(options.video, "endoscope", request.endoscope);
  add(options.video, "room", request.room);
  add(options.video, "fluoroscopy", request.fluoroscopy);
  add(options.vitals, "vitals", request.vitals);
  for (const std::string& also : request.also) add_second(options.video, also);
  options.event_recipients = recipients.of(kEventsRecipients);
  recipients.require_all_used(request.recipients_for);
  if (request.microphone) {
    if (options.video.empty()) {
      throw UsageError("--microphone needs pictures beside which its sound stands: --room or --endoscope");
    }
    const auto room =
        std::find_if(options.video.begin(), options.video.end(),
                     [](const recorder::StreamRequest& stream) { return stream.name == "room"; });
    (room == options.video.end() ? options.video.front() : *room).microphone = *request.microphone;
  }
  options.archive = home.archive();
  options.search = search_notes_of(home, configuration, [](const std::string& sentence) {
    print_error("kiroku", "warning: " + sentence);
  });
  options.device_name = home.device().name();
  if (request.subject) options.subject = load_subject(*request.subject);
  if (request.worklist) options.subject = listed_subject(worklist_of(configuration, *request.worklist));
  if (options.subject && !request.profile) choose_profile(options, configuration);
  if (request.plan) {
    options.plan = require_sealed(home, *request.plan);
    options.identity.plan_patients = recorder::patients_of_plan(*request.plan);
  }
  options.segment_duration =
      request.segment ? parse_segment_duration(*request.segment, "--segment") : configuration.segment;
  options.stamp_interval = request.stamp_every ? parse_stamp_interval(*request.stamp_every, "--stamp-every")
                                               : configuration.stamp_every;
  if (request.duration) options.duration = parse_duration(*request.duration, "--duration");
  return options;
}

ordered_json result_json(const recorder::SessionResult& result) {
  ordered_json streams = ordered_json::array();
  for (const auto& stream : result.last.streams) {
    streams.push_back({{"name", stream.name},
                       {"frames", stream.frames},
                       {"dropped", stream.dropped},
                       {"segments", stream.segments},
                       {"bytes", stream.bytes}});
  }
  ordered_json authorities = ordered_json::array();
  for (const auto& authority : result.last.authorities) {
    authorities.push_back({{"name", authority.name},
                           {"path", authority.path},
                           {"failures", authority.failures},
                           {"last_error", authority.last_error},
                           {"not_shared", authority.not_shared}});
  }
  return {{"case", result.folder.string()},
          {"id", result.case_id},
          {"duration_ns", result.duration_ns},
          {"reason", result.close_reason},
          {"streams", streams},
          {"tokens", result.last.tokens},
          {"missed", result.last.missed},
          {"authorities", authorities},
          {"last_problem", result.last.last_problem}};
}

void print_summary(const recorder::SessionResult& result) {
  std::cerr << "recorded " << format_duration(result.duration_ns) << ":";
  for (const auto& stream : result.last.streams) {
    std::cerr << "  " << stream.name << " " << stream.frames << " (" << stream.dropped << " lost, "
              << format_bytes(stream.bytes) << ")";
  }
  std::cerr << "  time-stamps " << result.last.tokens;
  if (result.last.missed > 0) std::cerr << " (" << result.last.missed << " missed)";
  std::cerr << std::endl;
}

/// A recording that ended by itself before it should have: the case is closed, but the person must know.
int status_of(const recorder::SessionResult& result) {
  const std::string& reason = result.close_reason;
  if (reason == "disk-full") {
    print_error(
        "kiroku",
        "the disk is full: the case was closed early with what is there; make room before recording on");
    return kRefused;
  }
  if (reason.starts_with("error: ")) {
    print_error("kiroku", "the recording ended early and was closed with what is there: " + reason.substr(7));
    return kRefused;
  }
  return kDone;
}

int run(const Request& request) {
  if (!request.endoscope && !request.room && !request.fluoroscopy && !request.vitals) {
    throw UsageError(
        "there is nothing to record: name a source with --endoscope, --room, --fluoroscopy or --vitals");
  }
  if (request.subject && request.worklist) {
    throw UsageError("patient and procedure come from --subject or from --worklist, not from both");
  }
  const Home home = Home::open(request.home);
  recorder::SessionOptions options = session_options(request, home, home.configuration());
  const recorder::SessionResult result =
      record_case(home, std::move(options), request.authorities, [](recorder::SessionOptions complete) {
        catch_stops();
        complete.cancelled = &must_stop;
        recorder::Session session(std::move(complete));
        const Running now(session);
        if (stops > 0) session.stop();
        RecordingDisplay display;
        display.tell(session.status());
        recorder::SessionResult recorded = session.run([&](const recorder::SessionStatus& status) {
          if (stops == 0) display.show(status);
        });
        display.tell(recorded.last);
        return recorded;
      });
  if (request.json) {
    print_json(result_json(result));
  } else {
    print_summary(result);
    std::cout << printable(result.folder.string()) << "\n";
  }
  return status_of(result);
}

}  // namespace

void add_record_command(Command& program) {
  Command& command = program.add_command("record", "records one procedure until its end or Ctrl-C");
  const auto request = std::make_shared<Request>();
  command.option("--endoscope", "SRC", request->endoscope, "the endoscope's picture");
  command.option("--room", "SRC", request->room, "the room's picture");
  command.option("--fluoroscopy", "SRC", request->fluoroscopy, "the fluoroscope's picture");
  command.option(
      "--vitals", "SRC", request->vitals,
      "the patient's vital signs: mllp://ADDRESS:PORT where monitors deliver HL7, a file, synthetic:patient");
  command.option("--duration", "T", request->duration, duration_help("ends by itself after"), "until Ctrl-C");
  command.option("--subject", "FILE", request->subject,
                 "JSON about patient, procedure and staff, to be sealed with the case");
  command.option("--worklist", "ROOM", request->worklist,
                 "asks the DICOM worklist of this room of kiroku.toml for patient and procedure");
  command.option(
      "--plan", "SEAL", request->plan,
      "the sealed plan that is carried out (kiroku plan seal); the case names it in its first entry");
  command.choice("--profile", {"mpeg2", "uncompressed", "lossless"}, request->profile,
                 "how pictures are archived", "kiroku.toml's, mpeg2 at first");
  command.option("--also", "STREAM=PROFILE", request->also,
                 "archives the pictures of a stream a second time, in another form: endoscope=lossless is "
                 "the stream endoscope-lossless");
  command.option("--bitrate", "RATE", request->bit_rate, "bits a second of one MPEG-2 stream",
                 "kiroku.toml's, 4M at first");
  command.choice("--chroma", {"420", "422"}, request->chroma, "colour resolution of MPEG-2",
                 "kiroku.toml's, 420 at first");
  command.flag("--audio", request->audio, "records sound where a source has it");
  command.option(
      "--microphone", "ALSA", request->microphone,
      "sound of an ALSA device, such as alsa:hw:1,0, beside the pictures of --room, else of the first "
      "camera");
  command.flag("--deinterlace", request->deinterlace, "takes interlacing out before encoding");
  command.option("--segment", "T", request->segment, "length of one sealed file, 500ms to 9s",
                 "kiroku.toml's, 2s at first");
  command.option("--stamp-every", "T", request->stamp_every, "how often a time-stamp is asked for",
                 "kiroku.toml's, 60s at first");
  command.option("--authority", "NAME", request->authorities, "asks only this authority of kiroku.toml");
  command.option("--recipients-for", "STREAM=FILE", request->recipients_for,
                 "seals one stream to the recipients in FILE instead of recipients.txt");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object at the end instead");
  command.explain(
      "SRC is a device (/dev/video0), rtsp://, srt:// or udp:// address, a film played at its own speed "
      "(film.mp4, "
      "film.mp4?loop=1, film.mp4?speed=max), or synthetic:endoscope, synthetic:room; for vital signs a .csv "
      "file (time, "
      "code, value, unit) or synthetic:patient.");
  command.explain(
      "Ctrl-C closes the case properly; a second one ends at once and leaves it unclosed. The case folder is "
      "printed on "
      "standard output. Exit status: 0 recorded, 2 refused, or closed early because the disk was full.");
  command.example(
      "kiroku record --endoscope synthetic:endoscope --room synthetic:room --vitals synthetic:patient "
      "--duration 20s",
      "twenty seconds without any camera");
  command.example(
      "kiroku record --endoscope /dev/video0 --room rtsp://camera.local/stream --subject patient.json",
      "a procedure, until Ctrl-C");
  command.example("kiroku record --endoscope /dev/video0 --worklist or-1",
                  "the same, with patient and procedure from the hospital's worklist");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
