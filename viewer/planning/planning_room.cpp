#include "viewer/planning/planning_room.h"

#include <utility>

#include "viewer/http/request.h"

namespace kiroku::viewer {

PlanningRoom::PlanningRoom(PlanningOptions options) : options_(std::move(options)), folder_(options_.plans) {}

std::unique_ptr<PlanningRoom::Place> PlanningRoom::enter() {
  if (++taken_ > options_.at_once) {
    --taken_;
    throw Refusal(503, "as many people plan here as this machine can compute for (" +
                           std::to_string(options_.at_once) + "): try again when somebody has left");
  }
  return std::make_unique<Place>(*this);
}

}  // namespace kiroku::viewer
