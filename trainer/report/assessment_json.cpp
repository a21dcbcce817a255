#include "trainer/report/assessment_json.h"

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

/// An object with these fields and no other.
template <typename Fields>
const json& with_fields(const json& object, const std::string& what, const Fields& fields) {
  bool fits = object.is_object() && object.size() == fields.size();
  for (const auto& field : fields) fits = fits && object.contains(std::string(field.name));
  if (fits) return object;
  std::string names;
  for (const auto& field : fields) names += (names.empty() ? "" : ", ") + std::string(field.name);
  throw UsageError(what + " must be an object with these fields and no other: " + names);
}

struct Field {
  std::string_view name;
};

std::string text_of(const json& object, const char* key) {
  if (!object.at(key).is_string()) throw UsageError("'" + std::string(key) + "' must be a text");
  return object.at(key).get<std::string>();
}

/// What is no whole number, or a huge one, is told as such: a conversion would cut it off.
int whole_number(const json& value, const std::string& name) {
  if (!value.is_number_integer() || value < -100 || value > 100)
    throw UsageError("'" + name + "' must be a small whole number");
  return value.get<int>();
}

}  // namespace

ordered_json questionnaire_json(const Questionnaire& questionnaire) {
  ordered_json answers = ordered_json::object();
  for (std::size_t i = 0; i < kQuestions.size(); ++i) {
    const std::optional<int> answer = questionnaire.answers.at(i);
    answers[std::string(kQuestions.at(i).name)] = answer ? ordered_json(*answer) : ordered_json(nullptr);
  }
  return {{"answers", answers}, {"comment", questionnaire.comment}, {"by", questionnaire.account}};
}

ordered_json checklist_json(const Checklist& checklist) {
  ordered_json items = ordered_json::object();
  for (std::size_t i = 0; i < kChecklistItems.size(); ++i)
    items[std::string(kChecklistItems.at(i).name)] = name_of(checklist.items.at(i));
  return {{"items", items},
          {"global_rating", checklist.global_rating},
          {"examiner", checklist.examiner},
          {"by", checklist.account}};
}

Questionnaire questionnaire_of(const json& told) {
  with_fields(told, "a questionnaire", std::array<Field, 2>{{{"answers"}, {"comment"}}});
  const json& answers = with_fields(told.at("answers"), "'answers'", kQuestions);
  Questionnaire questionnaire;
  for (std::size_t i = 0; i < kQuestions.size(); ++i) {
    const std::string name(kQuestions.at(i).name);
    if (!answers.at(name).is_null()) questionnaire.answers.at(i) = whole_number(answers.at(name), name);
  }
  questionnaire.comment = text_of(told, "comment");
  require_sound(questionnaire);
  return questionnaire;
}

Checklist checklist_of(const json& told) {
  with_fields(told, "a checklist", std::array<Field, 3>{{{"items"}, {"global_rating"}, {"examiner"}}});
  const json& items = with_fields(told.at("items"), "'items'", kChecklistItems);
  Checklist checklist;
  for (std::size_t i = 0; i < kChecklistItems.size(); ++i) {
    const std::string name(kChecklistItems.at(i).name);
    const json& value = items.at(name);
    const std::optional<ItemState> state =
        value.is_string() ? item_state(value.get<std::string>()) : std::nullopt;
    if (!state) throw UsageError("'" + name + "' must be done, not-done or not-seen");
    checklist.items.at(i) = *state;
  }
  checklist.global_rating = whole_number(told.at("global_rating"), "global_rating");
  checklist.examiner = text_of(told, "examiner");
  require_sound(checklist);
  return checklist;
}

}  // namespace kiroku::trainer
