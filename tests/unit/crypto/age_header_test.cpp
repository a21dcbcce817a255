#include "crypto/age_header.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/patterned_bytes.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;

std::vector<AgeStanza> stanzas_with_bodies_of(std::initializer_list<std::size_t> sizes) {
  std::vector<AgeStanza> stanzas;
  for (const std::size_t size : sizes)
    stanzas.push_back({"example", {"one", "!~"}, test::patterned_bytes(size)});
  return stanzas;
}

AgeFailure failure_of(std::string_view header, std::string* message = nullptr) {
  try {
    const auto parsed = parse_age_header(bytes_of(header));
    ADD_FAILURE() << (parsed ? "accepted: " : "asked for more: ") << header;
    return AgeFailure::kNoMatch;
  } catch (const AgeError& error) {
    if (message != nullptr) *message = error.what();
    return error.failure();
  }
}

TEST(AgeHeader, RoundTripsStanzasWhoseBodiesEndAnywhereInALine) {
  const Secret file_key = Secret::random(kFileKeySize);
  const auto stanzas = stanzas_with_bodies_of({0, 1, 32, 47, 48, 49, 95, 96, 97, 1000});
  const Bytes text = write_age_header(stanzas, file_key);
  const auto header = parse_age_header(text);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->size, text.size());
  ASSERT_EQ(header->stanzas.size(), stanzas.size());
  for (std::size_t i = 0; i < stanzas.size(); ++i) {
    EXPECT_EQ(header->stanzas[i].type, stanzas[i].type);
    EXPECT_EQ(header->stanzas[i].arguments, stanzas[i].arguments);
    EXPECT_EQ(header->stanzas[i].body, stanzas[i].body);
  }
  EXPECT_TRUE(age_header_mac_fits(*header, file_key));
  EXPECT_FALSE(age_header_mac_fits(*header, Secret::random(kFileKeySize)));
}

TEST(AgeHeader, AsksForMoreAtEveryCut) {
  Bytes text = write_age_header(stanzas_with_bodies_of({32, 48}), Secret(kFileKeySize));
  for (std::size_t size = 0; size < text.size(); ++size)
    EXPECT_FALSE(parse_age_header(ByteView(text).first(size))) << size;
  const std::size_t size = text.size();
  append(text, test::patterned_bytes(100));
  EXPECT_EQ(parse_age_header(text)->size, size);
}

TEST(AgeHeader, EveryFlippedBitIsFound) {
  const Secret file_key = Secret::random(kFileKeySize);
  Bytes text = write_age_header(stanzas_with_bodies_of({32}), file_key);
  for (std::size_t bit = 0; bit < 8 * text.size(); ++bit) {
    text[bit / 8] ^= std::byte(1U << bit % 8);
    bool found = true;
    try {
      const auto header = parse_age_header(text);
      found = !header || !age_header_mac_fits(*header, file_key);
    } catch (const AgeError&) {
    }
    EXPECT_TRUE(found) << bit;
    text[bit / 8] ^= std::byte(1U << bit % 8);
  }
}

TEST(AgeHeader, SaysWhatIsWrong) {
  const std::string intro = "age-encryption.org/v1\n";
  const std::string mac = "--- AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA\n";
  const std::pair<std::string, std::string> cases[] = {
      {"age-encryption.org/v2\n-> a\n\n" + mac, "does not begin with"},
      {"GIF89a", "does not begin with"},
      {intro + mac, "no recipient stanza"},
      {intro + "x\n" + mac, "neither a stanza nor the MAC"},
      {intro + "->\n\n" + mac, "does not begin with \"-> \""},
      {intro + "-> \n\n" + mac, "argument is empty"},
      {intro + "-> a  b\n\n" + mac, "argument is empty"},
      {intro + "-> a \n\n" + mac, "argument is empty"},
      {intro + "-> a\tb\n\n" + mac, "not visible"},
      {intro + "-> \xc3\xa9\n\n" + mac, "not visible"},
      {intro + "-> a\nAA==\n" + mac, "not canonical base64"},
      {intro + "-> a\nAB\n" + mac, "not canonical base64"},
      {intro + "-> a\n" + std::string(68, 'A') + "\n" + mac, "longer than 64"},
      {intro + "-> a\n" + std::string(100, 'A'), "longer than 64"},
      {intro + "-> a\n" + std::string(64, 'A') + "\n" + mac, "not canonical base64"},
      {intro + "-> a\n\n---\n", "MAC line"},
      {intro + "-> a\n\n--- AAAA\n", "MAC line"},
      {intro + "-> a\n\n---  " + mac.substr(4), "MAC line"},
      {intro + "-> a\n\n" + mac.substr(0, mac.size() - 1) + "=\n", "MAC line"},
      {intro + "-> scrypt\n\n-> a\n\n" + mac, "does not stand alone"},
  };
  for (const auto& [header, why] : cases) {
    std::string message;
    EXPECT_EQ(failure_of(header, &message), AgeFailure::kHeaderMalformed) << header;
    EXPECT_THAT(message, HasSubstr(why)) << header;
  }
}

TEST(AgeHeader, NamesArmor) {
  EXPECT_EQ(failure_of("-----BEGIN AGE ENCRYPTED FILE-----\n"), AgeFailure::kArmored);
  EXPECT_EQ(failure_of(" \r\n\t-----BEGIN AGE ENCRYPTED FILE-----\n"), AgeFailure::kArmored);
}

TEST(AgeHeader, EndlessHeadersAreRefused) {
  std::string header = "age-encryption.org/v1\n";
  while (header.size() <= kMaximumAgeHeaderSize) header += "-> a\n\n";
  EXPECT_EQ(failure_of(header), AgeFailure::kHeaderMalformed);
  const std::string endless_line = "age-encryption.org/v1\n-> " + std::string(kMaximumAgeHeaderSize, 'a');
  EXPECT_EQ(failure_of(endless_line), AgeFailure::kHeaderMalformed);
}

}  // namespace
}  // namespace kiroku::crypto
