// What every comparison stands on, and what proves its document: the hash in the appliance log, and tokens.
// Functions; not thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "apps/kiroku/stamped_file.h"
#include "apps/sim/compared_ct.h"
#include "apps/sim/comparison_request.h"
#include "apps/sim/comparison_telling.h"
#include "apps/sim/plan_at_hand.h"
#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "viewer/kept/provenance.h"

namespace kiroku::apps {

compare::NamedFile named(const SealedFile& file);

/// Who compares, which case as it is now, and which plan.
compare::Provenance provenance_of(const ComparisonRequest& request, const archive::CaseReader& recording,
                                  const FilesAtHand& at_hand, std::optional<compare::ComparedCt> ct,
                                  const PatientNumbers& numbers);

/// Those of the request, or of the socket that it names. kiroku::UsageError for one that is not there.
crypto::AgeIdentities identities_of(const ComparisonRequest& request, const std::optional<Home>& home);

/// Hash into the log, tokens beside the document.
std::vector<Stamp> seal_document(const ComparisonRequest& request, const Home& home,
                                 const std::string& case_id, const std::filesystem::path& document,
                                 const crypto::Sha256Digest& digest);

/// Writes the document where the request's output has it, and seals it where the case is of this home.
MadeComparison write_sealed(const ComparisonRequest& request, const std::optional<Home>& home,
                            const archive::CaseReader& recording, const std::string& text);

}  // namespace kiroku::apps
