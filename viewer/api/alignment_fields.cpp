#include "viewer/api/alignment_fields.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include <nlohmann/json.hpp>

#include "archive/reading/case_reader.h"
#include "base/number_text.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;

/// Nothing where it is absent or null.
std::optional<std::int64_t> take_time(const json& said, const char* key, const archive::OpenEntry& opening) {
  const auto time = said.find(key);
  if (time == said.end() || time->is_null()) return std::nullopt;
  if (!time->is_number_integer() || time->get<std::int64_t>() < opening.begins_ns) {
    throw Refusal(400, "'" + std::string(key) + "' must be a time of the case clock, in whole nanoseconds");
  }
  return time->get<std::int64_t>();
}

}  // namespace

std::vector<std::string> take_alignment(const json& body, const archive::OpenEntry& opening) {
  const auto said = body.find("alignment");
  if (said == body.end() || said->is_null()) return {};
  if (!said->is_object()) throw Refusal(400, "'alignment' must be an object with 'field_deg'");
  for (const auto& [key, value] : said->items()) {
    constexpr std::array<std::string_view, 5> kKnown{"field_deg", "view", "from_ns", "to_ns", "organ"};
    if (std::ranges::find(kKnown, key) == kKnown.end())
      throw Refusal(400, "'" + key + "' is nothing that can be said of an alignment");
  }
  const auto by_hand = body.find("by_hand");
  if (by_hand != body.end() && by_hand->is_object() && by_hand->contains("registration")) {
    throw Refusal(400,
                  "'alignment' and the registration in 'by_hand' both say where the organ is: leave one of "
                  "them out");
  }
  const auto field = said->find("field_deg");
  if (field == said->end() || !field->is_number() ||
      !(field->get<double>() >= kLeastAlignedFieldDeg && field->get<double>() <= kGreatestAlignedFieldDeg)) {
    throw Refusal(400, "'field_deg' must be the angle that the pictures' lesser side covers, 10 to 120");
  }
  std::vector<std::string> arguments{"--align", "auto", "--field", exact_text(field->get<double>())};
  if (const auto view = said->find("view"); view != said->end()) {
    constexpr std::array<std::string_view, 6> kViews{"front", "back", "left", "right", "head", "feet"};
    if (!view->is_string() || std::ranges::find(kViews, view->get<std::string>()) == kViews.end())
      throw Refusal(400, "'view' must be front, back, left, right, head or feet");
    arguments.insert(arguments.end(), {"--view", view->get<std::string>()});
  }
  bool deformed = false;
  if (const auto organ = said->find("organ"); organ != said->end()) {
    if (!organ->is_string() || (*organ != "rigid" && *organ != "deformed"))
      throw Refusal(400, "'organ' must be rigid or deformed");
    deformed = *organ == "deformed";
    arguments.insert(arguments.end(), {"--organ", organ->get<std::string>()});
  }
  const auto from_ns = take_time(*said, "from_ns", opening), to_ns = take_time(*said, "to_ns", opening);
  if (from_ns && to_ns && (*to_ns <= *from_ns || *to_ns - *from_ns > kLongestAlignedStretchNs))
    throw Refusal(400, "'to_ns' must be after 'from_ns', and by an hour at most");
  if (deformed && from_ns && to_ns && *to_ns - *from_ns > kLongestDeformedStretchNs)
    throw Refusal(400, "'to_ns' must be within ten minutes of 'from_ns' where the organ is deformed to fit");
  if (from_ns)
    arguments.insert(arguments.end(), {"--from", archive::case_time_text(*from_ns, opening.begins_ns)});
  if (to_ns) arguments.insert(arguments.end(), {"--to", archive::case_time_text(*to_ns, opening.begins_ns)});
  return arguments;
}

}  // namespace kiroku::viewer
