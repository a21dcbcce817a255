#include <chrono>
#include <iostream>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/stream_silence.h"
#include "base/error.h"
#include "recorder/control/control_client.h"

namespace kiroku::apps {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::int64_t kNanosecondsPerMillisecond = 1'000'000;

struct Request {
  std::optional<std::string> home;
  bool watch = false, json = false;
};

std::string age(const json& stream, const char* key) {
  return format_duration(stream.value(key, std::int64_t{0}) * kNanosecondsPerMillisecond);
}

/// Which authority answers, and why another does not.
void print_authorities(const json& authorities, std::string& out) {
  std::vector<std::vector<std::string>> rows;
  for (const json& authority : authorities) {
    const bool failing = authority.value("failures", 0) > 0;
    const bool stamped = authority["last_token"].is_string();
    std::string state =
        stamped ? "last token " + printable(authority["last_token"].get<std::string>()) : "no token yet";
    if (const std::string path = authority.value("path", ""); !path.empty()) state += " " + printable(path);
    if (const std::string why = authority.value("not_shared", ""); !why.empty())
      state += "; not shared with other rooms: " + printable(why);
    if (failing) {
      const std::int64_t pause_ns =
          authority.value("left_alone_ms", std::int64_t{0}) * kNanosecondsPerMillisecond;
      state += "; " + std::to_string(authority.value("failures", 0)) + " failures in a row, asked again in " +
               format_duration(pause_ns) + ": " + printable(authority.value("last_error", ""));
    }
    rows.push_back({printable(authority.value("name", "")),
                    failing ? "FAILING" : (stamped ? "answers" : "asked"), state});
  }
  if (!rows.empty()) out += format_table(rows, "lll", 4);
}

/// What a case can be recorded without.
void print_helper(const json& helper, const std::string& name, std::string& out) {
  const std::string line = name + ": " + printable(helper.value("state", ""));
  out += "  " + (helper.value("well", false) ? line : paint(Colour::kYellow, line)) + "\n";
}

/// "mpeg2"; "mpeg2, then lossless" while the picture is awaited with which that begins.
std::string profile_text(const json& stream) {
  const std::string to_come = printable(stream.value("profile_to_come", ""));
  return printable(stream.value("profile", "")) + (to_come.empty() ? "" : ", then " + to_come);
}

void print_room(const json& room, std::string& out) {
  const std::string state = room.value("state", "");
  const bool recording = state == "recording";
  out +=
      "room " + printable(room.value("room", "")) + ": " + (recording ? paint(Colour::kGreen, state) : state);
  if (const std::string id = room.value("case", ""); !id.empty()) {
    out += recording ? "  case " + id + "  " + format_duration(room.value("elapsed_ns", std::int64_t{0}))
                     : "  last case " + id + " (" + printable(room.value("reason", "")) + ")";
  }
  out += "\n";
  if (const std::string earlier = room.value("carries_on", ""); recording && !earlier.empty()) {
    out += "  carries on case " + printable(earlier) + ", which was cut off\n";
  }
  if (room.value("not_resumed", false)) {
    out += "  " + paint(Colour::kRed, "a case was cut off and is not carried on: nothing is recorded here") +
           "\n";
  }
  const bool tries_again = room.value("tries_again", false);
  if (room.value("ended_by_error", false)) {
    const std::string what_follows =
        tries_again
            ? "another one begins by itself as soon as that works, and takes the patient over; 'kiroku "
              "case stop' ends the operation"
            : "begin another one where the operation goes on";
    out += "  " + paint(Colour::kRed, "an error ended the case: nothing is recorded here; " + what_follows) +
           "\n";
  } else if (tries_again) {
    out += "  " +
           paint(Colour::kRed,
                 "a case was cut off: nothing is recorded here; another one carries it on as soon as that "
                 "works; 'kiroku case stop' ends the operation") +
           "\n";
  }
  if (holds_sources(state)) {
    std::vector<std::vector<std::string>> rows{
        {"stream", "", "as", "recorded", "lost", "segments", "size", "last", "on disk to"}};
    for (const json& stream : room["streams"]) {
      const bool is_live = stream.value("live", false) && !is_silent(stream);
      rows.push_back({printable(stream.value("name", "")), is_live ? "live" : "SILENT", profile_text(stream),
                      std::to_string(stream.value("frames", 0)), std::to_string(stream.value("dropped", 0)),
                      std::to_string(stream.value("segments", 0)), format_bytes(stream.value("bytes", 0ULL)),
                      age(stream, "age_ms") + " ago", age(stream, "durable_age_ms") + " ago"});
    }
    out += format_table(rows, "lllrrrrrr", 2);
    if (const std::string rule = room.value("profile_rule", ""); recording && !rule.empty())
      out += "  profile chosen by rule " + printable(rule) + "\n";
    for (const json& stream : room["streams"]) {
      if (const auto refused = stream.value("refused", std::uint64_t{0}); refused > 0) {
        out += "  " +
               paint(Colour::kYellow, printable(stream.value("name", "")) + ": " + std::to_string(refused) +
                                          " connections and messages refused, of senders who may not send") +
               "\n";
      }
    }
    for (const json& stream : room["streams"]) {
      if (const auto elsewhere = stream.value("elsewhere", std::uint64_t{0}); elsewhere > 0) {
        out += "  " + printable(stream.value("name", "")) + ": " + std::to_string(elsewhere) +
               " messages of other places not recorded\n";
      }
    }
    for (const json& stream : room["streams"]) {
      if (!stream.value("unboxed", false)) continue;
      out +=
          "  " +
          paint(Colour::kRed, printable(stream.value("name", "")) +
                                  ": decoded without a box, beside the device key; kiroku doctor says why") +
          "\n";
    }
  }
  if (recording) {
    out += "  time-stamps: " + std::to_string(room.value("tokens", 0)) + ", missed " +
           std::to_string(room.value("missed", 0)) + "\n";
    print_authorities(room["authorities"], out);
    if (!room["procedure"].empty()) out += "  subject: " + room.value("subject", "") + "\n";
  }
  for (const json& way : room["procedure"]) {
    print_helper(way, "procedure data, " + way.value("name", ""), out);
  }
  for (const json& footswitch : room["footswitches"]) print_helper(footswitch, "footswitch", out);
  if (const std::string problem = room.value("problem", ""); !problem.empty()) {
    out += "  " + paint(Colour::kYellow, "latest problem: " + printable(problem)) + "\n";
  }
}

/// Null where the recorder cannot look at the archive; its problems say so.
std::string disk_text(const json& disk) {
  if (!disk.is_object()) return "disk: " + paint(Colour::kRed, "not known");
  std::string out = "disk: " + format_bytes(disk.value("free_bytes", 0ULL)) + " free";
  if (disk["hours_left"].is_number()) {
    char hours[32];
    std::snprintf(hours, sizeof hours, ", %s %.1f hours",
                  disk.value("hours_at_most", false) ? "at most" : "about", disk["hours_left"].get<double>());
    out += std::string(hours) + " if every room records";
  }
  if (const std::string assumes = disk.value("hours_assume", ""); !assumes.empty()) {
    out += " (" + printable(assumes) + ")";
  }
  return out;
}

std::string page(const json& status) {
  std::string out;
  for (const json& room : status["rooms"]) print_room(room, out);
  for (const json& problem : status.value("problems", json::array()))
    out += paint(Colour::kRed, printable(problem.get<std::string>())) + "\n";
  for (const json& remark : status.value("remarks", json::array()))
    out += paint(Colour::kYellow, printable(remark.get<std::string>())) + "\n";
  out += disk_text(status["disk"]);
  const json& clock = status["clock"];
  out += std::string("\nclock: ") +
         (clock.value("synchronised", false) ? "synchronised" : "not synchronised") + "\n";
  if (const std::string why = status.value("hardware_silent", ""); !why.empty()) {
    out += paint(Colour::kRed,
                 "key in hardware: does not sign, so that what is recorded is unproven: " + printable(why)) +
           "\n";
  }
  return out;
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const std::filesystem::path socket = home.control_socket(home.configuration());
  const auto status = [&] { return recorder::ask_recorder(socket, {{"do", "status"}}); };
  if (!request.watch) {
    const json now = status();
    if (request.json) {
      print_json(now);
    } else {
      std::cout << page(now);
    }
    return kDone;
  }
  for (;;) {
    const std::string text = request.json ? status().dump() + "\n" : page(status());
    // Home and clear: one steady page on a terminal, a list of pages elsewhere.
    if (!request.json && output_is_terminal()) std::cout << "\033[H\033[2J";
    std::cout << text << std::flush;
    if (!std::cout) return kDone;
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
}

}  // namespace

void add_status_command(Command& program) {
  Command& command = program.add_command("status", "tells how the running kirokud is");
  const auto request = std::make_shared<Request>();
  command.flag("--watch", request->watch, "each second anew, until Ctrl-C");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead; with --watch, one a line");
  command.explain(
      "For each stream of a room that records, or records ahead: whether its source delivers, how much was "
      "recorded and lost, how long ago the last "
      "picture or "
      "sample came, and up to when everything is safely on the disk. For each room which time-stamping "
      "authorities "
      "answer, where procedure data come from, and its footswitches. Exit status 2 if no recorder answers.");
  command.example("kiroku status --watch", "a page that stays up to date");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
