// The numbers of an attempt as a recorder reads vital signs (recorder/vitals/csv_source.h). Pure,
// thread-safe.
#pragma once

#include <string>

#include "trainer/exclusion/exclusion_run.h"

namespace kiroku::apps {

inline constexpr const char* kVitalsHead = "time,code,value,unit\n";

/// One line a quantity.
std::string vitals_lines(const trainer::ExclusionView& view);

/// The outcome as a mark of the case says it.
std::string in_words(const trainer::ExclusionScore& score);

}  // namespace kiroku::apps
