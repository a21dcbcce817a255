// What a person says where the plan's organ shall be found in the recorded pictures by itself. Functions;
// thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "archive/format/ledger_entry.h"

namespace kiroku::viewer {

/// As sim/align/organ_track.h and viewer/compare/organ_alignment.h have them, which have no place in a server
/// beside a recorder; a test compares the two.
inline constexpr double kLeastAlignedFieldDeg = 10, kGreatestAlignedFieldDeg = 120;
inline constexpr std::int64_t kLongestAlignedStretchNs = 3'600'000'000'000,
                              kLongestDeformedStretchNs = 600'000'000'000;

/// "alignment" of a body: {"field_deg", "view"?, "from_ns"?, "to_ns"?, "organ"?}, as arguments of `kiroku
/// compare`; none where it is absent or null. Refusal 400 for what is wrong in it, and beside a registration
/// in "by_hand": both say where the organ is.
std::vector<std::string> take_alignment(const nlohmann::json& body, const archive::OpenEntry& opening);

}  // namespace kiroku::viewer
