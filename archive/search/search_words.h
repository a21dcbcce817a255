// By what a case can be found: what its subject says of the patient's number and the procedure's code,
// written so that it is the same however somebody types it. In the clear: never stored. Pure, thread-safe.
#pragma once

#include <string>
#include <string_view>

#include "base/bytes.h"

namespace kiroku::search {

inline constexpr std::size_t kLongestWord = 256;  // bytes as they are given; a longer one is none

/// What is not known is empty.
struct SearchWords {
  std::string patient, authority;  // the patient's number, and who gave it
  std::string code, system;        // of the procedure
  [[nodiscard]] bool empty() const { return patient.empty() && code.empty(); }
  bool operator==(const SearchWords&) const = default;
};

/// NFKC and folded case, without blanks and invisible characters, every dash a hyphen.
std::string normal_word(std::string_view text);
/// The same; digits alone lose their leading zeros.
std::string normal_number(std::string_view text);

/// Of a subject file (docs/reference/format-streams.md); none of what is no such JSON.
SearchWords words_of_subject(ByteView subject);

}  // namespace kiroku::search
