// What stands in the events stream of a case beside its time: marks, and what became known of the patient
// while the case ran. A function; thread-safe.
#pragma once

#include <cstddef>
#include <functional>

#include <nlohmann/json_fwd.hpp>

#include "viewer/playback/case_media.h"

namespace kiroku::playback {

/// Calls `visit` with each event (docs/reference/format-streams.md, "The events stream"), a JSON object, in
/// the order of the stream. An event that no `mark` entry of the ledger commits to is left out. To so many
/// events the ledger commits whose lines are not there: erased, lost, or not sealed yet. Opens nothing where
/// the ledger has no such entry. Throws kiroku::Error as media::SealedSegment::open, and whatever `visit`
/// throws.
std::size_t for_each_event(const CaseMedia& media,
                           const std::function<void(const nlohmann::json& event)>& visit);

}  // namespace kiroku::playback
