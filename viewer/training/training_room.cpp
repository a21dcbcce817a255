#include "viewer/training/training_room.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "viewer/server/session.h"

namespace kiroku::viewer {

TrainingUser training_user(const Request& request) {
  const Role role = request.session->role();
  return {request.session->user(), role == Role::kAdministrator,
          may(role, Right::kControlRooms) && may(role, Right::kVerify)};
}

bool may_train_as(const TrainingUser& user, const trainer::Trainee& trainee) {
  return !trainee.simulated &&
         (user.supervises || (!trainee.account.empty() && trainee.account == user.name));
}

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
    task.friction = options_.friction;
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

void TrainingRoom::keep_sealable(const std::string& trainee, Sealable sealable) {
  const std::lock_guard guard(sealable_mutex_);
  sealable_[trainee] = std::move(sealable);
}

trainer::ExclusionRecord TrainingRoom::require_may_seal(const TrainingUser& user, std::int64_t attempt) {
  if (!options_.sealer) throw Refusal(404, "this server makes no cases of attempts: start it with --seal");
  if (!user.may_record)
    throw Refusal(403, "sealing makes a case, which surgeons and administrators may: ask one of them");
  return with_results([&](const trainer::TrainingDatabase& results) {
    const std::vector<trainer::ExclusionRecord> records = results.attempts();
    const auto found = std::ranges::find(records, attempt, &trainer::ExclusionRecord::number);
    if (found == records.end() || !may_train_as(user, results.trainee(found->trainee)))
      throw Refusal(404, "there is no such attempt of a trainee that you may train as");
    return *found;
  });
}

SealedAttempt TrainingRoom::seal(const TrainingUser& user, std::int64_t attempt) {
  const trainer::ExclusionRecord record = require_may_seal(user, attempt);
  if (!record.sealed_case.empty())
    throw Refusal(409, "this attempt was sealed as " + record.sealed_case + " already");
  Sealable sealable;
  {
    const std::lock_guard guard(sealable_mutex_);
    const auto found = sealable_.find(record.trainee);
    if (found == sealable_.end() || found->second.attempt != attempt)
      throw Refusal(
          404, "an attempt can be sealed until its trainee's next one is over, and while the server runs");
    sealable = std::move(found->second);
    sealable_.erase(found);
  }
  SealedAttempt sealed;
  try {
    nlohmann::ordered_json facts = nlohmann::ordered_json::parse(sealable.facts);
    facts["sealed_by"] = user.name;
    sealed = options_.sealer->seal(*sealable.files, sealable.motion, facts, sealable.summary);
  } catch (...) {
    // What could not be done now can be tried again.
    const std::lock_guard guard(sealable_mutex_);
    sealable_.try_emplace(record.trainee, std::move(sealable));
    throw;
  }
  with_results([&](trainer::TrainingDatabase& results) { results.keep_case(attempt, sealed.case_id); });
  return sealed;
}

Bytes TrainingRoom::certificate(const TrainingUser& user, std::int64_t attempt) {
  const trainer::ExclusionRecord record = require_may_seal(user, attempt);
  if (record.sealed_case.empty()) throw Refusal(404, "this attempt was not sealed");
  return options_.sealer->certificate(record.sealed_case, user.name);
}

void TrainingRoom::leave(const std::string& trainee) {
  const std::lock_guard guard(places_mutex_);
  training_.erase(trainee);
}

}  // namespace kiroku::viewer
