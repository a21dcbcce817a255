// A case on disk with given plaintexts, as the archive's writer makes it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "crypto/age_recipient.h"

namespace kiroku::test {

struct RecordedStream {
  std::string name, kind, media;
  std::vector<Bytes> segments;       // plaintexts, a second of the case clock each
  std::vector<std::uint64_t> units;  // frames, samples or lines of each segment
  /// The last segment was being written when the power failed: never sealed, entered as incomplete.
  bool last_is_cut = false;
  /// The first segment's file was removed by retention ("after 30 days"), and the ledger says so.
  bool first_is_erased = false;
  /// When each segment begins on the case clock; absent: one after the other from 0. What lies between is
  /// stated as gaps.
  std::vector<std::int64_t> starts_ns = {};
  /// Time stamps of the segments' first pictures, in 1/90000 s; absent: those of the case clock.
  std::vector<std::int64_t> first_pts = {};
  /// Lines of events for which no mark is entered.
  std::vector<std::string> not_entered = {};
};

/// Someone who can open what is sealed to her.
struct Reader {
  crypto::AgeRecipients recipients;
  crypto::AgeIdentities identities;
  std::string identity_text = {};  // as an identity file holds it
};
Reader make_reader();

/// Makes the archive folder if need be, and the case in it; its folder.
std::filesystem::path record_case(const std::filesystem::path& archive,
                                  const std::vector<RecordedStream>& streams,
                                  const crypto::AgeRecipients& recipients);

}  // namespace kiroku::test
