#include "viewer/breathing/breathing_api.h"

#include <string>
#include <utility>

#include "viewer/breathing/breathing_socket.h"

namespace kiroku::viewer {

void add_breathing_routes(Router& router, BreathingRoom& room, ViewerContext& context) {
  Route table;
  table.method = "GET";
  table.pattern = "api/breathing/table";
  table.right = Right::kPlan;
  table.body_limit = kLongestBreathingMessage;
  table.socket = [&room, &context](const Request& request, std::shared_ptr<SocketOutput> output) {
    const BreathingBench& bench = room.bench();
    // Before anything of it is shown.
    const std::optional<BenchRecording>& recording = bench.recording();
    context.enter_access(recording ? recording->case_id : ViewerContext::kEveryCase,
                         "opened lung " + bench.file().filename().string() + " with its CT and " +
                             std::to_string(bench.radiographs().size()) + " radiographs" +
                             (recording ? " of its " + recording->stream : ""),
                         request.session->user(), request.peer);
    return std::make_unique<BreathingSocket>(room, request.session->person(), std::move(output));
  };
  router.add(std::move(table));
}

}  // namespace kiroku::viewer
