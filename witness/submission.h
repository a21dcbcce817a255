// What a log sends to a witness (C2SP tlog-witness.md, add-checkpoint). Functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::witness {

/// "old SIZE", at most 63 hashes of a consistency proof, an empty line, a signed checkpoint.
struct Submission {
  std::uint64_t old_size = 0;
  std::vector<crypto::Sha256Digest> proof;
  std::string note;  // the checkpoint with its signature lines
  std::string text;  // what they sign
  crypto::Checkpoint checkpoint;

  /// As the body of a request.
  [[nodiscard]] std::string to_text() const;
};
inline constexpr std::size_t kMostProofLines = 63;

struct ParsedSubmission {
  std::optional<Submission> submission;
  std::string why;  // it is none, in half a sentence
};
ParsedSubmission parse_submission(std::string_view body);

}  // namespace kiroku::witness
