#include "crypto/tpm_quote.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "crypto/encoding.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;

Bytes of_hex(std::string_view hex) { return from_hex(hex).value(); }

// Of swtpm 0.7.1 with libtpms 0.9.2: its attestation key, and what it quoted of registers of zeros when it
// was asked with SHA-256 of "abc".
const Bytes kArea = of_hex(
    "0023000b00050472000000100018000b0003001000200291ffc59b5c36391800170ebf159714ea5beeff367bd57603dff1ef5064"
    "77"
    "9800200075b49040fe6bdada739be01e0ab6f850c14d06ed8de4930096109f68cdb657");
const Bytes kAttest = of_hex(
    "ff54434780180022000b424f8d18abb12f4535bccf05a66076849264a832cfd1b4f9a7b24213283c91bc0020ba7816bf8f01cfea"
    "41"
    "4140de5dae2223b00361a396177a9cb410ff61f20015ad000000000000000f0e3bd327170334b6019c19b1db1a7ad46700000001"
    "00"
    "0b03ff43000020627f6149015f853f26db2f3dffba1b7c30b3b74b87c5cfb9f346c1616e3636d0");
const Bytes kSignature = of_hex(
    "3046022100e01e1eedec9fba3b9a598d3ba2f3b8a417eaf1df8a9ccb7d9f8d29fe73e9e4e20221009678bec5707a2e0bfcf0650b"
    "dd"
    "8b9397f61b91decd388dd4c432eee28c98a211");

BootAttester::Quote the_quote() {
  BootAttester::Quote quote{kAttest, kSignature, {}};
  for (const unsigned index : {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 14U})
    quote.pcrs.push_back({index, {}});
  return quote;
}
const Sha256Digest kAsked = sha256(bytes_of("abc"));

TEST(TpmQuote, IsReadAsTheTpmWroteIt) {
  std::string problem;
  const auto said = parse_tpm_quote(kAttest, problem);
  ASSERT_TRUE(said) << problem;
  EXPECT_EQ(said->clock_ms, 15U);
  EXPECT_EQ(said->resets, 0x0e3bd327U);
  EXPECT_EQ(said->restarts, 0x170334b6U);
  EXPECT_TRUE(said->clock_is_safe);
  EXPECT_EQ(said->qualifying_data, to_bytes(kAsked));
  EXPECT_THAT(said->pcrs, testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 14));
  EXPECT_EQ(why_no_quote(the_quote(), kArea, kAsked), "");
}

TEST(TpmQuote, OfSomethingElseIsTold) {
  EXPECT_THAT(why_no_quote(the_quote(), kArea, sha256(bytes_of("abd"))), HasSubstr("asked for"));
  BootAttester::Quote other = the_quote();
  other.pcrs.front().value.back() = std::byte{1};
  EXPECT_THAT(why_no_quote(other, kArea, kAsked), HasSubstr("asked for"));
  other = the_quote();
  other.pcrs.front().index = 10;
  EXPECT_THAT(why_no_quote(other, kArea, kAsked), HasSubstr("asked for"));
  Bytes unrestricted = kArea;
  unrestricted[5] = std::byte{0x04};
  EXPECT_THAT(why_no_quote(the_quote(), unrestricted, kAsked), HasSubstr("restricted"));
  EXPECT_THAT(why_no_quote(the_quote(), kAttest, kAsked), HasSubstr("TPMT_PUBLIC"));
}

TEST(TpmQuote, NoBitOfItCanBeChangedAndNoByteCutOffOrAdded) {
  for (std::size_t bit = 0; bit < 8 * kAttest.size(); ++bit) {
    BootAttester::Quote flipped = the_quote();
    flipped.attest[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_NE(why_no_quote(flipped, kArea, kAsked), "") << bit;
  }
  std::string problem;
  for (std::size_t size = 0; size < kAttest.size(); ++size)
    EXPECT_FALSE(parse_tpm_quote(ByteView(kAttest).first(size), problem)) << size;
  Bytes longer = kAttest;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(parse_tpm_quote(longer, problem));
}

TEST(AttestationKey, IsOneFormAlone) {
  std::string problem;
  const auto key = parse_attestation_key(kArea, problem);
  ASSERT_TRUE(key) << problem;
  EXPECT_TRUE(is_p256_public_key(key->key));
  std::string text;
  const auto said = parse_tpm_quote(kAttest, text);
  EXPECT_EQ(key->qualified_name, said.value().qualified_signer);
  // What the TPM may be told and what names it: user's authorisation and dictionary attacks are its own
  // matter.
  constexpr std::size_t kAttributes = 4, kAttributesEnd = 8, kX = 24;
  for (std::size_t at = 0; at < kArea.size(); ++at) {
    if (at >= kAttributes && at < kAttributesEnd) continue;
    Bytes flipped = kArea;
    flipped[at] ^= std::byte{1};
    EXPECT_FALSE(parse_attestation_key(flipped, problem)) << at << (at < kX ? "" : ": no point of the curve");
  }
  for (const unsigned needed : {1U, 4U, 5U, 16U, 18U}) {
    Bytes without = kArea;
    without[kAttributesEnd - 1 - needed / 8] &= ~(std::byte{1} << (needed % 8));
    EXPECT_FALSE(parse_attestation_key(without, problem)) << needed;
    EXPECT_THAT(problem, HasSubstr("restricted signing key"));
  }
  Bytes decrypts = kArea;
  decrypts[5] |= std::byte{0x02};
  EXPECT_FALSE(parse_attestation_key(decrypts, problem));
  for (std::size_t size = 0; size < kArea.size(); ++size)
    EXPECT_FALSE(parse_attestation_key(ByteView(kArea).first(size), problem)) << size;
}

}  // namespace
}  // namespace kiroku::crypto
