// One thing that was looked at and what was found. Plain values; header-only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/utc_time.h"

namespace kiroku {

/// What lacks is not known: neither true nor false.
struct Check {
  enum class Answer { kHolds, kDiffers, kUnknown };
  std::string what;  // "time"
  Answer answer = Answer::kHolds;
  std::string text;  // one sentence

  // The sentence's values, for who says it in another language.
  std::optional<std::uint64_t> entry = {};  // number of an entry of the appliance log
  std::optional<std::uint64_t> size = {};   // of a ledger: how many entries
  std::optional<UtcTime> time = {};
  std::string by = {};    // an authority or a person
  std::string kind = {};  // of an authority: "external", "self-issued"; what `by` says is only its name
};

inline const char* answer_name(Check::Answer answer) {
  switch (answer) {
    case Check::Answer::kHolds:
      return "holds";
    case Check::Answer::kDiffers:
      return "differs";
    case Check::Answer::kUnknown:
      break;
  }
  return "could-not-check";
}

/// Of all of them: differs where one does, else not known where one is.
template <typename Checks>
Check::Answer verdict_of(const Checks& checks) {
  Check::Answer verdict = Check::Answer::kHolds;
  for (const Check& check : checks) {
    if (check.answer == Check::Answer::kDiffers) return Check::Answer::kDiffers;
    if (check.answer == Check::Answer::kUnknown) verdict = Check::Answer::kUnknown;
  }
  return verdict;
}

}  // namespace kiroku
