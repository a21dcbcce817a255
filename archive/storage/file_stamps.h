// Time-stamps that lie beside a file: of liver.seal.json, liver.seal.AUTHORITY.tsr. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/check.h"
#include "crypto/hash.h"
#include "timestamp/token_verifier.h"

namespace kiroku::archive {

/// Where the token of an authority lies beside `file`, which need not be there.
std::filesystem::path token_beside(const std::filesystem::path& file, const std::string& authority);
/// All of them, by name. None where the folder cannot be listed.
std::vector<std::filesystem::path> tokens_beside(const std::filesystem::path& file);

/// What a file's token must be about: its SHA-256.
timestamp::Expectation expectation_of(const crypto::Sha256Digest& digest);

/// What the tokens beside `file` say of its hash, each by itself; that it is not known where there is none.
/// Of a valid token Check::kind and text say whether it is self-issued.
/// kiroku::IoError for one that cannot be read.
std::vector<Check> check_tokens_beside(const std::filesystem::path& file, const crypto::Sha256Digest& digest,
                                       const timestamp::TrustStore& trust);

}  // namespace kiroku::archive
