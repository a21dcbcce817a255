#include "viewer/planning/planning_socket.h"

#include <cstdio>
#include <utility>

#include <nlohmann/json.hpp>

#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

std::string seconds_text(double time_s) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", time_s);
  return text;
}

}  // namespace

PlanningSocket::PlanningSocket(PlanningRoom& room, std::string person, std::shared_ptr<SocketOutput> output,
                               EnterOpening enter)
    : room_(room), person_(std::move(person)), output_(std::move(output)), enter_(std::move(enter)) {}

void PlanningSocket::receive(const SocketMessage& message) {
  if (!message.is_text) throw Refusal(400, "a message must be text");
  PlanningMessage said = parse_planning_message(text_of(message.bytes));
  if (const auto* asked = std::get_if<OpenMessage>(&said)) return open(*asked);
  if (!planning_) throw Refusal(400, "a plan must be opened first");
  const auto* asked = std::get_if<SaveMessage>(&said);
  auto* deed = std::get_if<DeedMessage>(&said);
  const std::uint64_t input = asked != nullptr ? asked->input : deed->input;
  if (input <= last_input_) throw Refusal(400, "'input' must rise from message to message");
  last_input_ = input;
  if (asked != nullptr) return save(*asked);
  if (!planning_->apply(input, std::move(deed->deed)))
    throw Refusal(409, "more was asked for than can be computed");
}

void PlanningSocket::open(const OpenMessage& message) {
  if (planning_) throw Refusal(409, "a plan is open on this connection already");
  place_ = room_.enter(person_);
  planning_ = std::make_unique<LivePlanning>(
      [this, message](const LivePlanning::Opening& opening) {
        OpenedPlan opened = room_.folder().open(message.plan, opening);
        enter_(opened.file);
        const double all_s = sim::begins_s(opened.plan, opened.plan.steps.size());
        return std::make_unique<PlanningTable>(std::move(opened), message.anew, room_.options().table,
                                               [&](double time_s) {
                                                 opening("carrying out its steps: " + seconds_text(time_s) +
                                                         " of " + seconds_text(all_s) + " s");
                                               });
      },
      listener());
}

void PlanningSocket::save(const SaveMessage& message) {
  const auto task = [this, message](PlanningTable& table) {
    const std::string file = room_.folder().save(table.opened(), message.file, table.document(message.name));
    output_->send_text(ordered_json{{"saved", {{"plan", file}}}}.dump());
  };
  if (!planning_->run_task(message.input, task))
    throw Refusal(409, "more was asked for than can be computed");
}

PlanningListener PlanningSocket::listener() {
  PlanningListener out;
  out.opening = [this](const std::string& step) {
    output_->send_text(ordered_json{{"opening", step}}.dump());
  };
  out.opened = [this](const PlanningTable& table) { output_->send_text(opened_json(table).dump()); };
  // What a slow browser has not taken yet would only make the next picture later.
  out.ready = [this] { return output_->waiting() == 0; };
  out.shown = [this](const PlanningMoment& moment) {
    output_->send_bytes(std::make_shared<const Bytes>(moment_message(moment)));
  };
  out.steps_changed = [this](const PlanningTable& table) { output_->send_text(steps_json(table).dump()); };
  out.told = [this](const std::string& sentence) {
    output_->send_text(ordered_json{{"told", sentence}}.dump());
  };
  out.failed = [this](const std::string& sentence) {
    room_.options().tell("planning ended: " + sentence);
    // Nothing is planned any more, however long the connection is kept.
    place_.reset();
    output_->send_text(ordered_json{{"failed", sentence}}.dump());
  };
  return out;
}

}  // namespace kiroku::viewer
