#include "recorder/vitals/hl7_vitals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/shared_data.h"

namespace kiroku::recorder {
namespace {

using testing::HasSubstr;
using testing::SizeIs;
using testing::StartsWith;

const UtcTime kNow = *parse_utc("2026-01-01T12:00:00.5Z");

std::string message(const std::string& id, const std::string& more = "") {
  return "MSH|^~\\&|MON^A1^EUI-64|OR1|||20260101120000+0000||ORU^R01^ORU_R01|" + id + "|P|2.6" + more +
         "\rOBX|1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1|97|%\r";
}

std::size_t samples_in(const Hl7Vitals::Taken& taken) {
  std::size_t samples = 0;
  for (const media::VitalLine& line : taken.lines) {
    samples += std::holds_alternative<media::VitalSample>(line) ? 1U : 0U;
  }
  return samples;
}

TEST(Hl7Vitals, KeepsTheMessageBeforeWhatItReads) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  const auto taken = vitals.take(message("7"), 5, kNow, "10.0.0.9");
  ASSERT_GE(taken.lines.size(), 2U);
  EXPECT_EQ(std::get<media::DeviceMessage>(taken.lines[0]),
            (media::DeviceMessage{5, message("7"), "AA", "MON^A1/OR1@10.0.0.9"}));
  EXPECT_EQ(samples_in(taken), 1U);
  EXPECT_EQ(taken.answer, "AA");
}

TEST(Hl7Vitals, AcknowledgesByTheIdentifierOfTheMessage) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  EXPECT_EQ(
      vitals.take(message("A\\S\\7"), 5, kNow, "").acknowledgement,
      "MSH|^~\\&|KIROKU||MON^A1^EUI-64|OR1|20260101120000.500+0000||ACK^R01^ACK|K1767268800500000|P|2.6||||||"
      "UNICODE UTF-8\rMSA|AA|A\\S\\7\r");
  EXPECT_EQ(vitals.take(message("8", "|||NE|NE"), 5, kNow, "").acknowledgement, "");
  EXPECT_NE(vitals.take(message("9", "|||AL|NE"), 5, kNow, "").acknowledgement, "");
  // In the separators of the sender.
  const auto odd =
      vitals.take("MSH@~&#\\@MON@@@@20260101@@ORU~R01@9@P@2.3\rOBX@1@NM@1~MDC_X~MDC@@5", 5, kNow, "");
  EXPECT_THAT(odd.acknowledgement,
              StartsWith("MSH@~&#\\@KIROKU@@MON@@20260101120000.500+0000@@ACK~R01~ACK@"));
  EXPECT_THAT(odd.acknowledgement, HasSubstr("\rMSA@AA@9\r"));
  // What a broken line added to the header is not repeated: it would begin a segment of the answer.
  const auto broken =
      vitals.take("MSH|^~\\&|MON||||20260101||ORU^R01|10|P|2.3\nNTEOBX|1|NM|1^MDC_X^MDC||5", 5, kNow, "");
  ASSERT_NE(broken.acknowledgement, "");
  EXPECT_THAT(parse_hl7_message(broken.acknowledgement).message->segments(), SizeIs(2));
}

TEST(Hl7Vitals, ACharacterSetWhoseNameIsNoTextIsToldOfInText) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  for (const media::VitalLine& line : vitals.take(message("7", "||||||\xbaR1"), 5, kNow, "").lines) {
    EXPECT_NO_THROW(media::to_json_line(line));
  }
}

TEST(Hl7Vitals, RecordsAMessageSentAgainOnceAndAcknowledgesItAgain) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  EXPECT_EQ(samples_in(vitals.take(message("7"), 5, kNow, "a")), 1U);
  const auto again = vitals.take(message("7"), 6, kNow, "a");
  ASSERT_THAT(again.lines, SizeIs(1));
  EXPECT_EQ(std::get<media::VitalNotice>(again.lines[0]).notice, "message-repeated");
  EXPECT_THAT(again.acknowledgement, HasSubstr("MSA|AA|7\r"));
  // From another monitor, or with another content under the same identifier, it is another message.
  EXPECT_EQ(samples_in(vitals.take(message("7"), 7, kNow, "b")), 1U);
  std::string other = message("7");
  other.replace(other.find("|97|"), 4, "|98|");
  EXPECT_EQ(samples_in(vitals.take(other, 8, kNow, "a")), 1U);
  EXPECT_THAT(vitals.take(other, 9, kNow, "a").lines, SizeIs(1));
}

std::string sent_at(const std::string& time, std::string text) {
  return text.replace(text.find("20260101120000"), 14, time);
}

TEST(Hl7Vitals, ReadsTheValuesOfARetryWithAnotherTimeOnce) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  vitals.take(message("6"), 4, kNow, "a");
  EXPECT_EQ(samples_in(vitals.take(message("7"), 5, kNow, "a")), 1U);
  const std::string retry = sent_at("20260101120005", message("7"));
  const auto again = vitals.take(retry, 6, kNow, "a");
  ASSERT_THAT(again.lines, SizeIs(2));
  EXPECT_EQ(std::get<media::DeviceMessage>(again.lines[0]).bytes, retry) << "what differs is kept";
  EXPECT_THAT(std::get<media::VitalNotice>(again.lines[1]).text, HasSubstr("another time (MSH-7)"));
  EXPECT_THAT(again.acknowledgement, HasSubstr("MSA|AA|7\r"));
  // Much later it is another message, of a monitor that began to count anew.
  const auto later =
      vitals.take(sent_at("20260101120105", message("7")), Hl7Vitals::kLongestRetryNs + 7, kNow, "a");
  EXPECT_EQ(samples_in(later), 1U);
}

TEST(Hl7Vitals, TheSameValuesUnderAnIdentifierThatTellsNothingAreNewOnes) {
  Hl7Vitals constant(std::chrono::minutes(0));
  for (int second = 10; second < 20; ++second) {
    const std::string time = "202601011200" + std::to_string(second);
    EXPECT_EQ(samples_in(constant.take(sent_at(time, message("1")), second, kNow, "a")), 1U) << second;
  }
  // One that has used an identifier twice does not tell messages apart by it, however many it has.
  Hl7Vitals reusing(std::chrono::minutes(0));
  reusing.take(message("1"), 1, kNow, "a");
  reusing.take(message("2"), 2, kNow, "a");
  std::string other = message("1");
  other.replace(other.find("|97|"), 4, "|98|");
  reusing.take(other, 3, kNow, "a");
  EXPECT_EQ(samples_in(reusing.take(sent_at("20260101120030", message("2")), 4, kNow, "a")), 1U);
}

TEST(Hl7Vitals, ForgetsOnlyWhatIsLongAgo) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  for (std::size_t i = 0; i <= Hl7Vitals::kRemembered; ++i) {
    vitals.take(message(std::to_string(i)), static_cast<std::int64_t>(i), kNow, "a");
  }
  EXPECT_EQ(samples_in(vitals.take(message("1"), 9000, kNow, "a")), 0U);
  EXPECT_EQ(samples_in(vitals.take(message("0"), 9001, kNow, "a")), 1U);
}

TEST(Hl7Vitals, RefusesByNameAndKeepsWhatItRefused) {
  const auto refused = [](const std::string& bytes) {
    Hl7Vitals vitals(std::chrono::minutes(0));
    const auto taken = vitals.take(bytes, 5, kNow, "a");
    EXPECT_THAT(taken.lines, SizeIs(2));
    EXPECT_EQ(std::get<media::DeviceMessage>(taken.lines.at(0)).bytes, bytes);
    EXPECT_EQ(std::get<media::DeviceMessage>(taken.lines.at(0)).answer, taken.answer);
    return taken.answer + " " + std::get<media::VitalNotice>(taken.lines.at(1)).text;
  };
  EXPECT_EQ(refused("MSH|^~\\&|A||||20260101||ADT^A08|1|P|2.6\r"),
            "AR messages of type ADT^A08 are not read; ORU^R01, ORU^R30 to R32, ORU^R40 and ORU^W01 are");
  EXPECT_EQ(refused("MSH|^~\\&|A||||20260101|||1|P|2.6\r"), "AE the message states no type (MSH-9)");
  EXPECT_EQ(refused("hello"), "AE the message does not begin with MSH");
  Hl7Vitals vitals(std::chrono::minutes(0));
  EXPECT_THAT(vitals.take("hello", 5, kNow, "a").acknowledgement,
              HasSubstr("\rMSA|AE||the message does not begin with MSH\r"));
}

TEST(Hl7Vitals, TakesZonesInEveryForm) {
  const auto zone = [](const std::string& text) {
    return parse_assumed_zone(text, "s").at(kNow).count() / 60;
  };
  EXPECT_EQ(zone("+05:30"), 330);
  EXPECT_EQ(zone("-0800"), -480);
  EXPECT_EQ(zone("UTC"), 0);
  EXPECT_NO_THROW(zone("local"));
  for (const char* text : {"", "5", "+5", "Berlin", "+2500"}) {
    EXPECT_THROW(zone(text), UsageError) << text;
  }
}

TEST(Hl7Vitals, TakesEveryRealMessage) {
  KIROKU_NEEDS_SHARED_DATA("recording/hl7");
  Hl7Vitals vitals(std::chrono::minutes(0));
  std::map<std::string, int> answers;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(test::shared_data("recording/hl7"))) {
    if (entry.path().extension() == ".hl7") {
      const Bytes bytes = test::read_whole(entry.path());
      for (const std::string_view one : split_hl7_messages(text_of(bytes))) {
        const auto taken = vitals.take(one, 0, kNow, entry.path().filename());
        ++answers[taken.answer];
        for (const media::VitalLine& line : taken.lines) {
          EXPECT_NO_THROW(media::to_json_line(line));
        }
      }
    }
  }
  EXPECT_GE(answers["AA"], 28);
  EXPECT_GE(answers["AR"], 20);
  EXPECT_EQ(answers["AE"], 1);  // "MSH|^~"
}

}  // namespace
}  // namespace kiroku::recorder
