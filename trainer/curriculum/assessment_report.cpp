#include "trainer/curriculum/assessment_report.h"

#include <algorithm>
#include <utility>

#include "base/csv_field.h"
#include "base/number_text.h"
#include "base/printable.h"

namespace kiroku::trainer {
namespace {

std::string with_sign(double number, int digits) {
  return (number > 0 ? "+" : "") + number_text(number, digits);
}

/// What all who answered said of the trainer, and their words.
std::optional<ReportBlock> block_of_questionnaires(const std::vector<ExclusionRecord>& records) {
  ReportBlock block;
  block.heading = "Questionnaire";
  block.table.push_back({"statement", "answers", "mean", "least", "greatest", "the exclusion study's mean"});
  std::size_t asked = 0;
  std::string comments;
  for (const ExclusionRecord& record : records) {
    if (!record.questionnaire) continue;
    ++asked;
    if (record.questionnaire->comment.empty()) continue;
    comments += (comments.empty() ? " In words: " : "; ") + printable(record.questionnaire->account) +
                " of attempt " + std::to_string(record.number) + ": \"" +
                printable(record.questionnaire->comment) + "\"";
  }
  if (asked == 0) return std::nullopt;
  for (std::size_t i = 0; i < kQuestions.size(); ++i) {
    std::vector<double> answers;
    for (const ExclusionRecord& record : records) {
      if (record.questionnaire && record.questionnaire->answers.at(i))
        answers.push_back(*record.questionnaire->answers.at(i));
    }
    const Question& question = kQuestions.at(i);
    std::vector<std::string> row{std::string(question.text), std::to_string(answers.size())};
    if (answers.empty()) {
      row.insert(row.end(), {"", "", ""});
    } else {
      const auto [least, greatest] = std::ranges::minmax(answers);
      row.insert(row.end(),
                 {with_sign(summary_of(answers).mean, 2), with_sign(least, 1), with_sign(greatest, 1)});
    }
    row.push_back(with_sign(question.study_mean, 2));
    block.table.push_back(std::move(row));
  }
  block.text = std::to_string(asked) + (asked == 1 ? " questionnaire" : " questionnaires") +
               "; answers from -2 to +2. One person may have answered after several attempts." + comments;
  return block;
}

/// How examiners saw each attempt.
std::optional<ReportBlock> block_of_checklists(const std::vector<ExclusionRecord>& records) {
  ReportBlock block;
  block.heading = "Examiners' checklists";
  block.text = "Items done of those that were seen; the global rating is from 1 (" +
               std::string(kRatings.front()) + ") to " + std::to_string(kRatings.size()) + " (" +
               std::string(kRatings.back()) + ").";
  block.table.push_back(
      {"attempt", "trainee", "session", "object", "items done", "not done", "rating", "examiner"});
  for (const ExclusionRecord& record : records) {
    if (!record.checklist) continue;
    const Checklist& checklist = *record.checklist;
    std::string not_done;
    for (std::size_t i = 0; i < kChecklistItems.size(); ++i) {
      if (checklist.items.at(i) == ItemState::kNotDone)
        not_done += (not_done.empty() ? "" : ", ") + std::string(kChecklistItems.at(i).name);
    }
    const auto seen = static_cast<std::ptrdiff_t>(kChecklistItems.size()) -
                      std::ranges::count(checklist.items, ItemState::kNotSeen);
    block.table.push_back(
        {std::to_string(record.number), printable(record.trainee), std::to_string(record.session),
         record.object, std::to_string(items_done(checklist)) + " of " + std::to_string(seen), not_done,
         std::to_string(checklist.global_rating) + ", " +
             std::string(kRatings.at(static_cast<std::size_t>(checklist.global_rating) - 1)),
         printable(checklist.examiner)});
  }
  if (block.table.size() == 1) return std::nullopt;
  return block;
}

}  // namespace

std::string assessments_csv(const std::vector<ExclusionRecord>& records) {
  std::string csv = "attempt,trainee,session,kind,object,case";
  for (const Question& question : kQuestions) csv += "," + csv_field(std::string(question.name));
  csv += ",comment,answered_by";
  for (const ChecklistItem& item : kChecklistItems) csv += "," + csv_field(std::string(item.name));
  csv += ",global_rating,examiner,filled_in_by\n";
  for (const ExclusionRecord& record : records) {
    if (!record.questionnaire && !record.checklist) continue;
    csv += std::to_string(record.number) + "," + csv_field(record.trainee) + "," +
           std::to_string(record.session) + (record.test ? ",test," : ",practice,") +
           csv_field(record.object) + "," + csv_field(record.sealed_case);
    const Questionnaire said = record.questionnaire.value_or(Questionnaire());
    for (const std::optional<int> answer : said.answers) csv += "," + (answer ? std::to_string(*answer) : "");
    csv += "," + csv_field(said.comment) + "," + csv_field(said.account);
    if (const std::optional<Checklist>& checklist = record.checklist) {
      for (const ItemState state : checklist->items) csv += "," + std::string(name_of(state));
      csv += "," + std::to_string(checklist->global_rating) + "," + csv_field(checklist->examiner) + "," +
             csv_field(checklist->account);
    } else {
      csv += std::string(kChecklistItems.size() + 3, ',');
    }
    csv += "\n";
  }
  return csv;
}

std::vector<ReportBlock> assessment_blocks(const std::vector<ExclusionRecord>& records) {
  std::vector<ReportBlock> blocks;
  if (std::optional<ReportBlock> block = block_of_questionnaires(records))
    blocks.push_back(std::move(*block));
  if (std::optional<ReportBlock> block = block_of_checklists(records)) blocks.push_back(std::move(*block));
  return blocks;
}

}  // namespace kiroku::trainer
