#include "viewer/playback/case_vitals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "media/vital_codes.h"
#include "tests/support/decoded_video.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/support/recording.h"
#include "tests/support/temporary_folder.h"
#include "viewer/playback/case_playback.h"

namespace kiroku::playback {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr int kPatienceMs = 20'000;

class CaseVitalsTest : public testing::Test {
 protected:
  /// Lines of one stream "vitals", a segment a string.
  std::filesystem::path record(const std::vector<std::vector<media::VitalLine>>& segments) {
    test::RecordedStream stream{"vitals", "vitals", "application/jsonl", {}, {}};
    for (const auto& lines : segments) {
      std::string text;
      for (const media::VitalLine& line : lines) text += to_json_line(line) + "\n";
      stream.segments.push_back(to_bytes(text));
      stream.units.push_back(lines.size());
    }
    return test::record_case(folder_ / "archive", {stream}, reader_.recipients);
  }
  CasePlayback& open(const std::filesystem::path& recorded) {
    playback_ =
        std::make_unique<CasePlayback>(archive::CaseReader::open(recorded), reader_.identities, cache_);
    return *playback_;
  }
  static media::VitalSample heart_rate(std::int64_t time_ns, double value) {
    media::VitalSample sample;
    sample.time_ns = time_ns;
    sample.code = "MDC_ECG_HEART_RATE";
    sample.value = value;
    sample.unit = "/min";
    return sample;
  }
  static media::DeviceAlarm alarm(std::int64_t time_ns, const std::string& phase) {
    media::DeviceAlarm said;
    said.time_ns = time_ns;
    said.code = "MDC_EVT_LO";
    said.text = "SpO2 low";
    said.phase = phase;
    said.priority = "PH";
    return said;
  }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  std::shared_ptr<EncryptedCache> cache_ =
      std::make_shared<EncryptedCache>(folder_ / "cache", std::uint64_t{64} << 20);
  std::unique_ptr<CasePlayback> playback_;
};

TEST_F(CaseVitalsTest, ShowsValuesAtAnyZoomWithGapsAsGaps) {
  std::vector<std::vector<media::VitalLine>> segments(60);
  for (std::int64_t second = 0; second < 60; ++second) {
    if (second >= 20 && second < 40) continue;  // segments without a line
    segments[static_cast<std::size_t>(second)] = {
        heart_rate(second * kSecond + 5, 60.0 + static_cast<double>(second))};
  }
  CaseVitals& vitals = open(record(segments)).vitals("vitals");
  const VitalsView whole = vitals.view(0, 60 * kSecond, 60, kPatienceMs);
  EXPECT_GE(whole.complete_to_ns, 60 * kSecond);
  ASSERT_THAT(whole.series, SizeIs(1));
  EXPECT_EQ(whole.series[0].unit, "/min");
  EXPECT_EQ(whole.series[0].every_ns, kSecond);
  for (const VitalBin& bin : whole.series[0].bins) {
    EXPECT_TRUE(bin.end_ns <= 20 * kSecond || bin.end_ns > 40 * kSecond);
  }
  EXPECT_EQ(whole.series[0].bins.back().last, 119);
  const VitalsView near = vitals.view(10 * kSecond, 12 * kSecond, 1000, kPatienceMs);
  ASSERT_THAT(near.series.at(0).bins, SizeIs(2));
  EXPECT_EQ(near.series[0].bins[0].last_ns, 10 * kSecond + 5);
  EXPECT_EQ(near.series[0].bins[0].last, 70);
  for (const VitalSeries& series : vitals.view(25 * kSecond, 30 * kSecond, 1000, kPatienceMs).series) {
    EXPECT_THAT(series.bins, IsEmpty());
  }
  EXPECT_THAT(vitals.view(5, 5, 1000).series, IsEmpty());
}

TEST_F(CaseVitalsTest, KnowsValuesAtATime) {
  std::vector<std::vector<media::VitalLine>> segments(40);
  for (std::int64_t second = 0; second < 20; ++second) {
    segments[static_cast<std::size_t>(second)] = {heart_rate(second * kSecond, static_cast<double>(second))};
  }
  CaseVitals& vitals = open(record(segments)).vitals("vitals");
  (void)vitals.view(0, 40 * kSecond, 10, kPatienceMs);
  EXPECT_EQ(vitals.values_at(7 * kSecond).at(0).bins.at(0).last, 7);
  EXPECT_EQ(vitals.values_at(8 * kSecond - 1).at(0).bins.at(0).last, 7);
  EXPECT_EQ(vitals.values_at(39 * kSecond).at(0).bins.at(0).last_ns, 19 * kSecond) << "and how old it is";
  EXPECT_THAT(vitals.values_at(-1), IsEmpty());
}

TEST_F(CaseVitalsTest, AlarmsLastFromTheirStartToTheirEnd) {
  media::VitalText words;
  words.time_ns = 500'000'000;
  words.code = "MDC_ATTR_STATE";
  words.text = "Alert";
  CaseVitals& vitals = open(record({{alarm(100'000'000, "start"), words},
                                    {alarm(1'100'000'000, "continue"), alarm(1'500'000'000, "end")},
                                    {alarm(2'500'000'000, "")},
                                    {alarm(3'100'000'000, "start"), alarm(3'200'000'000, "continue")}}))
                           .vitals("vitals");
  const VitalsView view = vitals.view(0, 10 * kSecond, 10, kPatienceMs);
  EXPECT_THAT(view.alarms, ElementsAre(AlarmSpan{100'000'000, 1'500'000'000, "SpO2 low", "PH", true},
                                       AlarmSpan{2'500'000'000, 2'500'000'000, "SpO2 low", "PH", false},
                                       AlarmSpan{3'100'000'000, 3'200'000'000, "SpO2 low", "PH", false}));
  EXPECT_THAT(view.texts, ElementsAre(TimedText{500'000'000, "MDC_ATTR_STATE", "Alert"}));
  EXPECT_THAT(vitals.view(2 * kSecond, 3 * kSecond, 10, kPatienceMs).alarms, SizeIs(1));
}

TEST_F(CaseVitalsTest, SaysWhatMayBeAnEarlierPatientsAndWhatTheRecorderSays) {
  media::DeviceAlarm earlier = alarm(100'000'000, "start");
  earlier.quality = media::VitalQuality::kQuestionable;
  media::DeviceAlarm invalid = alarm(150'000'000, "start");
  invalid.text = "none";
  invalid.quality = media::VitalQuality::kInvalid;
  media::VitalText words;
  words.time_ns = 200'000'000;
  words.code = "RHYTHM";
  words.text = "VF";
  words.quality = media::VitalQuality::kQuestionable;
  media::VitalNotice notice;
  notice.time_ns = 200'000'000;
  notice.notice = "measured-before";
  notice.text = "they may be of an earlier patient";
  const auto recorded = record({{earlier, invalid, words, notice, alarm(400'000'000, "continue")}});
  for (int opened = 0; opened < 2; ++opened) {  // the second time from the cache
    const VitalsView view = open(recorded).vitals("vitals").view(0, kSecond, 2, kPatienceMs);
    EXPECT_THAT(view.alarms,
                ElementsAre(AlarmSpan{100'000'000, 100'000'000, "SpO2 low", "PH", false, true},
                            AlarmSpan{400'000'000, 400'000'000, "SpO2 low", "PH", false, false}));
    EXPECT_THAT(view.texts, ElementsAre(TimedText{200'000'000, "RHYTHM", "VF", true}));
    EXPECT_THAT(view.notices, ElementsAre(TimedNotice{200'000'000, "measured-before",
                                                      "they may be of an earlier patient"}));
    playback_.reset();
  }
}

TEST_F(CaseVitalsTest, WhatATamperedSegmentHeldIsLeftOutAndSaidSo) {
  const auto recorded =
      record({{heart_rate(0, 60)}, {heart_rate(kSecond, 61)}, {heart_rate(2 * kSecond, 62)}});
  const std::string file = "segments/vitals/00000001.jsonl.age";
  test::flip_byte(recorded / file, -1);
  CaseVitals& vitals = open(recorded).vitals("vitals");
  for (const std::size_t bins : {std::size_t{3}, std::size_t{1000}}) {
    const VitalsView view = vitals.view(0, 3 * kSecond, bins, kPatienceMs);
    ASSERT_THAT(view.unreadable, SizeIs(1));
    EXPECT_EQ(view.unreadable[0].span.start_ns, kSecond);
    EXPECT_THAT(view.unreadable[0].problem, HasSubstr(file + " is not what the ledger says"));
    for (const VitalBin& bin : view.series.at(0).bins) EXPECT_NE(bin.last, 61);
  }
}

TEST_F(CaseVitalsTest, TheCacheGivesTheSameAgain) {
  const auto recorded = record({{heart_rate(0, 60), alarm(5, "start")}, {heart_rate(kSecond, 61)}});
  const VitalsView built = open(recorded).vitals("vitals").view(0, 2 * kSecond, 2, kPatienceMs);
  playback_.reset();
  EXPECT_GT(cache_->bytes(), 0U);
  const VitalsView restored = open(recorded).vitals("vitals").view(0, 2 * kSecond, 2);
  EXPECT_EQ(restored.complete_to_ns, INT64_MAX) << "at once";
  EXPECT_EQ(restored.series.at(0).bins, built.series.at(0).bins);
  EXPECT_EQ(restored.alarms, built.alarms);
}

TEST_F(CaseVitalsTest, AnotherIdentityIsRefusedAlsoWhatIsInTheCache) {
  const auto recorded = record({{heart_rate(0, 60)}});
  (void)open(recorded).vitals("vitals").view(0, kSecond, 2, kPatienceMs);
  playback_.reset();
  CasePlayback stranger(archive::CaseReader::open(recorded), test::make_reader().identities, cache_);
  EXPECT_THROW((void)stranger.vitals("vitals"), Error);
}

TEST(CaseInSync, FlashOfTheVideoAndOfTheVitalSignsAreLessThanAPictureApart) {
  const test::RecorderBench bench;
  const test::Reader reader = test::make_reader();
  recorder::SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", "synthetic:endoscope?size=64x48&rate=25&flash=1")};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0&flash=1")};
  options.video[0].recipients = options.vitals[0].recipients = options.event_recipients = reader.recipients;
  options.duration = 2500ms;
  recorder::Session session(std::move(options));
  const auto folder = session.run().folder;
  CasePlayback playback(archive::CaseReader::open(folder), reader.identities,
                        std::make_shared<EncryptedCache>(bench / "cache", std::uint64_t{64} << 20));

  Bytes film = playback.init_segment("endoscope").bytes;
  for (std::uint64_t number = 0; number < 2; ++number) append(film, playback.piece("endoscope", number));
  std::vector<std::int64_t> flashes_ns;
  for (const test::DecodedFrame& frame : test::decode_video(film).frames) {
    if (frame.brightness > 200) flashes_ns.push_back(ns_of_ticks(frame.pts));
  }
  std::vector<std::int64_t> marks_ns;
  for (const VitalSeries& series :
       playback.vitals("vitals").view(0, 3 * kSecond, 20'000, kPatienceMs).series) {
    if (series.code != media::kFlashCode) continue;
    for (const VitalBin& bin : series.bins) marks_ns.push_back(bin.last_ns);
  }
  ASSERT_THAT(flashes_ns, SizeIs(3));
  ASSERT_EQ(marks_ns.size(), flashes_ns.size());
  constexpr std::int64_t kPictureNs = kSecond / 25;
  for (std::size_t i = 0; i < flashes_ns.size(); ++i) {
    EXPECT_LT(std::abs(flashes_ns[i] - marks_ns[i]), kPictureNs);
    // Stepping shows it at the same moment.
    const auto shown = playback.archived_picture("endoscope", flashes_ns[i], Step::kAt);
    ASSERT_TRUE(shown);
    EXPECT_EQ(shown->time_ns, flashes_ns[i]);
    EXPECT_GT(test::decode_video(shown->png).frames.at(0).brightness, 200);
  }
}

}  // namespace
}  // namespace kiroku::playback
