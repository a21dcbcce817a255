// The embedded authority with the programs that everybody has: openssl and curl.
#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority_server.h"
#include "timestamp/request.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

class StockClientTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!runs("openssl version") || !runs("curl --version")) {
      GTEST_SKIP() << "needs the programs openssl and curl";
    }
    std::ofstream(folder_ / "data") << "what was recorded";
    std::ofstream(folder_ / "ca.pem") << authority_.root_pem();
    std::ofstream(folder_ / "chain.pem") << authority_.chain_pem();
  }
  /// In the folder, its output in "log".
  [[nodiscard]] bool runs(const std::string& command) const {
    const std::string line = "cd '" + folder_.path().string() + "' && { " + command + "; } >>log 2>&1";
    return std::system(line.c_str()) == 0;  // NOLINT(cert-env33-c): stock programs are what is tested
  }
  [[nodiscard]] std::string log() const { return std::string(text_of(test::read_whole(folder_ / "log"))); }
  [[nodiscard]] std::string curl() const {
    return "curl --silent --show-error --fail --noproxy '*' -H 'Content-Type: application/timestamp-query' "
           "--data-binary @data.tsq -o data.tsr " +
           server_.url();
  }

  test::TemporaryFolder folder_;
  Authority authority_ = Authority::create(folder_ / "authority", "Test");
  AuthorityServer server_{authority_, "127.0.0.1:0"};
};

TEST_F(StockClientTest, GetsATokenThatOpensslVerifies) {
  for (const char* hash : {"-sha256", "-sha384", "-sha512"}) {
    ASSERT_TRUE(runs(std::string("openssl ts -query -data data ") + hash + " -cert -out data.tsq")) << log();
    ASSERT_TRUE(runs(curl())) << log();
    EXPECT_TRUE(runs("openssl ts -verify -data data -in data.tsr -CAfile ca.pem")) << log();
    EXPECT_TRUE(runs("openssl ts -verify -queryfile data.tsq -in data.tsr -CAfile ca.pem")) << log();
    EXPECT_FALSE(runs("openssl ts -verify -data log -in data.tsr -CAfile ca.pem"));
  }
  TrustStore trust;
  trust.add_trusted_file(folder_ / "ca.pem");
  Expectation expectation;
  expectation.data = test::read_whole(folder_ / "data");
  EXPECT_EQ(judge_token(test::read_whole(folder_ / "data.tsr"), expectation, trust).code, TokenCode::kValid);
}

TEST_F(StockClientTest, GetsATokenWithoutCertificatesThatOpensslVerifiesWithTheChain) {
  ASSERT_TRUE(runs("openssl ts -query -data data -sha256 -no_nonce -out data.tsq")) << log();
  ASSERT_TRUE(runs(curl())) << log();
  EXPECT_FALSE(runs("openssl ts -verify -data data -in data.tsr -CAfile ca.pem"));
  EXPECT_TRUE(runs("openssl ts -verify -data data -in data.tsr -CAfile ca.pem -untrusted chain.pem"))
      << log();
}

TEST_F(StockClientTest, CanVerifyTheTokenAsCms) {
  ASSERT_TRUE(runs("openssl ts -query -data data -sha256 -cert -out data.tsq")) << log();
  ASSERT_TRUE(runs(curl())) << log();
  ASSERT_TRUE(runs("openssl ts -reply -in data.tsr -token_out -out data.tst")) << log();
  EXPECT_TRUE(
      runs("openssl cms -verify -inform DER -in data.tst -CAfile ca.pem -purpose timestampsign -out info"))
      << log();
}

TEST_F(StockClientTest, IsToldWhyItIsRejected) {
  ASSERT_TRUE(runs("openssl ts -query -data data -sha1 -cert -out data.tsq")) << log();
  ASSERT_TRUE(runs(curl())) << log();
  ASSERT_TRUE(runs("openssl ts -reply -in data.tsr -text")) << log();
  EXPECT_NE(log().find("Status: Rejected."), std::string::npos) << log();
  EXPECT_NE(log().find("the query's hash algorithm sha1 is not stamped here"), std::string::npos) << log();
  EXPECT_NE(log().find("unrecognized or unsupported algorithm identifier"), std::string::npos) << log();
}

TEST_F(StockClientTest, WritesTheRequestsThatWeWrite) {
  ASSERT_TRUE(runs("openssl ts -query -data data -sha256 -cert -no_nonce -out data.tsq")) << log();
  Request request =
      make_request(crypto::HashAlgorithm::kSha256,
                   crypto::digest(crypto::HashAlgorithm::kSha256, test::read_whole(folder_ / "data")));
  request.nonce.reset();
  EXPECT_EQ(encode_request(request), test::read_whole(folder_ / "data.tsq"));
}

}  // namespace
}  // namespace kiroku::timestamp
