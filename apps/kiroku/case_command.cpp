#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/plan_seal.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "recorder/control/control_client.h"
#include "recorder/control/plan_patient.h"

namespace kiroku::apps {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> home, room, meant, subject, plan, camera, why;
  std::string text;
  bool no_wait = false, json = false;
};

int ask(const Request& request, json question, const std::string& done) {
  const Home home = Home::open(request.home);
  if (request.room) question["room"] = *request.room;
  if (request.meant) question["case"] = *request.meant;
  const json answer = recorder::ask_recorder(home.control_socket(home.configuration()), question);
  if (request.json) {
    print_json(answer);
  } else {
    std::cout << "room " << answer.value("room", "") << ": " << done << " " << answer.value("case", "")
              << "\n";
    if (const std::string warning = answer.value("warning", ""); !warning.empty())
      print_error("kiroku", "warning: " + warning);
  }
  return kDone;
}

int change_profile(const Request& request) {
  json question{{"do", "profile"}, {"profile", request.text}};
  if (request.camera) question["stream"] = *request.camera;
  if (request.why) question["why"] = *request.why;
  return ask(request, question, "from here on " + request.text + ":");
}

int start(const Request& request) {
  json question{{"do", "start"}};
  if (request.subject) {
    const Bytes bytes = read_small_file(*request.subject, "the subject");
    question["subject"] = parse_foreign_json(text_of(bytes));
    if (!question["subject"].is_object()) {
      throw UsageError("the subject " + *request.subject +
                       " is no JSON object: write {\"patient\": {...}, \"procedure\": \"...\"}");
    }
  }
  if (request.plan) {
    question["plan"] = crypto::to_hex(require_sealed(Home::open(request.home), *request.plan));
    question["plan_patients"] = recorder::patients_of_plan(*request.plan);
  }
  return ask(request, question, "recording");
}

void add_meant(Command& command, const std::shared_ptr<Request>& request) {
  command.option("--case", "CASE", request->meant, "the case that is meant; refused where it does not run",
                 "whichever runs");
}

void add_room(Command& command, const std::shared_ptr<Request>& request) {
  command.option("--room", "NAME", request->room, "which operating room", "the only one");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
}

}  // namespace

void add_case_command(Command& program) {
  Command& command = program.add_command(
      "case", "starts, stops and marks cases of the running kirokud, and changes their profile");
  {
    Command& one = command.add_command("start", "begins a case");
    const auto request = std::make_shared<Request>();
    one.option("--subject", "FILE", request->subject,
               "JSON about patient, procedure and staff, to be sealed with the case",
               "what the room's [room.procedure] finds");
    one.option(
        "--plan", "SEAL", request->plan,
        "the sealed plan (.seal.json) that the operation follows; its hash is in the case's first entry");
    add_room(one, request);
    one.explain(
        "Returns when recording has begun. Sources that are absent are stated as gaps and taken up when they "
        "come.");
    one.example("kiroku case start --room or-1 --subject patient.json", "begins a case in one room");
    one.example("kiroku case start --plan liver.seal.json", "begins the case that was planned so");
    one.on_run([request] { return start(*request); });
  }
  {
    Command& one = command.add_command("stop", "ends the case that runs");
    const auto request = std::make_shared<Request>();
    one.flag("--no-wait", request->no_wait, "returns before the case is closed and time-stamped");
    add_meant(one, request);
    add_room(one, request);
    one.example("kiroku case stop --room or-1", "ends it, and waits until it is closed");
    one.explain(
        "Exit status 0 says that the case is closed; with --no-wait that it is ending, and no more. Where it "
        "could not be closed, as on a disk that fails, the status is 2, and the recorder's next start closes "
        "it. Where an error ended the case and the recorder would begin another one by itself, this ends the "
        "operation: none begins any more.");
    one.on_run([request] {
      return ask(*request, {{"do", "stop"}, {"wait", !request->no_wait}},
                 request->no_wait ? "ending" : "closed");
    });
  }
  {
    Command& one = command.add_command("mark", "marks a moment of the case that runs");
    const auto request = std::make_shared<Request>();
    one.argument("TEXT", request->text, "what happens now; sealed, only recipients can read it");
    add_meant(one, request);
    add_room(one, request);
    one.example("kiroku case mark --room or-1 'clip placed'", "marks this moment");
    one.on_run([request] { return ask(*request, {{"do", "mark"}, {"text", request->text}}, "marked in"); });
  }
  {
    Command& one = command.add_command("profile", "archives pictures of the case that runs in another form");
    const auto request = std::make_shared<Request>();
    one.choice_argument("PROFILE", {"mpeg2", "uncompressed", "lossless"}, request->text, "in which form");
    one.option("--camera", "STREAM", request->camera, "which stream of pictures", "all of them");
    one.option("--why", "TEXT", request->why, "sealed with the case, only recipients can read it");
    add_meant(one, request);
    add_room(one, request);
    one.explain(
        "From the next picture on. A segment ends there and another one begins; no picture is lost or stands "
        "there twice. The ledger states of each segment in which form it is, and an event who decided so, "
        "when "
        "and why. While a source is away, it holds from its next picture on. Pictures that cannot be "
        "archived "
        "in that form go on as they were, and the status says so.");
    one.example("kiroku case profile lossless --camera endoscope --why 'resection begins'",
                "from here on without loss");
    one.example("kiroku case profile mpeg2 --room or-1", "back again");
    one.on_run([request] { return change_profile(*request); });
  }
}

}  // namespace kiroku::apps
