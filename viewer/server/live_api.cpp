#include <algorithm>

#include <nlohmann/json.hpp>

#include "viewer/server/api.h"

namespace kiroku::viewer {
namespace {

std::unique_ptr<SocketHandler> watch(ViewerContext& context, const Request& request,
                                     std::shared_ptr<SocketOutput> output) {
  const LivePictures& live = context.home().live;
  const LiveStream asked{request.parameter("room"), request.parameter("stream")};
  if (std::ranges::count(live.streams, asked) == 0) {
    throw Refusal(404,
                  "no pictures of " + asked.room + "/" + asked.stream +
                      " are recorded by this program; live pictures come from kirokud, where kiroku.toml "
                      "has a [viewer] section");
  }
  context.enter_access_once(request, ViewerContext::kEveryCase,
                            "watched " + asked.room + "/" + asked.stream + " live");
  return live.watch(asked, request.session, std::move(output));
}

Response streams(const ViewerContext& context) {
  auto list = nlohmann::ordered_json::array();
  for (const LiveStream& each : context.home().live.streams) {
    list.push_back({{"room", each.room}, {"stream", each.stream}});
  }
  return Response::json({{"streams", std::move(list)}});
}

}  // namespace

void add_live_routes(Router& router, ViewerContext& context) {
  router.add({"GET", "api/live", Right::kSeeLive,
              [&context](const Request& /*request*/) { return streams(context); }, false});
  router.add_socket("api/live/{room:name}/{stream:name}", Right::kSeeLive,
                    [&context](const Request& request, std::shared_ptr<SocketOutput> output) {
                      return watch(context, request, std::move(output));
                    });
}

}  // namespace kiroku::viewer
