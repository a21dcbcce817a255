#include "viewer/training/attempt_messages.h"

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "sim/render/picture_jpeg.h"
#include "trainer/report/score_json.h"
#include "viewer/http/picture_message.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using std::chrono::nanoseconds;

constexpr int kQuality = 80;

double ms(nanoseconds time) { return static_cast<double>(time.count()) / 1e6; }

const json& field(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) throw Refusal(400, std::string("'") + key + "' is missing");
  return *found;
}

bool flag(const json& object, const char* key) {
  const json& value = field(object, key);
  if (!value.is_boolean()) throw Refusal(400, std::string("'") + key + "' must be true or false");
  return value.get<bool>();
}

std::string text(const json& object, const char* key) {
  const json& value = field(object, key);
  if (!value.is_string()) throw Refusal(400, std::string("'") + key + "' must be a text");
  return value.get<std::string>();
}

double number(const json& object, const char* key) {
  const json& value = field(object, key);
  if (!value.is_number()) throw Refusal(400, std::string("'") + key + "' must be a number");
  return value.get<double>();
}

std::uint64_t count(const json& object, const char* key) {
  const json& value = field(object, key);
  if (!value.is_number_unsigned())
    throw Refusal(400, std::string("'") + key + "' must be a whole number from 0 on");
  return value.get<std::uint64_t>();
}

BeginMessage begin_of(const json& object) {
  if (!object.is_object()) throw Refusal(400, "'begin' must be an object");
  BeginMessage begin{text(object, "trainee"),
                     text(object, "object"),
                     count(object, "fingers"),
                     flag(object, "test"),
                     flag(object, "expert"),
                     object.contains("press") && flag(object, "press"),
                     object.contains("instrument") ? text(object, "instrument") : ""};
  if (begin.instrument.empty()) return begin;
  // Not closed jaws, which go between the nodes of meshes as coarse as the page's.
  if (begin.instrument != "retractor") throw Refusal(400, "'instrument' must be 'retractor', or be left out");
  if (begin.test) throw Refusal(400, "a test is with fingertips: leave 'instrument' out");
  if (begin.expert) throw Refusal(400, "an expert's hand has fingertips: leave out 'expert' or 'instrument'");
  return begin;
}

trainer::PointerInput input_of(const json& object) {
  const json& pointers = field(object, "pointers");
  if (!pointers.is_array() || pointers.size() > trainer::kMostExclusionFingers)
    throw Refusal(400, "'pointers' must be a list of at most 5");
  trainer::PointerInput input{count(object, "input"), {}};
  for (const json& pointer : pointers) {
    if (!pointer.is_object()) throw Refusal(400, "a pointer must be an object");
    input.pointers.push_back(
        {count(pointer, "finger"), number(pointer, "x"), number(pointer, "y"), number(pointer, "push_m")});
  }
  return input;
}

ordered_json latency_json(const trainer::LiveOutcome::Latency& latency) {
  return {{"median_ms", ms(latency.median)},
          {"of_99_percent_ms", ms(latency.of_99)},
          {"longest_ms", ms(latency.longest)}};
}

}  // namespace

PageMessage parse_page_message(std::string_view message) {
  const json object = parse_foreign_json(message);
  if (!object.is_object()) throw Refusal(400, "a message must be a JSON object");
  if (object.contains("begin")) return begin_of(object["begin"]);
  if (object.contains("end")) return EndMessage{};
  if (object.contains("input")) return input_of(object);
  throw Refusal(400, "a message must have 'begin', 'input' or 'end'");
}

Bytes jpeg_of_moment(const trainer::LiveView& view) { return sim::jpeg_of(*view.attempt->picture, kQuality); }

Bytes moment_message(const trainer::LiveView& view, bool shows_stress, ByteView jpeg) {
  const trainer::ExclusionView& attempt = *view.attempt;
  ordered_json forces_n = ordered_json::array();
  for (const sim::Vector3& force_n : attempt.hand.forces_n) forces_n.push_back(force_n.norm());
  ordered_json moment{{"picture", view.picture},
                      {"input", view.input},
                      {"time_s", attempt.time_s},
                      {"visible_share", attempt.visible_share},
                      {"held_s", attempt.held_s},
                      {"forces_n", forces_n},
                      {"wrist_force_n", attempt.hand.wrist_n.norm()},
                      {"path_m", attempt.hand.path_m},
                      {"input_to_force_ms", ms(view.input_to_force)}};
  if (!attempt.hand.instruments.empty()) {
    ordered_json walls_n = ordered_json::array();
    for (const trainer::HandForces::Instrument& one : attempt.hand.instruments)
      walls_n.push_back(one.forces.wall_n.norm());
    moment["walls_n"] = walls_n;
  }
  if (shows_stress) {
    moment["largest_von_mises_pa"] = attempt.largest_von_mises_pa;
    moment["danger"] = attempt.danger;
    moment["tone_hz"] = attempt.tone_hz;
  }
  return picture_message(moment, jpeg);
}

ordered_json over_json(const trainer::LiveOutcome& over) {
  return {{"ending", trainer::name_of(over.ending)},
          {"score", trainer::score_json(over.outcome.score)},
          {"input_to_force", latency_json(over.input_to_force)},
          {"input_to_picture", latency_json(over.input_to_picture)},
          {"force_rate_hz", over.force_rate_hz},
          {"picture_rate_hz", over.picture_rate_hz}};
}

}  // namespace kiroku::viewer
