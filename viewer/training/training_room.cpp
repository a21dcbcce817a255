#include "viewer/training/training_room.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "trainer/report/assessment_json.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {
namespace {

const std::vector<std::string> kMadeObjects{"a", "b", "c"};

}  // namespace

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
    : options_(std::move(options)),
      database_(options_.database),
      pace_(options_.pace),
      places_({.all = options_.at_once, .of_person = 1, .patience = options_.patience},
              {.others = "all places for training are taken: try again when an attempt has ended",
               .own = "is training already",
               .own_names_person = true,
               .own_status = 409},
              *options_.clock) {
  for (const std::string& name : kMadeObjects) made_[name];
}

std::vector<std::string> TrainingRoom::objects() const {
  std::vector<std::string> names = kMadeObjects;
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

void TrainingRoom::require_pace(const std::string& user) {
  const auto wait = pace_.take(user, options_.clock->now());
  if (wait.count() == 0) return;
  throw Refusal(429,
                "many attempts were begun one after the other: begin the next one in " +
                    std::to_string(wait.count()) + " s",
                wait);
}

std::unique_ptr<Turns::Turn> TrainingRoom::enter(const std::string& trainee) {
  return std::make_unique<Turns::Turn>(places_, trainee);
}

void TrainingRoom::keep_sealable(const std::string& trainee, Sealable sealable) {
  const std::lock_guard guard(sealable_mutex_);
  sealable_[trainee] = std::move(sealable);
}

trainer::ExclusionRecord TrainingRoom::require_own(const TrainingUser& user, std::int64_t attempt) {
  return with_results([&](const trainer::TrainingDatabase& results) {
    const std::vector<trainer::ExclusionRecord> records = results.attempts();
    const auto found = std::ranges::find(records, attempt, &trainer::ExclusionRecord::number);
    if (found == records.end() || !may_train_as(user, results.trainee(found->trainee)))
      throw Refusal(404, "there is no such attempt of a trainee that you may train as");
    return *found;
  });
}

trainer::ExclusionRecord TrainingRoom::require_may_seal(const TrainingUser& user, std::int64_t attempt) {
  if (!options_.sealer) throw Refusal(404, "this server makes no cases of attempts: start it with --seal");
  if (!user.may_record)
    throw Refusal(403, "sealing makes a case, which surgeons and administrators may: ask one of them");
  return require_own(user, attempt);
}

void TrainingRoom::keep_questionnaire(const TrainingUser& user, std::int64_t attempt,
                                      trainer::Questionnaire said) {
  said.account = user.name;
  keep_unsealed(user, attempt,
                [&](trainer::TrainingDatabase& results) { results.keep_questionnaire(attempt, said); });
}

void TrainingRoom::keep_checklist(const TrainingUser& user, std::int64_t attempt,
                                  trainer::Checklist checklist) {
  if (!user.supervises)
    throw Refusal(403, "a checklist is filled in by who supervises trainees: ask an administrator");
  checklist.account = user.name;
  keep_unsealed(user, attempt,
                [&](trainer::TrainingDatabase& results) { results.keep_checklist(attempt, checklist); });
}

void TrainingRoom::keep_unsealed(const TrainingUser& user, std::int64_t attempt,
                                 const std::function<void(trainer::TrainingDatabase&)>& keep) {
  static_cast<void>(require_own(user, attempt));
  // Until it is kept: a case that begins meanwhile takes it in, or is known to the results before.
  const std::lock_guard guard(sealable_mutex_);
  if (sealing_.contains(attempt)) throw Refusal(409, "this attempt is being sealed: wait a moment");
  with_results([&](trainer::TrainingDatabase& results) { keep(results); });
}

SealedAttempt TrainingRoom::seal(const TrainingUser& user, std::int64_t attempt) {
  const std::string trainee = require_may_seal(user, attempt).trainee;
  Sealable sealable = take_sealable(user, trainee, attempt);
  const auto done_with = [&](bool sealed) {
    const std::lock_guard guard(sealable_mutex_);
    sealing_.erase(attempt);
    // What could not be done now can be tried again, unless the trainee's next attempt is over by now.
    if (!sealed) sealable_.try_emplace(trainee, std::move(sealable));
  };
  try {
    // Only now: whoever sealed it meanwhile has told of the case before the attempt could be taken again.
    const trainer::ExclusionRecord record = require_may_seal(user, attempt);
    const std::string& earlier = record.sealed_case;
    nlohmann::ordered_json facts = nlohmann::ordered_json::parse(sealable.facts);
    if (record.questionnaire) facts["questionnaire"] = trainer::questionnaire_json(*record.questionnaire);
    if (record.checklist) facts["checklist"] = trainer::checklist_json(*record.checklist);
    facts["sealed_by"] = user.name;
    const SealedAttempt sealed = options_.sealer->seal(
        *sealable.files, sealable.motion, facts, sealable.summary, earlier, [&](const std::string& case_id) {
          with_results([&](trainer::TrainingDatabase& results) { results.keep_case(attempt, case_id); });
        });
    done_with(true);
    return sealed;
  } catch (...) {
    done_with(false);
    throw;
  }
}

TrainingRoom::Sealable TrainingRoom::take_sealable(const TrainingUser& user, const std::string& trainee,
                                                   std::int64_t attempt) {
  const std::lock_guard guard(sealable_mutex_);
  if (sealing_.contains(attempt)) throw Refusal(409, "this attempt is being sealed: wait a moment");
  const auto found = sealable_.find(trainee);
  if (found != sealable_.end() && found->second.attempt == attempt) {
    Sealable sealable = std::move(found->second);
    sealable_.erase(found);
    sealing_.insert(attempt);
    return sealable;
  }
  if (const std::string sealed = require_may_seal(user, attempt).sealed_case; !sealed.empty())
    throw Refusal(409, "this attempt was sealed as " + sealed + " already");
  throw Refusal(404,
                "an attempt can be sealed until its trainee's next one is over, and while the server runs");
}

Bytes TrainingRoom::certificate(const TrainingUser& user, std::int64_t attempt, report::Language language) {
  const trainer::ExclusionRecord record = require_may_seal(user, attempt);
  if (record.sealed_case.empty()) throw Refusal(404, "this attempt was not sealed");
  return options_.sealer->certificate(record.sealed_case, user.name, language);
}

}  // namespace kiroku::viewer
