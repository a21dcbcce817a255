// A score as score.json, the page and a sealed case tell it. A pure function.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "trainer/exclusion/exclusion_score.h"

namespace kiroku::trainer {

nlohmann::ordered_json score_json(const ExclusionScore& score);

}  // namespace kiroku::trainer
