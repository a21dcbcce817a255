// What a closed study came to, as tables, JSON, CSV, PDF and a page. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "base/check.h"
#include "viewer/study/closing.h"
#include "viewer/study/findings.h"
#include "viewer/study/study.h"

namespace kiroku::apps {

struct StudyResult {
  study::Study study;
  study::StudyKey key;
  study::Closing closing;
  std::vector<Check> checks;  // of files and time-stamps
  std::vector<study::Rating> ratings;
  study::Findings findings;
};

std::string study_text(const StudyResult& result);
nlohmann::ordered_json study_json(const StudyResult& result);
/// Every answer in a row, with what was shown.
std::string study_csv(const StudyResult& result);
Bytes study_pdf(const StudyResult& result);
std::string study_html(const StudyResult& result);

}  // namespace kiroku::apps
