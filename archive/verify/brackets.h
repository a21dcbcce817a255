// What tokens prove of entries. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "archive/verify/report.h"

namespace kiroku::archive {

/// A token in the ledger: its entry says that the token existed then, its checkpoint what existed before it.
struct StampedToken {
  std::uint64_t entry = 0;
  std::uint64_t checkpoint = 0;  // tree size, at most `entry`
  UtcTime gen_time;
  std::int64_t accuracy_ns = 0;
  std::string authority;
  std::string root = {};  // SHA-256 of the trusted certificate that vouches for it; a ledger chooses names
  std::string file = {};  // in the case
  bool outside = false;   // of an outside authority; else the recorder's own
  std::int64_t entered_ns = 0;  // the case clock of its entry

  [[nodiscard]] UtcTime earliest() const;  // gen_time - accuracy, rounded down to microseconds
  // gen_time + accuracy, rounded up. Of an authority that states whole seconds and no accuracy the second may
  // have been cut off (RFC 3161 2.4.2: the fraction may be left out): gen_time + 1 s.
  [[nodiscard]] UtcTime latest() const;
};

/// Runs of the entries [first, end) with the same bounds. An entry was written after the latest `earliest()`
/// of the tokens whose entry is not after it, and before the earliest `latest()` of the tokens whose
/// checkpoint covers it. `tokens` in any order.
std::vector<Bracket> brackets_of(const std::vector<StampedToken>& tokens, std::uint64_t first,
                                 std::uint64_t end);

}  // namespace kiroku::archive
