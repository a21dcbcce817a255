// Evidence records of a whole archive: begun for closed cases that have none, renewed where something ends
// soon (docs/explanation/evidence.md). One token for all that need the same kind of renewal. Functions; one
// thread at a time in an archive.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"
#include "evidence/renewal.h"

namespace kiroku::archive {

struct EvidenceRenewalOptions {
  const timestamp::TrustStore* trust = nullptr;
  evidence::Policy policy = evidence::Policy::without_ends();
  UtcTime now;
  evidence::Stamp stamp;  // throws kiroku::Error where no authority answers
  bool dry_run = false;   // says what is due, and asks nobody
};

struct EvidenceRenewal {
  enum class What {
    kBegun,
    kTimeStampRenewed,
    kHashTreeRenewed,
    kNothingDue,
    kRefused,  // nothing was done for this case; the text says why
  };
  std::string case_id;
  What what = What::kRefused;
  std::string text;  // a phrase: what was due, or the first thing that could not be read
};

/// Does what is due for these cases (folders of one archive); the answers are in their order. A case is
/// refused that is open, tampered with, or has data that cannot be read; and one whose record does not hold,
/// which must be looked at. A record is replaced durably. Throws what `stamp` throws, before any record is
/// written; kiroku::IoError.
std::vector<EvidenceRenewal> renew_evidence(FileSystem& files,
                                            const std::vector<std::filesystem::path>& cases,
                                            const EvidenceRenewalOptions& options);

}  // namespace kiroku::archive
