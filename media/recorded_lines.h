// The lines of a recorded stream of vital signs or events. A function; thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"

namespace kiroku::media {

/// Calls `visit` with every line, without its LF, of the stream's segments that meet [from_ns, to_ns), whole
/// ones, in order; segments that retention erased are passed over. Each segment's bytes are compared with the
/// ledger's hash before, and only those are decrypted. Throws kiroku::Error naming the segment, and whatever
/// `visit` throws.
void for_each_recorded_line(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                            const std::string& stream, std::int64_t from_ns, std::int64_t to_ns,
                            const std::function<void(std::string_view line)>& visit);

}  // namespace kiroku::media
