#include <deque>
#include <memory>
#include <mutex>

#include <nlohmann/json.hpp>

#include "archive/verify/report_json.h"
#include "archive/verify/verifier.h"
#include "archive/writing/log_reading.h"
#include "viewer/api/api.h"
#include "viewer/api/finding_meanings.h"

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
  const std::optional<std::string> type = request.query_text("type");
  std::deque<std::string> lines;
  archive::for_each_log_line(context.home().log_folder, [&](const archive::LogLine& line) {
    if (static_cast<std::int64_t>(line.seq) >= before || (type && line.type != *type)) return;
    lines.push_front(line.json);
    if (std::ssize(lines) > limit) lines.pop_back();
  });
  ordered_json entries = ordered_json::array();
  for (const std::string& line : lines) entries.push_back(ordered_json::parse(line));
  return Response::json({{"entries", std::move(entries)}});
}

/// Whether the log is whole, as `kiroku log --verify` judges it: one at a time, since it reads all of it.
Response verify_log(const ViewerContext& context, std::mutex& turn) {
  const std::unique_lock guard(turn, std::try_to_lock);
  if (!guard.owns_lock()) {
    return Response::error(503, "the appliance log is being verified already").with("Retry-After", "2");
  }
  archive::VerifyOptions options;
  options.devices = {context.home().device};
  options.trust = context.home().trust;
  options.threads = 1;
  const archive::VerificationReport report = archive::verify_log(context.home().log_folder, options);
  ordered_json out = archive::report_json(report);
  add_meanings(out);
  out["verified"] = format_utc(utc_now());
  return Response::json(out);
}

}  // namespace

void add_log_routes(Router& router, ViewerContext& context) {
  router.add("GET", "api/log", Right::kReadLog,
             [&context](const Request& request) { return list_log(context, request); });
  const auto turn = std::make_shared<std::mutex>();
  router.add("GET", "api/log/verification", Right::kReadLog,
             [&context, turn](const Request& /*request*/) { return verify_log(context, *turn); });
}

}  // namespace kiroku::viewer
