#include "timestamp/authority.h"

#include <set>
#include <sys/stat.h>
#include <thread>

#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/request.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

using test::TemporaryFolder;

class AuthorityTest : public ::testing::Test {
 protected:
  AuthorityTest() : authority_(Authority::create(folder_ / "authority", "Test hospital")) {
    trust_.add_trusted(bytes_of(authority_.root_pem()), "ca.pem");
  }

  static Request request_over(std::byte fill) {
    return make_request(crypto::HashAlgorithm::kSha256, Bytes(32, fill));
  }
  /// The rejection of `query`: its failure bit; -1 if it was granted.
  int failure_of(ByteView query) {
    std::string why;
    const auto response = parse_response(authority_.respond(query), why);
    EXPECT_TRUE(response) << why;
    EXPECT_EQ(response->token.empty(), response->status == 2);
    return response->failure_info.value_or(-1);
  }
  TokenInfo stamp(const Request& request) {
    std::string why;
    const auto response = parse_response(authority_.respond(encode_request(request)), why);
    EXPECT_TRUE(response) << why;
    const auto info = parse_token_info(response->token, why);
    EXPECT_TRUE(info) << why;
    return info.value_or(TokenInfo());
  }

  TemporaryFolder folder_;
  Authority authority_;
  TrustStore trust_;
};

TEST_F(AuthorityTest, StampsWhatTheVerifierAccepts) {
  authority_.set_clock([] { return *parse_utc("2027-03-04T05:06:07.080910Z"); });
  for (const auto algorithm : crypto::kHashAlgorithms) {
    const Request request = make_request(algorithm, crypto::digest(algorithm, bytes_of("hello")));
    Expectation expectation;
    expectation.data = to_bytes("hello");
    expectation.algorithm = algorithm;
    expectation.nonce = request.nonce;
    expectation.policy = std::string(kEmbeddedPolicy);
    const auto judgement = judge_token(authority_.respond(encode_request(request)), expectation, trust_);
    ASSERT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
    EXPECT_EQ(format_utc(judgement.info->gen_time), "2027-03-04T05:06:07.080910Z");
    EXPECT_EQ(judgement.info->accuracy_ns, 1'000'000'000);
    EXPECT_FALSE(judgement.info->ordering);
    EXPECT_EQ(judgement.signer_subject, "CN=Kiroku embedded time-stamping authority,O=Test hospital");
    EXPECT_EQ(judgement.root_subject, "CN=Kiroku embedded time-stamping CA,O=Test hospital");
    // What a policy of algorithms asks: on what the token rests, and until when.
    ASSERT_EQ(judgement.signatures.size(), 2U);
    for (const SignatureUse& use : judgement.signatures) {
      EXPECT_EQ(use.key + " " + std::to_string(use.bits) + " " + use.hash, "ecdsa 256 sha256");
    }
    ASSERT_TRUE(judgement.valid_until);
    const auto years =
        std::chrono::floor<std::chrono::days>(*judgement.valid_until - utc_now()).count() / 365;
    EXPECT_GE(years, 9);  // the signer's certificate ends first, after ten years
    EXPECT_LE(years, 10);
  }
}

TEST_F(AuthorityTest, EnclosesItsCertificatesOnlyWhenAsked) {
  Request request = request_over(std::byte{1});
  request.want_certificates = false;
  const Bytes bare = authority_.respond(encode_request(request));
  EXPECT_EQ(judge_token(bare, {}, trust_).code, TokenCode::kSignerCertificateMissing);
  trust_.add_untrusted(bytes_of(authority_.chain_pem()), "chain");
  EXPECT_EQ(judge_token(bare, {}, trust_).code, TokenCode::kValid);
}

TEST_F(AuthorityTest, AddsNoNonceOfItsOwn) {
  Request request = request_over(std::byte{1});
  request.nonce.reset();
  EXPECT_FALSE(stamp(request).nonce);
}

TEST_F(AuthorityTest, AcceptsItsOwnPolicyAndRefusesOthers) {
  Request request = request_over(std::byte{1});
  request.policy = std::string(kEmbeddedPolicy);
  EXPECT_EQ(stamp(request).policy, kEmbeddedPolicy);
  request.policy = "1.2.3.4";
  EXPECT_EQ(failure_of(encode_request(request)), 15);
}

TEST_F(AuthorityTest, RefusesAsRfc3161Says) {
  EXPECT_EQ(failure_of({}), 5);
  EXPECT_EQ(failure_of(bytes_of("GET / HTTP/1.1")), 5);
  const std::string good = crypto::to_hex(encode_request(request_over(std::byte{0xaa})));
  const auto spoilt = [&](std::string_view from, std::string_view to) {
    std::string text = good;
    return *crypto::from_hex(text.replace(text.find(from), from.size(), to));
  };
  EXPECT_EQ(failure_of(spoilt("3044020101", "3044020103")), 2);
  EXPECT_EQ(failure_of(spoilt("03040201", "0304027f")), 0);
  // SHA-1 as the algorithm: 30 09 06 05 2b 0e 03 02 1a 05 00 with 20 bytes
  EXPECT_EQ(failure_of(*crypto::from_hex("3026020101302130090605"
                                         "2b0e03021a05000414" +
                                         std::string(40, 'a'))),
            0);
  EXPECT_EQ(failure_of(spoilt("03040201", "03040203")), 5);
  EXPECT_EQ(failure_of(spoilt("3044", "3051") /* and an extension */), 5);
  Bytes extended = spoilt("3044", "3051");
  append(extended, *crypto::from_hex("a00b300906022a030403020100"));
  EXPECT_EQ(failure_of(extended), 16);
}

TEST_F(AuthorityTest, NeverRepeatsASerialNumber) {
  std::set<std::string> serials;
  for (int i = 0; i < 20; ++i) serials.insert(stamp(request_over(std::byte{1})).serial);
  authority_ = Authority::open(folder_ / "authority");
  for (int i = 0; i < 20; ++i) serials.insert(stamp(request_over(std::byte{1})).serial);
  EXPECT_EQ(serials.size(), 40U);
}

TEST_F(AuthorityTest, AnswersFromSeveralThreads) {
  constexpr int kThreads = 4;
  constexpr int kEach = 25;
  std::vector<std::set<std::string>> serials(kThreads);
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kEach; ++i) {
        const Request request = request_over(std::byte(t));
        Expectation expectation;
        expectation.imprint = request.imprint;
        expectation.nonce = request.nonce;
        const auto judgement = judge_token(authority_.respond(encode_request(request)), expectation, trust_);
        if (judgement.code == TokenCode::kValid) serials[std::size_t(t)].insert(judgement.info->serial);
      }
    });
  }
  for (auto& thread : threads) thread.join();
  std::set<std::string> all;
  for (auto& some : serials) all.merge(some);
  EXPECT_EQ(all.size(), std::size_t(kThreads * kEach));
}

TEST_F(AuthorityTest, KeepsItsKeysToItself) {
  for (const auto& [name, mode] : {std::pair("ca.key", 0600U),
                                   {"tsa.key", 0600U},
                                   {"serial", 0600U},
                                   {"ca.pem", 0644U},
                                   {"tsa.pem", 0644U}}) {
    struct stat status {};
    ASSERT_EQ(::stat((folder_ / "authority" / name).c_str(), &status), 0) << name;
    EXPECT_EQ(status.st_mode & 07777U, mode) << name;
  }
}

TEST_F(AuthorityTest, IsNotMadeOverAnother) {
  EXPECT_THROW(Authority::create(folder_ / "authority", "Another"), UsageError);
}

TEST_F(AuthorityTest, IsNotMadeForANameThatDoesNotFit) {
  EXPECT_THROW(Authority::create(folder_ / "second", std::string(65, 'x')), UsageError);
  EXPECT_THROW(Authority::create(folder_ / "second", ""), UsageError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "second"));
}

TEST_F(AuthorityTest, CannotBeOpenedWithAnotherKey) {
  const Authority other = Authority::create(folder_ / "other", "Other");
  std::filesystem::copy_file(folder_ / "other" / "tsa.key", folder_ / "authority" / "tsa.key",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THROW(Authority::open(folder_ / "authority"), Error);
  EXPECT_THROW(Authority::open(folder_ / "nowhere"), IoError);
}

TEST_F(AuthorityTest, RejectsWhenItCannotCount) {
  std::filesystem::remove(folder_ / "authority" / "serial");
  EXPECT_EQ(failure_of(encode_request(request_over(std::byte{1}))), 25);
}

TEST_F(AuthorityTest, WaitsWhileItsClockStandsBehindItsLastToken) {
  UtcTime now = *parse_utc("2027-03-04T05:06:07Z");
  authority_.set_clock([&now] { return now; });
  const Bytes query = encode_request(request_over(std::byte{1}));
  EXPECT_EQ(judge_token(authority_.respond(query), {}, trust_).code, TokenCode::kValid);
  now -= std::chrono::hours(1);
  EXPECT_EQ(failure_of(query), 14);  // timeNotAvailable
  // Within what tokens state as their accuracy it goes on.
  now += std::chrono::hours(1) - std::chrono::milliseconds(900);
  EXPECT_EQ(judge_token(authority_.respond(query), {}, trust_).code, TokenCode::kValid);
}

TEST_F(AuthorityTest, OutsideItsCertificatesValidityIsTold) {
  authority_.set_clock([] { return *parse_utc("1999-12-31T23:59:59Z"); });
  const Bytes response = authority_.respond(encode_request(request_over(std::byte{1})));
  EXPECT_EQ(judge_token(response, {}, trust_).code, TokenCode::kCertificateNotValidAtTime);
}

}  // namespace
}  // namespace kiroku::timestamp
