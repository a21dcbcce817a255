#include <chrono>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "recorder/control/control_client.h"
#include "viewer/server/api.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kLongestMark = 500;

/// A recorder that hangs must not hold every thread of the viewer; starting opens cameras, which takes long.
constexpr std::chrono::seconds kPatience{30};

/// 503 where no recorder answers, or not in time, 409 with its own sentence where it could not do what it was
/// asked.
Response ask(const ViewerContext& context, const json& question) {
  try {
    ordered_json answer = recorder::ask_recorder(context.home().control_socket, question, kPatience);
    answer.erase("ok");
    return Response::json(answer);
  } catch (const recorder::NobodyAnswers& nobody) {
    throw Refusal(503, nobody.what());
  } catch (const recorder::AnswersTooLate& late) {
    throw Refusal(503, late.what());
  } catch (const Error& refused) {
    throw Refusal(409, refused.what());
  }
}

Response start(const ViewerContext& context, const Request& request) {
  return ask(context, {{"do", "start"}, {"room", request.parameter("room")}});
}

Response stop(const ViewerContext& context, const Request& request) {
  return ask(context, {{"do", "stop"}, {"room", request.parameter("room")}, {"wait", false}});
}

Response mark(const ViewerContext& context, const Request& request) {
  const json asked = request.json();
  const auto text = asked.find("text");
  if (text == asked.end() || !text->is_string() || text->get_ref<const std::string&>().empty() ||
      text->get_ref<const std::string&>().size() > kLongestMark) {
    throw Refusal(400, "'text' must be a text of 1 to " + std::to_string(kLongestMark) + " bytes");
  }
  return ask(context, {{"do", "mark"}, {"room", request.parameter("room")}, {"text", *text}});
}

}  // namespace

void add_room_routes(Router& router, ViewerContext& context) {
  router.add({"GET", "api/status", Right::kSeeLive,
              [&context](const Request& /*request*/) {
                return ask(context, {{"do", "status"}});
              },
              false});
  router.add("POST", "api/rooms/{room:name}/start", Right::kControlRooms,
             [&context](const Request& request) { return start(context, request); });
  router.add("POST", "api/rooms/{room:name}/stop", Right::kControlRooms,
             [&context](const Request& request) { return stop(context, request); });
  router.add("POST", "api/rooms/{room:name}/mark", Right::kControlRooms,
             [&context](const Request& request) { return mark(context, request); });
}

}  // namespace kiroku::viewer
