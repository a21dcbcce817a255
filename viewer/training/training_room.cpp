#include "viewer/training/training_room.h"

#include <utility>

#include "viewer/server/request.h"

namespace kiroku::viewer {

TrainingRoom::TrainingRoom(TrainingOptions options)
    : options_(std::move(options)), database_(options_.database) {}

std::shared_ptr<const trainer::ExclusionBody> TrainingRoom::body(trainer::ObjectKind kind) {
  Organ& organ = organs_.at(static_cast<std::size_t>(kind));
  const std::lock_guard guard(organ.mutex);
  if (!organ.body) {
    trainer::OrganObject object = trainer::make_object(kind, options_.vertices);
    trainer::ExclusionTask task = trainer::exclusion_task(object);
    task.damage_pa = options_.damage_pa;
    task.most_s = options_.most_s;
    organ.body = std::make_shared<const trainer::ExclusionBody>(std::move(object), task);
  }
  return organ.body;
}

std::unique_ptr<TrainingRoom::Place> TrainingRoom::enter(const std::string& trainee) {
  const std::lock_guard guard(places_mutex_);
  if (training_.contains(trainee)) throw Refusal(409, trainee + " is training already");
  if (training_.size() >= options_.at_once)
    throw Refusal(503, "all places for training are taken: try again when an attempt has ended");
  training_.insert(trainee);
  return std::make_unique<Place>(*this, trainee);
}

void TrainingRoom::leave(const std::string& trainee) {
  const std::lock_guard guard(places_mutex_);
  training_.erase(trainee);
}

}  // namespace kiroku::viewer
