#include "timestamp/token.h"

#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "tests/support/token_maker.h"

namespace kiroku::timestamp {
namespace {

Bytes from_hex_text(std::string_view text) { return *crypto::from_hex(text); }

class Token : public ::testing::Test {
 protected:
  Bytes token(const std::string& time = "20260805091502.25Z") {
    test::TokenRecipe recipe;
    recipe.signer = &authority_.signer;
    recipe.gen_time = time;
    recipe.nonce = 0x80;
    return test::make_token(recipe);
  }
  test::TestAuthority authority_ = test::make_test_authority();
};

TEST_F(Token, SaysWhatWasStampedWhenAndUnderWhichPolicy) {
  std::string why;
  const auto info = parse_token_info(token(), why);
  ASSERT_TRUE(info) << why;
  EXPECT_EQ(info->policy, "1.2.3.4");
  EXPECT_EQ(info->algorithm, crypto::HashAlgorithm::kSha256);
  EXPECT_EQ(info->algorithm_name, "sha256");
  EXPECT_EQ(info->imprint, Bytes(32, std::byte{0x11}));
  EXPECT_EQ(info->serial, "7");
  EXPECT_EQ(format_utc(info->gen_time), "2026-08-05T09:15:02.250000Z");
  EXPECT_EQ(info->accuracy_ns, 0);
  EXPECT_FALSE(info->ordering);
  EXPECT_EQ(info->nonce, from_hex_text("80"));
}

TEST_F(Token, IsSplitFromItsResponseUnchanged) {
  const Bytes bare = token();
  std::string why;
  const auto response = parse_response(test::make_response(bare), why);
  ASSERT_TRUE(response) << why;
  EXPECT_EQ(response->status, 0);
  EXPECT_EQ(response->token, bare);
  const auto alone = parse_response(bare, why);
  ASSERT_TRUE(alone) << why;
  EXPECT_EQ(alone->token, bare);
}

TEST(Response, SaysWhyTheAuthorityRejected) {
  std::string why;
  const auto response =
      parse_response(from_hex_text("301a3018020102300f0c0d6e6f2c207468616e6b20796f7503020780"), why);
  ASSERT_TRUE(response) << why;
  EXPECT_EQ(response->status, 2);
  EXPECT_EQ(response->status_text, std::vector<std::string>{"no, thank you"});
  EXPECT_EQ(response->failure_info, 0);
  EXPECT_TRUE(response->token.empty());
}

TEST(Response, ShowsNoControlCharactersOfForeignText) {
  std::string why;
  // ESC [ 2 J, U+202E, an overlong slash, é
  const auto response = parse_response(from_hex_text("3014301202010230"
                                                     "0d0c0b1b5b324ae280aec0afc3a9"),
                                       why);
  ASSERT_TRUE(response) << why;
  EXPECT_EQ(response->status_text, std::vector<std::string>{"\\u{001B}[2J\\u{202E}\\x{C0}\\x{AF}\xc3\xa9"});
}

TEST(Response, IsRefusedWhereItContradictsItself) {
  std::string why;
  EXPECT_FALSE(parse_response(from_hex_text("30053003020100"), why));
  EXPECT_EQ(why, "the response says granted, but holds no token");
  EXPECT_FALSE(parse_response(from_hex_text("300730030201023000"), why));
  EXPECT_EQ(why, "the response says rejected, but holds a token");
}

TEST(Response, IsToldFromAWebPage) {
  std::string why;
  EXPECT_FALSE(parse_response(bytes_of("<!DOCTYPE html><html></html>"), why));
  EXPECT_EQ(why, "the bytes are a text page, not a time-stamp response");
}

TEST(Response, IsRefusedWhenEmptyCutOrFollowedByMore) {
  const Bytes whole = from_hex_text("301a3018020102300f0c0d6e6f2c207468616e6b20796f7503020780");
  std::string why;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(parse_response(ByteView(whole).first(size), why)) << size;
  }
  Bytes longer = whole;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(parse_response(longer, why));
  EXPECT_EQ(why, "bytes follow after the end of the time-stamp response");
}

TEST(Response, IsRefusedWithAStatusThatIsNone) {
  std::string why;
  for (const char* text :
       {"3005300302 01ff", "30063004020200ff", "30043002 0200", "3003 3001 02", "30023000"}) {
    std::string compact(text);
    std::erase(compact, ' ');
    EXPECT_FALSE(parse_response(from_hex_text(compact), why)) << text;
  }
}

}  // namespace
}  // namespace kiroku::timestamp
