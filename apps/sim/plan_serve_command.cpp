// 'kiroku plan serve': planning on a page.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/serving.h"
#include "apps/sim/number_option.h"
#include "apps/sim/picture_options.h"
#include "apps/sim/plan_command.h"
#include "base/error.h"
#include "viewer/planning/planning_api.h"
#include "viewer/viewer.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  ServingRequest serving{.listen = "", .own_port = "8445"};
  std::optional<std::string> plans, transfer, gpu, engine, at_once;
};

viewer::PlanningOptions planning_options(const Request& request, const Home& home) {
  constexpr std::size_t kMostAtOnce = 64;
  viewer::PlanningOptions options;
  options.plans = request.plans ? fs::path(*request.plans) : home.folder() / "plans";
  if (request.transfer) options.table.transfer = *request.transfer;
  static_cast<void>(sim::find_transfer_function(options.table.transfer));  // refuses what is none, in time
  options.table.engine = engine_choice(request.gpu, request.engine);
  options.at_once = request.at_once ? parse_count(*request.at_once, "--at-once", 1, kMostAtOnce)
                                    : std::max(1U, std::thread::hardware_concurrency() / 2);
  options.tell = tell_on_standard_error();
  return options;
}

int run(const Request& request) {
  const Home home = Home::open(request.serving.home);
  if (!request.serving.listen.empty() && !page_of(request.serving))
    throw UsageError("there is no page to plan on: it was not built; name its folder with --web");
  viewer::PlanningRoom room(planning_options(request, home));
  const std::string plans = room.options().plans.string();
  const std::size_t count = room.folder().plans().size(), at_once = room.options().at_once;
  serve_until_stopped(request.serving, home,
                      {.serves = "planning",
                       .identities = nullptr,
                       .more_routes =
                           [&room](viewer::Router& router, viewer::ViewerContext& context) {
                             viewer::add_planning_routes(router, room, context);
                           },
                       .tell = room.options().tell,
                       .first_line =
                           [&](const std::string& url) {
                             return "Planning" + (url.empty() ? "" : " at " + url) + " on " +
                                    std::to_string(count) + (count == 1 ? " plan" : " plans") + " of " +
                                    plans + ", " + std::to_string(at_once) +
                                    (at_once == 1 ? " person" : " persons") + " at a time";
                           },
                       .tell_more =
                           [&](nlohmann::ordered_json& told) {
                             told["folder"] = plans;
                             told["plans"] = count;
                             told["at_once"] = at_once;
                           }});
  return kDone;
}

}  // namespace

void add_plan_serve_command(Command& plan) {
  Command& command = plan.add_command("serve", "serves a page to plan on: grasp, press, cut, undo, save");
  const auto request = std::make_shared<Request>();
  command.option("--plans", "DIR", request->plans,
                 "the plans that may be opened: documents in it and in the folders directly below it; new "
                 "ones are saved beside them",
                 "plans in the home");
  command.writes("--plans");
  command.option("--transfer", "NAME", request->transfer,
                 "how tissue looks: a name of 'kiroku sim transfer', or a file of your own (.json)", "liver");
  add_engine_options(command, request->gpu, request->engine);
  command.option("--at-once", "N", request->at_once, "people who plan at a time",
                 "half as many as there are cores");
  add_serving_options(command, request->serving);
  command.explain(
      "Surgeons and administrators sign in to the viewer of the home ('kiroku view', or kirokud), choose "
      "Planning "
      "there, open a plan, and do by hand what becomes its steps. What is saved is a new plan for 'kiroku "
      "plan check', 'run', 'replay' and "
      "'seal'; no plan is overwritten.");
  command.example("kiroku plan serve", "the home's plans, behind its viewer");
  command.example("kiroku plan serve --plans plans --listen 127.0.0.1:8445", "with an address of its own");
  command.example("kiroku plan serve --plans plans --transfer kidney --gpu off", "with a kidney's colours");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
