// What a session is asked for: whether it can be done at all, and how it stands in the case's ledger. Pure
// functions, but for the look at a source's address.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "archive/format/ledger_entry.h"
#include "recorder/session.h"
#include "recorder/source/source_address.h"

namespace kiroku::recorder {

/// Throws kiroku::UsageError for options that contradict themselves or the format.
void require_valid(const SessionOptions& options);

/// Where the stream of that name stands; how many there are, if none has it.
std::size_t index_of(const std::vector<StreamRequest>& requests, const std::string& name);

/// Nothing where none is asked for. Throws kiroku::UsageError for an address of something else.
std::optional<SourceAddress> microphone_of(const StreamRequest& request);

/// The address of a stream's pictures or vital signs. Throws kiroku::UsageError where a session cannot record
/// from it, kiroku::Error where it must be there and is not.
SourceAddress checked_address(const StreamRequest& request, const SessionOptions& options);

/// Stands in the source of a stream that archives another one's pictures a second time, before its name.
inline constexpr std::string_view kPicturesOfStream = "; the pictures of stream ";
/// What the ledger's first entry says of a stream (docs/reference/format.md).
archive::StreamInfo stream_info(const StreamRequest& request, const SourceAddress& address, bool video);
inline constexpr const char* kEventsPurpose = "marks of the operator";
inline constexpr const char* kPointingPurpose = "where people pointed on live pictures";
archive::StreamInfo events_info(const crypto::AgeRecipients& recipients);
archive::StreamInfo pointing_info(const crypto::AgeRecipients& recipients);

/// The numbers of the patient and the visit that a subject's JSON states, as a recorder writes it; none where
/// it is otherwise.
std::vector<PatientNumber> numbers_of_subject(const Bytes& json);

/// An event of the case: `video` are its streams, as no stream named means all of pictures.
nlohmann::ordered_json json_of(const ProfileDecision& decision, const std::vector<StreamRequest>& video);

}  // namespace kiroku::recorder
