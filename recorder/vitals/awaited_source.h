// A source of vital signs that is not there yet.
#pragma once

#include <memory>
#include <string>

#include "recorder/source/source_address.h"
#include "recorder/vitals/vital_source.h"

namespace kiroku::recorder {

/// Stands for a source that could not be opened, with the sentence that said `why`: a notice says so in the
/// stream, opening is tried again each few seconds, another notice says when it came, and then it gives what
/// the source gives; what states times before that moment is stamped with it. `clock` must outlive the
/// source.
std::unique_ptr<VitalSource> await_vital_source(const SourceAddress& address, const CaseClock& clock,
                                                const std::string& why);

}  // namespace kiroku::recorder
