// Which lines of an events stream are events of the case: those to which a `mark` entry of its ledger
// commits, each once. An object belongs to one thread.
#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "archive/reading/case_reader.h"
#include "crypto/hash.h"

namespace kiroku::archive {

class CommittedEvents {
 public:
  /// Throws kiroku::Error as CaseReader::for_each.
  explicit CommittedEvents(const CaseReader& recording);

  /// The event of a line, as text, if an entry commits to it, and no line before was it.
  [[nodiscard]] std::optional<std::string> take(std::string_view line);
  /// Entries whose event was not taken yet.
  [[nodiscard]] std::size_t lacking() const { return left_.size(); }

 private:
  std::multiset<crypto::Sha256Digest> left_;
};

}  // namespace kiroku::archive
