// Verifying a case, and hashing its files under more than SHA-256 in the same pass: for whoever needs these
// hashes next, so that no file is read twice. Function; thread-safe as verify_case() is.
#pragma once

#include <filesystem>
#include <vector>

#include "archive/verify/case_data.h"
#include "archive/verify/verifier.h"

namespace kiroku::archive {

struct AlsoHash {
  std::vector<crypto::HashAlgorithm> algorithms;
  /// What the files hash to, also under the hashes of the case's evidence record.
  FileHashes taken = {};
};
/// As verify_case(), of a case. Throws what that throws.
VerificationReport verify_case(const std::filesystem::path& folder, const VerifyOptions& options,
                               AlsoHash& also);

}  // namespace kiroku::archive
