#include "viewer/api/fluoroscopy_fields.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include <nlohmann/json.hpp>

#include "archive/reading/case_reader.h"
#include "viewer/http/request.h"
#include "viewer/people/json_fields.h"
#include "viewer/programs/comparison_program.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;

}  // namespace

FluoroscopyFields take_fluoroscopy(const json& body, const archive::OpenEntry& opening) {
  const auto said = body.find("fluoroscopy");
  if (said == body.end() || said->is_null()) return {};
  if (!said->is_object()) throw Refusal(400, "'fluoroscopy' must be an object with 'stream' and 'geometry'");
  for (const auto& [key, value] : said->items()) {
    constexpr std::array<std::string_view, 4> kKnown{"stream", "geometry", "align_at_ns", "polarity"};
    if (std::ranges::find(kKnown, key) == kKnown.end())
      throw Refusal(400, "'" + key + "' is nothing that can be said of a fluoroscopy");
  }
  const std::string stream = take_text(*said, "stream");
  const bool has_pictures = std::ranges::any_of(opening.streams, [&](const archive::StreamInfo& one) {
    return one.name == stream && one.kind == "video";
  });
  if (!has_pictures) throw Refusal(400, "the case has no stream of pictures '" + stream + "'");
  const auto geometry = said->find("geometry");
  if (geometry == said->end() || !geometry->is_object())
    throw Refusal(
        400, "'geometry' must say how the fluoroscope sees the patient: an object, as of kiroku sim drr");
  FluoroscopyFields taken{{"--geometry", ComparisonProgramCall::kFurtherFile, "--fluoroscopy", stream},
                          geometry->dump()};
  if (const auto polarity = said->find("polarity"); polarity != said->end()) {
    if (*polarity != "bone-black" && *polarity != "bone-white")
      throw Refusal(400, "'polarity' must be bone-black or bone-white");
    taken.arguments.insert(taken.arguments.end(), {"--polarity", polarity->get<std::string>()});
  }
  if (const auto at = said->find("align_at_ns"); at != said->end() && !at->is_null()) {
    if (!at->is_number_integer() || at->get<std::int64_t>() < opening.begins_ns)
      throw Refusal(400, "'align_at_ns' must be a time of the case clock, in whole nanoseconds");
    taken.arguments.insert(
        taken.arguments.end(),
        {"--align-at", archive::case_time_text(at->get<std::int64_t>(), opening.begins_ns)});
  }
  return taken;
}

}  // namespace kiroku::viewer
