// Played decades for evidence records: authorities with certificates of any years, who stamp at any time.
#pragma once

#include <string>

#include "evidence/renewal.h"
#include "tests/support/token_maker.h"

namespace kiroku::test {

/// A CA and a signer under it, valid from `from` to `to` ("2026-01-01").
class PlayedAuthority {
 public:
  PlayedAuthority(const std::string& name, const std::string& from, const std::string& to);
  /// Stamps at this time ("2026-06-01"), whatever the certificates say.
  [[nodiscard]] evidence::Stamp at(const std::string& day) const;
  [[nodiscard]] std::string root_pem() const { return authority_.root_pem(); }

 private:
  TestAuthority authority_;
};

/// "2026-06-01" at midnight, UTC.
UtcTime day(const std::string& text);
/// Some bytes as a data object, and its hash.
evidence::DataObject object_of(const std::string& bytes);
Bytes hash_of(crypto::HashAlgorithm algorithm, const std::string& bytes);
/// "record-lapsed record-link-missing": the codes of all problems, in order; "" where there is none.
std::string codes_of(const evidence::RecordJudgement& judgement);

}  // namespace kiroku::test
