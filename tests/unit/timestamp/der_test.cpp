#include "timestamp/der.h"

#include <gtest/gtest.h>

#include "crypto/encoding.h"

namespace kiroku::timestamp {
namespace {

Bytes hex(std::string_view text) { return *crypto::from_hex(text); }

TEST(DerReader, GivesValuesOneAfterTheOther) {
  const Bytes bytes = hex("02010504020102");
  DerReader reader(bytes);
  const auto number = reader.next(der::kInteger);
  ASSERT_TRUE(number);
  EXPECT_EQ(to_bytes(number->content), hex("05"));
  EXPECT_EQ(to_bytes(number->whole), hex("020105"));
  EXPECT_FALSE(reader.next(der::kInteger));
  EXPECT_TRUE(reader.next(der::kOctetString));
  EXPECT_TRUE(reader.at_end());
  EXPECT_FALSE(reader.next());
}

TEST(DerReader, RefusesWhatGoesBeyondTheEnd) {
  for (const char* text :
       {"02", "0201", "048101", "04820100", "04850000000001", "1f0100", "30800201050000"}) {
    const Bytes bytes = hex(text);
    EXPECT_FALSE(DerReader(bytes).next()) << text;
  }
}

TEST(DerReader, RefusesLongerLengthsThanNeededUnlessBer) {
  for (const char* text : {"04810101", "0482000101"}) {
    const Bytes bytes = hex(text);
    EXPECT_FALSE(DerReader(bytes).next()) << text;
    const auto element = DerReader(bytes, Encoding::kBer).next();
    ASSERT_TRUE(element) << text;
    EXPECT_EQ(to_bytes(element->content), hex("01"));
  }
}

TEST(DerReader, FindsTheEndOfIndefiniteValues) {
  const Bytes bytes = hex("3080308002010500000000ff");
  DerReader reader(bytes, Encoding::kBer);
  const auto element = reader.next();
  ASSERT_TRUE(element);
  EXPECT_EQ(to_bytes(element->content), hex("30800201050000"));
  EXPECT_EQ(to_bytes(reader.rest()), hex("ff"));
}

TEST(DerReader, RefusesBottomlessNesting) {
  Bytes bytes;
  for (int i = 0; i < 100'000; ++i) append(bytes, hex("3080"));
  EXPECT_FALSE(DerReader(bytes, Encoding::kBer).next());
}

TEST(DerValue, WritesTheShortestLength) {
  EXPECT_EQ(der_value(der::kOctetString, {}), hex("0400"));
  EXPECT_EQ(to_bytes(ByteView(der_value(der::kOctetString, {Bytes(127)})).first(2)), hex("047f"));
  EXPECT_EQ(to_bytes(ByteView(der_value(der::kOctetString, {Bytes(128)})).first(3)), hex("048180"));
  EXPECT_EQ(to_bytes(ByteView(der_value(der::kOctetString, {Bytes(200), Bytes(100)})).first(4)),
            hex("0482012c"));
}

}  // namespace
}  // namespace kiroku::timestamp
