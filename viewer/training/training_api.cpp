#include "viewer/training/training_api.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "trainer/curriculum/learning.h"
#include "trainer/report/assessment_json.h"
#include "trainer/report/score_json.h"
#include "viewer/api/report_api.h"
#include "viewer/people/json_fields.h"
#include "viewer/training/attempt_socket.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using trainer::ExclusionRecord;
using trainer::Trainee;
using trainer::TrainingDatabase;

constexpr std::array<const char*, trainer::kMeasures.size()> kMeasureNames{"stress", "high-stress", "time",
                                                                           "path",   "force",       "damage"};

ordered_json trainee_json(const Trainee& trainee, const std::vector<ExclusionRecord>& records,
                          const TrainingRoom& room) {
  ordered_json progress = ordered_json::object();
  for (const std::string& object : room.objects()) {
    const trainer::TraineeProgress found = trainer::progress_of(records, trainee.name, object);
    progress[object] = {{"session", found.session}, {"practised_s", found.practised_s}};
  }
  return {
      {"name", trainee.name}, {"group", trainee.group}, {"user", trainee.account}, {"progress", progress}};
}

template <typename Named>
ordered_json names_of(const Named& all) {
  ordered_json names = ordered_json::array();
  for (const auto& one : all) names.push_back(one.name);
  return names;
}

Response training(TrainingRoom& room, const Request& request) {
  const TrainingUser user = training_user(request);
  ordered_json trainees = ordered_json::array();
  room.with_results([&](const TrainingDatabase& results) {
    const std::vector<ExclusionRecord> records = results.attempts();
    for (const Trainee& trainee : results.trainees()) {
      if (may_train_as(user, trainee)) trainees.push_back(trainee_json(trainee, records, room));
    }
  });
  ordered_json experts = ordered_json::array();
  for (const auto& [object, motion] : room.options().experts) experts.push_back(object);
  return Response::json({{"objects", room.objects()},
                         {"doubted", room.options().doubted},
                         {"fingers", trainer::kMostExclusionFingers},
                         {"groups", {trainer::kStressShown, trainer::kStressHidden}},
                         {"experts", experts},
                         {"damage_pa", room.options().damage_pa},
                         {"practice_s", room.options().practice_s},
                         {"questions", names_of(trainer::kQuestions)},
                         {"checklist_items", names_of(trainer::kChecklistItems)},
                         {"supervises", user.supervises},
                         {"may_seal", room.options().sealer != nullptr && user.may_record},
                         {"trainees", trainees}});
}

Response add_trainee(TrainingRoom& room, const Request& request) {
  const json asked = request.json();
  const std::string name = take_text(asked, "name"), group = take_text(asked, "group");
  const TrainingUser user = training_user(request);
  // Who adds a trainee for others says for whom; others are their own.
  const std::string account = !user.supervises         ? user.name
                              : asked.contains("user") ? take_text(asked, "user")
                                                       : "";
  if (group != trainer::kStressShown && group != trainer::kStressHidden)
    throw Refusal(400, std::string("'group' must be '") + trainer::kStressShown + "' or '" +
                           trainer::kStressHidden + "'");
  return Response::json(room.with_results([&](TrainingDatabase& results) {
    const std::vector<Trainee> known = results.trainees();
    const auto own = std::ranges::find(known, account, &Trainee::account);
    if (!account.empty() && own != known.end())
      throw Refusal(409, account + " trains as '" + own->name + "' already");
    return trainee_json(results.add_trainee(name, group, false, account), {}, room);
  }),
                        201);
}

ordered_json curve_json(const std::vector<ExclusionRecord>& records, const std::string& trainee,
                        const std::string& object, trainer::Measure measure) {
  ordered_json own = ordered_json::array(), groups = ordered_json::array();
  for (const trainer::OwnCurve& curve : trainer::learning_curves_of(records, trainee, object, measure)) {
    for (const auto& [session, value] : curve.points)
      own.push_back({{"fingers", curve.fingers}, {"session", session}, {"value", value}});
  }
  for (const trainer::LearningCurve& curve : trainer::learning_curves(records, object, measure)) {
    ordered_json points = ordered_json::array();
    for (const trainer::CurvePoint& point : curve.points) {
      ordered_json one{
          {"session", point.session}, {"trainees", point.summary.count}, {"mean", point.summary.mean}};
      if (point.summary.of_mean) {
        one["low"] = point.summary.of_mean->low;
        one["high"] = point.summary.of_mean->high;
      }
      points.push_back(one);
    }
    groups.push_back({{"group", curve.group}, {"fingers", curve.fingers}, {"points", points}});
  }
  return {{"measure", kMeasureNames.at(static_cast<std::size_t>(measure))}, {"own", own}, {"groups", groups}};
}

Response results_of(TrainingRoom& room, const Request& request) {
  const std::string& name = request.parameter("trainee");
  const std::string object = request.query_text("object").value_or("a");
  room.require_object(object);
  const std::vector<ExclusionRecord> records = room.with_results([&](const TrainingDatabase& results) {
    const std::vector<Trainee> trainees = results.trainees();
    const auto found = std::ranges::find(trainees, name, &Trainee::name);
    // Who may not see a trainee learns nothing about who there is.
    if (found == trainees.end() || !may_train_as(training_user(request), *found))
      throw Refusal(404, "there is no trainee of that name whose results you may see");
    return results.attempts();
  });
  ordered_json attempts = ordered_json::array();
  for (const ExclusionRecord& record : records) {
    if (record.trainee != name || record.object != object) continue;
    attempts.push_back(
        {{"attempt", record.number},
         {"session", record.session},
         {"test", record.test},
         {"tests_without_result_before",
          record.test ? trainer::tests_without_result_before(records, record) : 0},
         {"stress_shown", record.stress_shown},
         {"fingers", record.fingers},
         {"instrument", record.instrument},
         {"ending", trainer::name_of(record.ending)},
         {"score", trainer::score_json(record.score)},
         {"case", record.sealed_case},
         {"questionnaire",
          record.questionnaire ? trainer::questionnaire_json(*record.questionnaire) : ordered_json(nullptr)},
         {"checklist",
          record.checklist ? trainer::checklist_json(*record.checklist) : ordered_json(nullptr)}});
  }
  ordered_json curves = ordered_json::array();
  const std::vector<ExclusionRecord> comparable = trainer::comparable_records(records, name, object);
  for (const trainer::Measure measure : trainer::kMeasures)
    curves.push_back(curve_json(comparable, name, object, measure));
  return Response::json({{"trainee", name}, {"object", object}, {"attempts", attempts}, {"curves", curves}});
}

}  // namespace

void add_training_routes(Router& router, TrainingRoom& room) {
  router.add("GET", "api/training", Right::kTrain,
             [&room](const Request& request) { return training(room, request); });
  router.add("POST", "api/training/trainees", Right::kTrain,
             [&room](const Request& request) { return add_trainee(room, request); });
  router.add("GET", "api/training/trainees/{trainee:text}/results", Right::kTrain,
             [&room](const Request& request) { return results_of(room, request); });
  router.add("POST", "api/training/attempts/{attempt:number}/case", Right::kTrain,
             [&room](const Request& request) {
               const SealedAttempt sealed =
                   room.seal(training_user(request), static_cast<std::int64_t>(request.number("attempt")));
               return Response::json({{"case", sealed.case_id}, {"verdict", sealed.verdict}}, 201);
             });
  router.add("POST", "api/training/attempts/{attempt:number}/questionnaire", Right::kTrain,
             [&room](const Request& request) {
               room.keep_questionnaire(training_user(request),
                                       static_cast<std::int64_t>(request.number("attempt")),
                                       trainer::questionnaire_of(request.json()));
               return Response::json({{"kept", true}});
             });
  router.add("POST", "api/training/attempts/{attempt:number}/checklist", Right::kTrain,
             [&room](const Request& request) {
               room.keep_checklist(training_user(request),
                                   static_cast<std::int64_t>(request.number("attempt")),
                                   trainer::checklist_of(request.json()));
               return Response::json({{"kept", true}});
             });
  router.add("GET", "api/training/attempts/{attempt:number}/certificate.pdf", Right::kTrain,
             [&room](const Request& request) {
               const auto number = static_cast<std::int64_t>(request.number("attempt"));
               return Response::bytes(
                          room.certificate(training_user(request), number, asked_language(request)),
                          "application/pdf")
                   .with("Content-Disposition", "inline; filename=\"certificate.pdf\"");
             });
  Route attempt;
  attempt.method = "GET";
  attempt.pattern = "api/training/attempt";
  attempt.right = Right::kTrain;
  attempt.body_limit = kLongestPageMessage;
  attempt.socket = [&room](const Request& request, std::shared_ptr<SocketOutput> output) {
    return std::make_unique<AttemptSocket>(room, training_user(request), std::move(output));
  };
  router.add(std::move(attempt));
}

}  // namespace kiroku::viewer
