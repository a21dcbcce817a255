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

  [[nodiscard]] UtcTime earliest() const;  // gen_time - accuracy, rounded down to microseconds
  [[nodiscard]] UtcTime latest() const;    // gen_time + accuracy, rounded up
};

/// Runs of the entries [first, end) with the same bounds. An entry was written after the latest `earliest()`
/// of the tokens whose entry is not after it, and before the earliest `latest()` of the tokens whose
/// checkpoint covers it. `tokens` in any order.
std::vector<Bracket> brackets_of(const std::vector<StampedToken>& tokens, std::uint64_t first,
                                 std::uint64_t end);

}  // namespace kiroku::archive
