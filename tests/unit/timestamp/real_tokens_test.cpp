// Tokens of real authorities (and of others' test suites): what each must be told, and why.
#include <algorithm>

#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/judged_alike.h"
#include "tests/support/shared_data.h"
#include "tests/support/token_maker.h"
#include "timestamp/der.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

using test::read_whole;
using test::shared_data;

class RealToken : public ::testing::Test {
 protected:
  void SetUp() override { KIROKU_NEEDS_SHARED_DATA("timestamp/digicert-ysimonx/file.digicert.tsr") }

  static Bytes file(const std::string& name) { return read_whole(shared_data("timestamp/" + name)); }
  static TrustStore trusting(const std::string& name) {
    TrustStore trust;
    trust.add_trusted_file(shared_data("timestamp/" + name));
    return trust;
  }
  static Expectation over(ByteView data) {
    Expectation expectation;
    expectation.data = to_bytes(data);
    return expectation;
  }
  /// What the answer to a stored request must be.
  static Expectation answering(const std::string& request_file) {
    const auto parsed = parse_request(file(request_file));
    EXPECT_TRUE(parsed.request) << parsed.explanation;
    Expectation expectation;
    expectation.algorithm = parsed.request->algorithm;
    expectation.imprint = parsed.request->imprint;
    expectation.nonce = parsed.request->nonce;
    return expectation;
  }
  /// Certificates that a token encloses, as PEM.
  static std::vector<std::string> enclosed_in(ByteView token) {
    const auto cms = decode_with<CmsContent, d2i_CMS_ContentInfo>(token);
    const OwnedCertificates certificates(CMS_get1_certs(cms.get()));
    const int count = std::max(sk_X509_num(certificates.get()), 0);
    std::vector<std::string> out;
    out.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      out.push_back(test::pem_of(sk_X509_value(certificates.get(), i)));
    }
    return out;
  }
};

TEST_F(RealToken, OfDigiCertIsValidWithItsChainAndRoot) {
  TrustStore trust = trusting("digicert-ysimonx/DigiCertAssuredIDRootCA.crt.pem");
  const Bytes response = file("digicert-ysimonx/file.digicert.tsr");
  const Expectation expectation = over(file("digicert-ysimonx/file.txt"));
  // Neither the signer nor its chain is enclosed, since the request did not ask for them.
  EXPECT_EQ(test::judge_alike(response, expectation, trust).code, TokenCode::kSignerCertificateMissing);
  EXPECT_EQ(trust.add_untrusted_file(shared_data("timestamp/digicert-ysimonx/CHAIN.pem")), 3U);
  const auto judgement = test::judge_alike(response, expectation, trust);
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(format_utc(judgement.info->gen_time), "2024-09-18T21:17:50.000000Z");
  EXPECT_EQ(judgement.info->serial, "1ac5fa61f8004c0f75fdecdb6e261b9b");
  EXPECT_EQ(judgement.info->policy, "2.16.840.1.114412.7.1");
  EXPECT_EQ(judgement.signer_subject, "CN=DigiCert Timestamp 2023,O=DigiCert\\, Inc.,C=US");
  EXPECT_EQ(judgement.root_subject, "CN=DigiCert Assured ID Root CA,OU=www.digicert.com,O=DigiCert Inc,C=US");
  EXPECT_EQ(judgement.chain.size(), 4U);
  EXPECT_EQ(judgement.authority, TimeAuthority::kOutside);
  EXPECT_EQ(test::judge_alike(response, answering("digicert-ysimonx/file.digicert.tsq"), trust).code,
            TokenCode::kValid);
}

TEST_F(RealToken, OfDigiCertEndsAtACrossSignedRootWhereThatIsTrusted) {
  const auto judgement = test::judge_alike(file("digicert-ysimonx/toto.sha256.tsr"), {},
                                           trusting("digicert-ysimonx/DigiCertTrustedRootG4.cer"));
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(judgement.chain.size(), 3U);
}

TEST_F(RealToken, ForAnotherRequestIsRefused) {
  const auto judgement = test::judge_alike(file("digicert-ysimonx/toto.sha256.tsr"),
                                           answering("digicert-ysimonx/file.digicert.tsq"),
                                           trusting("digicert-ysimonx/DigiCertAssuredIDRootCA.crt.pem"));
  EXPECT_EQ(judgement.code, TokenCode::kImprintDiffers);
  EXPECT_EQ(judgement.explanation, "the token is over a sha256 hash, where sha512 was expected");
}

TEST_F(RealToken, OfSigstoreIsValidWithEachHash) {
  for (const char* name : {"sha256", "sha384", "sha512"}) {
    const auto judgement =
        test::judge_alike(file("rfc3161-client/sigstage/response-" + std::string(name) + ".tsr"),
                          over(bytes_of("hello")), trusting("rfc3161-client/sigstage/ts_chain.pem"));
    EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
    EXPECT_EQ(judgement.info->algorithm_name, name);
    EXPECT_EQ(judgement.info->accuracy_ns, 1'000'000'000);
    EXPECT_EQ(judgement.root_subject, "CN=sigstore-tsa-selfsigned,O=sigstore.dev");
  }
}

TEST_F(RealToken, WithoutCertificateIsValidOnceTheChainIsGiven) {
  const Bytes response = file("rfc3161-client/sigstage/response-no-embedded-cert.tsr");
  EXPECT_EQ(test::judge_alike(response, over(bytes_of("hello")), TrustStore()).code,
            TokenCode::kSignerCertificateMissing);
  EXPECT_EQ(
      test::judge_alike(response, over(bytes_of("hello")), trusting("rfc3161-client/sigstage/ts_chain.pem"))
          .code,
      TokenCode::kValid);
}

TEST_F(RealToken, WithABrokenSignatureIsRefused) {
  const auto judgement =
      test::judge_alike(file("rfc3161-client/sigstage/response-invalid-signature.tsr"),
                        over(bytes_of("hello")), trusting("rfc3161-client/sigstage/ts_chain.pem"));
  EXPECT_EQ(judgement.code, TokenCode::kSignatureInvalid);
}

TEST_F(RealToken, OverOtherDataIsRefused) {
  EXPECT_EQ(test::judge_alike(file("rfc3161-client/sigstage/response-sha256.tsr"), over(bytes_of("hello\n")),
                              trusting("rfc3161-client/sigstage/ts_chain.pem"))
                .code,
            TokenCode::kImprintDiffers);
}

TEST_F(RealToken, OfIdenTrustIsValidUnderADerRoot) {
  const auto judgement =
      test::judge_alike(file("rfc3161-client/identrust/issue-104.tsr"), over(bytes_of("hello")),
                        trusting("rfc3161-client/identrust/ts_chain.pem"));
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(judgement.root_subject, "CN=IdenTrust Commercial Root CA 1,O=IdenTrust,C=US");
  EXPECT_EQ(judgement.info->nonce, crypto::from_hex("75c3b3214ac39fbb"));
}

TEST_F(RealToken, WithForeignCertificatesInjectedIsAttributedToItsTrueSigner) {
  for (const char* name : {"response", "response-injected-certs"}) {
    const auto judgement = test::judge_alike(file("rfc3161-client/test_tsa/" + std::string(name) + ".tsr"),
                                             answering("rfc3161-client/test_tsa/request.der"),
                                             trusting("rfc3161-client/test_tsa/ts_chain.pem"));
    EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
    EXPECT_EQ(judgement.signer_subject, "CN=Test TSA Timestamping,O=local");
    EXPECT_EQ(judgement.root_subject, "CN=Test TSA Root,O=local");
  }
}

TEST_F(RealToken, OfASecondInstallationWithTheSameNamesIsNotConfused) {
  const TrustStore trust = trusting("rfc3161-client/test_tsa/ts_chain.pem");
  const Bytes response = file("rfc3161-client/test_tsa/other_response.tsr");
  EXPECT_EQ(test::judge_alike(response, over(bytes_of("hello")), trust).code, TokenCode::kIssuerUnknown);
  EXPECT_EQ(test::judge_alike(response, answering("rfc3161-client/test_tsa/request.der"), trust).code,
            TokenCode::kNonceDiffers);
}

TEST_F(RealToken, WhoseCertificateExpiredSinceIsValid) {
  const auto judgement = test::judge_alike(file("rfc3161-client/sigstore.mock/response-expired.tsr"), {},
                                           trusting("rfc3161-client/sigstore.mock/ts_chain.pem"));
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(format_utc(judgement.info->gen_time), "2023-02-01T00:00:00.000000Z");
  EXPECT_EQ(judgement.info->serial, "-21524111");
}

TEST_F(RealToken, Of2017IsReadWithAndWithoutNonceAndCertificates) {
  const Bytes with_nonce = file("digitorus-embedded/respNonce.tsr");
  std::string why;
  const auto certificates = enclosed_in(parse_response(with_nonce, why)->token);
  ASSERT_EQ(certificates.size(), 2U);
  TrustStore trust;
  trust.add_trusted(bytes_of(certificates[1]), "GlobalSign Primary SHA256 CA for Adobe");

  const auto judgement = test::judge_alike(with_nonce, answering("digitorus-embedded/reqNonce.tsq"), trust);
  EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  EXPECT_EQ(judgement.signer_subject, "CN=GlobalSign TSA for Adobe CDS - G2,O=GMO GlobalSign Pte Ltd,C=SG");

  const Bytes no_nonce = file("digitorus-embedded/respNoNonce.tsr");
  EXPECT_EQ(test::judge_alike(no_nonce, answering("digitorus-embedded/reqNoNonce.tsq"), trust).code,
            TokenCode::kValid);
  const auto other = test::judge_alike(no_nonce, answering("digitorus-embedded/reqNonce.tsq"), trust);
  EXPECT_EQ(other.code, TokenCode::kNonceDiffers);
  EXPECT_EQ(other.explanation, "the token carries no nonce, although the request did");

  const Bytes no_certificate = file("digitorus-embedded/respNoCert.tsr");
  const Expectation expectation = answering("digitorus-embedded/reqNoCert.tsq");
  EXPECT_EQ(test::judge_alike(no_certificate, expectation, trust).code, TokenCode::kSignerCertificateMissing);
  trust.add_untrusted(bytes_of(certificates[0]), "GlobalSign TSA for Adobe");
  EXPECT_EQ(test::judge_alike(no_certificate, expectation, trust).code, TokenCode::kValid);
}

TEST_F(RealToken, WithoutAResponseAroundItIsRead) {
  const auto judgement = test::judge_alike(file("digitorus-embedded/timeStampToken.tst"), {},
                                           trusting("ca-extra/freetsa_cacert.pem"));
  EXPECT_EQ(judgement.code, TokenCode::kIssuerUnknown);
  EXPECT_EQ(judgement.signer_subject,
            "CN=Globalsign TSA for AATL - SHA256 - G2,O=GMO GlobalSign Pte Ltd,C=SG");
  ASSERT_TRUE(judgement.info);
  EXPECT_EQ(judgement.info->serial, "6d43be1ca9bc92054c31c9072cd24249741d1e7e");
}

TEST_F(RealToken, ThatIsARejectionSaysWhy) {
  const auto judgement = test::judge_alike(file("digitorus-embedded/respRejection.tsr"), {}, TrustStore());
  EXPECT_EQ(judgement.code, TokenCode::kRejected);
  EXPECT_EQ(judgement.explanation,
            "the authority rejected the request (rejection, addInfoNotAvailable): Error during serial number "
            "generation.");
  EXPECT_FALSE(judgement.info);
}

/// The tokens inside an evidence record (RFC 4998): every CMS SignedData over a TSTInfo, in order.
std::vector<Bytes> tokens_inside(ByteView record) {
  const Bytes signed_data = *crypto::from_hex("06092a864886f70d010702a082");
  constexpr std::size_t kHeader = 4;  // 30 82 and two octets of length
  std::vector<Bytes> out;
  auto at = record.begin();
  while (true) {
    at = std::search(at, record.end(), signed_data.begin(), signed_data.end());
    if (at == record.end()) return out;
    const auto start = static_cast<std::size_t>(at - record.begin()) - kHeader;
    if (const auto token = DerReader(record.subspan(start)).next(der::kSequence)) {
      out.push_back(to_bytes(token->whole));
    }
    ++at;
  }
}

class TokenInEvidenceRecord : public RealToken {
 protected:
  static std::vector<Bytes> tokens_of(const std::string& name) {
    Bytes record = file("ers-bsi-ervt/" + name);
    if (name.ends_with(".b64")) {
      std::string text(text_of(record));
      std::erase_if(text, [](char c) { return c == '\n' || c == '\r'; });
      const auto decoded = crypto::from_base64(text, crypto::Base64Padding::kPadded);
      EXPECT_TRUE(decoded) << name;
      record = decoded.value_or(Bytes());
    }
    return tokens_inside(record);
  }
  /// Judged with the token's own last certificate as the trusted one.
  static TokenJudgement judge_under_own_root(ByteView token) {
    TrustStore trust;
    for (const std::string& certificate : enclosed_in(token))
      trust.add_untrusted(bytes_of(certificate), "enclosed");
    trust.add_trusted(bytes_of(enclosed_in(token).back()), "enclosed");
    return test::judge_alike(token, {}, trust);
  }
};

TEST_F(TokenInEvidenceRecord, WithOcspAnswersEnclosedIsRead) {
  struct Case {
    const char* file;
    const char* signer;
  };
  for (const auto& [name, signer] :
       {Case{"example.ers.b64",
             "C=de,O=Governikus KG,OU=Testcertificate Governikus SC,CN=Gov-Testtimestamp-LZA"},
        Case{"xaip_ok.ers", "C=de,O=Governikus KG,OU=Testcertificate Governikus SC,CN=Gov-Testtimestamp-LZA"},
        Case{"ArchiveTimeStamp_sorted.b64",
             "C=de,O=Governikus KG,OU=Testcertificate Governikus SC,CN=Gov-Testtimestamp-LZA"},
        Case{"ATS1_BIN_ER.ers.b64",
             "organizationIdentifier=NTRDE-HRB74346,CN=D-TRUST TSU 12 2017,O=D-Trust GmbH,C=DE"}}) {
    const auto tokens = tokens_of(name);
    ASSERT_EQ(tokens.size(), 1U) << name;
    const auto judgement = judge_under_own_root(tokens[0]);
    EXPECT_EQ(judgement.code, TokenCode::kValid) << name << ": " << judgement.explanation;
    EXPECT_EQ(judgement.signer_subject, signer);
  }
}

TEST_F(TokenInEvidenceRecord, SignedWithRsaPssIsRead) {
  for (const char* name : {"xaip_ok_qualified_dtrust.ers", "ER_SHA256-DGN_XAIP_OK_SC1.ers"}) {
    const auto tokens = tokens_of(name);
    ASSERT_EQ(tokens.size(), 1U) << name;
    EXPECT_EQ(test::judge_alike(tokens[0], {}, TrustStore()).code, TokenCode::kNoTrust) << name;
  }
}

TEST_F(TokenInEvidenceRecord, UnderARootThatHadExpiredByThenCannotBeChecked) {
  // German qualified certificates were judged by a chain model, in which an issuer may expire first; RFC
  // 5280, and so this verifier, wants the whole path valid at the token's time. Its last certificate was
  // chosen by whoever verifies, so that its validity accuses nobody.
  const auto tokens = tokens_of("erDataMSOS-001.ers.b64");
  ASSERT_EQ(tokens.size(), 1U);
  const auto judgement = judge_under_own_root(tokens[0]);
  EXPECT_EQ(judgement.code, TokenCode::kRootNotValidAtTime);
  EXPECT_EQ(judgement.explanation,
            "the trusted certificate CN=14R-CA 1:PN,O=Bundesnetzagentur,C=DE was not valid at the token's "
            "time, 2017-02-15T13:38:13.000000Z: give the root that the authority had then");
}

TEST_F(TokenInEvidenceRecord, OfTheWrongCmsVersionIsRefused) {
  const auto tokens = tokens_of("example_wrong_cms_version.ers.b64");
  ASSERT_EQ(tokens.size(), 1U);
  const auto judgement = test::judge_alike(tokens[0], {}, TrustStore());
  EXPECT_EQ(judgement.code, TokenCode::kMalformed);
  EXPECT_EQ(judgement.explanation, "the token's SignedData has version 1, which RFC 5652 forbids");
}

TEST_F(TokenInEvidenceRecord, ByASignerWhoseKeyUsageIsNotCriticalIsRefused) {
  const auto tokens = tokens_of("example_invalidTSPs.ers.b64");
  ASSERT_EQ(tokens.size(), 4U);
  for (const Bytes& token : tokens) {
    EXPECT_EQ(test::judge_alike(token, {}, TrustStore()).code, TokenCode::kNotATimeStampSigner);
  }
}

TEST(TrustStore, SaysWhichFileHoldsNoCertificate) {
  TrustStore trust;
  try {
    trust.add_trusted(bytes_of("hello"), "/home/notes.txt");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "there is no certificate (PEM or DER) in /home/notes.txt");
  }
  EXPECT_THROW(trust.add_trusted_file("/nonexistent/root.pem"), IoError);
  EXPECT_FALSE(trust.has_trusted());
}

TEST(TrustStore, RefusesAFileWithADamagedCertificate) {
  const auto authority = test::make_test_authority();
  std::string text = authority.root_pem() + authority.root_pem();
  text[text.size() - 60] = '!';
  TrustStore trust;
  try {
    trust.add_trusted(bytes_of(text), "roots.pem");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "certificate number 2 in roots.pem is malformed: export it anew");
  }
}

}  // namespace
}  // namespace kiroku::timestamp
