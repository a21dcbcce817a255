#include "trainer/assessment/assessment.h"

#include <algorithm>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::trainer {
namespace {

constexpr std::array<std::pair<ItemState, std::string_view>, 3> kItemStates{
    {{ItemState::kDone, "done"}, {ItemState::kNotDone, "not-done"}, {ItemState::kNotSeen, "not-seen"}}};

/// Line by line: a comment may have several.
bool is_readable(std::string_view text) {
  while (true) {
    const std::size_t end = text.find('\n');
    if (first_unprintable(text.substr(0, end))) return false;
    if (end == std::string_view::npos) return true;
    text.remove_prefix(end + 1);
  }
}

}  // namespace

std::string_view name_of(ItemState state) {
  return std::ranges::find(kItemStates, state, &decltype(kItemStates)::value_type::first)->second;
}

std::optional<ItemState> item_state(std::string_view name) {
  const auto found = std::ranges::find(kItemStates, name, &decltype(kItemStates)::value_type::second);
  if (found == kItemStates.end()) return std::nullopt;
  return found->first;
}

std::size_t items_done(const Checklist& checklist) {
  return static_cast<std::size_t>(std::ranges::count(checklist.items, ItemState::kDone));
}

void require_sound(const Questionnaire& questionnaire) {
  bool says_something = !questionnaire.comment.empty();
  for (std::size_t i = 0; i < kQuestions.size(); ++i) {
    const std::optional<int> answer = questionnaire.answers.at(i);
    if (!answer) continue;
    says_something = true;
    if (*answer < kLeastAnswer || *answer > kMostAnswer)
      throw UsageError("'" + std::string(kQuestions.at(i).name) + "' must be from " +
                       std::to_string(kLeastAnswer) + " to " + std::to_string(kMostAnswer) + ", not " +
                       std::to_string(*answer));
  }
  if (questionnaire.comment.size() > kLongestComment || !is_readable(questionnaire.comment))
    throw UsageError("'comment' must be a text of at most " + std::to_string(kLongestComment) +
                     " bytes without control characters and others that cannot be seen");
  if (!says_something)
    throw UsageError("'answers' and 'comment' say nothing: answer a question or write a comment");
}

void require_sound(const Checklist& checklist) {
  if (checklist.global_rating < 1 || checklist.global_rating > static_cast<int>(kRatings.size()))
    throw UsageError("'global_rating' must be from 1 to " + std::to_string(kRatings.size()) + ", not " +
                     std::to_string(checklist.global_rating));
  if (checklist.examiner.empty() || checklist.examiner.size() > kLongestExaminer ||
      first_unprintable(checklist.examiner))
    throw UsageError("'examiner' must be a name of at most " + std::to_string(kLongestExaminer) +
                     " bytes without control characters and others that cannot be seen");
}

}  // namespace kiroku::trainer
