#include "viewer/breathing/breathing_room.h"

#include <algorithm>
#include <utility>

namespace kiroku::viewer {
namespace {

Turns::Limits places_at_bench(std::size_t at_once, Clock::Duration patience) {
  return {.all = at_once, .of_person = std::max<std::size_t>(1, at_once - 1), .patience = patience};
}

Turns::Sentences refusals_at_bench(std::size_t at_once) {
  return {"as many people work here as this machine can compute for (" + std::to_string(at_once) +
              "): try again when somebody has left",
          "you work at this lung already, on another page: close that first"};
}

Turns::Sentences refusals_of_fits() {
  return {"another fit is being computed on this machine: try again when it is done",
          "you have a fit computed already, on another page: wait for that, or cancel it"};
}

}  // namespace

BreathingRoom::BreathingRoom(const BreathingBench& bench, std::size_t at_once,
                             std::function<void(const std::string& sentence)> tell, ModelSealer sealer,
                             Clock::Duration patience)
    : bench_(bench),
      tell_(std::move(tell)),
      sealer_(std::move(sealer)),
      places_(places_at_bench(at_once, patience), refusals_at_bench(at_once)),
      fits_({.all = 1, .of_person = 1, .patience = {}}, refusals_of_fits()) {}

std::unique_ptr<Turns::Turn> BreathingRoom::enter(const std::string& person) {
  return std::make_unique<Turns::Turn>(places_, person);
}

std::unique_ptr<Turns::Turn> BreathingRoom::enter_fit(const std::string& person) {
  return std::make_unique<Turns::Turn>(fits_, person);
}

}  // namespace kiroku::viewer
