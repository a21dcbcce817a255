#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <system_error>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/camera_look.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/group_advice.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/monitor_watch.h"
#include "base/error.h"
#include "base/joined.h"
#include "recorder/control/control_client.h"
#include "recorder/devices/plugged_devices.h"
#include "recorder/source/source_address.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr const char* kSoundAdvice =
    "Sound is recorded beside the pictures of a [[room.stream]]. A network camera or a file that carries its "
    "own needs audio = true in the place of this.";
constexpr const char* kSerialAdvice =
    "A serial port is not recorded. Monitors are read by HL7 over the network (MLLP): let the monitor, or "
    "its "
    "gateway, deliver to this machine.";

struct Request {
  std::optional<std::string> home, stills, monitors;
  std::string how_long = "30s";
  std::vector<std::string> cameras;
  bool force = false, json = false;
};

std::atomic<bool> told_to_end = false;

/// What kiroku.toml records, where there is one.
struct Recorded {
  struct Stream {
    std::string room, name, source, stated;
    bool is_video = true;
    std::string microphone = {};
  };
  std::vector<Stream> streams;
  std::string problem;         // why kiroku.toml could not be read; "" where it could
  std::optional<json> status;  // of kirokud, where it runs

  /// "or-1/endoscope" of a device; "" where no stream is recorded from it.
  [[nodiscard]] std::string stream_of(const recorder::CameraNode& camera) const {
    for (const Stream& stream : streams) {
      const auto address = recorder::parse_source_address(stream.source, recorder::Presence::kNotLookedAt);
      std::error_code failed;
      if (stream.is_video && (address.location == camera.node || address.location == camera.lasting ||
                              fs::equivalent(address.location, camera.node, failed))) {
        return stream.room + "/" + stream.name;
      }
    }
    return "";
  }
  /// The same of a sound card, by the card and device that the names of ALSA's state.
  [[nodiscard]] std::string stream_of(const recorder::SoundInput& sound) const {
    const std::string device = sound.device.substr(sound.device.find(':'));
    for (const Stream& stream : streams) {
      const std::size_t at = stream.microphone.find(device);
      if (at == std::string::npos) continue;
      const std::size_t end = at + device.size();
      if (end == stream.microphone.size() || stream.microphone[end] == '?')
        return stream.room + "/" + stream.name;
    }
    return "";
  }
  /// What kirokud says of a stream; "" where it says nothing.
  [[nodiscard]] std::string state_of(const Stream& stream) const {
    if (!status) return "";
    for (const json& room : (*status)["rooms"]) {
      if (room.value("room", "") != stream.room) continue;
      if (room.value("state", "") != "recording") return "not being recorded now";
      for (const json& one : room["streams"]) {
        if (one.value("name", "") == stream.name) return one.value("live", false) ? "live" : "silent";
      }
    }
    return "";
  }
};

Recorded recorded_of(const std::optional<Home>& home) {
  Recorded recorded;
  if (!home) return recorded;
  try {
    const Configuration configuration = home->configuration();
    for (const RoomConfiguration& room : configuration.rooms) {
      for (const StreamConfiguration& stream : room.streams) {
        const auto address = recorder::parse_source_address(stream.source, recorder::Presence::kNotLookedAt);
        recorded.streams.push_back(
            {room.name, stream.name, stream.source, address.stated, stream.is_video, stream.microphone});
      }
    }
    constexpr std::chrono::seconds kPatience{3};
    recorded.status =
        recorder::ask_recorder(home->control_socket(configuration), {{"do", "status"}}, kPatience);
  } catch (const recorder::NobodyAnswers&) {
  } catch (const Error& error) {
    recorded.problem = error.what();
  }
  return recorded;
}

/// One camera, and its still where one is wanted.
struct Camera {
  CameraLook look;
  std::string stream;  // that is recorded from it
  std::optional<Still> still;
};

class Listing {
 public:
  Listing(const Request& request, Recorded recorded) : request_(request), recorded_(std::move(recorded)) {}

  void look() {
    std::vector<recorder::CameraNode> nodes;
    if (request_.cameras.empty()) {
      nodes = recorder::camera_nodes();
    } else {
      for (const std::string& named : request_.cameras) nodes.push_back({named, "", ""});
    }
    if (request_.stills) fs::create_directories(*request_.stills);
    for (const recorder::CameraNode& node : nodes) {
      Camera camera{look_at_camera(node), recorded_.stream_of(node), {}};
      if (request_.stills && !camera.look.source.empty()) take(camera);
      cameras_.push_back(std::move(camera));
    }
    if (!request_.cameras.empty()) return;
    sound_ = recorder::sound_inputs();
    serial_ = recorder::serial_ports();
  }

  void hear() {
    if (!request_.monitors) return;
    const std::chrono::nanoseconds how_long = parse_duration(request_.how_long, "--for");
    heard_ = listen_for_monitors(
        *request_.monitors, how_long,
        [](const std::string& sentence) { std::cerr << printable(sentence) + "\n"
                                                    << std::flush; },
        [] { return told_to_end.load(); });
  }

  /// Whether something that was asked for could not be done.
  [[nodiscard]] bool failed() const {
    for (const Camera& camera : cameras_) {
      const bool asked_for = request_.stills || !request_.cameras.empty();
      if (asked_for && !camera.look.problem.empty()) return true;
    }
    return false;
  }

  [[nodiscard]] ordered_json as_json() const {
    ordered_json cameras = ordered_json::array(), sound = ordered_json::array(),
                 serial = ordered_json::array(), monitors = ordered_json::array();
    for (const Camera& camera : cameras_) cameras.push_back(json_of(camera));
    for (const recorder::SoundInput& one : sound_) {
      sound.push_back({{"node", one.node},
                       {"device", one.device},
                       {"name", one.name},
                       {"microphone", microphone_of(one)},
                       {"stream", recorded_.stream_of(one)}});
    }
    for (const recorder::SerialPort& one : serial_) {
      serial.push_back({{"node", one.node}, {"lasting", one.lasting}, {"name", one.name}});
    }
    for (const Recorded::Stream& stream : recorded_.streams) {
      if (stream.is_video) continue;
      monitors.push_back({{"stream", stream.room + "/" + stream.name},
                          {"source", stream.stated},
                          {"state", recorded_.state_of(stream)}});
    }
    ordered_json all{{"cameras", cameras}, {"sound", sound}, {"serial", serial}, {"monitors", monitors}};
    if (heard_) {
      ordered_json heard = ordered_json::array();
      for (const HeardMonitor& one : heard_->monitors) {
        heard.push_back({{"address", one.address},
                         {"sender", one.sender},
                         {"messages", one.messages},
                         {"types", one.types},
                         {"quantities", one.quantities},
                         {"places", one.places},
                         {"problem", one.problem},
                         {"source", source_for(one, heard_->listened_at)}});
      }
      all["heard"] = {{"at", heard_->listened_at}, {"monitors", std::move(heard)}};
    }
    if (!recorded_.problem.empty()) all["configuration_problem"] = recorded_.problem;
    return all;
  }

  void print() const {
    if (!recorded_.problem.empty()) std::cout << paint(Colour::kYellow, printable(recorded_.problem)) << "\n";
    print_cameras();
    if (request_.cameras.empty()) {
      print_sound();
      print_serial();
      print_monitors();
    }
    print_heard();
  }

 private:
  void take(Camera& camera) const {
    const std::string name = fs::path(camera.look.node.node).filename().string();
    try {
      camera.still =
          take_still(camera.look.source, fs::path(*request_.stills) / (name + ".png"), request_.force);
    } catch (const UsageError&) {
      throw;
    } catch (const Error& error) {
      camera.look.problem = error.what();
      camera.look.advice =
          recorded_.status && !camera.stream.empty()
              ? "kirokud runs and may hold it for " + camera.stream + ": 'kiroku status' tells how it is"
              : "look at cable and power, and whether another program has it";
    }
  }

  [[nodiscard]] static ordered_json json_of(const Camera& camera) {
    const CameraLook& look = camera.look;
    ordered_json modes = ordered_json::array();
    if (look.ability) {
      for (const recorder::CameraMode& mode : look.ability->modes) {
        modes.push_back(
            {{"format", mode.format},
             {"readable", mode.readable},
             {"width", mode.width},
             {"height", mode.height},
             {"rate", mode.rate.pictures == 0 ? ordered_json() : ordered_json(mode.rate.value())}});
      }
    }
    ordered_json one{{"node", look.node.node},
                     {"lasting", look.node.lasting},
                     {"name", look.node.name},
                     {"driver", look.ability ? look.ability->driver : ""},
                     {"bus", look.ability ? look.ability->bus : ""},
                     {"gives_pictures", look.ability ? ordered_json(look.ability->captures) : ordered_json()},
                     {"modes", std::move(modes)},
                     {"source", look.source},
                     {"stream", camera.stream},
                     {"problem", look.problem},
                     {"advice", look.advice}};
    if (camera.still) {
      one["still"] = {{"file", camera.still->file.string()},
                      {"input", camera.still->input},
                      {"remark", camera.still->remark}};
    }
    return one;
  }

  /// Of each format its sizes: "mjpeg 1920x1080 (30 a second), 1280x720 (60)".
  [[nodiscard]] static std::vector<std::string> forms_of(const recorder::CameraAbility& ability) {
    constexpr int kShown = 6;
    std::vector<std::pair<std::string, int>> forms;
    for (const recorder::CameraMode& mode : ability.modes) {
      if (forms.empty() || !forms.back().first.starts_with(mode.format + " ")) {
        forms.emplace_back(mode.format + (mode.readable ? " " : " (not read here) "), 0);
      }
      auto& [text, count] = forms.back();
      if (++count > kShown) continue;
      char rate[32] = "";
      if (mode.rate.pictures > 0) std::snprintf(rate, sizeof rate, " at %.4g", mode.rate.value());
      text +=
          (count == 1 ? "" : ", ") + std::to_string(mode.width) + "x" + std::to_string(mode.height) + rate;
    }
    std::vector<std::string> lines;
    for (const auto& [text, count] : forms) {
      lines.push_back(text + (count > kShown ? ", and " + std::to_string(count - kShown) + " more" : ""));
    }
    return lines;
  }

  static void print_line(const std::string& name, const std::string& text) {
    constexpr std::size_t kColumn = 12;
    std::cout << "    " << name << std::string(kColumn > name.size() ? kColumn - name.size() : 1, ' ')
              << printable(text) << "\n";
  }

  static void print_source(const std::string& source) {
    print_line("kiroku.toml", "source = \"" + source + "\"");
  }

  /// Through ALSA's converter: a card need not offer what is recorded.
  static std::string microphone_of(const recorder::SoundInput& sound) { return "alsa:plug" + sound.device; }

  void print_cameras() const {
    std::cout << "Cameras\n";
    bool any = false;
    for (const Camera& camera : cameras_) {
      const CameraLook& look = camera.look;
      // A camera's node for other data is of no use to anybody who looks for pictures.
      if (look.ability && !look.ability->captures && request_.cameras.empty()) continue;
      any = true;
      const bool nameless = look.node.name.empty();
      std::cout << "  " << printable(nameless ? look.node.node : look.node.name);
      if (look.ability) std::cout << " (" << printable(look.ability->driver) << ")";
      std::cout << "\n";
      if (!nameless) print_line("now at", look.node.node);
      if (!look.node.lasting.empty()) print_line("always at", look.node.lasting);
      if (look.ability && !look.ability->captures) print_line("gives", "no pictures through this node");
      if (look.ability) {
        for (const std::string& form : forms_of(*look.ability)) print_line("gives", form);
      }
      if (!camera.stream.empty()) print_line("recorded as", camera.stream);
      if (!look.source.empty()) print_source(look.source);
      if (camera.still) {
        print_line("still", camera.still->file.string() + ": " + camera.still->input);
        if (!camera.still->remark.empty()) print_line("", camera.still->remark);
      }
      if (!look.problem.empty()) {
        print_line(paint(Colour::kYellow, "problem"), look.problem);
        print_line("what to do", look.advice);
      }
    }
    if (!any) {
      std::cout << "  none: nothing is plugged in that the kernel knows as a camera (V4L2). Network cameras "
                   "are not looked for: source = \"rtsp://…\".\n";
    }
  }

  void print_sound() const {
    std::cout << "Sound\n";
    for (const recorder::SoundInput& one : sound_) {
      std::cout << "  " << printable(one.name) << "\n";
      print_line("ALSA", one.device + ", " + one.node);
      const std::string stream = recorded_.stream_of(one);
      if (!stream.empty()) print_line("recorded as", "sound of " + stream);
      print_line("kiroku.toml", "microphone = \"" + microphone_of(one) + "\"");
      print_group(one.node);
    }
    std::cout << "  " << (sound_.empty() ? "none" : kSoundAdvice) << "\n";
  }

  void print_serial() const {
    std::cout << "Serial ports\n";
    for (const recorder::SerialPort& one : serial_) {
      std::cout << "  " << printable(one.name.empty() ? one.node : one.name) << "\n";
      print_line("now at", one.node);
      if (!one.lasting.empty()) print_line("always at", one.lasting);
      print_group(one.node);
    }
    std::cout << "  " << (serial_.empty() ? "none" : kSerialAdvice) << "\n";
  }

  static void print_group(const std::string& node) {
    const auto group = group_advice(node);
    if (!group) return;
    print_line(paint(Colour::kYellow, "problem"), group->finding);
    print_line("what to do", group->advice);
  }

  void print_monitors() const {
    std::cout << "Monitors\n";
    bool any = false;
    for (const Recorded::Stream& stream : recorded_.streams) {
      if (stream.is_video) continue;
      any = true;
      const std::string state = recorded_.state_of(stream);
      std::cout << "  " << printable(stream.room + "/" + stream.name + ": " + stream.stated)
                << (state.empty() ? "" : ", " + state) << "\n";
    }
    if (!any) std::cout << "  kiroku.toml names none.\n";
    if (!request_.monitors) {
      std::cout << "  To see who sends: kiroku devices --monitors mllp://0.0.0.0:2575\n";
    }
  }

  void print_heard() const {
    if (!heard_) return;
    std::cout << "Heard at " << printable(heard_->listened_at) << "\n";
    if (heard_->monitors.empty()) {
      std::cout
          << "  nobody: let the monitor deliver HL7 (MLLP) to this machine's address and this port, and "
             "open the firewall for it.\n";
    }
    for (const HeardMonitor& one : heard_->monitors) {
      std::cout << "  " << printable(one.address + (one.sender.empty() ? "" : ", " + one.sender)) << "\n";
      if (one.messages > 0) {
        print_line("sent", std::to_string(one.messages) + " messages, " + joined(one.types));
        if (!one.quantities.empty()) print_line("of", joined(one.quantities));
        if (!one.places.empty()) print_line("places", joined(one.places));
        print_source(source_for(one, heard_->listened_at));
        if (one.places.size() > 1) {
          print_line("what to do", "add &locations= with the places of this room, or every bed is recorded");
        }
      }
      if (!one.problem.empty()) print_line(paint(Colour::kYellow, "problem"), one.problem);
    }
  }

  const Request& request_;
  Recorded recorded_;
  std::vector<Camera> cameras_;
  std::vector<recorder::SoundInput> sound_;
  std::vector<recorder::SerialPort> serial_;
  std::optional<HeardMonitors> heard_;
};

int run(const Request& request) {
  if (request.force && !request.stills) throw UsageError("--force goes with --stills");
  struct sigaction action {};
  action.sa_handler = [](int) { told_to_end = true; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // who asks twice is obeyed at once
  if (request.monitors) ::sigaction(SIGINT, &action, nullptr);
  Listing listing(request, recorded_of(Home::find(request.home)));
  listing.look();
  listing.hear();
  if (request.json) {
    print_json(listing.as_json());
  } else {
    listing.print();
  }
  return listing.failed() ? kAnswerIsNo : kDone;
}

}  // namespace

void add_devices_command(Command& program) {
  Command& command = program.add_command("devices", "lists cameras, sound, serial ports and monitors found");
  const auto request = std::make_shared<Request>();
  command.option("--camera", "DEVICE", request->cameras, "looks at this camera alone");
  command.option("--stills", "FOLDER", request->stills, "writes a picture of each camera into it, as PNG");
  command.writes("--stills");
  command.flag("--force", request->force, "replaces stills that are there");
  command.option("--monitors", "ADDRESS", request->monitors,
                 "waits at mllp://ADDRESS:PORT for monitors and tells who sends");
  command.option("--for", "T", request->how_long, duration_help("how long"));
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Says of each camera what it can give and what to put into kiroku.toml, likewise of each sound card, "
      "which rooms of the home record it, and which group is missing where it may not be opened. A camera "
      "that is in use can be listed, and "
      "as a rule gives no still.");
  command.explain(
      "--monitors lets everybody connect unless the address has allow=. Nothing that comes is kept, and "
      "nothing is acknowledged, so that monitors send it again. No patient is named. Ctrl-C ends it early.");
  command.explain("Exit status 1 if a camera that was asked for, or its still, could not be had.");
  command.example("kiroku devices --stills looks", "what is plugged in, and what each camera sees");
  command.example("kiroku devices --monitors mllp://0.0.0.0:2575 --for 2m",
                  "which monitors send to this machine");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
