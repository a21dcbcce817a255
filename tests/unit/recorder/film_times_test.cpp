// Films whose own times do not go on, or that say how they are shown: what of that stands in the ledger.
#include <array>
#include <cstring>
#include <fstream>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "media/libav_handles.h"
#include "recorder/session.h"
#include "recorder/source/ffmpeg_source.h"
#include "recorder/source/picture_turn.h"
#include "tests/support/decoded_video.h"
#include "tests/support/media_maker.h"
#include "tests/support/moved_clock.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

using archive::GapCause;
using test::RecordedCase;
using test::RecorderBench;
using testing::AllOf;
using testing::Each;
using testing::EndsWith;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr std::int64_t kPictureNs = kSecond / 25;

class FilmTimes : public testing::Test {
 protected:
  /// Two seconds of pictures with so long a hole between them, played `times` times, one after the other.
  void write_film(int hole_s, int times = 1) const {
    const std::vector<Bytes> segments =
        test::make_transport_stream({.segments = 2, .gap_frames = hole_s * 25});
    std::ofstream film(bench_ / "film.ts", std::ios::binary);
    for (int i = 0; i < times; ++i) {
      for (const Bytes& segment : segments)
        film.write(reinterpret_cast<const char*>(segment.data()),
                   static_cast<std::streamsize>(segment.size()));
    }
  }
  [[nodiscard]] RecordedCase record() const {
    SessionOptions options = bench_.options();
    options.video = {bench_.stream("endoscope", (bench_ / "film.ts").string() + "?speed=max")};
    return bench_.record(options);
  }
  static std::uint64_t dropped(const RecordedCase& recorded) {
    std::uint64_t all = 0;
    for (const archive::SegmentEntry& segment : recorded.segments("endoscope")) all += segment.dropped;
    return all;
  }

  const RecorderBench bench_;
};

TEST_F(FilmTimes, AHoleOfManySecondsIsAGapOfItsLength) {
  write_film(20);
  const RecordedCase recorded = record();
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kSignalLost);
  EXPECT_EQ(gaps[0].span.start_ns, kSecond);
  EXPECT_EQ(gaps[0].span.end_ns, 21 * kSecond);
  EXPECT_EQ(dropped(recorded), 0U) << "nobody knows of a picture that was lost";
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(FilmTimes, TimesThatGoBackAreAGapOfOnePicture) {
  write_film(0, 2);
  const RecordedCase recorded = record();
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kSignalLost);
  EXPECT_EQ(gaps[0].span.end_ns - gaps[0].span.start_ns, kPictureNs);
  EXPECT_NEAR(double(gaps[0].span.start_ns), 2e9, double(3 * kPictureNs));
  EXPECT_EQ(dropped(recorded), 1U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(FilmTimes, WhatIsTooFarAheadToBeFollowedIsAGapOfOnePicture) {
  write_film(25 * 3600);
  const RecordedCase recorded = record();
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].span.end_ns - gaps[0].span.start_ns, kPictureNs);
  EXPECT_EQ(dropped(recorded), 1U);
}

// At its own pace such a hole would have to be waited for.
TEST_F(FilmTimes, AtItsOwnPaceAHoleIsNotWaitedForAndStated) {
  write_film(20);
  test::MovedClock time;
  const CaseClock clock(time);
  time.move(std::chrono::hours(1));
  const auto source = open_ffmpeg_source(parse_source_address((bench_ / "film.ts").string()), clock, {});
  std::vector<TimedFrame> breaks;
  std::int64_t last_ns = 0;
  while (auto frame = source->read()) {
    last_ns = frame->time_ns;
    if (frame->time_break != TimeBreak::kNone) breaks.push_back(std::move(*frame));
  }
  ASSERT_THAT(breaks, SizeIs(1));
  EXPECT_EQ(breaks[0].time_break, TimeBreak::kAhead);
  EXPECT_EQ(breaks[0].lost_before, 1U);
  EXPECT_TRUE(breaks[0].lost_on_the_way);
  EXPECT_LT(last_ns, 3 * kSecond);
}

TEST_F(FilmTimes, AFilmThatGoesOnHasNoGap) {
  write_film(0);
  EXPECT_THAT(record().gaps("endoscope"), IsEmpty());
}

/// A picture of 4:2:0 whose samples say where they are.
media::Frame numbered(int width, int height) {
  media::Frame frame = media::make_frame();
  frame->format = AV_PIX_FMT_YUV420P;
  frame->width = width;
  frame->height = height;
  frame->sample_aspect_ratio = {4, 3};
  media::require(av_frame_get_buffer(frame.get(), 0), "make a picture");
  for (int plane = 0; plane < 3; ++plane) {
    const int side = plane == 0 ? 1 : 2;
    for (int y = 0; y < height / side; ++y) {
      for (int x = 0; x < width / side; ++x)
        frame->data[plane][y * frame->linesize[plane] + x] =
            static_cast<std::uint8_t>(100 * plane + 16 * y + x);
    }
  }
  return frame;
}

int sample(const AVFrame& frame, int plane, int x, int y) {
  return frame.data[plane][y * frame.linesize[plane] + x];
}

// libavutil's own words for a display matrix are what they are compared with.
TEST(PictureTurn, IsReadAsLibavutilWritesIt) {
  std::array<std::int32_t, 9> matrix{};
  const auto rotated = [&](double clockwise) {
    av_display_rotation_set(matrix.data(), clockwise);
    return turn_of(matrix.data());
  };
  EXPECT_EQ(rotated(0), Turn::kNone);
  EXPECT_EQ(rotated(90), Turn::kClockwise);
  EXPECT_EQ(rotated(-90), Turn::kAnticlockwise);
  EXPECT_EQ(rotated(180), Turn::kHalf);
  EXPECT_EQ(rotated(30), Turn::kOther);
  (void)rotated(0);
  av_display_matrix_flip(matrix.data(), 1, 0);
  EXPECT_EQ(turn_of(matrix.data()), Turn::kMirrored);
  (void)rotated(0);
  av_display_matrix_flip(matrix.data(), 0, 1);
  EXPECT_EQ(turn_of(matrix.data()), Turn::kUpsideDown);
  matrix = {0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30};
  EXPECT_EQ(turn_of(matrix.data()), Turn::kClockwise);
  matrix = {0, 1 << 16, 0, 1 << 16, 0, 0, 0, 0, 1 << 30};
  EXPECT_EQ(turn_of(matrix.data()), Turn::kTransposed);
  matrix = {0, -(1 << 16), 0, -(1 << 16), 0, 0, 0, 0, 1 << 30};
  EXPECT_EQ(turn_of(matrix.data()), Turn::kTransversed);
  matrix = {};
  EXPECT_EQ(turn_of(matrix.data()), Turn::kOther);
}

// As libavcodec gives pictures of H.264 whose display orientation stands before the first one of each group.
TEST(PictureTurn, ThatAPictureSaysHoldsUntilTheNextOneThatBeginsAnew) {
  const auto picture = [](bool begins, bool says) {
    media::Frame frame = media::make_frame();
#ifdef AV_FRAME_FLAG_KEY
    frame->flags = begins ? frame->flags | AV_FRAME_FLAG_KEY : frame->flags & ~AV_FRAME_FLAG_KEY;
#else
    frame->key_frame = begins ? 1 : 0;
#endif
    if (says) {
      AVFrameSideData* const said =
          av_frame_new_side_data(frame.get(), AV_FRAME_DATA_DISPLAYMATRIX, 9 * sizeof(std::int32_t));
      auto* const matrix = reinterpret_cast<std::int32_t*>(said->data);
      av_display_rotation_set(matrix, 0);
      av_display_matrix_flip(matrix, 1, 0);
    }
    return frame;
  };
  std::optional<Turn> before;
  const auto next = [&](bool begins, bool says) {
    before = turn_of(*picture(begins, says), Turn::kNone, before);
    return *before;
  };
  EXPECT_EQ(next(true, true), Turn::kMirrored);
  EXPECT_EQ(next(false, false), Turn::kMirrored);
  EXPECT_EQ(next(false, false), Turn::kMirrored);
  EXPECT_EQ(next(true, true), Turn::kMirrored);
  EXPECT_EQ(next(true, false), Turn::kNone) << "it says nothing any more";
  EXPECT_EQ(next(false, false), Turn::kNone);
  EXPECT_EQ(next(false, true), Turn::kMirrored);
  EXPECT_EQ(turn_of(*picture(false, false), Turn::kHalf), Turn::kHalf) << "of the container";
}

TEST(PictureTurn, MovesEverySampleToItsPlaceAndChangesNone) {
  const media::Frame frame = numbered(8, 4);
  const auto at = [](int plane, int x, int y) { return 100 * plane + 16 * y + x; };
  const auto expect = [&](Turn turn, const auto& from) {
    ASSERT_TRUE(can_turn(*frame, turn));
    const media::Frame made = turned(*frame, turn);
    for (int plane = 0; plane < 3; ++plane) {
      const int side = plane == 0 ? 1 : 2, width = made->width / side, height = made->height / side;
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const auto [column, row] = from(x, y, width, height);
          ASSERT_EQ(sample(*made, plane, x, y), at(plane, column, row))
              << int(turn) << " " << plane << " " << x << " " << y;
        }
      }
    }
  };
  using Place = std::pair<int, int>;
  expect(Turn::kMirrored, [](int x, int y, int width, int) { return Place{width - 1 - x, y}; });
  expect(Turn::kUpsideDown, [](int x, int y, int, int height) { return Place{x, height - 1 - y}; });
  expect(Turn::kHalf, [](int x, int y, int width, int height) {
    return Place{width - 1 - x, height - 1 - y};
  });
  // What was on the left is above, after a turn clockwise: the column from the right is the row.
  expect(Turn::kClockwise, [](int x, int y, int width, int) { return Place{y, width - 1 - x}; });
  expect(Turn::kAnticlockwise, [](int x, int y, int, int height) { return Place{height - 1 - y, x}; });
  expect(Turn::kTransposed, [](int x, int y, int, int) { return Place{y, x}; });
  expect(Turn::kTransversed, [](int x, int y, int width, int height) {
    return Place{height - 1 - y, width - 1 - x};
  });
  const media::Frame made = turned(*frame, Turn::kClockwise);
  EXPECT_EQ(made->width, 4);
  EXPECT_EQ(made->height, 8);
  EXPECT_EQ(made->sample_aspect_ratio.num, 3);
  EXPECT_EQ(made->sample_aspect_ratio.den, 4);
}

TEST(PictureTurn, WhatWouldLoseSomethingIsNotTurned) {
  media::Frame frame = numbered(8, 4);
  EXPECT_FALSE(can_turn(*frame, Turn::kOther));
  EXPECT_FALSE(can_turn(*frame, Turn::kNone));
  frame->format = AV_PIX_FMT_YUV422P;
  EXPECT_FALSE(can_turn(*frame, Turn::kClockwise)) << "chroma of two columns would become that of two rows";
  EXPECT_TRUE(can_turn(*frame, Turn::kHalf));
  frame->format = AV_PIX_FMT_YUYV422;
  EXPECT_FALSE(can_turn(*frame, Turn::kMirrored));
  frame->format = AV_PIX_FMT_PAL8;
  EXPECT_FALSE(can_turn(*frame, Turn::kMirrored));
  frame->format = AV_PIX_FMT_YUV420P;
  frame->width = 7;
  EXPECT_FALSE(can_turn(*frame, Turn::kMirrored));
}

TEST(PictureTurn, IsSaidInTheLedgersWords) {
  EXPECT_EQ(ledger_text({}), "");
  EXPECT_EQ(ledger_text({Turn::kMirrored, true, FieldOrder::kProgressive}),
            "; its pictures are mirrored left to right, as it says that they are shown");
  EXPECT_EQ(
      ledger_text({Turn::kOther, false, FieldOrder::kUpperFirst}),
      "; its pictures are recorded as they are coded, and it says that they are shown turned by another "
      "angle, or distorted; interlaced, upper field first");
}

class FilmWithMatrix : public testing::Test {
 protected:
  struct Recorded {
    std::string source;
    std::vector<std::string> events;
    std::vector<test::DecodedFrame> frames;
  };
  [[nodiscard]] Recorded record(const std::array<std::int32_t, 9>& matrix,
                                const std::vector<int>& orientations = {}) const {
    test::write_film_with_matrix(bench_ / "film.mov", matrix, orientations);
    SessionOptions options = bench_.options();
    options.video = {
        bench_.stream("endoscope", (bench_ / "film.mov").string() + "?speed=max", Profile::kLossless)};
    const RecordedCase recorded = bench_.record(options);
    Recorded found;
    if (!recorded.all<archive::MarkEntry>().empty()) found.events = recorded.lines("events");
    found.source = recorded.all<archive::OpenEntry>().front().streams.front().source;
    for (const archive::SegmentEntry& segment : recorded.segments("endoscope")) {
      for (test::DecodedFrame& frame : test::decode_video(recorded.plaintext(segment)).frames)
        found.frames.push_back(std::move(frame));
    }
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    return found;
  }

  const RecorderBench bench_;
  static constexpr std::int32_t kOne = 1 << 16;
};

TEST_F(FilmWithMatrix, IsRecordedAsItIsShownAndTheLedgerSaysSo) {
  const Recorded plain = record({kOne, 0, 0, 0, kOne, 0, 0, 0, 1 << 30});
  ASSERT_THAT(plain.frames, SizeIs(10));
  EXPECT_THAT(plain.source, Not(HasSubstr("; ")));
  const Recorded mirrored = record({-kOne, 0, 0, 0, kOne, 0, 64 << 16, 0, 1 << 30});
  ASSERT_THAT(mirrored.frames, SizeIs(10));
  EXPECT_THAT(mirrored.source, EndsWith("; its pictures are mirrored left to right, as it says that they are "
                                        "shown"));
  EXPECT_NE(mirrored.frames.front().sha256, plain.frames.front().sha256);
  EXPECT_NEAR(mirrored.frames.front().brightness, plain.frames.front().brightness, 1e-9);
  const Recorded turned = record({0, kOne, 0, -kOne, 0, 0, 32 << 16, 0, 1 << 30});
  ASSERT_THAT(turned.frames, SizeIs(10));
  EXPECT_THAT(turned.source, HasSubstr("; its pictures are turned by 90 degrees clockwise"));
  EXPECT_THAT(turned.frames,
              Each(AllOf(Field(&test::DecodedFrame::width, 32), Field(&test::DecodedFrame::height, 64))));
}

TEST_F(FilmWithMatrix, ThatIsNoPermutationIsRecordedAsCodedAndTheLedgerSaysSo) {
  const Recorded sheared = record({kOne, kOne / 2, 0, 0, kOne, 0, 0, 0, 1 << 30});
  ASSERT_THAT(sheared.frames, SizeIs(10));
  EXPECT_EQ(sheared.frames.front().width, 64);
  EXPECT_THAT(sheared.source, HasSubstr("; its pictures are recorded as they are coded"));
}

// The first picture says nothing for those that follow.
TEST_F(FilmWithMatrix, ThatChangesInItsCourseIsStatedInTheCase) {
  constexpr int kUpsideDown = 4;
  const std::array<std::int32_t, 9> none{kOne, 0, 0, 0, kOne, 0, 0, 0, 1 << 30};
  const Recorded plain = record(none);
  EXPECT_THAT(plain.events, IsEmpty());
  const Recorded changed = record(none, {0, 0, 0, 0, kUpsideDown, kUpsideDown, 0, 0, 0, 0});
  ASSERT_THAT(changed.frames, SizeIs(10));
  if (changed.frames[4].sha256 == changed.frames[3].sha256)
    GTEST_SKIP() << "this libavcodec does not read how a JPEG picture is turned";
  EXPECT_THAT(changed.source, Not(HasSubstr("; ")));
  ASSERT_THAT(changed.events, SizeIs(2));
  EXPECT_THAT(changed.events[0],
              HasSubstr(R"(\"kind\":\"picture-turn\",\"stream\":\"endoscope\",\"text\":)"));
  EXPECT_THAT(changed.events[0],
              HasSubstr("from 0.160 s of the case's clock on: its pictures are mirrored upside "
                        "down, as it says that they are shown"));
  EXPECT_THAT(changed.events[1],
              HasSubstr("from 0.240 s of the case's clock on: its pictures are recorded as they"));
}

}  // namespace
}  // namespace kiroku::recorder
