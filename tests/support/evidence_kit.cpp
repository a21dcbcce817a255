#include "tests/support/evidence_kit.h"

#include <stdexcept>

#include "crypto/encoding.h"

namespace kiroku::test {

UtcTime day(const std::string& text) {
  const auto time = parse_utc(text + "T00:00:00Z");
  if (!time) throw std::runtime_error(text + " is no day");
  return *time;
}

PlayedAuthority::PlayedAuthority(const std::string& name, const std::string& from, const std::string& to) {
  using timestamp::CertificateRole;
  authority_.ca = timestamp::issue_certificate({.organisation = "Test",
                                                .common_name = name + " root",
                                                .role = CertificateRole::kAuthority,
                                                .not_before = day(from),
                                                .not_after = day(to),
                                                .extended_key_usage = ""},
                                               nullptr);
  authority_.signer = timestamp::issue_certificate({.organisation = "Test",
                                                    .common_name = name,
                                                    .role = CertificateRole::kSigner,
                                                    .not_before = day(from),
                                                    .not_after = day(to),
                                                    .extended_key_usage = "critical,timeStamping"},
                                                   &authority_.ca);
}

evidence::Stamp PlayedAuthority::at(const std::string& when) const {
  return [this, when](crypto::HashAlgorithm algorithm, ByteView imprint) {
    TokenRecipe recipe;
    recipe.imprint_algorithm = EVP_MD_get_type(timestamp::message_digest_of(algorithm));
    recipe.imprint = to_bytes(imprint);
    recipe.gen_time = format_utc_compact(day(when)).erase(8, 1);  // without the T
    recipe.signer = &authority_.signer;
    recipe.enclosed = {authority_.signer.certificate.get(), authority_.ca.certificate.get()};
    return make_token(recipe);
  };
}

evidence::DataObject object_of(const std::string& bytes) {
  return {bytes,
          [bytes](crypto::HashAlgorithm algorithm) { return std::optional(hash_of(algorithm, bytes)); }};
}

Bytes hash_of(crypto::HashAlgorithm algorithm, const std::string& bytes) {
  return crypto::digest(algorithm, bytes_of(bytes));
}

std::string codes_of(const evidence::RecordJudgement& judgement) {
  std::string codes;
  for (const evidence::Problem& problem : judgement.problems) {
    codes += (codes.empty() ? "" : " ") + problem.code;
  }
  return codes;
}

}  // namespace kiroku::test
