// Decodes a sealed segment and compares it with what its ledger entry states.
#pragma once

#include "archive/verifier.h"

namespace kiroku::media {

/// For archive::VerifyOptions::inspect: video must decode to the stated number of frames without an error,
/// vitals must be JSON Lines with the stated number of samples. Thread-safe.
archive::SegmentInspector decoding_inspector();

}  // namespace kiroku::media
