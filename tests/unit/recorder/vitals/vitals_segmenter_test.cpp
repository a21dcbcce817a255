#include "recorder/vitals/vitals_segmenter.h"

#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using std::chrono::nanoseconds;

/// What a sink was told, in words.
class Diary : public VitalsSegmentSink {
 public:
  void begin_segment(std::uint64_t index, std::int64_t start_ns) override {
    entries.push_back("begin " + std::to_string(index) + " at " + std::to_string(start_ns));
    start = start_ns;
    spans.emplace_back(start_ns, -1);
  }
  void write(ByteView lines) override {
    for (const char c : text_of(lines)) {
      lines_written += c == '\n' ? 1 : 0;
    }
    entries.emplace_back("line");
    written += text_of(lines);
  }
  void end_segment(std::int64_t end_ns, std::uint64_t samples) override {
    entries.push_back("end at " + std::to_string(end_ns) + " with " + std::to_string(samples));
    spans.back().second = end_ns;
    samples_told += samples;
  }

  std::vector<std::string> entries;
  std::string written;
  std::vector<std::pair<std::int64_t, std::int64_t>> spans;
  std::int64_t start = 0;
  std::uint64_t lines_written = 0, samples_told = 0;
};

media::VitalSample at(std::int64_t time_ns) {
  media::VitalSample sample;
  sample.time_ns = time_ns;
  sample.code = "MDC_ECG_HEART_RATE";
  sample.value = 72;
  return sample;
}

using Entries = std::vector<std::string>;

// Eight hours of a machine that sleeps are a gap and not 32,000 empty segments.
TEST(VitalsSegmenter, PassesOverATimeInWhichNothingWasRecorded) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.add(at(120));
  EXPECT_EQ(segmenter.pass_over(1'250), 121);
  segmenter.advance_to(1'270);
  EXPECT_EQ(segmenter.pass_over(2'000), 1'270);
  EXPECT_EQ(segmenter.pass_over(2'030), 2'000);
  segmenter.add(at(2'030));
  segmenter.finish(2'050);
  EXPECT_EQ(diary.entries, (Entries{"begin 0 at 0", "end at 100 with 0", "begin 1 at 100", "line",
                                    "end at 121 with 1", "begin 2 at 1250", "end at 1270 with 0",
                                    "begin 3 at 2030", "line", "end at 2050 with 1"}));
}

// What was recorded before somebody came is to be told from what came after.
TEST(VitalsSegmenter, SplitsWhereItIsAsked) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.add(at(120));
  segmenter.split(130, 125);
  EXPECT_EQ(segmenter.start_ns(), 100) << "something of before may come yet";
  segmenter.split(120, 120);
  segmenter.add(at(120));
  EXPECT_EQ(segmenter.start_ns(), 100) << "lines of one moment stay together";
  segmenter.split(120, 150);
  EXPECT_EQ(segmenter.start_ns(), 121);
  segmenter.split(120, 160);
  segmenter.add(at(160));
  segmenter.split(310, 350);
  segmenter.add(at(350));
  segmenter.finish(360);
  EXPECT_EQ(diary.entries, (Entries{"begin 0 at 0", "end at 100 with 0",                    //
                                    "begin 1 at 100", "line", "line", "end at 121 with 2",  //
                                    "begin 2 at 121", "line", "end at 200 with 1",          //
                                    "begin 3 at 200", "end at 300 with 0",                  //
                                    "begin 4 at 300", "end at 310 with 0",                  //
                                    "begin 5 at 310", "line", "end at 360 with 1"}));
}

TEST(VitalsSegmenter, CutsAtWholeMultiplesAndStatesEmptySegments) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.add(at(0));
  segmenter.add(at(99));
  segmenter.add(at(100));
  segmenter.add(at(350));
  segmenter.finish(360);
  EXPECT_EQ(diary.entries, (Entries{"begin 0 at 0", "line", "line", "end at 100 with 2",  //
                                    "begin 1 at 100", "line", "end at 200 with 1",        //
                                    "begin 2 at 200", "end at 300 with 0",                //
                                    "begin 3 at 300", "line", "end at 360 with 1"}));
  EXPECT_EQ(segmenter.samples(), 4U);
  EXPECT_EQ(segmenter.segments(), 4U);
}

TEST(VitalsSegmenter, EndsASegmentWhenItsTimeIsOverThoughNothingCame) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.advance_to(99);
  EXPECT_TRUE(diary.entries.empty());
  segmenter.advance_to(100);
  EXPECT_EQ(diary.entries, (Entries{"begin 0 at 0", "end at 100 with 0"}));
  segmenter.finish(100);
  EXPECT_EQ(diary.entries.size(), 2U) << "no segment of length zero";
}

TEST(VitalsSegmenter, BeginsWhereTheStreamBegan) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100), 150);
  segmenter.add(at(160));
  segmenter.finish(200);
  EXPECT_EQ(diary.entries, (Entries{"begin 0 at 150", "line", "end at 200 with 1"}));
}

TEST(VitalsSegmenter, SpansItsLastSampleEvenIfToldToEndBefore) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.add(at(50));
  segmenter.finish(10);
  EXPECT_EQ(diary.entries.back(), "end at 51 with 1");
}

TEST(VitalsSegmenter, EndsOnceWhenTheLastSampleFillsItsSegment) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.add(at(99));
  segmenter.finish(99);
  EXPECT_EQ(diary.entries, (Entries{"begin 0 at 0", "line", "end at 100 with 1"}));
}

TEST(VitalsSegmenter, RefusesTimeGoingBackAndSamplesAfterTheEnd) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100));
  segmenter.add(at(50));
  EXPECT_THROW(segmenter.add(at(49)), Error);
  segmenter.advance_to(60);
  EXPECT_THROW(segmenter.add(at(59)), Error);
  segmenter.finish(70);
  EXPECT_THROW(segmenter.add(at(80)), Error);
  EXPECT_THROW(segmenter.finish(80), Error);
  EXPECT_THROW(VitalsSegmenter(diary, nanoseconds(0)), UsageError);
}

TEST(VitalsSegmenter, JoinsSpansWithoutHoleWhateverComes) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 300; ++round) {
    Diary diary;
    const auto duration = static_cast<std::int64_t>(1 + random() % 50);
    const auto first = static_cast<std::int64_t>(random() % 120);
    VitalsSegmenter segmenter(diary, nanoseconds(duration), first);
    std::int64_t now = first;
    std::uint64_t samples = 0;
    for (int i = 0; i < 40; ++i) {
      now += static_cast<std::int64_t>(random() % 30);
      if (random() % 2 == 0) {
        segmenter.add(at(now));
        ++samples;
      } else {
        segmenter.advance_to(now);
      }
    }
    segmenter.finish(now + static_cast<std::int64_t>(random() % 3));
    std::int64_t expected_start = first;
    for (const auto& [start, end] : diary.spans) {
      ASSERT_EQ(start, expected_start);
      ASSERT_GT(end, start);
      ASSERT_LE(end - start, duration);
      expected_start = end;
    }
    ASSERT_GE(expected_start, now);
    ASSERT_EQ(diary.lines_written, samples);
    ASSERT_EQ(diary.samples_told, samples);
  }
}

TEST(VitalsSegmenter, ALineThatCannotBeWrittenIsStatedAndTheStreamGoesOn) {
  Diary diary;
  VitalsSegmenter segmenter(diary, nanoseconds(100), 0);
  segmenter.add(media::VitalNotice{10, "of-tests", "\xff is no UTF-8", ""});
  segmenter.add(media::VitalNotice{20, "of-tests", "text", ""});
  EXPECT_EQ(diary.lines_written, 2U);
  EXPECT_NE(diary.written.find(R"("notice":"line-left-out")"), std::string::npos);
  // What has no place in time is the recorder's own mistake.
  EXPECT_THROW(segmenter.add(media::VitalNotice{-1, "of-tests", "text", ""}), Error);
}

}  // namespace
}  // namespace kiroku::recorder
