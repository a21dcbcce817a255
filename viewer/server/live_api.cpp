#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"
#include "viewer/server/api.h"
#include "viewer/server/guest_output.h"

namespace kiroku::viewer {
namespace {

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

}  // namespace

void add_live_routes(Router& router, ViewerContext& context) {
  router.add({"GET", "api/live", Right::kWatchRoom,
              [&context](const Request& request) { return streams(context, request); }, false});
  router.add_socket("api/live/{room:name}/{stream:name}", Right::kWatchRoom,
                    [&context](const Request& request, std::shared_ptr<SocketOutput> output) {
                      return watch(context, request, std::move(output));
                    });
}

}  // namespace kiroku::viewer
