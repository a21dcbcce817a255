#include "crypto/encoding.h"

#include <gtest/gtest.h>

namespace kiroku::crypto {
namespace {

TEST(Hex, RoundTripsAndIsLowerCase) {
  const Bytes bytes = {std::byte{0x00}, std::byte{0x7f}, std::byte{0xab}, std::byte{0xff}};
  EXPECT_EQ(to_hex(bytes), "007fabff");
  EXPECT_EQ(from_hex("007fabff"), bytes);
  EXPECT_EQ(from_hex(""), Bytes());
}

TEST(Hex, RefusesWhatItWouldNotWrite) {
  EXPECT_FALSE(from_hex("AB"));
  EXPECT_FALSE(from_hex("abc"));
  EXPECT_FALSE(from_hex("0g"));
  EXPECT_FALSE(from_hex("0 "));
}

// RFC 4648 section 10.
TEST(Base64, GivesThePublishedVectors) {
  const std::pair<std::string_view, std::string_view> vectors[] = {{"", ""},
                                                                   {"f", "Zg=="},
                                                                   {"fo", "Zm8="},
                                                                   {"foo", "Zm9v"},
                                                                   {"foob", "Zm9vYg=="},
                                                                   {"fooba", "Zm9vYmE="},
                                                                   {"foobar", "Zm9vYmFy"}};
  for (const auto& [plain, padded] : vectors) {
    const std::string_view unpadded = padded.substr(0, padded.find('='));
    EXPECT_EQ(to_base64(bytes_of(plain), Base64Padding::kPadded), padded);
    EXPECT_EQ(to_base64(bytes_of(plain), Base64Padding::kUnpadded), unpadded);
    EXPECT_EQ(from_base64(padded, Base64Padding::kPadded), to_bytes(plain));
    EXPECT_EQ(from_base64(unpadded, Base64Padding::kUnpadded), to_bytes(plain));
  }
}

TEST(Base64, RefusesWhatItWouldNotWrite) {
  for (const std::string_view text :
       {"Zg", "Zg=", "Zg===", "Zh==", "Zm9=", "Z===", "====", "Zm9v\n", "Zm 9v", "Zm-_", "Zg==Zg=="})
    EXPECT_FALSE(from_base64(text, Base64Padding::kPadded)) << text;
  for (const std::string_view text : {"Zg==", "Zh", "Zm9", "Z", "Zm9vY", "Zm9v\n", "\xc3\xa9\xc3\xa9"})
    EXPECT_FALSE(from_base64(text, Base64Padding::kUnpadded)) << text;
}

// BIP 173's valid strings that carry whole bytes, and age's own.
TEST(Bech32, ReadsThePublishedStrings) {
  const auto empty = from_bech32("A12UEL5L");
  ASSERT_TRUE(empty);
  EXPECT_EQ(empty->human_part, "A");
  EXPECT_TRUE(empty->bytes.empty());
  const auto all = from_bech32("abcdef1qpzry9x8gf2tvdw0s3jn54khce6mua7lmqqqxw");
  ASSERT_TRUE(all);
  EXPECT_EQ(all->human_part, "abcdef");
  EXPECT_EQ(to_hex(all->bytes), "00443214c74254b635cf84653a56d7c675be77df");
  EXPECT_EQ(to_bech32("abcdef", all->bytes), "abcdef1qpzry9x8gf2tvdw0s3jn54khce6mua7lmqqqxw");
}

TEST(Bech32, KeepsTheCaseOfTheHumanPart) {
  const Bytes bytes(32, std::byte{0x42});
  const std::string lower = to_bech32("age", bytes);
  const std::string upper = to_bech32("AGE-SECRET-KEY-", bytes);
  EXPECT_TRUE(lower.starts_with("age1"));
  EXPECT_TRUE(upper.starts_with("AGE-SECRET-KEY-1"));
  EXPECT_EQ(from_bech32(lower)->bytes, bytes);
  EXPECT_EQ(from_bech32(upper)->bytes, bytes);
  EXPECT_EQ(from_bech32(upper)->human_part, "AGE-SECRET-KEY-");
}

TEST(Bech32, RefusesDamagedStrings) {
  // Invalid strings of BIP 173: no separator, no human part, foreign character, short checksum, wrong
  // checksum, mixed case.
  for (const std::string_view text : {"pzry9x0s0muk", "1pzry9x0s0muk", "x1b4n0q5v", "li1dgmt3", "A1G7SGD8",
                                      "10a06t8", "1qzzfhee", "A12uEL5L", "", "1", "age1",
                                      "\x7f"
                                      "1axkwrx"})
    EXPECT_FALSE(from_bech32(text)) << text;
}

TEST(Bech32, FindsEverySingleWrongCharacter) {
  const std::string good = to_bech32("age", Bytes(32, std::byte{0x5a}));
  for (std::size_t i = 4; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = bad[i] == 'q' ? 'p' : 'q';
    EXPECT_FALSE(from_bech32(bad)) << i;
  }
}

}  // namespace
}  // namespace kiroku::crypto
