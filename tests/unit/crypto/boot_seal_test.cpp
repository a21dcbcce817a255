#include "crypto/boot_seal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/pkcs8.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

PcrValue filled(unsigned index, unsigned char with) {
  PcrValue value{index, {}};
  value.value.fill(std::byte{with});
  return value;
}

TEST(PcrList, IsReadInAnyOrderAndWrittenAscending) {
  std::string problem;
  const auto read = parse_pcr_list("7,0,14,2", problem);
  ASSERT_TRUE(read) << problem;
  EXPECT_THAT(*read, ElementsAre(0U, 2U, 7U, 14U));
  EXPECT_EQ(pcr_list(*read), "0,2,7,14");
}

TEST(PcrList, SaysWhatIsWrongWithOneThatIsNone) {
  const auto refusal = [](std::string_view text) {
    std::string problem;
    EXPECT_FALSE(parse_pcr_list(text, problem)) << text;
    return problem;
  };
  EXPECT_THAT(refusal(""), HasSubstr("no number"));
  EXPECT_THAT(refusal("0,,2"), HasSubstr("''"));
  EXPECT_THAT(refusal("0,2,"), HasSubstr("no number"));
  EXPECT_THAT(refusal("0, 2"), HasSubstr("' 2'"));
  EXPECT_THAT(refusal("sha256:0,2"), HasSubstr("'sha256:0'"));
  EXPECT_THAT(refusal("-1"), HasSubstr("'-1'"));
  EXPECT_THAT(refusal("0x7"), HasSubstr("'0x7'"));
  EXPECT_THAT(refusal("4294967296"), HasSubstr("no number"));
  EXPECT_THAT(refusal("24"), HasSubstr("0 to 23, and no 24"));
  EXPECT_THAT(refusal("7,0,7"), HasSubstr("7 is named twice"));
}

TEST(ApprovalKey, IsReadAsItIsWrittenWithAndWithoutPassphrase) {
  const auto key = ApprovalKey::generate();
  EXPECT_EQ(ApprovalKey::from_pem(key.to_pem(nullptr).text(), nullptr).public_key(), key.public_key());
  const Secret passphrase = Secret::copy_of(std::string_view("of the administrator"));
  const Secret pem = key.to_pem(&passphrase);
  EXPECT_THAT(std::string(pem.text()), HasSubstr("BEGIN ENCRYPTED PRIVATE KEY"));
  EXPECT_EQ(ApprovalKey::from_pem(pem.text(), &passphrase).public_key(), key.public_key());
  const Secret other = Secret::copy_of(std::string_view("of somebody else"));
  EXPECT_THAT([&] { ApprovalKey::from_pem(pem.text(), &other); },
              ThrowsMessage<Error>(HasSubstr("passphrase does not open")));
}

TEST(ApprovalKey, RefusesWhatTpmsDoNotVerify) {
  const PrivateKey of_384_bits(EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-384"));
  const KeyInfo plain(EVP_PKEY2PKCS8(of_384_bits.get()));
  const auto refuse = [](const Secret& pem) {
    EXPECT_THAT([&] { ApprovalKey::from_pem(pem.text(), nullptr); },
                ThrowsMessage<Error>(HasSubstr("P-256")));
  };
  refuse(SigningKey::generate().to_pem(nullptr));
  refuse(pkcs8_pem(*plain, nullptr));
  EXPECT_THAT([] { ApprovalKey::from_pem("no key", nullptr); },
              ThrowsMessage<Error>(HasSubstr("no private key")));
}

TEST(ApprovalKey, SignsWhatVerifies) {
  const auto key = ApprovalKey::generate();
  const ByteView message = bytes_of("a state");
  const Bytes signature = key.sign(message);
  EXPECT_TRUE(verify_ecdsa_p256(key.public_key(), message, signature));
  const auto numbers = ecdsa_numbers(signature);
  ASSERT_TRUE(numbers);
  EXPECT_EQ(ecdsa_signature(numbers->first, numbers->second), signature);
}

TEST(EcdsaNumbers, AreNoneOfWhatIsNoSignature) {
  EXPECT_FALSE(ecdsa_numbers({}));
  EXPECT_FALSE(ecdsa_numbers(bytes_of("no DER")));
  Bytes signature = ApprovalKey::generate().sign(bytes_of("a state"));
  signature.push_back(std::byte{0});
  EXPECT_FALSE(ecdsa_numbers(signature)) << "bytes behind it";
  EXPECT_FALSE(ecdsa_numbers(ecdsa_signature(Bytes(33, std::byte{0x7f}), Bytes(32, std::byte{1}))))
      << "a number of another curve";
}

// Each policy has one digest: what a policy rests on cannot be exchanged under it.
TEST(BootSeal, PoliciesDependOnAllThatTheyState) {
  const P256PublicKey approver = ApprovalKey::generate().public_key();
  const BootSeal seal{approver, {0, 7}, boot_seal_tag(Bytes(32, std::byte{1}))};
  BootSeal other_key = seal, other_device = seal;
  other_key.approver = ApprovalKey::generate().public_key();
  other_device.tag = boot_seal_tag(Bytes(32, std::byte{2}));
  EXPECT_NE(seal_policy(other_key), seal_policy(seal));
  EXPECT_NE(seal_policy(other_device), seal_policy(seal));
  const std::vector<PcrValue> state{filled(0, 1), filled(7, 2)};
  EXPECT_NE(state_policy({filled(0, 1), filled(7, 3)}), state_policy(state));
  EXPECT_NE(state_policy({filled(0, 1), filled(4, 2)}), state_policy(state));
  EXPECT_NE(approval_message(other_device, state), approval_message(seal, state));
}

// By Python's hashlib, out of the formulas of part 3 for TPM2_PolicyPCR and TPM2_PolicyAuthorize. That a TPM
// computes the same, BootSealTest in recorder/device_key shows.
TEST(BootSeal, PoliciesAreThoseOfTheSpecification) {
  EXPECT_EQ(to_hex(state_policy({filled(0, 1), filled(7, 2)})),
            "fb961b799f25bc23910b1afd87d98c8bb2242a3836825d2700c46ecd82a17cb8");
  const auto approver = from_hex(
      "3059301306072a8648ce3d020106082a8648ce3d03010703420004c47853a8fc73b32c5735d98a23c65d576abe2b"
      "cfc0e3001186f695a714bb8c11a627a9d527de57c3a19715b176f1db7a04799f4da0e824a4ae545033a75e5cf1");
  ASSERT_TRUE(approver);
  EXPECT_EQ(to_hex(approver_name(*approver)),
            "000ba68271787d32da9b533aaa11cf391d561780b2f2716c3c0ef2963e2da7236085");
  EXPECT_EQ(to_hex(seal_policy({*approver, {0, 7}, boot_seal_tag(Bytes(32, std::byte{1}))})),
            "a34cd9e21f653889121e317e12916b7284a0398a9dae773eee88bb9ca2082d4d");
}

}  // namespace
}  // namespace kiroku::crypto
