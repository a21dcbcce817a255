// Who cosigned the log's checkpoint that holds a case's entries. A witness says of a log that it is the only
// one, and of a case nothing: what is found here changes no verdict. Functions; thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "archive/verify/log_proof.h"
#include "archive/verify/log_rules.h"
#include "archive/verify/outside_notes.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "crypto/witness_policy.h"

namespace kiroku::archive {

/// What a walk over the log showed, for the cosigned checkpoints that were given with it.
struct WalkedLog {
  std::vector<OutsideNotes::Held> notes;  // of this very log
  std::optional<std::uint64_t> opened;    // entry of the case's opening
  std::optional<KnownRoot> closed;        // and of its end
};
/// What an excerpt shows of its case, whose first `size` entries its lines lead to.
struct ShownPart {
  std::uint64_t size = 0;
  std::uint64_t known = 0;  // the log states the root of so many of them
};
/// After `walk` of the log over this case gave `contents`, compared with `notes`.
WalkedLog walked_log(const LogContents& contents, OutsideNotes& notes,
                     const std::optional<OpenEntry>& opening);
/// Nothing where options.witnesses is null. Of several checkpoints that one is told which holds the most of
/// the case, by a quorum if one does, over the most entries. `part`: of an excerpt. The case's end says
/// nothing of its lines where nothing leads from them to it.
std::optional<WitnessReport> judge_case_witnesses(const VerifyOptions& options,
                                                  const std::optional<WalkedLog>& log, const LogProof& proof,
                                                  const std::optional<ShownPart>& part = std::nullopt);

/// By options.policy: cosignatures are by Ed25519 or ML-DSA-44 over roots of SHA-256, without which none
/// counts.
crypto::CountedCosignatures counted_cosignatures(const VerifyOptions& options);
/// Which cosignatures of the witnesses count no more, in a sentence; nothing to say while all of them do.
std::optional<std::string> why_cosignatures_ended(const VerifyOptions& options,
                                                  const crypto::WitnessPolicy& witnesses);

}  // namespace kiroku::archive
