// What witnesses, policies and proofs from logs are made of: all of it comes from strangers. Parsers are
// strict: what they accept is written again, letter for letter, and nothing that nobody signed holds.
#include <cstdint>
#include <cstdlib>

#include "archive/verify/log_proof.h"
#include "base/error.h"
#include "crypto/cosignature.h"
#include "crypto/ml_dsa.h"
#include "crypto/note_format.h"
#include "crypto/tlog_proof.h"
#include "crypto/witness_policy.h"
#include "witness/submission.h"

namespace {

using namespace kiroku;          // NOLINT(google-build-using-namespace)
using namespace kiroku::crypto;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

const CosignerKey& nobody() {
  static const CosignerKey kKey("w", SigningKey::generate().public_key());
  return kKey;
}

const MlDsaPrivateKey& ml_dsa_key() {
  static const MlDsaPrivateKey kKey = MlDsaPrivateKey::generate(MlDsaSet::k44);
  return kKey;
}

/// Any bytes as a signature by a key that never signed, as the key itself, and behind the line of a key that
/// the note does name.
void check_ml_dsa(std::string_view text) {
  static const CosignerKey kNobody = CosignerKey::of_ml_dsa_44("w", ml_dsa_key().public_key());
  require(check_cosignature(text, kNobody).state != CosignatureCheck::State::kValid);
  Bytes signature = to_bytes(text);
  signature.resize(ml_dsa_signature_size(MlDsaSet::k44));
  require(!verify_ml_dsa(MlDsaSet::k44, ml_dsa_key().public_key(), bytes_of("m"), signature));
  Bytes key = to_bytes(text);
  key.resize(ml_dsa_public_key_size(MlDsaSet::k44));
  // A public key of zeros takes signatures that anybody can make: it may say yes, and must say something.
  static_cast<void>(verify_ml_dsa(MlDsaSet::k44, key, bytes_of("m"), signature));
  signature = to_bytes(text);
  signature.resize(8 + ml_dsa_signature_size(MlDsaSet::k44));
  const std::string note =
      Checkpoint{"log", 7, {}}.to_text() + "\n" + signature_line("w", kNobody.key_id(), signature);
  require(check_cosignature(note, kNobody).state == CosignatureCheck::State::kInvalid);
}

void check_policy(std::string_view text) {
  try {
    const WitnessPolicy policy = WitnessPolicy::parse(text, "fuzz");
    const std::size_t count = policy.witnesses().size();
    require(count <= WitnessPolicy::kMost && policy.logs().size() <= WitnessPolicy::kMost);
    // Whoever all have cosigned for is witnessed; nobody is by nobody, unless nobody is asked.
    require(policy.is_met(std::vector<bool>(count, true)));
    require(policy.is_met(std::vector<bool>(count, false)) == policy.asks_for_none());
    require(judge_witnesses(policy, text, 1).cosigners.size() == count);
  } catch (const Error&) {
  }
  try {
    require(CosignerKey::parse(text).to_string() == text);
  } catch (const UsageError&) {
  }
}

void check_cosignatures(std::string_view text) {
  require(check_cosignature(text, nobody()).state != CosignatureCheck::State::kValid);
  if (const auto checkpoint = parse_extended_checkpoint(text))
    require(text.starts_with(checkpoint->to_text()));
}

void check_proof(std::string_view text) {
  const ParsedTlogProof parsed = parse_tlog_proof(text);
  require(parsed.proof.has_value() == parsed.why.empty());
  if (!parsed.proof) return;
  require(parsed.proof->to_text() == text && parsed.proof->path.size() <= TlogProof::kMostHashes);
  static const std::vector<VerifierKey> kKeys{VerifierKey("fuzz", SigningKey::generate().public_key())};
  require(!verify_tlog_proof(*parsed.proof, {}, kKeys, "fuzz").checkpoint);
  if (!parsed.proof->extra) return;
  if (const auto extra = archive::LogProofExtra::parse(*parsed.proof->extra))
    require(extra->to_bytes() == *parsed.proof->extra);
}

void check_submission(std::string_view text) {
  const witness::ParsedSubmission parsed = witness::parse_submission(text);
  require(parsed.submission.has_value() == parsed.why.empty());
  if (parsed.submission) require(parsed.submission->to_text() == text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = text_of(std::as_bytes(std::span(data, size)));
  check_policy(text);
  check_cosignatures(text);
  check_ml_dsa(text);
  check_proof(text);
  check_submission(text);
  return 0;
}
