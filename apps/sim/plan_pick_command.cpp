// 'kiroku plan pick': a plan's pictures and the points under them, for programs.
#include <iostream>
#include <memory>
#include <string>

#include "apps/sim/comparison_progress.h"
#include "apps/sim/picture_options.h"
#include "apps/sim/plan_at_hand.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/plan_reading.h"
#include "base/error.h"
#include "sim/plan/plan_frames.h"
#include "sim/volume/volume_reader.h"
#include "viewer/compare/organ_picking.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string plan;
  PictureOptions picture;
};

int run(const Request& request) {
  const auto at_hand = read_plan_at_hand(request.plan, false);
  if (!at_hand) return kRefused;
  const sim::Plan& plan = at_hand->plan;
  if (plan.volume.empty()) {
    throw UsageError(
        "the plan names no CT that could be shown: points can be picked where its \"volume\" "
        "names a file or folder");
  }
  ComparisonTold told(true);
  told.begin("reading the CT");
  const auto volume = std::make_shared<const sim::ShadedVolume>(
      sim::shade(sim::read_volume(plan.volume, {"", true}).volume, sim::extent_of(plan.body.mesh), {}));
  told.begin("carrying out the plan");
  const double all_s = std::max(1e-9, duration_s(plan));
  const sim::PlanFrames frames(plan, [&](double time_s) { told.update(time_s / all_s); });
  compare::OrganPicking picking(plan, frames, volume, request.picture.transfer_function("liver"),
                                request.picture.engine_choice());
  std::cout << R"({"ready":true})" << std::endl;
  for (std::string line; std::getline(std::cin, line);)
    std::cout << compare::answer_picking(picking, line) << std::endl;
  return kDone;
}

}  // namespace

void add_plan_pick_command(Command& plan) {
  Command& command = plan.add_command(
      "pick", "for programs: pictures of a plan, and which point of the organ is under them");
  const auto request = std::make_shared<Request>();
  command.argument("PLAN", request->plan, "the plan (.json), or the sealed plan (.seal.json)");
  command.option("--transfer", "NAME", request->picture.transfer, "how tissue looks (kiroku sim transfer)",
                 "liver");
  add_engine_options(command, request->picture.gpu, request->picture.engine);
  command.explain(
      "Carries the plan out, says {\"ready\":true}, and then answers each line of standard input, a JSON "
      "object, by one on standard output, until its end: pictures from any side at any moment of the plan, "
      "the point of the organ under a place of them, and how well picked points register a camera. The "
      "viewer's page picks points so (docs/reference/viewer.md, \"Picking\").");
  command.example("kiroku plan pick liver.seal.json < questions.jsonl", "answers them, a line each");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
