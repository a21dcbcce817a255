#include "timestamp/request.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/shared_data.h"

namespace kiroku::timestamp {
namespace {

using crypto::HashAlgorithm;
using test::read_whole;
using test::shared_data;

Bytes bytes_of_hex(std::string_view text) { return *crypto::from_hex(text); }

Request simple_request() {
  Request request;
  request.imprint = Bytes(32, std::byte{0xaa});
  request.nonce = bytes_of_hex("80000000000000ff");
  return request;
}

TEST(Request, IsEncodedAsRfc3161Says) {
  // openssl ts -query -digest aa… -sha256 -cert, with the nonce replaced
  EXPECT_EQ(crypto::to_hex(encode_request(simple_request())),
            "30440201013031300d060960864801650304020105000420" + std::string(64, 'a') +
                "02090080000000000000ff0101ff");
}

TEST(Request, IsReadBackAsItWas) {
  Request request = simple_request();
  request.algorithm = HashAlgorithm::kSha512;
  request.imprint = Bytes(64, std::byte{1});
  request.policy = "1.2.3.4.1";
  request.want_certificates = false;
  const auto parsed = parse_request(encode_request(request));
  ASSERT_TRUE(parsed.request) << parsed.explanation;
  EXPECT_EQ(parsed.request->algorithm, HashAlgorithm::kSha512);
  EXPECT_EQ(parsed.request->imprint, request.imprint);
  EXPECT_EQ(parsed.request->policy, "1.2.3.4.1");
  EXPECT_EQ(parsed.request->nonce, request.nonce);
  EXPECT_FALSE(parsed.request->want_certificates);
}

TEST(Request, CarriesAFreshNonceOf64Bits) {
  const Bytes imprint(32);
  const Request first = make_request(HashAlgorithm::kSha256, imprint);
  const Request second = make_request(HashAlgorithm::kSha256, imprint);
  ASSERT_TRUE(first.nonce);
  EXPECT_EQ(first.nonce->size(), 8U);
  EXPECT_NE(first.nonce, second.nonce);
  EXPECT_TRUE(first.want_certificates);
}

TEST(Request, CannotCarryAnImprintOfAnotherLength) {
  Request request = simple_request();
  request.imprint.pop_back();
  EXPECT_THROW(encode_request(request), UsageError);
}

TEST(Request, CannotAskForAPolicyThatIsNone) {
  Request request = simple_request();
  request.policy = "default";
  EXPECT_THROW(encode_request(request), UsageError);
}

TEST(Request, IsRefusedWithTheFailureThatFits) {
  const std::string good = crypto::to_hex(encode_request(simple_request()));
  const auto failure_of = [](std::string text, std::string_view from, std::string_view to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    return parse_request(bytes_of_hex(text.replace(at, from.size(), to))).failure;
  };
  EXPECT_EQ(failure_of(good, "3044020101", "3044020102"), RequestFailure::kBadRequest);
  // SHA-224 of 32 bytes; an unknown hash function
  EXPECT_EQ(failure_of(good, "03040201", "03040204"), RequestFailure::kBadAlgorithm);
  EXPECT_EQ(failure_of(good, "03040201", "0304027f"), RequestFailure::kBadAlgorithm);
  // SHA-512 of 32 bytes
  EXPECT_EQ(failure_of(good, "03040201", "03040203"), RequestFailure::kBadDataFormat);
  // An extension 1.2.3 [0] { { oid, octets } }
  EXPECT_EQ(failure_of("3051" + good.substr(4) + "a00b3009" + "06022a03" + "0403020100", "a00b", "a00b"),
            RequestFailure::kUnacceptedExtension);
  EXPECT_EQ(parse_request(bytes_of_hex(good + "00")).failure, RequestFailure::kBadDataFormat);
  EXPECT_EQ(parse_request(bytes_of_hex(good.substr(0, good.size() - 2))).failure,
            RequestFailure::kBadDataFormat);
  EXPECT_EQ(parse_request({}).failure, RequestFailure::kBadDataFormat);
  EXPECT_EQ(parse_request(bytes_of("<html>")).failure, RequestFailure::kBadDataFormat);
}

TEST(Request, OfForeignClientsIsRead) {
  KIROKU_NEEDS_SHARED_DATA("timestamp/rfc3161-client/test_tsa/other_request.der");
  const auto parsed =
      parse_request(read_whole(shared_data("timestamp/rfc3161-client/test_tsa/other_request.der")));
  ASSERT_TRUE(parsed.request) << parsed.explanation;
  EXPECT_EQ(parsed.request->algorithm, HashAlgorithm::kSha512);
  EXPECT_EQ(parsed.request->nonce, bytes_of_hex("b17470d29bfe1226"));
  EXPECT_TRUE(parsed.request->want_certificates);
  EXPECT_FALSE(parsed.request->policy);
}

TEST(Request, WithPolicyAndWithoutNonceIsRead) {
  KIROKU_NEEDS_SHARED_DATA("timestamp/digicert-ysimonx/file.digicert.withpolicyid.tsq");
  const auto parsed =
      parse_request(read_whole(shared_data("timestamp/digicert-ysimonx/file.digicert.withpolicyid.tsq")));
  ASSERT_TRUE(parsed.request) << parsed.explanation;
  EXPECT_EQ(parsed.request->policy, "1.2.3.4.1");
  EXPECT_FALSE(parsed.request->nonce);
  EXPECT_FALSE(parsed.request->want_certificates);
}

}  // namespace
}  // namespace kiroku::timestamp
