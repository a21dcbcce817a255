#include "recorder/vitals/hl7_vitals.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/shared_data.h"

namespace kiroku::recorder {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
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

/// Of a gateway: who lies where, and one value.
std::string of_bed(const std::string& id, const std::string& place, const std::string& patient,
                   const std::string& value) {
  return "MSH|^~\\&|GATEWAY|ICU|||20260101120000+0000||ORU^R01^ORU_R01|" + id + "|P|2.6\rPID|||" + patient +
         "||SECRET^NAME\rPV1||I|" + place +
         "\rOBR|1|||69990^MDC_X^MDC\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|" + value +
         "|264864^MDC_DIM_BEAT_PER_MIN^MDC|||||F\r";
}

/// "72 of GATEWAY/ICU[SURG^OR1]@a" of each sample.
std::vector<std::string> values_in(const Hl7Vitals::Taken& taken) {
  std::vector<std::string> values;
  for (const media::VitalLine& line : taken.lines) {
    if (const auto* const sample = std::get_if<media::VitalSample>(&line)) {
      values.push_back(std::to_string(static_cast<int>(sample->value.value_or(-1))) + " of " +
                       sample->source);
    }
  }
  return values;
}

/// The words of notices, but those about the form of these short messages.
std::vector<std::string> notices_in(const Hl7Vitals::Taken& taken) {
  std::vector<std::string> names;
  for (const media::VitalLine& line : taken.lines) {
    if (const auto* const notice = std::get_if<media::VitalNotice>(&line)) {
      EXPECT_THAT(notice->text, Not(HasSubstr("4711")));
      EXPECT_THAT(notice->text, Not(HasSubstr("SECRET")));
      names.push_back(notice->notice);
    }
  }
  return names;
}

bool keeps_message(const Hl7Vitals::Taken& taken) {
  return std::ranges::any_of(taken.lines, [](const media::VitalLine& line) {
    return std::holds_alternative<media::DeviceMessage>(line);
  });
}

TEST(Hl7Vitals, ValuesOfSeveralBedsAreToldApartAndTold) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  constexpr std::int64_t kSecondNs = 1'000'000'000;
  const auto mine = vitals.take(of_bed("1", "SURG^OR1", "4711^^^H^MR", "72"), kSecondNs, kNow, "a");
  EXPECT_THAT(values_in(mine), ElementsAre("72 of GATEWAY/ICU[SURG^OR1]@a"));
  EXPECT_THAT(notices_in(mine), IsEmpty());
  EXPECT_EQ(std::get<media::DeviceMessage>(mine.lines.at(0)).source, "GATEWAY/ICU[SURG^OR1]@a");
  const auto other = vitals.take(of_bed("2", "ICU^BED9", "", "141"), 2 * kSecondNs, kNow, "a");
  EXPECT_THAT(values_in(other), ElementsAre("141 of GATEWAY/ICU[ICU^BED9]@a"));
  EXPECT_THAT(notices_in(other), ElementsAre("several-beds"));
  // Again each minute as long as it lasts: a case may begin in between.
  EXPECT_THAT(notices_in(vitals.take(of_bed("3", "surg^or1", "", "72"), 3 * kSecondNs, kNow, "a")),
              IsEmpty());
  EXPECT_THAT(notices_in(vitals.take(of_bed("4", "SURG^OR1", "", "72"), 62 * kSecondNs, kNow, "a")),
              ElementsAre("several-beds"));
  EXPECT_THAT(notices_in(vitals.take(of_bed("5", "SURG^OR1", "", "72"), 130 * kSecondNs, kNow, "a")),
              Not(Contains("several-beds")));
  // A monitor that knows no bed is none.
  EXPECT_THAT(notices_in(vitals.take(message("6"), 200 * kSecondNs, kNow, "a")),
              Not(Contains("several-beds")));
}

TEST(Hl7Vitals, BedsOfOneWardAreSeveralHoweverTheyAreWritten) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  vitals.take(of_bed("1", "^^ICU&1&3232241923", "", "72"), 1, kNow, "a");
  const auto next = vitals.take(of_bed("2", "^^ICU&2&3232241924", "", "72"), 2, kNow, "a");
  EXPECT_THAT(values_in(next), ElementsAre("72 of GATEWAY/ICU[^^ICU&2&3232241924]@a"));
  EXPECT_THAT(notices_in(next), ElementsAre("several-beds"));
}

TEST(Hl7Vitals, SeveralPatientsAreToldApartAndNotNamed) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  int id = 0;
  const auto take = [&](const std::string& patient, const std::string& peer) {
    ++id;
    return vitals.take(of_bed(std::to_string(id), "", patient, "72"), id, kNow, peer);
  };
  EXPECT_THAT(notices_in(take("4711^^^H^MR", "a")), IsEmpty());
  EXPECT_THAT(notices_in(take("", "a")), IsEmpty()) << "nobody is named";
  EXPECT_THAT(notices_in(take("99^^^H^VN~4711^^^H^MR", "b")), IsEmpty())
      << "another device, the same patient";
  EXPECT_THAT(notices_in(take("V900^^^H^VN~4711^^^H^PI", "a")), IsEmpty()) << "the visit's number first";
  EXPECT_THAT(notices_in(take("4711", "b")), IsEmpty()) << "without the number's issuer";
  const auto other = take("4712^^^H^MR", "a");
  EXPECT_THAT(notices_in(other), ElementsAre("several-patients"));
  EXPECT_THAT(values_in(other), ElementsAre("72 of GATEWAY/ICU[#2]@a"));
  EXPECT_THAT(values_in(take("4711^^^H^MR", "a")), ElementsAre("72 of GATEWAY/ICU@a"));
  EXPECT_THAT(values_in(take("4712^^^H^MR", "a")), ElementsAre("72 of GATEWAY/ICU[#2]@a"));
}

TEST(Hl7Vitals, WhatIsOfOtherPlacesIsAcknowledgedAndNotRecorded) {
  Hl7Vitals vitals(std::chrono::minutes(0), {}, PlaceList::parse("or1,^^icu%267", "s"));
  const auto other = vitals.take(of_bed("1", "ICU^BED9", "4711", "141"), 1, kNow, "a");
  EXPECT_EQ(other.answer, "AA");
  EXPECT_TRUE(other.is_of_sender);
  EXPECT_THAT(other.acknowledgement, HasSubstr("\rMSA|AA|1\r"));
  EXPECT_THAT(notices_in(other), ElementsAre("other-place"));
  EXPECT_EQ(other.lines.size(), 1U);
  EXPECT_EQ(vitals.elsewhere(), 1U);
  for (const char* place : {"SURG^OR1", "OR1", "X^^OR1", "^^ICU&7&99"}) {
    const auto mine = vitals.take(of_bed(place, place, "", "72"), 2, kNow, "a");
    EXPECT_EQ(samples_in(mine), std::string(place).ends_with("99") ? 0U : 1U) << place;
    EXPECT_THAT(notices_in(mine), Not(Contains("several-beds"))) << "these are this room's names";
  }
  EXPECT_EQ(samples_in(vitals.take(of_bed("3", "^^ICU&7", "", "72"), 2, kNow, "a")), 1U);
  EXPECT_EQ(vitals.elsewhere(), 2U);
  Hl7Vitals of_hospital(std::chrono::minutes(0), {}, PlaceList::parse("SURG^OR1^^NORTH", "s"));
  EXPECT_EQ(samples_in(of_hospital.take(of_bed("5", "SURG^OR1^^NORTH&1.2", "", "72"), 1, kNow, "a")), 1U);
  for (const char* place : {"SURG^OR1^^SOUTH", "SURG^OR1"})
    EXPECT_EQ(samples_in(of_hospital.take(of_bed(place, place, "", "72"), 2, kNow, "a")), 0U) << place;
  // Nor is what it refuses of another place kept.
  std::string moved = of_bed("4", "ICU^BED9", "4711", "1");
  moved.replace(moved.find("ORU^R01^ORU_R01"), 15, "ADT^A01");
  EXPECT_FALSE(keeps_message(vitals.take(moved, 3, kNow, "a")));
}

TEST(Hl7Vitals, WhatNamesNoPlaceIsNotRecordedWherePlacesAreAsked) {
  Hl7Vitals vitals(std::chrono::minutes(0), {}, PlaceList::parse("OR1", "s"));
  const auto taken = vitals.take(message("1"), 1, kNow, "a");
  EXPECT_EQ(taken.answer, "AA");
  EXPECT_THAT(notices_in(taken), ElementsAre("place-not-stated"));
  EXPECT_EQ(taken.lines.size(), 1U);
  EXPECT_EQ(vitals.elsewhere(), 1U);
  EXPECT_THAT(vitals.take(message("2"), 2, kNow, "a").lines, SizeIs(1));
  EXPECT_THAT(vitals.take(message("3"), 3, kNow, "a").lines, IsEmpty()) << "ever fewer are told";
  for (const char* list : {"", "OR1,", ",OR1"}) EXPECT_THROW(PlaceList::parse(list, "s"), UsageError) << list;
}

TEST(Hl7Vitals, OneMessageOfSeveralPatientsIsReadPatientByPatient) {
  const std::string first = of_bed("1", "SURG^OR1", "4711", "72");
  const std::string second = of_bed("1", "ICU^BED9", "4712", "141");
  const std::string both = first + second.substr(second.find("PID"));
  Hl7Vitals vitals(std::chrono::minutes(0));
  const auto all = vitals.take(both, 1, kNow, "a");
  EXPECT_THAT(values_in(all), ElementsAre("72 of GATEWAY/ICU[SURG^OR1]@a", "141 of GATEWAY/ICU[ICU^BED9]@a"));
  EXPECT_THAT(notices_in(all), ElementsAre("several-beds", "several-patients"));
  EXPECT_TRUE(keeps_message(all));

  Hl7Vitals of_room(std::chrono::minutes(0), {}, PlaceList::parse("OR1", "s"));
  const auto mine = of_room.take(both, 1, kNow, "a");
  EXPECT_THAT(values_in(mine), ElementsAre("72 of GATEWAY/ICU[SURG^OR1]@a"));
  EXPECT_THAT(notices_in(mine), ElementsAre("other-place"));
  EXPECT_FALSE(keeps_message(mine)) << "it holds the values of another patient";
  EXPECT_THAT(notices_in(of_room.take(both, 2, kNow, "a")), Contains("message-repeated"));

  std::string many = first.substr(0, first.find("PID"));
  for (std::size_t i = 0; i <= Hl7Vitals::kMostPatients; ++i) many += first.substr(first.find("PID"));
  EXPECT_EQ(vitals.take(many, 3, kNow, "a").answer, "AE");
  EXPECT_EQ(vitals.take(of_bed("2", std::string(201, 'x'), "", "1"), 3, kNow, "a").answer, "AE");
}

TEST(Hl7Vitals, TrainingAndDebuggingAreRefusedAndTold) {
  Hl7Vitals vitals(std::chrono::minutes(0));
  const auto in_mode = [](const std::string& id, const std::string& mode) {
    std::string text = message(id);
    return text.replace(text.find("|P|"), 3, "|" + mode + "|");
  };
  std::vector<std::size_t> told;
  for (const char* mode : {"T", "D", "t^T", "D"}) {
    const auto taken = vitals.take(in_mode(mode, mode), 1, kNow, "a");
    EXPECT_EQ(taken.answer, "AR") << mode;
    EXPECT_TRUE(taken.is_of_sender);
    EXPECT_EQ(samples_in(taken), 0U) << mode;
    EXPECT_TRUE(keeps_message(taken)) << "whoever set the monitor wrong can have it read later";
    EXPECT_THAT(taken.acknowledgement,
                HasSubstr("|messages of training and debugging (MSH-11) are not taken here\r"));
    told.push_back(notices_in(taken).size());
  }
  EXPECT_THAT(told, ElementsAre(1U, 1U, 0U, 1U)) << "the first, second and fourth";
  EXPECT_EQ(vitals.take(in_mode("5", "P^T"), 1, kNow, "a").answer, "AA") << "production, at intervals";
  EXPECT_EQ(vitals.take(in_mode("6", ""), 1, kNow, "a").answer, "AA");
  const auto restored = vitals.take(in_mode("7", "P^R"), 1, kNow, "a");
  EXPECT_EQ(restored.answer, "AR") << "of before";
  EXPECT_EQ(samples_in(restored), 0U);
  EXPECT_THAT(notices_in(restored), Contains("archived-message"));
}

TEST(Hl7Vitals, NothingIsTakenOfAFrameOfSeveralMessages) {
  const std::string first = of_bed("1", "SURG^OR1", "4711", "72"),
                    second = of_bed("2", "ICU^BED9", "", "141");
  std::string other_separators = second;
  std::ranges::replace(other_separators, '|', '#');
  const std::string unended = first.substr(0, first.size() - 1);
  for (const std::string& frame : {first + second, unended + second, unended + "\n" + other_separators}) {
    Hl7Vitals vitals(std::chrono::minutes(0));
    const auto taken = vitals.take(frame, 1, kNow, "a");
    EXPECT_EQ(taken.answer, "AE") << frame;
    EXPECT_THAT(taken.acknowledgement, HasSubstr("\rMSA|AE|1|several messages came in one frame"));
    EXPECT_EQ(samples_in(taken), 0U) << frame;
    EXPECT_THAT(notices_in(taken), ElementsAre("several-messages"));
    EXPECT_TRUE(keeps_message(taken));
  }
  // A laboratory's hormone is no header, nor is a monitor that is called so.
  Hl7Vitals vitals(std::chrono::minutes(0));
  EXPECT_EQ(vitals.take(first + "NTE|1||\nMSH: 12 pg/ml\nMSH-1\r", 1, kNow, "a").answer, "AA");
  EXPECT_EQ(
      vitals.take("MSH|^~\\&|MSH||MSH||20260101||ORU^R01|9|P|2.6\rOBX|1|NM|1^X||5\r", 2, kNow, "a").answer,
      "AA");
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
  EXPECT_GE(answers["AA"], 25);
  EXPECT_GE(answers["AR"], 23);  // three of them of training and debugging
  EXPECT_EQ(answers["AE"], 1);   // "MSH|^~"
}

}  // namespace
}  // namespace kiroku::recorder
