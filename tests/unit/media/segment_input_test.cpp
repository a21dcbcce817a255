#include "media/segment_input.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include "base/error.h"
#include "media/output_file.h"
#include "media/remuxer.h"
#include "tests/support/media_maker.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

std::vector<std::int64_t> packet_times(SegmentInput& input) {
  std::vector<std::int64_t> times;
  const Packet packet = make_packet();
  while (input.read(*packet)) {
    times.push_back(packet->pts);
    av_packet_unref(packet.get());
  }
  return times;
}

/// Gives a few bytes at a time, as decryption at a segment's end does.
SequentialReader in_small_steps(const Bytes& bytes) {
  return [rest = ByteView(bytes)](std::span<std::byte> into) mutable {
    const std::size_t count = std::min({rest.size(), into.size(), std::size_t{1000}});
    std::copy_n(rest.begin(), count, into.begin());
    rest = rest.subspan(count);
    return count;
  };
}

TEST(SegmentInput, ReadsPacketsOfBothContainers) {
  const Bytes ts = test::make_transport_stream({.segments = 1})[0];
  const Bytes mkv = test::make_matroska({.segments = 1}, "ffv1")[0];
  const auto ts_source = crypto::memory_source(ts), mkv_source = crypto::memory_source(mkv);
  SegmentInput ts_input(*ts_source, "video/mp2t", "ts"), mkv_input(*mkv_source, "video/x-matroska", "mkv");
  EXPECT_EQ(packet_times(ts_input).size(), 25U);
  EXPECT_EQ(packet_times(mkv_input).size(), 25U);
  EXPECT_EQ(mkv_input.video().codecpar->codec_id, AV_CODEC_ID_FFV1);
}

TEST(SegmentInput, ReadsTheSameWithAndWithoutSeeking) {
  for (const bool matroska : {false, true}) {
    const std::string media = matroska ? "video/x-matroska" : "video/mp2t";
    const Bytes bytes = matroska ? test::make_matroska({.segments = 1}, "rawvideo")[0]
                                 : test::make_transport_stream({.segments = 1})[0];
    const auto source = crypto::memory_source(bytes);
    SegmentInput seekable(*source, media, "film"), sequential(in_small_steps(bytes), media, "film");
    EXPECT_EQ(packet_times(seekable), packet_times(sequential)) << media;
  }
}

TEST(SegmentInput, SeeksByTime) {
  const Bytes mkv = test::make_matroska({.segments = 1}, "ffv1")[0];
  const auto source = crypto::memory_source(mkv);
  SegmentInput input(*source, "video/x-matroska", "film");
  const auto all = packet_times(input);
  ASSERT_GE(av_seek_frame(&input.context(), 0, 0, AVSEEK_FLAG_BACKWARD), 0);
  EXPECT_EQ(packet_times(input), all);
}

TEST(SegmentInput, PassesOnWhatTheSourceThrows) {
  const SequentialReader failing = [](std::span<std::byte>) -> std::size_t {
    throw IoError("read", "disk", EIO);
  };
  EXPECT_THROW(SegmentInput(failing, "video/mp2t", "film"), IoError);
  const Bytes ts = test::make_transport_stream({.frames_per_segment = 200, .segments = 1})[0];
  SequentialReader whole = in_small_steps(ts);
  SegmentInput input(
      [&, left = ts.size()](std::span<std::byte> into) mutable {
        const std::size_t count = whole(into);
        left -= count;
        if (left < 1000) {
          throw IoError("read", "disk", EIO);
        }
        return count;
      },
      "video/mp2t", "film");
  EXPECT_THROW(packet_times(input), IoError);
}

TEST(SegmentInput, OpensNoOtherFileThanItIsGiven) {
  // A playlist that names a file: a demuxer chosen by probing would open it.
  const Bytes playlist =
      to_bytes("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n/etc/passwd\n#EXT-X-ENDLIST\n");
  const auto source = crypto::memory_source(playlist);
  EXPECT_THROW(SegmentInput(*source, "video/x-matroska", "list"), MediaError);
  EXPECT_THROW(SegmentInput(*source, "application/vnd.apple.mpegurl", "list"), MediaError);
}

TEST(SegmentInput, HasNoPicturesInSoundAlone) {
  const Bytes nothing;
  const auto source = crypto::memory_source(nothing);
  EXPECT_THROW(
      {
        SegmentInput input(*source, "video/mp2t", "film");
        static_cast<void>(input.video());
      },
      MediaError);
}

// Whatever stands in a segment, copying it ends in a copy or a sentence.
TEST(SegmentInput, SurvivesDamagedMedia) {
  const test::TemporaryFolder folder;
  std::mt19937 random(1);
  for (const bool matroska : {false, true}) {
    const std::string media = matroska ? "video/x-matroska" : "video/mp2t";
    const Bytes whole = matroska ? test::make_matroska({.frames_per_segment = 5, .segments = 1}, "ffv1")[0]
                                 : test::make_transport_stream({.frames_per_segment = 5, .segments = 1})[0];
    int copied = 0;
    for (int round = 0; round < 150; ++round) {
      Bytes damaged = whole;
      for (auto i = 1 + random() % 20; i > 0; --i) {
        damaged[random() % damaged.size()] = static_cast<std::byte>(random());
      }
      damaged.resize(damaged.size() - random() % 500);
      const auto source = crypto::memory_source(damaged);
      OutputFile output(folder / "film.mkv", true);
      try {
        SegmentInput input(*source, media, "film");
        Remuxer remuxer(output, Container::kMatroska, "film.mkv", {});
        remuxer.copy(input, 0);
        remuxer.finish();
        ++copied;
      } catch (const Error& error) {
        EXPECT_STRNE(error.what(), "");
      }
    }
    EXPECT_GT(copied, 0) << media;
  }
}

}  // namespace
}  // namespace kiroku::media
