#include "viewer/planning/planning_room.h"

#include <algorithm>
#include <utility>

namespace kiroku::viewer {
namespace {

Turns::Limits places_of(std::size_t at_once, Clock::Duration patience) {
  return {.all = at_once, .of_person = std::max<std::size_t>(1, at_once - 1), .patience = patience};
}

Turns::Sentences refusals(std::size_t at_once) {
  return {"as many people plan here as this machine can compute for (" + std::to_string(at_once) +
              "): try again when somebody has left",
          "you plan here already, on another page: close that first"};
}

}  // namespace

PlanningRoom::PlanningRoom(PlanningOptions options)
    : options_(std::move(options)),
      folder_(options_.plans),
      places_(places_of(options_.at_once, options_.patience), refusals(options_.at_once)) {}

std::unique_ptr<Turns::Turn> PlanningRoom::enter(const std::string& person) {
  return std::make_unique<Turns::Turn>(places_, person);
}

}  // namespace kiroku::viewer
