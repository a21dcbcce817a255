// What a person says of the fluoroscopy that a plan's radiographs are compared with. Functions; thread-safe.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "archive/format/ledger_entry.h"

namespace kiroku::viewer {

struct FluoroscopyFields {
  std::vector<std::string> arguments;  // of `kiroku compare`; none where nothing was said
  std::string geometry;                // JSON, read under ComparisonProgramCall::kFurtherFile
};

/// "fluoroscopy" of a body: {"stream", "geometry", "align_at_ns"?, "polarity"?}; nothing where it is absent
/// or null. Refusal 400 for what is wrong in it, a stream among that which the case does not have as
/// pictures.
FluoroscopyFields take_fluoroscopy(const nlohmann::json& body, const archive::OpenEntry& opening);

}  // namespace kiroku::viewer
