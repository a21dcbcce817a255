#include "viewer/playback/case_playback.h"

#include <fstream>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/decoded_video.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/forger.h"
#include "tests/support/recording.h"
#include "tests/unit/viewer/playback/rewritten_case.h"
#include "viewer/playback/case_ticks.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::playback {
namespace {

using namespace std::chrono_literals;
using recorder::Profile;
using test::decode_video;
using test::DecodedFrame;
using test::Fate;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

/// How far libavformat's muxer sets time stamps of MPEG-TS behind the packets'.
constexpr Ticks kTransportDelay = 45'000;

class CasePlaybackTest : public testing::Test {
 protected:
  struct Recorded {
    std::filesystem::path folder;
    test::RecordedCase contents;
  };
  /// `duration` of one stream "room", as fast as it goes.
  Recorded record(const std::string& source, Profile profile = Profile::kMpeg2,
                  std::chrono::nanoseconds duration = 5s, std::chrono::nanoseconds segment = 700ms) {
    recorder::SessionOptions options = bench_.options();
    options.segment_duration = segment;
    options.stamp_interval = 1h;
    auto stream = bench_.stream("room", source, profile);
    stream.recipients = reader_.recipients;
    options.event_recipients = reader_.recipients;
    options.video = {stream};
    options.duration = duration;
    recorder::Session session(std::move(options));
    const auto folder = session.run().folder;
    return {folder, {folder, reader_.identities}};
  }
  Recorded rewrite(const Recorded& recorded,
                   const std::function<Fate(const archive::SegmentEntry&)>& fate_of) {
    const auto folder =
        test::rewrite_case(bench_ / "rewritten", recorded.contents, reader_.recipients, fate_of);
    return {folder, {folder, reader_.identities}};
  }
  std::unique_ptr<CasePlayback> open(const Recorded& recorded) {
    return std::make_unique<CasePlayback>(archive::CaseReader::open(recorded.folder), reader_.identities,
                                          cache_);
  }

  /// Times of the archived pictures, in ticks: from what a decoder makes of each segment's plaintext.
  static std::vector<Ticks> archived_times(const Recorded& recorded) {
    std::vector<Ticks> times;
    const bool transport_stream =
        std::get<archive::OpenEntry>(recorded.contents.entries().front().body).streams.at(0).media ==
        "video/mp2t";
    for (const auto& segment : recorded.contents.segments("room")) {
      for (const DecodedFrame& frame : decode_video(recorded.contents.plaintext(segment)).frames) {
        times.push_back(transport_stream ? frame.pts - kTransportDelay : frame.pts * 90);
      }
    }
    return times;
  }
  /// Initialisation segment and pieces [0, count), one after the other.
  static Bytes film(CasePlayback& playback, std::uint64_t count = 8) {
    Bytes bytes = playback.init_segment("room").bytes;
    for (std::uint64_t number = 0; number < count; ++number) append(bytes, playback.piece("room", number));
    return bytes;
  }
  static std::vector<Ticks> times_of(const test::DecodedVideo& video) {
    std::vector<Ticks> times;
    for (const DecodedFrame& frame : video.frames) times.push_back(frame.pts);
    return times;
  }
  std::vector<std::filesystem::path> cached_files() {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(bench_ / "cache"))
      files.push_back(entry.path());
    return files;
  }

  test::RecorderBench bench_;
  test::Reader reader_ = test::make_reader();
  std::shared_ptr<EncryptedCache> cache_ =
      std::make_shared<EncryptedCache>(bench_ / "cache", std::uint64_t{64} << 20);
};

TEST(CaseTicks, AreWhatNanosecondsRoundTo) {
  for (const Ticks ticks :
       {Ticks{0}, Ticks{1}, Ticks{89'999}, Ticks{-7}, Ticks{3'240'000'001}, Ticks{1} << 40}) {
    EXPECT_EQ(ticks_of_ns(ns_of_ticks(ticks)), ticks);
  }
  EXPECT_EQ(ns_of_ticks(kPieceTicks), kPieceNs);
  EXPECT_EQ(ticks_of_ns(5'555), 0);
  EXPECT_EQ(ticks_of_ns(5'556), 1);
}

TEST_F(CasePlaybackTest, CopiesHaveTheArchivedPicturesAtTheirTimes) {
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless, Profile::kUncompressed}) {
    const Recorded recorded = record("synthetic:room?size=96x64&rate=24&speed=max", profile);
    const auto playback = open(recorded);
    const test::DecodedVideo video = decode_video(film(*playback));
    EXPECT_THAT(video.complaints, IsEmpty());
    EXPECT_THAT(video.frames, SizeIs(120));
    EXPECT_EQ(times_of(video), archived_times(recorded));
  }
}

// From MPEG-2 in MPEG-TS to FFV1 in Matroska and back: two containers, two kinds of time stamps.
TEST_F(CasePlaybackTest, CopiesGoOnOverAChangeOfTheProfile) {
  recorder::SessionOptions options = bench_.options();
  options.video = {bench_.stream("room", "synthetic:room?size=96x64&rate=24")};
  options.video.front().recipients = reader_.recipients;
  options.event_recipients = reader_.recipients;
  recorder::Session session(options);
  int changes = 0;
  std::uint64_t frames = 0;
  const recorder::SessionResult result = session.run([&](const recorder::SessionStatus& status) {
    const auto& stream = status.streams.at(0);
    if (stream.frames < frames + 20 || !stream.profile_to_come.empty()) return;
    frames = stream.frames;
    if (changes == 3) return session.stop();
    const Profile next[]{Profile::kLossless, Profile::kMpeg2, Profile::kUncompressed};
    session.change_profile({{}, next[changes++], "operator", ""});
  });
  const Recorded recorded{result.folder, {result.folder, reader_.identities}};
  std::vector<Ticks> times;
  for (const auto& segment : recorded.contents.segments("room")) {
    for (const DecodedFrame& frame : decode_video(recorded.contents.plaintext(segment)).frames) {
      const bool transport_stream = segment.file.file.ends_with(".ts.age");
      times.push_back(transport_stream ? frame.pts - kTransportDelay : frame.pts * 90);
    }
  }
  EXPECT_EQ(times.size(), result.last.streams.at(0).frames);
  const auto playback = open(recorded);
  const test::DecodedVideo video = decode_video(film(*playback));
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_EQ(times_of(video), times);
}

TEST_F(CasePlaybackTest, APieceBeginsWithAKeyFrameAndDecodesAlone) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=24&speed=max");
  const auto playback = open(recorded);
  for (std::uint64_t number = 0; number < 3; ++number) {
    Bytes alone = playback->init_segment("room").bytes;
    append(alone, playback->piece("room", number));
    const test::DecodedVideo video = decode_video(alone);
    EXPECT_THAT(video.complaints, IsEmpty());
    ASSERT_THAT(video.frames, SizeIs(number == 2 ? 24 : 48));
    for (std::size_t i = 0; i < video.frames.size(); ++i) {
      EXPECT_EQ(video.frames[i].key, i % 24 == 0) << "a group of one second each";
      EXPECT_GE(video.frames[i].pts, static_cast<Ticks>(number) * kPieceTicks);
      EXPECT_LT(video.frames[i].pts, static_cast<Ticks>(number + 1) * kPieceTicks);
    }
  }
}

TEST_F(CasePlaybackTest, ThePieceOfAnyMomentIsTheSameWhateverWasAskedBefore) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max");
  const Bytes sought = open(recorded)->piece("room", 2);
  cache_ = std::make_shared<EncryptedCache>(bench_ / "other", std::uint64_t{64} << 20);
  const auto playback = open(recorded);
  (void)film(*playback, 2);
  EXPECT_EQ(playback->piece("room", 2), sought);
}

TEST_F(CasePlaybackTest, NamesItsCodecAsBrowsersAskForIt) {
  const InitSegment init =
      open(record("synthetic:pattern?size=1280x720&rate=25&speed=max", Profile::kMpeg2, 1s))
          ->init_segment("room");
  EXPECT_THAT(init.codecs, testing::MatchesRegex("avc1\\.6400[0-9a-f]{2}"));
}

TEST_F(CasePlaybackTest, AGapIsEmpty) {
  const Recorded whole = record("synthetic:room?size=96x64&rate=25&speed=max", Profile::kMpeg2, 12s, 1s);
  const Recorded recorded = rewrite(whole, [](const archive::SegmentEntry& segment) {
    return segment.span.start_ns >= 3'000'000'000 && segment.span.start_ns < 9'000'000'000 ? Fate::kLeftOut
                                                                                           : Fate::kKept;
  });
  const auto playback = open(recorded);
  EXPECT_THAT(playback->piece("room", 1), Not(IsEmpty()));
  EXPECT_THAT(playback->piece("room", 2), IsEmpty());
  EXPECT_THAT(playback->piece("room", 3), IsEmpty());
  EXPECT_THAT(playback->piece("room", 6), IsEmpty()) << "after the end";
  EXPECT_THAT(playback->piece("room", UINT64_MAX), IsEmpty());
  const test::DecodedVideo video = decode_video(film(*playback));
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_THAT(video.frames, SizeIs(150));
  EXPECT_EQ(times_of(video), archived_times(recorded));
}

TEST_F(CasePlaybackTest, WhatRetentionRemovedIsEmptyToo) {
  const Recorded recorded = rewrite(
      record("synthetic:room?size=96x64&rate=25&speed=max", Profile::kMpeg2, 6s, 2s),
      [](const archive::SegmentEntry& segment) { return segment.index == 0 ? Fate::kErased : Fate::kKept; });
  const auto playback = open(recorded);
  EXPECT_THAT(playback->piece("room", 0), IsEmpty());
  EXPECT_THAT(decode_video(film(*playback)).frames, SizeIs(100));
}

TEST_F(CasePlaybackTest, ACrashLeavesWhatWasWholeAtItsExactTimes) {
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    const Recorded whole = record("synthetic:endoscope?size=640x480&rate=25&speed=max", profile, 4s, 1s);
    const std::vector<Ticks> all = archived_times(whole);
    const Recorded recorded = rewrite(whole, [](const archive::SegmentEntry& segment) {
      return segment.index == 3 ? Fate::kFoundCut : Fate::kKept;
    });
    const auto playback = open(recorded);
    const std::vector<Ticks> times = times_of(decode_video(film(*playback)));
    EXPECT_GT(times.size(), 80U);
    ASSERT_LT(times.size(), 100U);
    EXPECT_EQ(times,
              std::vector<Ticks>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(times.size())));
    // Between where recovery says that the segment begins and its first picture, the one before is shown.
    const auto shown = playback->archived_picture("room", ns_of_ticks(all[75]) - 20'000'000, Step::kAt);
    ASSERT_TRUE(shown);
    EXPECT_EQ(shown->time_ns, ns_of_ticks(all[74]));
    // Who reads once sees the same.
    PictureSpan span(archive::CaseReader::open(recorded.folder), reader_.identities, "room", 2'500'000'000);
    std::vector<std::int64_t> spanned;
    while (span.next()) spanned.push_back(span.time_ns());
    std::vector<std::int64_t> expected;
    for (const Ticks time : times) expected.push_back(ns_of_ticks(time));
    ASSERT_LT(spanned.size(), expected.size());
    EXPECT_EQ(spanned, std::vector<std::int64_t>(expected.end() - static_cast<std::ptrdiff_t>(spanned.size()),
                                                 expected.end()));
    std::filesystem::remove_all(bench_ / "rewritten");
  }
}

TEST_F(CasePlaybackTest, PicturesThatChangeTheirSizeStandInOneForm) {
  const Recorded recorded = record("synthetic:pattern?size=160x120&rate=25&speed=max&change=2");
  const auto playback = open(recorded);
  const test::DecodedVideo video = decode_video(film(*playback));
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_EQ(times_of(video), archived_times(recorded));
  for (const DecodedFrame& frame : video.frames) EXPECT_EQ(frame.width, 160);
}

TEST_F(CasePlaybackTest, UnusualRatesAndPixelFormatsAreShown) {
  const Recorded recorded =
      record("synthetic:pattern?size=96x64&rate=7&speed=max&pixel_format=gray", Profile::kLossless);
  const test::DecodedVideo video = decode_video(film(*open(recorded)));
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_THAT(video.frames, SizeIs(35));
  EXPECT_EQ(times_of(video), archived_times(recorded));
}

TEST_F(CasePlaybackTest, ATamperedSegmentIsRefusedInASentence) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max", Profile::kMpeg2, 6s, 2s);
  const std::string file = recorded.contents.segments("room").at(1).file.file;
  test::flip_byte(recorded.folder / file, 1000);
  const auto playback = open(recorded);
  EXPECT_THAT(playback->piece("room", 0), Not(IsEmpty()));
  for (int again = 0; again < 2; ++again) {
    EXPECT_THAT([&] { (void)playback->piece("room", 1); },
                testing::ThrowsMessage<Error>(HasSubstr(file + " is not what the ledger says")));
  }
  EXPECT_THROW((void)playback->thumbnail("room", 1), Error);
  EXPECT_THROW((void)playback->archived_picture("room", 3'000'000'000, Step::kAt), Error);
  EXPECT_THAT(playback->piece("room", 2), Not(IsEmpty()));
}

TEST_F(CasePlaybackTest, ASegmentTouchedAfterItWasCheckedIsFoundOut) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max", Profile::kMpeg2, 2s, 2s);
  const CaseMedia media(archive::CaseReader::open(recorded.folder), reader_.identities);
  const archive::SegmentEntry segment = recorded.contents.segments("room").at(0);
  EXPECT_NO_THROW((void)media.open(segment));
  EXPECT_NO_THROW((void)media.open(segment));
  const std::filesystem::path file = recorded.folder / segment.file.file;
  const auto written = std::filesystem::last_write_time(file);
  test::flip_byte(file, -3);
  std::filesystem::last_write_time(file, written);
  EXPECT_THAT([&] { (void)media.open(segment); },
              testing::ThrowsMessage<Error>(HasSubstr(segment.file.file + " of " + recorded.folder.string() +
                                                      " changed after it was hashed")));
}

// Under the same key, which a reader of the case knows: decryption alone tells nothing. No time of change
// helps either, for the file is exchanged after it was looked at.
TEST_F(CasePlaybackTest, ASegmentExchangedAfterItWasCheckedIsNotShown) {
  const Recorded recorded =
      record("synthetic:pattern?size=640x480&rate=25&speed=max", Profile::kLossless, 2s, 2s);
  const archive::SegmentEntry segment = recorded.contents.segments("room").at(0);
  const std::filesystem::path file = recorded.folder / segment.file.file;
  const std::string honest = test::bytes_in(file);
  ASSERT_GT(honest.size(), crypto::HashTrail::kBlockBytes + crypto::kSealedAgeChunkSize);
  const Bytes film = recorded.contents.plaintext(segment);
  const std::string forged = test::resealed(honest, reader_.identities, Bytes(film.size()));
  bool forging = false;
  const CaseMedia media(archive::CaseReader::open(recorded.folder), test::observed(reader_.identities, [&] {
                          if (forging) test::write_into(file, forged);
                        }));
  Bytes shown(film.size());
  {
    const media::SealedSegment opened = media.open(segment);
    EXPECT_EQ(opened.read_at(0, std::span(shown).first(1000)), 1000U);
    test::write_into(file, forged);  // while the film is open
    EXPECT_THROW(opened.read_at(0, shown), crypto::SourceChanged);
  }
  test::write_into(file, honest);
  EXPECT_EQ(media.open(segment).read_at(0, shown), film.size());
  EXPECT_EQ(shown, film);
  forging = true;  // while the film is opened, whose hash is remembered
  EXPECT_THROW((void)media.open(segment), crypto::SourceChanged);
}

TEST_F(CasePlaybackTest, AnotherIdentityIsRefusedAlsoWhatIsInTheCache) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max");
  (void)film(*open(recorded));
  CasePlayback stranger(archive::CaseReader::open(recorded.folder), test::make_reader().identities, cache_);
  EXPECT_THROW((void)stranger.piece("room", 0), Error);
  EXPECT_THROW((void)stranger.thumbnail("room", 0), Error);
}

TEST_F(CasePlaybackTest, RefusesStreamsThatAreNoVideo) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max", Profile::kMpeg2, 1s);
  const auto playback = open(recorded);
  EXPECT_THROW((void)playback->piece("nowhere", 0), UsageError);
  EXPECT_THROW((void)playback->piece("events", 0), UsageError);
}

TEST_F(CasePlaybackTest, WhatIsInTheCacheIsUnreadableAndAMissWhereDamaged) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max");
  auto playback = open(recorded);
  const Bytes piece = playback->piece("room", 0);
  playback.reset();
  ASSERT_THAT(cached_files(), Not(IsEmpty()));
  for (const auto& file : cached_files()) {
    std::ifstream input(file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(input), {}};
    EXPECT_THAT(bytes, Not(HasSubstr("moof")));
    test::flip_byte(file, 100);
  }
  EXPECT_EQ(open(recorded)->piece("room", 0), piece);
}

TEST_F(CasePlaybackTest, ManyAtOnceGetTheSame) {
  const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max");
  const auto playback = open(recorded);
  std::vector<Bytes> pieces(8);
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      threads.emplace_back([&, i] { pieces[i] = playback->piece("room", i % 2); });
    }
  }
  for (std::size_t i = 2; i < pieces.size(); ++i) EXPECT_EQ(pieces[i], pieces[i % 2]);
  EXPECT_NE(pieces[0], pieces[1]);
}

TEST_F(CasePlaybackTest, ThumbnailsAreSmallPicturesOfTheirPiece) {
  const Recorded recorded = record("synthetic:room?size=320x180&rate=25&speed=max");
  const auto playback = open(recorded);
  for (std::uint64_t number = 0; number < 3; ++number) {
    const test::DecodedVideo video = decode_video(playback->thumbnail("room", number));
    ASSERT_THAT(video.frames, SizeIs(1));
    EXPECT_EQ(video.frames[0].width, 160);
    EXPECT_EQ(video.frames[0].height, 90);
  }
  EXPECT_THAT(playback->thumbnail("room", 3), IsEmpty());
}

TEST_F(CasePlaybackTest, ArchivedPicturesAreSteppedThroughOneByOne) {
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    const Recorded recorded = record("synthetic:room?size=96x64&rate=25&speed=max", profile);
    const std::vector<Ticks> times = archived_times(recorded);
    const auto playback = open(recorded);
    auto at = playback->archived_picture("room", 0, Step::kAt);
    ASSERT_TRUE(at);
    EXPECT_FALSE(playback->archived_picture("room", at->time_ns, Step::kBefore));
    std::set<Bytes> pictures;
    for (const Ticks time : times) {
      ASSERT_TRUE(at);
      EXPECT_EQ(at->time_ns, ns_of_ticks(time));
      pictures.insert(at->png);
      at = playback->archived_picture("room", at->time_ns, Step::kAfter);
    }
    EXPECT_FALSE(at);
    EXPECT_GT(pictures.size(), times.size() / 2) << "the room's clock moves";
    std::int64_t time_ns = ns_of_ticks(times.back());
    for (std::size_t i = times.size() - 1; i-- > 0;) {
      const auto before = playback->archived_picture("room", time_ns, Step::kBefore);
      ASSERT_TRUE(before);
      EXPECT_EQ(before->time_ns, ns_of_ticks(times[i]));
      time_ns = before->time_ns;
    }
    // Between two pictures, the earlier one is shown; far after the end, the last.
    EXPECT_EQ(playback->archived_picture("room", ns_of_ticks(times[60]) + 1'000'000, Step::kAt)->time_ns,
              ns_of_ticks(times[60]));
    EXPECT_EQ(playback->archived_picture("room", 3'600'000'000'000, Step::kAt)->time_ns,
              ns_of_ticks(times.back()));
  }
}

TEST_F(CasePlaybackTest, AnArchivedPictureIsUnchangedButForItsColourSpace) {
  const Recorded recorded =
      record("synthetic:pattern?size=64x48&rate=5&speed=max&pixel_format=gray", Profile::kLossless, 1s);
  const auto picture = open(recorded)->archived_picture("room", 0, Step::kAt);
  ASSERT_TRUE(picture);
  const DecodedFrame archived =
      decode_video(recorded.contents.plaintext(recorded.contents.segments("room").at(0))).frames.at(0);
  const DecodedFrame shown = decode_video(picture->png).frames.at(0);
  EXPECT_EQ(shown.width, 64);
  EXPECT_EQ(shown.height, 48);
  EXPECT_EQ(shown.pixel_format, "rgb24");
  EXPECT_EQ(archived.pixel_format, "gray");
}

}  // namespace
}  // namespace kiroku::playback
