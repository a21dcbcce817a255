#include <deque>

#include <nlohmann/json.hpp>

#include "archive/appliance_log.h"
#include "viewer/server/api.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

constexpr std::int64_t kUsualLines = 100;
constexpr std::int64_t kMostLines = 1000;

Response list_log(const ViewerContext& context, const Request& request) {
  const std::int64_t limit = request.query_integer("limit").value_or(kUsualLines);
  if (limit < 1 || limit > kMostLines) {
    throw Refusal(400, "'limit' must be from 1 to " + std::to_string(kMostLines));
  }
  const std::int64_t before = request.query_integer("before").value_or(INT64_MAX);
  std::deque<std::string> lines;
  archive::for_each_log_line(context.home().log_folder, [&](const archive::LogLine& line) {
    if (static_cast<std::int64_t>(line.seq) >= before) return;
    lines.push_front(line.json);
    if (std::ssize(lines) > limit) lines.pop_back();
  });
  ordered_json entries = ordered_json::array();
  for (const std::string& line : lines) entries.push_back(ordered_json::parse(line));
  return Response::json({{"entries", std::move(entries)}});
}

}  // namespace

void add_log_routes(Router& router, ViewerContext& context) {
  router.add("GET", "api/log", Right::kReadLog,
             [&context](const Request& request) { return list_log(context, request); });
}

}  // namespace kiroku::viewer
