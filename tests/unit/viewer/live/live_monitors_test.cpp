#include "viewer/live/live_monitors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::live {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

class LiveMonitorsTest : public testing::Test {
 protected:
  LiveMonitorsTest() {
    monitors_.add("or-1", "vitals", tap_);
    tap_->begin();
  }
  void number(std::int64_t time_ns, std::optional<double> value,
              media::VitalQuality quality = media::VitalQuality::kGood) {
    media::VitalSample sample;
    sample.time_ns = time_ns;
    sample.code = "MDC_ECG_HEART_RATE";
    sample.value = value;
    sample.unit = "/min";
    sample.quality = quality;
    tap_->offer(sample);
  }
  void wave(std::int64_t end_ns) {
    media::VitalSample sample;
    sample.time_ns = end_ns;
    sample.code = "MDC_ECG_ELEC_POTL_II";
    sample.rate_hz = 4;
    sample.values = {1, 2, 3, 4};
    tap_->offer(sample);
  }
  void alarm(std::int64_t time_ns, const std::string& phase, const std::string& text = "SpO2 low",
             const std::string& priority = "PH") {
    media::DeviceAlarm alarm;
    alarm.time_ns = time_ns;
    alarm.text = text;
    alarm.phase = phase;
    alarm.priority = priority;
    tap_->offer(alarm);
  }
  viewer::LiveVitalsNow now(std::int64_t after_ns = -1) { return monitors_.now("or-1", after_ns).value(); }

  std::shared_ptr<recorder::VitalsTap> tap_ = std::make_shared<recorder::VitalsTap>();
  LiveMonitors monitors_;
};

TEST_F(LiveMonitorsTest, ShowTheNewestNumber) {
  EXPECT_FALSE(monitors_.now("or-2", -1)) << "nothing is recorded there";
  EXPECT_THAT(now().series, IsEmpty());
  number(kSecond, 60);
  number(2 * kSecond, 61);
  ASSERT_THAT(now().series, SizeIs(1));
  EXPECT_EQ(now().series[0].value, 61);
  EXPECT_EQ(now().series[0].time_ns, 2 * kSecond);
  number(3 * kSecond, std::nullopt, media::VitalQuality::kMissing);
  EXPECT_EQ(now().series[0].value, std::nullopt);
  number(4 * kSecond, 250, media::VitalQuality::kInvalid);
  EXPECT_EQ(now().series[0].value, std::nullopt) << "what its device calls invalid is no number";
  EXPECT_FALSE(now().series[0].is_questionable);
  number(5 * kSecond, 18, media::VitalQuality::kQuestionable);
  EXPECT_TRUE(now().series[0].is_questionable);
}

TEST_F(LiveMonitorsTest, GiveOfAWaveWhatIsNewAndKeepTenSeconds) {
  for (int second = 1; second <= 30; ++second) wave(second * kSecond);
  ASSERT_THAT(now().series, SizeIs(1));
  EXPECT_EQ(now().series[0].blocks.front().end_ns, 20 * kSecond);
  ASSERT_THAT(now(29 * kSecond).series[0].blocks, SizeIs(1));
  EXPECT_THAT(now(29 * kSecond).series[0].blocks[0].values, ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(now(30 * kSecond).series[0].blocks, IsEmpty());
}

TEST_F(LiveMonitorsTest, ShowAlarmsUntilTheyEnd) {
  alarm(kSecond, "start");
  alarm(2 * kSecond, "continue");
  alarm(3 * kSecond, "start", "Asystole");
  ASSERT_THAT(now().alarms, SizeIs(2));
  EXPECT_EQ(now().alarms[0].since_ns, kSecond);
  alarm(4 * kSecond, "end");
  ASSERT_THAT(now().alarms, SizeIs(1));
  EXPECT_EQ(now().alarms[0].text, "Asystole");
  alarm(5 * kSecond, "end", "never began");
  EXPECT_THAT(now().alarms, SizeIs(1));
}

// What a queue brings of an earlier patient is told by no alarm of now.
TEST_F(LiveMonitorsTest, AnAlarmThatMayBeAnEarlierPatientsIsNotOpened) {
  media::DeviceAlarm earlier;
  earlier.time_ns = kSecond;
  earlier.text = "Asystole";
  earlier.phase = "start";
  earlier.quality = media::VitalQuality::kQuestionable;
  tap_->offer(earlier);
  EXPECT_THAT(now().alarms, IsEmpty());
  alarm(2 * kSecond, "continue");
  EXPECT_THAT(now().alarms, SizeIs(1));
}

// A device whose alarms name values begins each under another text, and ends none of them.
TEST_F(LiveMonitorsTest, ShowANewAlarmAlsoBehindManyThatNeverEnded) {
  for (std::size_t i = 1; i <= LiveMonitors::kMostAlarms; ++i)
    alarm(static_cast<std::int64_t>(i), "start", "HR " + std::to_string(i));
  alarm(kSecond, "start", "asystole");
  const auto alarms = now().alarms;
  ASSERT_THAT(alarms, SizeIs(LiveMonitors::kMostAlarms));
  EXPECT_EQ(alarms.back().text, "asystole");
  EXPECT_EQ(alarms.front().text, "HR 2") << "the oldest made room";
  alarm(2 * kSecond, "end", "asystole");
  EXPECT_EQ(now().alarms.back().text, "HR " + std::to_string(LiveMonitors::kMostAlarms));
}

TEST_F(LiveMonitorsTest, ShowAGraveAlarmAlsoBeforeManyThatAreNot) {
  alarm(1, "start", "asystole");
  for (std::size_t i = 0; i < 2 * LiveMonitors::kMostAlarms; ++i)
    alarm(static_cast<std::int64_t>(i) + 2, "start", "cable " + std::to_string(i), "PL");
  EXPECT_EQ(now().alarms.front().text, "asystole");
  for (std::size_t i = 0; i < LiveMonitors::kMostAlarms; ++i)
    alarm(kSecond + static_cast<std::int64_t>(i), "start", "HR " + std::to_string(i));
  alarm(2 * kSecond, "start", "cable", "PL");
  const auto alarms = now().alarms;
  ASSERT_THAT(alarms, SizeIs(LiveMonitors::kMostAlarms));
  for (const viewer::LiveAlarm& each : alarms) EXPECT_EQ(each.priority, "PH") << each.text;
}

TEST_F(LiveMonitorsTest, ShowANumberAlsoBehindManyNamesThatCameOnce) {
  for (std::size_t i = 1; i <= LiveMonitors::kMostSeries; ++i) {
    media::VitalSample sample;
    sample.time_ns = static_cast<std::int64_t>(i);
    sample.code = "NAME " + std::to_string(i);
    sample.value = 1;
    tap_->offer(sample);
  }
  number(kSecond, 60);
  const auto series = now().series;
  ASSERT_THAT(series, SizeIs(LiveMonitors::kMostSeries));
  EXPECT_EQ(series.back().code, "MDC_ECG_HEART_RATE");
}

TEST_F(LiveMonitorsTest, ForgetACaseWithTheNext) {
  number(kSecond, 60);
  alarm(kSecond, "start");
  ASSERT_THAT(now().alarms, SizeIs(1));
  tap_->begin();
  EXPECT_THAT(now().alarms, IsEmpty());
  EXPECT_THAT(now().series, IsEmpty());
}

TEST_F(LiveMonitorsTest, TakeWhatComesThoughNobodyLooks) {
  alarm(1, "start");
  // More than a tap holds: only because it is emptied meanwhile does none of it lack.
  for (std::size_t i = 0; i < 3 * recorder::VitalsTap::kMostWaiting; ++i) {
    while (tap_->waiting() == recorder::VitalsTap::kMostWaiting) std::this_thread::yield();
    number(static_cast<std::int64_t>(i) + 2, 60);
  }
  EXPECT_EQ(tap_->lost(), 0U);
  EXPECT_THAT(now().alarms, SizeIs(1));
  EXPECT_EQ(now().series[0].time_ns, static_cast<std::int64_t>(3 * recorder::VitalsTap::kMostWaiting) + 1);
}

}  // namespace
}  // namespace kiroku::live
