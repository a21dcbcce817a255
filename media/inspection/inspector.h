// Decodes a sealed segment and compares it with what its ledger entry states.
#pragma once

#include "archive/verify/verify_options.h"

namespace kiroku::media {

/// For archive::VerifyOptions::inspect. Video must be one film in one container (container_form.h) and decode
/// to the stated number of frames without an error. Its first time stamp must be the stated one. All must
/// rise, and last no longer than the segment and what a recorder spreads a burst over. Vitals must be as
/// vital_line.h says and within the segment's time to a millisecond, events JSON objects, one a line, and as
/// many as stated. A segment with complete = false may end anywhere; what it holds until there is not counted
/// against what is stated, which may include what was lost. Of one that recovery found no times are compared.
/// What does not hold is returned, with an identity that does not fit among it. What keeps the file from
/// being read is thrown: kiroku::IoError, crypto::SourceChanged, std::bad_alloc. Thread-safe. What is demuxed
/// and decoded is so in boxes (box/boxed_jobs.h), as many as threads call at once: a decoder that is killed
/// by what it decodes is something that does not hold; that none can be started, or that one was killed from
/// outside, is thrown as kiroku::IoError.
archive::SegmentInspector decoding_inspector();

}  // namespace kiroku::media
