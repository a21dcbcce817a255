#include "viewer/training/training_room.h"

#include <algorithm>
#include <utility>

#include "viewer/server/request.h"

namespace kiroku::viewer {

TrainingRoom::TrainingRoom(TrainingOptions options)
    : options_(std::move(options)), database_(options_.database) {
  made_["a"];
  made_["b"];
}

std::vector<std::string> TrainingRoom::objects() const {
  std::vector<std::string> names{"a", "b"};
  for (const auto& organ : options_.organs) names.push_back(organ->object().name);
  return names;
}

void TrainingRoom::require_object(const std::string& name) const {
  const std::vector<std::string> known = objects();
  if (std::ranges::find(known, name) == known.end())
    throw Refusal(400, "'" + name + "' is no object: it must be one of those that 'training' lists");
}

std::shared_ptr<const trainer::ExclusionBody> TrainingRoom::body(const std::string& object_name) {
  for (const auto& organ : options_.organs) {
    if (organ->object().name == object_name) return organ;
  }
  const trainer::ObjectKind kind = trainer::object_kind(object_name);
  Made& made = made_.at(object_name);
  const std::lock_guard guard(made.mutex);
  if (!made.body) {
    trainer::OrganObject object = trainer::make_object(kind, options_.vertices);
    trainer::ExclusionTask task = trainer::exclusion_task(kind);
    task.damage_pa = options_.damage_pa;
    task.most_s = options_.most_s;
    made.body = std::make_shared<const trainer::ExclusionBody>(std::move(object), task);
  }
  return made.body;
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
