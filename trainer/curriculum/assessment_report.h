// What was said of attempts, as a table and as parts of the training report. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include "trainer/curriculum/learning.h"
#include "trainer/report/plot.h"

namespace kiroku::trainer {

/// A line for each attempt of which a questionnaire or a checklist was filled in, with its head.
std::string assessments_csv(const std::vector<ExclusionRecord>& records);
/// The questionnaires together, beside the study's means, and a row for each checklist; no part where there
/// is none of either.
std::vector<ReportBlock> assessment_blocks(const std::vector<ExclusionRecord>& records);

}  // namespace kiroku::trainer
