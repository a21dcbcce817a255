// excerpt.json: what an excerpt is of, and the proofs that its lines are those of the case
// (docs/reference/format.md, "Excerpts"). Pure functions, thread-safe.
//
// An excerpt folder holds
//   excerpt.json           this document: one line of JSON and LF
//   ledger-open.jsonl      entry 0 of the case, its line verbatim, with LF
//   ledger-part.jsonl      entries [first_entry, size), their lines verbatim, each with LF
//   checkpoints/ tokens/   the note of tree size `size`; every token whose entry is among the lines, and the
//                          notes these are over
//   segments/…             segments of the selected streams that meet [from_ns, to_ns); a re-keyed one has
//   its
//                          original age header beside it as NAME.header
//   device.pub authorities/  as in the case
// The keys of excerpt.json, in this order:
//   format       "kiroku-excerpt/1"
//   case         identifier of the case
//   from_ns to_ns  selected time on the case clock, half open
//   streams      names of the selected streams
//   first_entry  number of the first line of ledger-part.jsonl
//   size         tree size of the checkpoint that covers all lines; it is the number after the last line
//   open_proof   RFC 6962 audit path of entry 0 in the tree of `size`: hashes in lower-case hex, leaf to root
//   left         the largest complete subtrees over the entries before first_entry, left to right: with the
//                lines they give the root at every size in (first_entry, size]
//   earlier      [{size, proof}]: for every note of a size not above first_entry, the RFC 6962 consistency
//                proof from that size to `size`
//   made_utc     optional: when the excerpt was made
//   made_by      optional: who made it
// There is at least one stream, none stands twice, and from_ns is before to_ns. Nothing proves made_utc and
// made_by: whoever has the folder can write there what they like.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/limits.h"
#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::archive {

inline constexpr std::string_view kExcerptFormat = "kiroku-excerpt/1";
inline constexpr std::string_view kExcerptFile = "excerpt.json";
inline constexpr std::string_view kExcerptOpenFile = "ledger-open.jsonl";
inline constexpr std::string_view kExcerptLinesFile = "ledger-part.jsonl";

struct ExcerptDocument {
  struct Earlier {
    std::uint64_t size = 0;
    std::vector<crypto::Sha256Digest> proof;
  };
  std::string case_id;
  std::int64_t from_ns = 0, to_ns = 0;
  std::vector<std::string> streams;
  std::uint64_t first_entry = 0, size = 0;
  std::vector<crypto::Sha256Digest> open_proof, left;
  std::vector<Earlier> earlier;
  std::optional<UtcTime> made_utc;
  std::string made_by;  // empty: not stated
};

/// With LF.
std::string to_text(const ExcerptDocument& document);

struct ExcerptParse {
  std::optional<ExcerptDocument> document;
  std::string problem;
};
ExcerptParse parse_excerpt(std::string_view text);

}  // namespace kiroku::archive
