// What is to be known of a stretch of a case that was taken out of it. Pure functions; thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "archive/format/ledger_entry.h"
#include "archive/reading/wall_clock.h"

namespace kiroku::apps {

/// That the recorder's clock was set in the course of the case, when and by how much: a sentence with its
/// line feed; "" where it was not.
std::string clock_set_words(const archive::WallClock& clock, std::int64_t begins_ns);
nlohmann::ordered_json clock_set_json(const archive::WallClock& clock);

/// Those that meet the stretch.
std::vector<archive::GapEntry> gaps_within(std::vector<archive::GapEntry> gaps, const archive::Span& stretch);
/// "2 stated gaps, 7.3 s in all: at 00:01:02 for 1.5 s (source-lost), …"; "" for none.
std::string gap_words(const std::vector<archive::GapEntry>& gaps, std::int64_t begins_ns);
nlohmann::ordered_json gaps_json(const std::vector<archive::GapEntry>& gaps);

}  // namespace kiroku::apps
