// Proofs that an entry is in a log, for whoever has neither the log nor a network (C2SP tlog-proof.md, v1).
// Values; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::crypto {

/// What a .tlog-proof states. None of it is proved before verify_tlog_proof().
struct TlogProof {
  /// Longer texts are not parsed: a long entry in base64 and a checkpoint with many cosignatures have less.
  static constexpr std::size_t kMostBytes = 2U << 20U;
  /// An inclusion proof is no longer than the tree is high.
  static constexpr std::size_t kMostHashes = 63;

  std::optional<Bytes> extra;      // whatever the application needs to know the entry; nothing signs it
  std::uint64_t index = 0;         // of the entry in the log
  std::vector<Sha256Digest> path;  // RFC 6962 2.1.1, from the leaf's sibling to the root's child
  std::string note;                // the signed checkpoint, verbatim

  [[nodiscard]] std::string to_text() const;
};

struct ParsedTlogProof {
  std::optional<TlogProof> proof;
  std::string why;  // it is none: what is wrong, and on which line
};
/// As strict as to_text() writes: what is accepted is written again, letter for letter. The checkpoint's form
/// is not looked at.
ParsedTlogProof parse_tlog_proof(std::string_view text);

/// The checkpoint in which the proof shows the entry, if one of `log_keys` signed it for `origin`, and which
/// of them did; or why it shows nothing, in half a sentence. Extension lines of the checkpoint say nothing
/// here. Who cosigned it is for judge_witnesses() to say.
struct VerifiedTlogProof {
  std::optional<Checkpoint> checkpoint;
  std::vector<VerifierKey> signers;
  /// It may be a good proof for whoever knows other keys.
  bool unknown_signer = false;
  std::string why;
};
VerifiedTlogProof verify_tlog_proof(const TlogProof& proof, ByteView entry,
                                    const std::vector<VerifierKey>& log_keys, std::string_view origin);

}  // namespace kiroku::crypto
