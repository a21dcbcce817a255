#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"
#include "media/vital_codes.h"
#include "viewer/api/api.h"
#include "viewer/api/guest_output.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

std::unique_ptr<SocketHandler> watch(ViewerContext& context, const Request& request,
                                     std::shared_ptr<SocketOutput> output) {
  const LivePictures& live = context.home().live;
  const LiveStream asked{request.parameter("room"), request.parameter("stream")};
  std::unique_ptr<GuestPresence> guest = GuestPresence::of(context, request, asked.room);
  if (std::ranges::count(live.streams, asked) == 0) {
    throw Refusal(404,
                  "no pictures of " + asked.room + "/" + asked.stream +
                      " are recorded by this program; live pictures come from kirokud, where kiroku.toml "
                      "has a [viewer] section");
  }
  context.enter_access_once(request, ViewerContext::kEveryCase,
                            "watched " + asked.room + "/" + asked.stream + " live");
  if (guest) output = std::make_shared<GuestOutput>(std::move(output), std::move(guest));
  return live.watch(asked, request.session, std::move(output));
}

/// The clock of the case that the request's session may see in the room, by which a page knows how old a
/// picture is.
std::optional<std::int64_t> now_ns_of(const ViewerContext& context, const Request& request,
                                      const std::string& room) {
  const std::shared_ptr<Invitation>& invitation = request.session->invitation();
  if (invitation && !invitation->admits(context.running_case(room))) return std::nullopt;
  const LiveRooms& rooms = context.home().rooms;
  return rooms.now_ns ? rooms.now_ns(room) : std::nullopt;
}

Response streams(const ViewerContext& context, const Request& request) {
  const std::shared_ptr<Invitation>& invitation = request.session->invitation();
  auto list = nlohmann::ordered_json::array();
  for (const LiveStream& each : context.home().live.streams) {
    if (invitation && invitation->terms().room != each.room) continue;
    list.push_back({{"room", each.room},
                    {"stream", each.stream},
                    {"now_ns", or_null(now_ns_of(context, request, each.room))}});
  }
  return Response::json({{"streams", std::move(list)}});
}

ordered_json series_json(const LiveVitalSeries& series) {
  const media::VitalCode* const known = media::find_vital_code(series.code);
  ordered_json out{
      {"code", series.code},       {"label", known == nullptr ? series.code : std::string(known->label)},
      {"unit", series.unit},       {"kind", series.is_wave ? "wave" : "numeric"},
      {"stream", series.stream},   {"source", series.source},
      {"time_ns", series.time_ns}, {"questionable", series.is_questionable}};
  if (!series.is_wave) {
    out["value"] = or_null(series.value);
    return out;
  }
  ordered_json blocks = ordered_json::array();
  for (const LiveWaveBlock& block : series.blocks) {
    // What is no number becomes null.
    blocks.push_back({{"end_ns", block.end_ns}, {"rate_hz", block.rate_hz}, {"values", block.values}});
  }
  out["blocks"] = std::move(blocks);
  return out;
}

/// What the monitors of the room show; nothing of it while no case runs.
Response vitals(ViewerContext& context, const Request& request) {
  const std::string& room = request.parameter("room");
  const std::int64_t after_ns = request.query_integer("after_ns").value_or(-1);
  const LiveRooms& rooms = context.home().rooms;
  const std::optional<std::int64_t> now_ns = rooms.now_ns ? rooms.now_ns(room) : std::nullopt;
  std::optional<LiveVitalsNow> now =
      context.home().vitals ? context.home().vitals(room, after_ns) : std::nullopt;
  if (!now) {
    throw Refusal(404, "no vital signs of " + room + " are recorded by this program");
  }
  if (!now_ns) now.emplace();
  context.enter_access_once(request, ViewerContext::kEveryCase, "watched vital signs of " + room + " live");
  ordered_json series = ordered_json::array(), alarms = ordered_json::array();
  for (const LiveVitalSeries& each : now->series) series.push_back(series_json(each));
  for (const LiveAlarm& alarm : now->alarms) {
    alarms.push_back({{"text", alarm.text},
                      {"priority", alarm.priority},
                      {"stream", alarm.stream},
                      {"source", alarm.source},
                      {"since_ns", alarm.since_ns}});
  }
  return Response::json(
      {{"now_ns", or_null(now_ns)}, {"series", std::move(series)}, {"alarms", std::move(alarms)}});
}

}  // namespace

void add_live_routes(Router& router, ViewerContext& context) {
  router.add({"GET", "api/live", Right::kWatchRoom,
              [&context](const Request& request) { return streams(context, request); }, false});
  Route vital_signs{"GET", "api/rooms/{room:name}/vitals", Right::kSeeLive,
                    [&context](const Request& request) { return vitals(context, request); }, false};
  vital_signs.is_quick = true;
  router.add(std::move(vital_signs));
  router.add_socket("api/live/{room:name}/{stream:name}", Right::kWatchRoom,
                    [&context](const Request& request, std::shared_ptr<SocketOutput> output) {
                      return watch(context, request, std::move(output));
                    });
}

}  // namespace kiroku::viewer
