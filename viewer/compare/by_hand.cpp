#include "viewer/compare/by_hand.h"

#include <span>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/model/json_field.h"

namespace kiroku::compare {
namespace {

using sim::JsonField;

class ByHandReader {
 public:
  ByHandReader(const archive::CaseReader& recording, const sim::Plan& plan)
      : recording_(recording), plan_(plan) {}

  ByHand read(const JsonField& document) {
    document.expect_object({"steps", "points", "registration", "tools", "limits"});
    ByHand said;
    if (const auto steps = document.optional_member("steps")) {
      said.steps.emplace();
      for (const JsonField& step : steps->elements()) said.steps->push_back(match_of(step));
    }
    if (const auto points = document.optional_member("points")) {
      for (const JsonField& point : points->elements()) {
        point.expect_object({"plan_s", "at"});
        said.points.push_back({point.member("plan_s").number(), time_ns(point.member("at"))});
      }
    }
    if (const auto registration = document.optional_member("registration"))
      said.registration = registration_of(*registration);
    if (const auto tools = document.optional_member("tools")) {
      for (const auto& [name, clicks] : tools->members())
        said.tools[tool_of(name, clicks)] = clicks_of(clicks);
    }
    if (const auto limits = document.optional_member("limits")) said.limits = limits_of(*limits);
    return said;
  }

 private:
  [[nodiscard]] std::int64_t time_ns(const JsonField& field) const {
    if (!field.is_text()) return field.integer();
    try {
      return recording_.parse_time(field.text());
    } catch (const UsageError& error) {
      field.fail(std::string("is no time of the case: ") + error.what());
    }
  }

  [[nodiscard]] StepMatch match_of(const JsonField& field) const {
    field.expect_object({"step", "name", "start", "end", "pauses"});
    const JsonField number = field.member("step");
    const std::int64_t step = number.integer();
    if (step < 1 || step > static_cast<std::int64_t>(plan_.steps.size()))
      number.fail("is " + std::to_string(step) + ": the plan's steps are 1 to " +
                  std::to_string(plan_.steps.size()));
    StepMatch match;
    match.step = static_cast<std::size_t>(step - 1);
    match.start_from = KnownFrom::kHand;
    match.span.start_ns = time_ns(field.member("start"));
    match.span.end_ns = match.span.start_ns - 1;
    if (const auto end = field.optional_member("end")) {
      match.span.end_ns = time_ns(*end);
      match.end_from = KnownFrom::kHand;
      if (match.span.end_ns < match.span.start_ns) end->fail("is before the step's start");
    }
    if (const auto pauses = field.optional_member("pauses")) {
      for (const JsonField& pause : pauses->elements()) {
        const std::vector<JsonField> ends = pause.elements(2);
        match.pauses.push_back({time_ns(ends[0]), time_ns(ends[1])});
      }
    }
    return match;
  }

  [[nodiscard]] static Eigen::Vector2d pixel_of(const JsonField& field) {
    const std::vector<JsonField> numbers = field.elements(2);
    return {numbers[0].number(), numbers[1].number()};
  }

  [[nodiscard]] PickedRegistration registration_of(const JsonField& field) const {
    field.expect_object({"at", "field_deg", "points"});
    PickedRegistration picked;
    picked.time_ns = time_ns(field.member("at"));
    if (const auto angle = field.optional_member("field_deg")) picked.field_deg = angle->number();
    for (const JsonField& point : field.member("points").elements()) {
      point.expect_object({"organ", "pixel"});
      picked.points.push_back({point.member("organ").vector() / sim::units_per_metre(plan_.body.unit),
                               pixel_of(point.member("pixel"))});
    }
    return picked;
  }

  [[nodiscard]] std::size_t tool_of(const std::string& name, const JsonField& field) const {
    for (std::size_t tool = 0; tool < plan_.tools.size(); ++tool) {
      if (plan_.tools[tool].tool.name == name) return tool;
    }
    field.fail("is for a tool that the plan does not have");
  }

  [[nodiscard]] std::vector<ToolClick> clicks_of(const JsonField& field) const {
    std::vector<ToolClick> clicks;
    for (const JsonField& click : field.elements()) {
      click.expect_object({"at", "pixel"});
      clicks.push_back({time_ns(click.member("at")), pixel_of(click.member("pixel"))});
    }
    if (clicks.empty()) field.fail("holds no click");
    return clicks;
  }

  [[nodiscard]] static PressureLimits limits_of(const JsonField& field) {
    field.expect_object({"systolic_low", "systolic_high", "mean_low"});
    PressureLimits limits;
    const auto take = [&](const char* key, double& into) {
      if (const auto value = field.optional_member(key)) into = value->number();
    };
    take("systolic_low", limits.systolic_low);
    take("systolic_high", limits.systolic_high);
    take("mean_low", limits.mean_low);
    return limits;
  }

  const archive::CaseReader& recording_;
  const sim::Plan& plan_;
};

}  // namespace

ByHand read_by_hand(std::string_view text, const std::string& name, const archive::CaseReader& recording,
                    const sim::Plan& plan) {
  const nlohmann::json document = JsonField::parse(text, name);
  return ByHandReader(recording, plan).read(JsonField(document, name));
}

std::string by_hand_text(const StepMatching& matching, std::span<const PlannedStep> steps,
                         std::int64_t begins_ns) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  const auto time = [&](std::int64_t time_ns) { return archive::case_time_text(time_ns, begins_ns); };
  for (const StepMatch& match : matching.matches) {
    nlohmann::ordered_json step{
        {"step", match.step + 1}, {"name", steps[match.step].name}, {"start", time(match.span.start_ns)}};
    if (match.end_from == KnownFrom::kMark || match.end_from == KnownFrom::kHand)
      step["end"] = time(match.span.end_ns);
    for (const archive::Span& pause : match.pauses)
      step["pauses"].push_back({time(pause.start_ns), time(pause.end_ns)});
    all.push_back(std::move(step));
  }
  return nlohmann::ordered_json{{"steps", all}}.dump(1, ' ', false,
                                                     nlohmann::json::error_handler_t::replace) +
         "\n";
}

}  // namespace kiroku::compare
