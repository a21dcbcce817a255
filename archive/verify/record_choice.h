// Which of several evidence records of one case counts. A store keeps every version of one, an appliance and
// its fleet may both renew it, and whoever may put can put more. Functions; thread-safe.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "archive/verify/case_evidence.h"
#include "crypto/hash.h"

namespace kiroku::archive {

struct RecordChoice {
  std::size_t index = 0;
  /// All that it covers was compared with the case and holds, now or as `is_known_to_hold` says.
  bool holds = false;
};

/// `records` has one at least, each of them once. The first that holds for the whole case: those of outside
/// authorities alone in front, of these the one that proves the earliest time, of these the one with the
/// newest time-stamp. Where none holds, the first of
/// that order. Files are read for records under another hash than SHA-256 alone, once under each; and none
/// where `is_known_to_hold` says so of a record. Throws kiroku::Error where the ledger cannot be read.
RecordChoice choose_record(const CaseFolder& folder, const std::vector<Bytes>& records,
                           const evidence::JudgingRules& rules,
                           const std::function<bool(const crypto::Sha256Digest&)>& is_known_to_hold);

}  // namespace kiroku::archive
