#include "media/pointing_line.h"

#include <cmath>

#include <nlohmann/json.hpp>

namespace kiroku::media {
namespace {

constexpr double kSteps = 10'000;

double rounded(double part) { return std::round(part * kSteps) / kSteps; }
bool is_part(double value) { return value >= 0 && value <= 1; }

}  // namespace

std::string pointing_line(const PointingLine& line) {
  nlohmann::ordered_json out{{"time_ns", line.time_ns}, {"by", line.at.by},
                             {"role", line.at.role},    {"stream", line.at.stream},
                             {"x", rounded(line.at.x)}, {"y", rounded(line.at.y)}};
  if (line.at.picture_ns) out["picture_ns"] = *line.at.picture_ns;
  return out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::optional<PointingLine> parse_pointing_line(std::string_view text) {
  try {
    const auto json = nlohmann::json::parse(text);
    PointingLine line;
    line.time_ns = json.at("time_ns").get<std::int64_t>();
    line.at.by = json.at("by").get<std::string>();
    line.at.role = json.at("role").get<std::string>();
    line.at.stream = json.at("stream").get<std::string>();
    line.at.x = json.at("x").get<double>();
    line.at.y = json.at("y").get<double>();
    if (json.contains("picture_ns")) line.at.picture_ns = json["picture_ns"].get<std::int64_t>();
    if (!is_part(line.at.x) || !is_part(line.at.y)) return std::nullopt;
    return line;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace kiroku::media
