#include "recorder/vitals/monitor_reader.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/shared_data.h"

namespace kiroku::recorder {
namespace {

using media::DeviceAlarm;
using media::DeviceClock;
using media::VitalNotice;
using media::VitalQuality;
using media::VitalSample;
using media::VitalText;
using std::chrono::minutes;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// The lines of one kind.
template <typename Line>
std::vector<Line> of(const std::vector<media::VitalLine>& lines) {
  std::vector<Line> found;
  for (const media::VitalLine& line : lines) {
    if (const auto* const one = std::get_if<Line>(&line)) {
      found.push_back(*one);
    }
  }
  return found;
}

class MonitorReaderTest : public testing::Test {
 protected:
  std::vector<media::VitalLine> read(const std::string& body, std::int64_t arrival_ns = 1'000'000'000,
                                     const std::string& time = "20260101120000+0000",
                                     const std::string& type = "ORU^R01^ORU_R01") {
    const Hl7Parse parsed =
        parse_hl7_message("MSH|^~\\&|MON||||" + time + "||" + type + "|7|P|2.6||||||UNICODE UTF-8\r" + body);
    EXPECT_TRUE(parsed.message) << parsed.problem;
    auto lines = reader_.read(*parsed.message, arrival_ns, arrived_);
    for (const media::VitalLine& line : lines) {
      EXPECT_EQ(media::time_ns_of(line), arrival_ns);
      EXPECT_NO_THROW(media::to_json_line(line));
    }
    return lines;
  }
  VitalSample sample(const std::string& obx) {
    const auto samples = of<VitalSample>(read(obx));
    EXPECT_THAT(samples, SizeIs(1)) << obx;
    return samples.empty() ? VitalSample() : samples.front();
  }
  std::vector<std::string> notices(const std::vector<media::VitalLine>& lines) {
    std::vector<std::string> texts;
    for (const VitalNotice& notice : of<VitalNotice>(lines)) {
      texts.push_back(notice.notice + ": " + notice.text);
    }
    return texts;
  }

  /// Of a message of a heart rate that arrives `seconds` after the recording began at 12:00.
  VitalQuality quality_at(double seconds, const std::string& sent, const std::string& measured = "") {
    const auto since_ns = static_cast<std::int64_t>(seconds * 1e9);
    arrived_ = *parse_utc("2026-01-01T12:00:00Z") + std::chrono::microseconds(since_ns / 1000);
    const auto lines =
        read("OBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|72|/min|||||R|||" + measured, since_ns, sent);
    for (const std::string& each : notices(lines)) told_.push_back(each);
    const auto samples = of<VitalSample>(lines);
    EXPECT_THAT(samples, SizeIs(1));
    return samples.empty() ? VitalQuality::kMissing : samples.front().quality;
  }

  MonitorReader reader_{"bed 4", minutes(0)};
  std::optional<UtcTime> arrived_;
  std::vector<std::string> told_;  // by quality_at()
};

constexpr const char* kSaturation =
    "OBX|1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.3.1.150456|97|262688^MDC_DIM_PERCENT^MDC|||||R|||"
    "20260101115959";

// HL7 v2 chapter 2, MSH-7: a zone that is stated there holds throughout the message.
TEST_F(MonitorReaderTest, TimesWithoutAZoneAreInTheZoneOfMsh7) {
  const auto device_time = [this](const std::string& body, const std::string& sent) {
    const auto samples = of<VitalSample>(read(body, 1'000'000'000, sent));
    return samples.size() == 1 && samples[0].device_time ? format_utc(*samples[0].device_time).substr(0, 19)
                                                         : "none";
  };
  EXPECT_EQ(device_time(kSaturation, "20260101120000+0900"), "2026-01-01T02:59:59");
  EXPECT_EQ(device_time(kSaturation, "20260101120000-0500"), "2026-01-01T16:59:59");
  EXPECT_EQ(device_time(kSaturation, "20260101120000"), "2026-01-01T11:59:59") << "the assumed one again";
  EXPECT_EQ(device_time("OBR|1|||X|||20260101115800\rOBX|1|NM|1^A||5|%\r", "20260101120000+0900"),
            "2026-01-01T02:58:00")
      << "OBR-7";
}

TEST_F(MonitorReaderTest, ReadsANumber) {
  const auto lines = read(kSaturation);
  const auto samples = of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(1));
  EXPECT_EQ(
      media::to_json_line(samples[0]),
      R"({"time_ns":1000000000,"device_time":"2026-01-01T11:59:59.000000Z","code":"MDC_PULS_OXIM_SAT_O2",)"
      R"("mdc":150456,"value":97,"unit":"%","source":"bed 4","quality":"good"})");
  EXPECT_THAT(notices(lines), IsEmpty());
}

TEST_F(MonitorReaderTest, KnowsMissingValuesInAllTheirForms) {
  for (const char* value : {"-999", "-99.9", "32767", "8388607", "-999.0", "", "---", "***", "\"\""}) {
    const VitalSample missing = sample(std::string("OBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1.7.4.147842|") +
                                       value + "|264864^MDC_DIM_BEAT_PER_MIN^MDC");
    EXPECT_EQ(missing.quality, VitalQuality::kMissing) << value;
    EXPECT_FALSE(missing.value) << value;
    EXPECT_EQ(missing.unit, "/min");
  }
  EXPECT_EQ(sample("OBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1||264864^MDC_DIM_BEAT_PER_MIN^MDC|||||X").quality,
            VitalQuality::kMissing);
  EXPECT_EQ(
      sample("OBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|0|264864^MDC_DIM_BEAT_PER_MIN^MDC||NAV|||R").quality,
      VitalQuality::kMissing);
  EXPECT_EQ(sample("OBX|1|NM|1^MDC_X^MDC|1|-98").value, -98);
}

TEST_F(MonitorReaderTest, TellsOfValuesThatWereMeasuredLongBefore) {
  const auto measured = [](const std::string& time) {
    return "OBR|1|||1^MDC_X^MDC|||" + time +
           "\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|72|264864^MDC_DIM_BEAT_PER_MIN^MDC";
  };
  EXPECT_THAT(notices(read(measured("20260101115801+0000"))), IsEmpty());
  const auto late = read(measured("20260101110000+0000"));
  EXPECT_THAT(notices(late), ElementsAre(HasSubstr("measured-earlier: OBX 1 (MDC_ECG_HEART_RATE)")));
  const auto samples = of<VitalSample>(late);
  ASSERT_THAT(samples, SizeIs(1));
  EXPECT_EQ(samples[0].time_ns, 1'000'000'000) << "when it arrived";
  EXPECT_EQ(samples[0].device_time, parse_utc("2026-01-01T11:00:00Z"));
  EXPECT_EQ(samples[0].quality, VitalQuality::kGood) << "the monitor's word";
  EXPECT_THAT(notices(read(measured("20260101110001+0000"))), IsEmpty()) << "once a monitor and quantity";
}

// The monitor kept it while the network was away: the message is as old as its values.
TEST_F(MonitorReaderTest, TellsOfAMessageThatWasHeldUp) {
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  read("OBX|1|NM|1^MDC_X^MDC|1|5", kHourNs, "20260101130000+0000");
  EXPECT_THAT(notices(read("OBX|1|NM|2^MDC_Y^MDC|1|5", kHourNs + 1, "20260101121000+0000")),
              ElementsAre(HasSubstr("measured-earlier: OBX 1 (MDC_Y)")));
}

// The port is closed between cases: a gateway keeps the earlier patient's values, and sends them at once.
TEST_F(MonitorReaderTest, WhatAQueueBringsAtTheBeginningIsQuestionable) {
  for (const char* sent : {"20260101113500", "20260101113600", "20260101113700", "20260101113800"})
    EXPECT_EQ(quality_at(0.2, sent), VitalQuality::kQuestionable) << sent;
  EXPECT_THAT(told_, ElementsAre(HasSubstr("zone-assumed"), HasSubstr("measured-before: messages state")));
  EXPECT_EQ(quality_at(1, "20260101120001"), VitalQuality::kGood) << "of now";
  EXPECT_EQ(quality_at(2, "20260101115000"), VitalQuality::kQuestionable) << "and the rest of the queue";
  const auto lines = read("OBX|1|NM|1^MDC_X^MDC|1|5", 70'000'000'000, "20260101120110");
  const auto clocks = of<media::DeviceClock>(lines);
  ASSERT_THAT(clocks, SizeIs(1));
  EXPECT_EQ(clocks[0].zero, parse_utc("2026-01-01T12:00:00Z")) << "not by the queue's times";
}

TEST_F(MonitorReaderTest, AQueueThatComesSlowlyIsQuestionableToo) {
  for (int message = 0; message < 20; ++message) {
    const std::string minute = std::to_string(30 + message);
    EXPECT_EQ(quality_at(message, "2026010111" + minute + "00"), VitalQuality::kQuestionable);
  }
}

// A clock that is wrong, as of a monitor that nobody set, is one that goes on as its messages arrive.
TEST_F(MonitorReaderTest, AWrongClockIsKnownAfterSomeSeconds) {
  for (const char* hour : {"09", "15"}) {
    reader_ = MonitorReader("bed 4", minutes(0));
    const auto sent = [&](const std::string& second) {
      return "20260101" + std::string(hour) + "00" + second;
    };
    EXPECT_EQ(quality_at(0, sent("00")), VitalQuality::kQuestionable);
    EXPECT_EQ(quality_at(2, sent("02")), VitalQuality::kQuestionable);
    EXPECT_EQ(quality_at(4, sent("04")), VitalQuality::kGood);
    EXPECT_EQ(quality_at(5, sent("05")), VitalQuality::kGood);
  }
}

// A gateway sends each half minute what it was told since; another one states whole minutes.
TEST_F(MonitorReaderTest, AWrongClockIsKnownThroughBurstsAndWholeMinutes) {
  const auto two = [](int number) { return (number < 10 ? "0" : "") + std::to_string(number); };
  VitalQuality quality = VitalQuality::kMissing;
  for (int burst = 0; burst < 4; ++burst) {
    for (int of = 0; of < 6; ++of) {
      const int second = burst * 30 + of * 5;
      quality = quality_at(burst * 30 + 25, "2026010109" + two(second / 60) + two(second % 60));
    }
  }
  EXPECT_EQ(quality, VitalQuality::kGood);
  reader_ = MonitorReader("bed 4", minutes(0));
  for (int second = 5; second < 300; second += 10)
    quality = quality_at(second, "2026010109" + two(second / 60) + "00");
  EXPECT_EQ(quality, VitalQuality::kGood);
}

TEST_F(MonitorReaderTest, WhatWasMeasuredBeforeTheRecordingIsQuestionable) {
  EXPECT_EQ(quality_at(0, "20260101120000", "20260101114000"), VitalQuality::kQuestionable);
  EXPECT_EQ(quality_at(600, "20260101121000", "20260101120300"), VitalQuality::kGood)
      << "late, and in the recording";
  EXPECT_THAT(told_, Contains(HasSubstr("measured-before: OBX 1 (MDC_ECG_HEART_RATE)")));
  EXPECT_THAT(told_, Contains(HasSubstr("measured-earlier: OBX 1 (MDC_ECG_HEART_RATE)")));
}

// Alarms and words of an earlier patient's queue, before any value and behind one.
TEST_F(MonitorReaderTest, AlarmsAndTextsOfAQueueAreQuestionableToo) {
  const auto qualities_at = [this](double seconds, const std::string& sent, const std::string& measured) {
    const auto since_ns = static_cast<std::int64_t>(seconds * 1e9);
    arrived_ = *parse_utc("2026-01-01T12:00:00Z") + std::chrono::microseconds(since_ns / 1000);
    const auto texts = read("OBX|1|ST|9999^RHYTHM^L|1|VF||||||F|||" + measured, since_ns, sent);
    const auto alarms = read("OBX|1|CWE|196616^MDC_EVT_ALARM^MDC|1.1.1.1.1|^ASYSTOLE||||||F|||" + measured +
                                 "\rOBX|2|ST|68481^MDC_ATTR_EVENT_PHASE^MDC|1.1.1.1.2|start||||||F",
                             since_ns, sent, "ORU^R40");
    for (const auto& lines : {texts, alarms}) {
      for (const std::string& each : notices(lines)) told_.push_back(each);
    }
    EXPECT_THAT(of<VitalText>(texts), SizeIs(1));
    EXPECT_THAT(of<DeviceAlarm>(alarms), SizeIs(1));
    return std::pair(of<VitalText>(texts).at(0).quality, of<DeviceAlarm>(alarms).at(0).quality);
  };
  const std::pair questionable(VitalQuality::kQuestionable, VitalQuality::kQuestionable);
  EXPECT_EQ(qualities_at(0, "20260101112000", "20260101112000"), questionable);
  EXPECT_THAT(told_, Contains(HasSubstr("measured-before: messages state")));
  EXPECT_EQ(qualities_at(1, "20260101120001", "20260101120001"),
            std::pair(VitalQuality::kGood, VitalQuality::kGood));
  told_.clear();
  EXPECT_EQ(qualities_at(2, "20260101120002", "20260101112100"), questionable);
  EXPECT_THAT(told_, ElementsAre(HasSubstr("measured-before: OBX 1 (9999^RHYTHM^L)"),
                                 HasSubstr("measured-before: OBX 1 (MDC_EVT_ALARM)")));
}

// A gateway stamps the message as it sends it, and the order says when it was measured.
TEST_F(MonitorReaderTest, AnOldOrderThatIsSentNowIsQuestionable) {
  std::int64_t since_ns = 10'000'000'000;
  const auto of_order = [&](const std::string& sent, const std::string& begun,
                            const std::string& measured = "") {
    arrived_ = *parse_utc("2026-01-01T12:00:00Z") + std::chrono::microseconds(since_ns / 1000);
    const auto samples = of<VitalSample>(read(
        "OBR|1|||1^X|||" + begun + "\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|31|/min|||||F|||" + measured,
        since_ns, sent));
    return samples.empty() ? VitalQuality::kMissing : samples.front().quality;
  };
  EXPECT_EQ(of_order("", "20260101112000"), VitalQuality::kQuestionable) << "without MSH-7";
  EXPECT_EQ(of_order("20260101", "20260101112000", "20260101112000"), VitalQuality::kQuestionable);
  EXPECT_EQ(of_order("", "20260101120009"), VitalQuality::kGood);
  EXPECT_EQ(of_order("20260101120010", "20260101112000"), VitalQuality::kQuestionable);
  EXPECT_EQ(of_order("20260101120010", "20260101112000", "20260101120009"), VitalQuality::kGood)
      << "its value is of now";
  since_ns += MonitorReader::kOrderGoesOnNs;
  EXPECT_EQ(of_order("20260101120110", "20260101112000"), VitalQuality::kGood) << "an order that goes on";
  EXPECT_EQ(of_order("20260101120110", "20260101112500"), VitalQuality::kQuestionable) << "another one";
  EXPECT_EQ(of_order("20260101120110", "20260101112000", "20260101112000"), VitalQuality::kQuestionable);
}

// What goes ahead of a case may be another patient's, too.
TEST_F(MonitorReaderTest, WhatWasMeasuredAheadOfTheCaseIsBeforeIt) {
  EXPECT_EQ(quality_at(600, "20260101121000", "20260101120300"), VitalQuality::kGood);
  EXPECT_EQ(quality_at(601, "20260101121001", "20260101115000"), VitalQuality::kQuestionable);
  told_.clear();
  reader_.case_begins(590'000'000'000);
  EXPECT_EQ(quality_at(602, "20260101121002", "20260101120300"), VitalQuality::kQuestionable);
  EXPECT_THAT(told_, Contains(HasSubstr("measured-before")))
      << "what was told ahead of the case may not be in it";
  EXPECT_EQ(quality_at(603, "20260101121003", "20260101120900"), VitalQuality::kGood);
}

// Its times are of another day than this machine's.
TEST_F(MonitorReaderTest, OfAFileNothingIsBeforeTheRecording) {
  EXPECT_EQ(sample("OBX|1|NM|1^MDC_X^MDC|1|5|||||R|||20251231120000").quality, VitalQuality::kGood);
}

TEST_F(MonitorReaderTest, TellsQualities) {
  const auto with = [&](const std::string& flags, const std::string& status) {
    return sample("OBX|1|NM|1^MDC_X^MDC|1|5|%||" + flags + "|||" + status).quality;
  };
  EXPECT_EQ(with("", "R"), VitalQuality::kGood);
  EXPECT_EQ(with("H", "F"), VitalQuality::kGood);
  EXPECT_EQ(with("INV", "R"), VitalQuality::kInvalid);
  EXPECT_EQ(with("L~QUES", "R"), VitalQuality::kQuestionable);
  EXPECT_EQ(with("", "W"), VitalQuality::kInvalid);
  EXPECT_EQ(with("", "X"), VitalQuality::kQuestionable);
  EXPECT_EQ(with("DEMO", "R"), VitalQuality::kQuestionable);
  EXPECT_THAT(notices(read("OBX|1|NM|1^MDC_X^MDC|1|5|%||TEST|||R")),
              ElementsAre(HasSubstr("not-of-a-patient: the monitor marks values as TEST")));
}

TEST_F(MonitorReaderTest, BringsCodesIntoOneForm) {
  const auto code = [&](const std::string& obx3) {
    const VitalSample read = sample("OBX|1|NM|" + obx3 + "|1|5");
    return read.code + " " + std::to_string(read.mdc);
  };
  EXPECT_EQ(code("150456^MDC_PULS_OXIM_SAT_O2^MDC"), "MDC_PULS_OXIM_SAT_O2 150456");
  EXPECT_EQ(code("MDC_PULS_OXIM_SAT_O2^150456^MDC"), "MDC_PULS_OXIM_SAT_O2 150456");
  EXPECT_EQ(code("150456^^MDC"), "MDC_PULS_OXIM_SAT_O2 150456");
  EXPECT_EQ(code("150999^^MDC"), "MDC:150999 150999");
  EXPECT_EQ(code("8889-8^Heart Rate^LN^149530^MDC_PULS_OXIM_PULS_RATE^MDC"),
            "MDC_PULS_OXIM_PULS_RATE 149530");
  EXPECT_EQ(code("2267^COMEN_ACVPU^99COMEN"), "2267^COMEN_ACVPU^99COMEN 0");
  EXPECT_EQ(code("HR"), "HR 0");
  EXPECT_EQ(code("0^MDC_NEW_TERM^MDC"), "MDC_NEW_TERM 0");
  // Seen: a systolic cuff pressure under the number of something else.
  const auto lines = read("OBX|1|NM|150017^MDC_PRESS_BLD_NONINV_SYS^MDC|1|128|mmHg");
  EXPECT_EQ(of<VitalSample>(lines).at(0).mdc, 150021U);
  EXPECT_THAT(notices(lines),
              ElementsAre(HasSubstr("the number 150017 is not that of MDC_PRESS_BLD_NONINV_SYS")));
}

TEST_F(MonitorReaderTest, BringsUnitsIntoUcum) {
  const auto unit = [&](const std::string& obx6) { return sample("OBX|1|NM|1^MDC_X^MDC|1|5|" + obx6).unit; };
  EXPECT_EQ(unit("262688^MDC_DIM_PERCENT^MDC"), "%");
  EXPECT_EQ(unit("266016^MDC_DIM_MMHG^MDC"), "mm[Hg]");
  EXPECT_EQ(unit("266016"), "mm[Hg]");
  EXPECT_EQ(unit("264864^/min^MDC"), "/min");
  EXPECT_EQ(unit("{beats}/min^beats per minute^UCUM"), "/min");
  EXPECT_EQ(unit("263762^MDC_DIM_MILLI_L^MDC^mL^mL^UCUM"), "mL");
  EXPECT_EQ(unit("mmHg"), "mm[Hg]");
  EXPECT_EQ(unit("bpm"), "/min");
  EXPECT_EQ(unit("\xC2\xB0"
                 "C"),
            "Cel");
  EXPECT_EQ(unit("ng/mL^^UCUM"), "ng/mL");
  EXPECT_EQ(unit(""), "");
  const auto lines = read("OBX|1|NM|1^MDC_X^MDC|1|5|furlong");
  EXPECT_EQ(of<VitalSample>(lines).at(0).unit, "furlong");
  EXPECT_THAT(notices(lines), ElementsAre(HasSubstr("the unit 'furlong' is not known")));
}

TEST_F(MonitorReaderTest, ACuffPressureSentAgainWithItsOldTimeIsOneMeasurement) {
  const std::string cuff = "OBX|1|NM|150021^MDC_PRESS_BLD_NONINV_SYS^MDC|1.1.9.150021|120|mmHg|||||R|||";
  EXPECT_THAT(of<VitalSample>(read(cuff + "20260101113000")), SizeIs(1));
  const auto again = read(cuff + "20260101113000", 2'000'000'000);
  EXPECT_THAT(of<VitalSample>(again), IsEmpty());
  EXPECT_THAT(notices(again), ElementsAre(HasSubstr("measurement-repeated")));
  EXPECT_THAT(notices(read(cuff + "20260101113000", 3'000'000'000)), IsEmpty());  // said once
  const auto next = of<VitalSample>(read(cuff + "20260101114500", 4'000'000'000));
  ASSERT_THAT(next, SizeIs(1));  // the same value, measured anew
  EXPECT_EQ(next[0].device_time, parse_utc("2026-01-01T11:45:00Z"));
  const auto corrected =
      read("OBX|1|NM|150021^MDC_PRESS_BLD_NONINV_SYS^MDC|1.1.9.150021|121|mmHg|||||R|||20260101114500",
           5'000'000'000);
  EXPECT_THAT(of<VitalSample>(corrected), SizeIs(1));
  // What is measured all the time is recorded each time, whatever its clock says.
  EXPECT_THAT(of<VitalSample>(read(kSaturation)), SizeIs(1));
  EXPECT_THAT(of<VitalSample>(read(kSaturation)), SizeIs(1));
  const std::string temperature =
      "OBX|7|NM|188496^MDC_TEMP_AXIL^MDC|1.2.5.188496|35.1|268192^MDC_DIM_DEGC^MDC|||||R|||20191206113415|||^"
      "APERIODIC";
  EXPECT_THAT(of<VitalSample>(read(temperature)), SizeIs(1));
  EXPECT_THAT(of<VitalSample>(read(temperature)), IsEmpty());
}

TEST_F(MonitorReaderTest, TakesTheTimeOfTheOrderOrOfTheMessageWhereTheObservationHasNone) {
  const std::string bare = "OBX|1|NM|1^MDC_X^MDC|1|5";
  EXPECT_EQ(of<VitalSample>(read("OBR|1||||||20260101110000+0530\r" + bare)).at(0).device_time,
            parse_utc("2026-01-01T05:30:00Z"));
  EXPECT_EQ(sample(bare).device_time, parse_utc("2026-01-01T12:00:00Z"));
  const auto lines = read(bare, 1, "");
  EXPECT_FALSE(of<VitalSample>(lines).at(0).device_time);
  EXPECT_THAT(notices(lines), ElementsAre(HasSubstr("states no time")));
  const auto odd = read(bare + "||||||R|||yesterday");
  EXPECT_EQ(of<VitalSample>(odd).at(0).device_time, parse_utc("2026-01-01T12:00:00Z"));
}

TEST_F(MonitorReaderTest, SaysByWhichZoneItReadTimesWithoutOne) {
  reader_ = MonitorReader("bed 4", minutes(330));
  const auto lines = read(kSaturation, 1, "20260101173000");
  EXPECT_THAT(notices(lines), Contains("zone-assumed: times without zone were taken to be UTC+0530"));
  EXPECT_EQ(of<VitalSample>(lines).at(0).device_time, parse_utc("2026-01-01T06:29:59Z"));
}

TEST_F(MonitorReaderTest, PutsShiftedFieldsBack) {
  for (const char* obx : {"OBX|1|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.3.1|88|%|||||F",
                          "OBX||1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.3.1|88|%|||||F",
                          "OBX|1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|88|262688^MDC_DIM_PERCENT^MDC|||||F"}) {
    reader_ = MonitorReader("bed 4", minutes(0));
    const auto lines = read(obx);
    ASSERT_THAT(of<VitalSample>(lines), SizeIs(1)) << obx;
    EXPECT_EQ(of<VitalSample>(lines)[0].value, 88) << obx;
    EXPECT_EQ(of<VitalSample>(lines)[0].unit, "%") << obx;
    EXPECT_THAT(notices(lines), testing::Contains(HasSubstr("shifted"))) << obx;
  }
}

TEST_F(MonitorReaderTest, KeepsWordsAsTexts) {
  const auto lines = read(
      "OBX|1|NM|2267^COMEN_ACVPU^99COMEN||Alert||||||F\r"
      "OBX|2|ST|68^MDC_ATTR_NAME^MDC||pump A||||||F\r"
      "OBX|3|CWE|1^MDC_MODE^MDC||5^ventilated^MDC~6^paced^MDC||||||F\r"
      "OBX|4|SN|5671-3^Lead^LN||>^100|ug/dL||||||F");
  const auto texts = of<VitalText>(lines);
  ASSERT_THAT(texts, SizeIs(4));
  EXPECT_EQ(texts[0].code, "2267^COMEN_ACVPU^99COMEN");
  EXPECT_EQ(texts[0].text, "Alert");
  EXPECT_EQ(texts[1].text, "pump A");
  EXPECT_EQ(texts[2].text, "ventilated\npaced");
  EXPECT_EQ(texts[3].text, ">^100 ug/dL");
  EXPECT_THAT(notices(lines), ElementsAre(HasSubstr("'Alert' is no number"), HasSubstr("unit 'ug/dL'"),
                                          HasSubstr("'>^100' is no number")));
  EXPECT_EQ(sample("OBX|1|SN|1^MDC_X^MDC||^97|%").value, 97);
  EXPECT_EQ(sample("OBX|1|ST|1^MDC_X^MDC||97.5|%").value, 97.5);
  EXPECT_EQ(sample("OBX|1||1^MDC_X^MDC||97|%").value, 97);
}

TEST_F(MonitorReaderTest, SaysWhatItDoesNotUnderstandOnce) {
  const std::string body =
      "ZDP|1|x\rOBX|1|ED|1^MDC_X^MDC||^application^pdf^Base64^AA\rOBX|2|NM|||5\rOBX|3|NA|1^MDC_W^MDC|1|1^2^3";
  EXPECT_THAT(
      notices(read(body)),
      ElementsAre(HasSubstr("segment-unknown: the segment ZDP"), HasSubstr("type-unknown: OBX 1 (MDC_X)"),
                  HasSubstr("observation-unknown"), HasSubstr("waveform-without-rate: OBX 3 (MDC_W)")));
  EXPECT_THAT(notices(read(body)), IsEmpty());
  EXPECT_THAT(notices(read("PID|1")), ElementsAre(HasSubstr("message-empty")));
}

TEST_F(MonitorReaderTest, PassesOverTheDeviceTree) {
  const auto lines = read(
      "OBX|1||69965^MDC_DEV_MON_PHYSIO_MULTI_PARAM_MDS^MDC|1.0.0.0|||||||X\r"
      "OBX|2||69798^MDC_DEV_ECG_VMD^MDC|1.5.0.0|||||||X");
  EXPECT_THAT(of<VitalSample>(lines), IsEmpty());
  EXPECT_THAT(notices(lines), IsEmpty());
}

TEST_F(MonitorReaderTest, ReadsWaveformsWithTheRateInAFollowingSegment) {
  const auto lines = read(
      "OBR|1||1|100001^CONTINUOUS WAVEFORM^99MNDRY|||20260101115959.000+0000|20260101120000.000+0000\r"
      "OBX|1|NA|131329^MDC_ECG_ELEC_POTL_I^MDC|1.7.6.131329|80^88^32767^96\r"
      "OBX|2|NM|0^MDC_ATTR_SAMP_RATE^MDC|1.7.6.131329.1|500|264640^MDC_DIM_HZ^MDC\r"
      "OBX|3|NM|2327^MDC_ATTR_NU_MSMT_RES^MDC|1.7.6.131329.2|0.5|266418^MDC_DIM_MILLI_VOLT^MDC\r"
      "OBX|4|NA|150452^MDC_PULS_OXIM_PLETH^MDC|1.3.1.150452|1~2~3|262656^MDC_DIM_DIMLESS^MDC\r"
      "OBX|5|NM|0^MDC_ATTR_TIME_PD_SAMP^MDC|1.3.1.150452.1|8|264338^MDC_DIM_MILLI_SEC^MDC");
  const auto waves = of<VitalSample>(lines);
  ASSERT_THAT(waves, SizeIs(2));
  EXPECT_EQ(
      media::to_json_line(waves[0]),
      R"({"time_ns":1000000000,"device_time":"2026-01-01T11:59:59.008000Z","code":"MDC_ECG_ELEC_POTL_I",)"
      R"("mdc":131329,"rate_hz":500,"values":[40,44,null,48],"unit":"mV","source":"bed 4","quality":"good"})");
  EXPECT_EQ(waves[1].rate_hz, 125);
  EXPECT_THAT(waves[1].values, ElementsAre(1, 2, 3));
  EXPECT_EQ(waves[1].unit, "1");
  EXPECT_THAT(notices(lines), IsEmpty());
}

TEST_F(MonitorReaderTest, FindsTheRateWhereverItStands) {
  const auto rate = [&](const std::string& body) {
    reader_ = MonitorReader("bed 4", minutes(0));
    const auto waves = of<VitalSample>(read(body));
    return waves.empty() ? 0 : waves.front().rate_hz;
  };
  const std::string wave = "OBX|2|NA|131330^MDC_ECG_ELEC_POTL_II^MDC|1.1|1^2^3^4|mV";
  EXPECT_EQ(rate("OBX|1|CD|x|1.1|1&II^^^^250^\r" + wave), 250);
  EXPECT_EQ(rate(wave + "|||||R||||||500 Hz"), 500);
  EXPECT_EQ(rate("OBR|1||1|WAVEFORM|||20260101115959|20260101120000\r" + wave), 4);
  EXPECT_EQ(rate(wave + "\rOBX|3|NM|0^MDC_ATTR_SAMP_RATE^MDC||500"), 500);
  EXPECT_EQ(rate(wave), 0);
  // Said once, it holds for the messages after.
  reader_ = MonitorReader("bed 4", minutes(0));
  read(wave + "\rOBX|3|NM|0^MDC_ATTR_SAMP_RATE^MDC|1.1.1|500");
  EXPECT_EQ(of<VitalSample>(read(wave)).at(0).rate_hz, 500);
}

TEST_F(MonitorReaderTest, RefusesWaveformsThatCannotBeByName) {
  const std::string rate = "\rOBX|3|NM|0^MDC_ATTR_SAMP_RATE^MDC|1.1.1|1|264608^MDC_DIM_PER_SEC";
  const auto lines = read("OBX|1|NA|131330^MDC_PULS_OXIM_PLETH^MDC|1.1|Pleth signal" + rate);
  ASSERT_THAT(of<VitalSample>(lines), SizeIs(1));
  EXPECT_EQ(of<VitalSample>(lines)[0].quality, VitalQuality::kMissing);
  EXPECT_THAT(notices(lines), testing::Contains(HasSubstr("waveform-unreadable")));
  std::string minute = "1";
  for (int i = 0; i < 60; ++i) {
    minute += "^1";
  }
  EXPECT_THAT(notices(read("OBX|1|NA|1^MDC_W^MDC|1.1|" + minute + rate)),
              ElementsAre(HasSubstr("waveform-too-long")));
  EXPECT_THAT(notices(read("OBX|1|NA|1^MDC_V^MDC|1.1|1^2\rOBX|2|NM|0^MDC_ATTR_SAMP_RATE^MDC|1.1.1|0")),
              ElementsAre(HasSubstr("waveform-without-rate")));
  EXPECT_THAT(notices(read("OBX|1|NA|1^MDC_U^MDC|1.1|1^2\rOBX|2|NM|0^MDC_ATTR_TIME_PD_SAMP^MDC|1.1.1|0")),
              ElementsAre(HasSubstr("waveform-without-rate")));
}

TEST_F(MonitorReaderTest, ReadsAlarms) {
  const auto lines = read(
      "OBR|1||1|196616^MDC_EVT_ALARM^MDC|||20260101115900+0000\r"
      "OBX|1|CWE|196616^MDC_EVT_ALARM^MDC|1.1.0.0.1|196670^MDC_EVT_HI^MDC||||||F|||20260101115930+0000\r"
      "OBX|2|ST|68480^MDC_ATTR_ALERT_SOURCE^MDC|1.1.0.0.2|150456^MDC_PULS_OXIM_SAT_O2^MDC||||||F\r"
      "OBX|3|ST|68481^MDC_ATTR_EVENT_PHASE^MDC|1.1.0.0.3|start||||||F\r"
      "OBX|4|ST|68482^MDC_ATTR_ALARM_STATE^MDC|1.1.0.0.4|active||||||F\r"
      "OBX|5|ST|68483^MDC_ATTR_ALARM_INACTIVATION_STATE^MDC|1.1.0.0.5|audio-paused||||||F\r"
      "OBX|6|ST|68484^MDC_ATTR_ALARM_PRIORITY^MDC|1.1.0.0.6|PH||||||F\r"
      "OBX|8|ST|68546^MDC_ATTR_ALERT_TEXT^MDC|1.1.0.0.8|SpO2 high||||||F\r"
      "OBX|9|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.1.0.1|100|%",
      7, "20260101120000+0000", "ORU^R40^ORU_R40");
  EXPECT_THAT(
      of<DeviceAlarm>(lines),
      ElementsAre(DeviceAlarm{7, parse_utc("2026-01-01T11:59:30Z"), "MDC_EVT_HI", 196670, "SpO2 high",
                              "MDC_PULS_OXIM_SAT_O2", "start", "active, audio-paused", "PH", "bed 4"}));
  EXPECT_THAT(of<VitalSample>(lines), SizeIs(1));
  EXPECT_THAT(notices(lines), IsEmpty());
}

TEST_F(MonitorReaderTest, ReadsAlarmsInOtherWords) {
  const auto lines = read(
      "OBX|1||69965^MDC_DEV_MON_PHYSIO_MULTI_PARAM_MDS^MDC|1.0.0.0|||||||X\r"
      "OBX|2|ST|0^MDCX_EVT_ALERT_ADVISORY^MDC|1.0.0.0.1|Recheck BP|||A~PM~SA|||R\r"
      "OBX|4|ST|68165^MDC_ATTR_EVENT_PHASE^MDC|1.0.0.0.3|update|||A~PM~SA|||R\r"
      "OBX|5|ST|MDC_EVT_HI_VAL_ALARM^12345^MDC|1.1.3.1.1|MDC_PRESS_BLD_ART^150032^MDC\r"
      "OBX|6|ST|MDC_ATTR_EVT_PHASE^68481^MDC|1.1.3.1.3|end",
      7, "20260101120000+0000", "ORU^R40^ORU_R40");
  const auto alarms = of<DeviceAlarm>(lines);
  ASSERT_THAT(alarms, SizeIs(2));
  EXPECT_EQ(alarms[0].code + "/" + alarms[0].text + "/" + alarms[0].phase + "/" + alarms[0].priority,
            "MDCX_EVT_ALERT_ADVISORY/Recheck BP/update/PM");
  EXPECT_EQ(alarms[1].code + "/" + alarms[1].about + "/" + alarms[1].phase,
            "MDC_EVT_HI_VAL_ALARM/MDC_PRESS_BLD_ART/end");
  EXPECT_THAT(notices(read("OBX|1|NM|1^MDC_X^MDC||5", 8, "20260101120000+0000", "ORU^R40")),
              ElementsAre(HasSubstr("alarm-unknown")));
}

TEST_F(MonitorReaderTest, KeepsTheMonitorsClockBesideTheCaseClock) {
  const auto first = of<DeviceClock>(read(kSaturation, 10'000'000'000, "20260101120000+0000"));
  ASSERT_THAT(first, SizeIs(1));
  EXPECT_EQ(first[0].zero, parse_utc("2026-01-01T11:59:50Z"));
  EXPECT_EQ(first[0].messages, 1U);
  EXPECT_THAT(of<DeviceClock>(read(kSaturation, 11'000'000'000, "20260101120001+0000")), IsEmpty());
  EXPECT_THAT(of<DeviceClock>(read(kSaturation, 71'000'000'000, "20260101120101+0000")), SizeIs(1));
}

TEST(DeviceClockEstimate, IsThatOfTheLeastDelay) {
  DeviceClockEstimate estimate;
  const UtcTime zero = *parse_utc("2026-01-01T12:00:00Z");
  for (int i = 0; i < 200; ++i) {
    const auto now_ms = std::int64_t{1000} * i;
    // Up to 400 ms on the way, stamps cut to whole seconds.
    const std::int64_t delay_ms = (i * 37) % 400;
    EXPECT_FALSE(estimate.add((now_ms + delay_ms) * 1'000'000, zero + std::chrono::milliseconds(now_ms)));
  }
  EXPECT_EQ(estimate.estimate().zero, zero - std::chrono::milliseconds(1));
  EXPECT_GT(estimate.estimate().spread_ns, 100'000'000);
  EXPECT_LT(estimate.estimate().spread_ns, 300'000'000);
  EXPECT_EQ(estimate.estimate().messages, 200U);
}

TEST(DeviceClockEstimate, TellsAClockThatWasSetFromMessagesThatWereHeldUp) {
  DeviceClockEstimate estimate;
  const UtcTime zero = *parse_utc("2026-01-01T12:00:00Z");
  const auto at = [&](double arrival_s, double device_s) {
    return estimate.add(static_cast<std::int64_t>(arrival_s * 1e9),
                        zero + std::chrono::milliseconds(static_cast<std::int64_t>(device_s * 1e3)));
  };
  for (int i = 0; i < 20; ++i) {
    EXPECT_FALSE(at(i, i));
  }
  for (int i = 20; i < 80; ++i) {
    EXPECT_FALSE(at(80 + i * 0.01, i)) << "a minute's messages in one burst";
  }
  for (int i = 81; i < 90; ++i) {
    EXPECT_FALSE(at(i, i));
  }
  EXPECT_EQ(estimate.estimate().zero, zero);
  std::vector<std::int64_t> steps;
  for (int i = 90; i < 100; ++i) {
    if (const auto step = at(i, i + 3600)) {
      steps.push_back(*step);
    }
  }
  EXPECT_THAT(steps, ElementsAre(3'600'000'000));
  EXPECT_EQ(estimate.estimate().zero, zero + std::chrono::hours(1));
}

TEST_F(MonitorReaderTest, ReadsEveryRealMessageOrNamesWhatItDoesNotUnderstand) {
  KIROKU_NEEDS_SHARED_DATA("recording/hl7");
  std::size_t results = 0, lines_read = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(test::shared_data("recording/hl7"))) {
    if (entry.path().extension() != ".hl7") {
      continue;
    }
    const Bytes bytes = test::read_whole(entry.path());
    for (const std::string_view one : split_hl7_messages(text_of(bytes))) {
      const Hl7Parse parsed = parse_hl7_message(one);
      ASSERT_TRUE(parsed.message) << entry.path();
      if (!MonitorReader::reads(parsed.message->type())) {
        continue;
      }
      ++results;
      std::size_t observations = 0;
      for (const Hl7Segment& segment : parsed.message->segments()) {
        observations += segment.name() == "OBX" ? 1U : 0U;
      }
      MonitorReader reader("x", minutes(0));
      const auto lines = reader.read(*parsed.message, 0);
      const std::size_t read = of<VitalSample>(lines).size() + of<VitalText>(lines).size();
      EXPECT_TRUE(read == observations || !of<VitalNotice>(lines).empty()) << entry.path();
      for (const media::VitalLine& line : lines) {
        EXPECT_NO_THROW(media::to_json_line(line)) << entry.path();
        ++lines_read;
      }
    }
  }
  EXPECT_GE(results, 28U);
  EXPECT_GE(lines_read, 90U);
}

}  // namespace
}  // namespace kiroku::recorder
