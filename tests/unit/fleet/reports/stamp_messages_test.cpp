#include "fleet/reports/stamp_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::ThrowsMessage;

const std::string kDigestDigits(64, 'a'), kNonceDigits(64, 'b'), kTicketDigits(32, '7');

std::string request_text(const std::string& authority, const std::string& digest, const std::string& nonce) {
  return R"({"authority":")" + authority + R"(","digest":")" + digest + R"(","nonce":")" + nonce + R"("})";
}

TEST(StampMessages, AreReadAsTheyAreWritten) {
  const StampRequest asked = parse_stamp_request(request_text("swiss", kDigestDigits, kNonceDigits));
  EXPECT_EQ(asked.authority, "swiss");
  EXPECT_EQ(asked.digest, Bytes(32, std::byte{0xaa}));
  EXPECT_EQ(asked.nonce, Bytes(32, std::byte{0xbb}));
  EXPECT_EQ(to_json(asked), request_text("swiss", kDigestDigits, kNonceDigits));
  const auto place = parse_place(place_json({kTicketDigits, 1500ms}));
  EXPECT_EQ(place.ticket, kTicketDigits);
  EXPECT_EQ(place.ready_in, 1500ms);
  const auto question = parse_stamp_path(stamp_path("swiss", kTicketDigits));
  ASSERT_TRUE(question);
  EXPECT_EQ(question->authority, "swiss");
  EXPECT_EQ(question->ticket, kTicketDigits);
  const Bytes record(kLargestSharedToken, std::byte{7});
  EXPECT_EQ(parse_record_answer(record_json(record)), record);
}

TEST(StampMessages, ARequestThatDoesNotFitIsRefusedWithAReason) {
  const auto refused = [](const std::string& text, const char* why) {
    EXPECT_THAT([&] { parse_stamp_request(text); }, ThrowsMessage<UsageError>(HasSubstr(why))) << text;
  };
  refused("", "no JSON object");
  refused("[]", "no JSON object");
  refused(std::string(1025, ' '), "larger than 1 KiB");
  refused(std::string(1000, '['), "no JSON object");
  refused("\xff\xfe", "no JSON object");
  for (const char* name : {"", "Swiss", "sw iss", "../swiss", "swiss\\u0000", "swiss\\u001b[2J"})
    refused(request_text(name, kDigestDigits, kNonceDigits), "'authority'");
  for (const std::string& hash : {std::string(), std::string(62, 'a'), std::string(66, 'a'),
                                  std::string(64, 'A'), std::string(64, 'g')}) {
    refused(request_text("swiss", hash, kNonceDigits), "'digest' is not 64");
    refused(request_text("swiss", kDigestDigits, hash), "'nonce' is not 64");
  }
  refused(R"({"authority":"swiss","digest":7,"nonce":null})", "'digest' is not 64");
}

TEST(StampMessages, AnotherAddressIsNoTicket) {
  for (const std::string& path :
       {std::string("/stamp"), std::string("/stamp/"), std::string("/stamp/swiss"),
        std::string("/stamp/swiss/"), "/stampede/swiss/" + kTicketDigits, "/stamp//" + kTicketDigits,
        "/stamp/swiss/" + kTicketDigits + "/", "/stamp/swiss/" + kTicketDigits + "?x",
        "/stamp/SWISS/" + kTicketDigits, "/stamp/swiss/" + std::string(32, 'A'),
        "/stamp/swiss/" + std::string(31, '7'), "/stamp/../" + kTicketDigits})
    EXPECT_FALSE(parse_stamp_path(path)) << path;
}

TEST(StampMessages, WhatNoAggregatorAnswersIsRefused) {
  for (const std::string& answer :
       {std::string(), std::string("[]"), std::string("{}"), std::string(60'000, '['),
        R"({"ticket":"x","ready_in_ms":1})" + std::string(), R"({"ticket":")" + kTicketDigits + R"("})",
        R"({"ticket":")" + kTicketDigits + R"(","ready_in_ms":-1})",
        R"({"ticket":")" + kTicketDigits + R"(","ready_in_ms":1e300})",
        R"({"ticket":")" + kTicketDigits + R"(","ready_in_ms":"1"})"})
    EXPECT_THROW(parse_place(answer), Error) << answer.substr(0, 80);
  EXPECT_LE(
      parse_place(R"({"ticket":")" + kTicketDigits + R"(","ready_in_ms":18446744073709551615})").ready_in,
      24h);
  for (const std::string& answer :
       {std::string(), std::string("null"), std::string(R"({"record":7})"),
        std::string(R"({"record":"***"})"), record_json(Bytes(kLargestSharedToken + 1))})
    EXPECT_THROW(parse_record_answer(answer), Error) << answer.substr(0, 80);
}

}  // namespace
}  // namespace kiroku::fleet
