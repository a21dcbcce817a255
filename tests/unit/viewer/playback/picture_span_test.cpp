#include "viewer/playback/picture_span.h"

#include <csignal>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/child_processes.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/media_maker.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::playback {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

class PictureSpanTest : public testing::Test {
 protected:
  std::filesystem::path record(const test::RecordedStream& stream) {
    return test::record_case(folder_ / "archive", {stream}, reader_.recipients);
  }
  static test::RecordedStream film(std::vector<Bytes> segments, const std::string& media) {
    return {"room", "video", media, std::move(segments), {25, 25, 25}};
  }
  [[nodiscard]] std::vector<std::int64_t> times(const archive::CaseReader& recording,
                                                std::int64_t from_ns = INT64_MIN,
                                                std::int64_t to_ns = INT64_MAX) const {
    PictureSpan frames(recording, reader_.identities, "room", from_ns, to_ns);
    std::vector<std::int64_t> all;
    while (frames.next()) all.push_back(frames.time_ns());
    return all;
  }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
};

TEST_F(PictureSpanTest, GivesEveryPictureItsTimeOnTheCaseClock) {
  for (const bool transport_stream : {true, false}) {
    const auto folder =
        record(transport_stream ? film(test::make_transport_stream({.sound = true}), "video/mp2t")
                                : film(test::make_matroska({}, "ffv1"), "video/x-matroska"));
    const auto recording = archive::CaseReader::open(folder);
    const auto all = times(recording);
    ASSERT_EQ(all.size(), 75U);
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_NEAR(static_cast<double>(all[i]), static_cast<double>(i) * 0.04 * kSecondNs, 1e6) << i;
    EXPECT_EQ(times(recording, kSecondNs, kSecondNs + 1).size(), 25U);
    EXPECT_EQ(times(recording, 5 * kSecondNs, 6 * kSecondNs).size(), 0U);
  }
}

TEST_F(PictureSpanTest, PassesOverWhatWasErasedAndWhatWasCutOff) {
  // A segment that was cut off ends with the last chunk of 64 KiB that was sealed.
  test::RecordedStream stream =
      film(test::make_transport_stream({.width = 640, .height = 480}), "video/mp2t");
  stream.first_is_erased = true;
  stream.segments[2].resize(stream.segments[2].size() / 2);
  stream.last_is_cut = true;
  const auto all = times(archive::CaseReader::open(record(stream)));
  ASSERT_GT(all.size(), 27U);
  EXPECT_LT(all.size(), 50U);
  EXPECT_EQ(all.front(), kSecondNs);
}

TEST_F(PictureSpanTest, RefusesDamageAndWhatItCannotOpen) {
  const auto folder = record(film(test::make_transport_stream({}), "video/mp2t"));
  const auto recording = archive::CaseReader::open(folder);
  EXPECT_THROW(PictureSpan(recording, reader_.identities, "endoscope"), UsageError);
  const test::Reader other = test::make_reader();
  PictureSpan closed(recording, other.identities, "room");
  EXPECT_THROW(closed.next(), Error);
  test::flip_byte(folder / "segments/room/00000000.ts.age", 5000);
  EXPECT_THROW(times(recording), Error);
}

TEST_F(PictureSpanTest, WhatWasRecordedIsDecodedInABox) {
  const auto recording =
      archive::CaseReader::open(record(film(test::make_matroska({}, "ffv1"), "video/x-matroska")));
  PictureSpan frames(recording, reader_.identities, "room");
  ASSERT_TRUE(frames.next());
  std::vector<pid_t> boxes;
  for (const pid_t child : test::child_processes()) {
    if (test::line_of_process(child, "status", "Name:") != "kiroku-decoder") continue;
    boxes.push_back(child);
    EXPECT_EQ(test::line_of_process(child, "status", "Seccomp:"), "2");
  }
  ASSERT_EQ(boxes.size(), 1U) << "its pictures are decoded beside the identities";
  // A decoder that somebody killed is no end of the stream.
  ASSERT_EQ(::kill(boxes[0], SIGKILL), 0);
  EXPECT_THROW(while (frames.next()){}, IoError);
}

TEST_F(PictureSpanTest, GivesSamplesOfAPictureAndOfTheOneBefore) {
  const auto recording =
      archive::CaseReader::open(record(film(test::make_matroska({}, "ffv1"), "video/x-matroska")));
  PictureSpan frames(recording, reader_.identities, "room");
  ASSERT_TRUE(frames.next());
  const std::vector<std::uint8_t> first = frames.rgb();
  EXPECT_EQ(first.size(), 3U * static_cast<unsigned>(frames.width() * frames.height()));
  ASSERT_TRUE(frames.next());
  const std::vector<std::uint8_t> second = frames.rgb();
  EXPECT_NE(first, second);
  EXPECT_EQ(frames.rgb_of_one_before(frames.width(), frames.height()), first);
  EXPECT_EQ(frames.rgb(16, 8).size(), 3U * 16 * 8);
  std::vector<std::uint8_t> last = second;
  while (frames.next()) last = frames.rgb();
  EXPECT_EQ(frames.rgb_of_one_before(frames.width(), frames.height()), last) << "also at the end";
}

}  // namespace
}  // namespace kiroku::playback
