// Reads the codes of a display (light/) in a case's pictures.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "light/ledger_lights.h"
#include "light/light_judge.h"

namespace kiroku::media {

/// A stream's pictures beside the ledger's codes.
struct StreamLight {
  light::LightReport report;
  std::uint64_t segments = 0, erased = 0;
  /// Segments that could not be looked at, and why the first of them could not.
  std::uint64_t unread_segments = 0;
  std::string why_unread;
};

using LightProgress = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Every segment of `stream` whose file is what the ledger says is decrypted, and decoded in a box
/// (box/boxed_jobs.h). Throws kiroku::UsageError for a stream that there is not or that has no pictures,
/// kiroku::IoError, crypto::AgeError where none of the identities fits any segment.
StreamLight read_light(const archive::CaseReader& recording, const light::LedgerLights& ledger,
                       const std::string& stream, const crypto::AgeIdentities& identities,
                       const LightProgress& progress = {});

}  // namespace kiroku::media
