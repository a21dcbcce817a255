// What people say of an attempt that is over: of the trainer, in a questionnaire, and of the trainee, in an
// examiner's checklist. Plain data; functions are pure and thread-safe.
//
// Source of the questions and their scale: "Construction of Training Environment for Surgical Exclusion with
// a Basic Study of Multi-finger Haptic Interaction", section 6.3. The checklist is the project's own: the
// study names the OSCE (objective structured clinical examination) as a use, and gives no items.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace kiroku::trainer {

struct Question {
  std::string_view name;  // by which it is kept and sealed
  std::string_view text;
  double study_mean;  // of the study's three surgeons
};
inline constexpr std::array<Question, 3> kQuestions{{
    {"organ-feel", "the trainer gives the feel of an organ", 1.3},
    {"useful", "it is useful to train pushing organs aside", 1.7},
    {"stress-helps", "showing stress helps", 1.7},
}};
inline constexpr int kLeastAnswer = -2, kMostAnswer = 2;
inline constexpr std::size_t kLongestComment = 6000, kLongestExaminer = 100;  // bytes

struct Questionnaire {
  std::array<std::optional<int>, kQuestions.size()> answers;  // kLeastAnswer to kMostAnswer; absent: none
  std::string comment;                                        // UTF-8, may have several lines; may be empty
  std::string account;                                        // the user who filled it in
  bool operator==(const Questionnaire&) const = default;
};

enum class ItemState { kDone, kNotDone, kNotSeen };
/// "done", "not-done", "not-seen"; the other way nothing for other texts.
std::string_view name_of(ItemState state);
std::optional<ItemState> item_state(std::string_view name);

struct ChecklistItem {
  std::string_view name, text;
};
inline constexpr std::array<ChecklistItem, 8> kChecklistItems{{
    {"looks-first", "looks where the organ's border is before touching it"},
    {"touches-gently", "touches the border without a push"},
    {"shares-the-load", "lets all fingers bear the organ"},
    {"lifts-steadily", "lifts steadily, without jerks"},
    {"minds-the-limit", "eases off when stress or force grows"},
    {"keeps-hold", "does not let the organ slip"},
    {"keeps-the-view", "keeps in sight what was hidden"},
    {"lets-down-slowly", "lets the organ down slowly"},
}};
/// From the worst to the best.
inline constexpr std::array<std::string_view, 5> kRatings{"clear fail", "borderline", "clear pass", "good",
                                                          "excellent"};

struct Checklist {
  std::array<ItemState, kChecklistItems.size()> items{};
  int global_rating = 1;  // 1 to kRatings.size()
  std::string examiner;   // as the person at the page wrote the name
  std::string account;    // the user who filled it in
  bool operator==(const Checklist&) const = default;
};
std::size_t items_done(const Checklist& checklist);

/// Throws kiroku::UsageError that names the field: for an answer or a rating out of range, a text that is too
/// long or has characters that mislead (base/printable.h), an examiner without a name, and a questionnaire
/// that says nothing.
void require_sound(const Questionnaire& questionnaire);
void require_sound(const Checklist& checklist);

}  // namespace kiroku::trainer
