// Sound beside viewing copies: where the archive has it, sample for sample, whichever piece is asked for.
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/decoded_sound.h"
#include "tests/support/decoded_video.h"
#include "tests/support/film_with_sound.h"
#include "tests/support/recording.h"
#include "tests/unit/viewer/playback/rewritten_case.h"
#include "viewer/playback/case_playback.h"
#include "viewer/playback/sound_reader.h"

namespace kiroku::playback {
namespace {

using namespace std::chrono_literals;
using recorder::Profile;
using test::DecodedSound;
using test::Fate;
using testing::Ge;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr int kRate = 48'000;
/// How far libavformat's muxer sets time stamps of MPEG-TS behind the packets'.
constexpr std::int64_t kTransportDelaySamples = kRate / 2;

class ViewingSoundTest : public testing::Test {
 protected:
  struct Recorded {
    std::filesystem::path folder;
    test::RecordedCase contents;
  };
  Recorded record(const std::string& source, Profile profile, std::chrono::nanoseconds duration,
                  std::chrono::nanoseconds segment, bool with_sound = true) {
    recorder::SessionOptions options = bench_.options();
    options.segment_duration = segment;
    options.stamp_interval = 1h;
    auto stream = bench_.stream("room", source, profile);
    stream.video.audio = with_sound;
    stream.recipients = reader_.recipients;
    options.event_recipients = reader_.recipients;
    options.video = {stream};
    options.duration = duration;
    recorder::Session session(std::move(options));
    const auto folder = session.run().folder;
    return {folder, {folder, reader_.identities}};
  }
  /// A flash and a beep together each second.
  Recorded record_beeps(Profile profile, std::chrono::nanoseconds duration = 9s) {
    return record("synthetic:pattern?size=64x48&rate=25&flash=1&beep=1&speed=max", profile, duration, 700ms);
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
  /// Pieces [first, last), one after the other behind what goes before them.
  static DecodedSound sound_of(CasePlayback& playback, std::uint64_t first, std::uint64_t last) {
    Bytes film = playback.sound_init_segment("room").value().bytes;
    for (std::uint64_t number = first; number < last; ++number) {
      append(film, playback.sound_piece("room", number));
    }
    return test::decode_sound(film);
  }

  test::RecorderBench bench_;
  test::Reader reader_ = test::make_reader();
  std::shared_ptr<EncryptedCache> cache_ =
      std::make_shared<EncryptedCache>(bench_ / "cache", std::uint64_t{64} << 20);
};

/// What synthetic sources sound like at a sample of the case clock.
double beep_at(std::int64_t sample) {
  const std::int64_t since = sample % kRate;
  const double phase = 2 * std::numbers::pi * 1000 * static_cast<double>(since) / kRate;
  return since < kRate / 10 ? std::trunc(16'000 * std::sin(phase)) / 32'768 : 0;
}

TEST(SoundForm, PutsBlocksOnOneRowWhateverTheContainerRounds) {
  // Matroska tells milliseconds, and blocks of FLAC at 44.1 kHz begin between them.
  const SoundForm form{44'100, 2, 4'608, 1'234};
  for (std::int64_t block = 0; block < 100'000; ++block) {
    const std::int64_t sample = 1'234 + block * 4'608;
    const Ticks stated = (sample * 1000 + 22'050) / 44'100 * 90;
    ASSERT_EQ(form.place_of(stated), sample) << block;
  }
  EXPECT_EQ(form.place_of(90'000 * 10 + 4'500), 44'100 * 10 + 2'205) << "another row";
}

TEST_F(ViewingSoundTest, IsTheArchivedOneSampleForSample) {
  const auto playback = open(record_beeps(Profile::kLossless));
  ASSERT_EQ(playback->sound_init_segment("room").value().codecs, "flac");
  const DecodedSound sound = sound_of(*playback, 0, 5);
  EXPECT_EQ(sound.rate, kRate);
  EXPECT_EQ(sound.channels, 1);
  EXPECT_EQ(sound.start, 0);
  EXPECT_THAT(sound.breaks, IsEmpty());
  ASSERT_THAT(sound.samples, SizeIs(Ge(9U * kRate)));
  std::int64_t differing = 0;
  // The last block of a recording ends where its pictures did.
  for (std::int64_t at = 0; at < 9 * kRate - 5'000; ++at) {
    if (std::abs(sound.at(at) - beep_at(at)) > 1e-9) ++differing;
  }
  EXPECT_EQ(differing, 0);
}

TEST_F(ViewingSoundTest, OfLayer2IsWhatADecoderOfTheWholeMakesOfIt) {
  const Recorded recorded = record_beeps(Profile::kMpeg2);
  const DecodedSound archived = test::decode_sound(recorded.contents.joined("room"), 1);
  const auto playback = open(recorded);
  const DecodedSound sound = sound_of(*playback, 0, 5);
  EXPECT_THAT(sound.breaks, IsEmpty());
  double largest = 0;
  for (std::int64_t at = 1'152; at < 9 * kRate - 5'000; ++at) {
    largest = std::max(largest, std::abs(sound.at(at) - archived.at(at + kTransportDelaySamples)));
  }
  EXPECT_LT(largest, 0.51 / 32'768) << "more than rounding to 16 bit";
}

TEST_F(ViewingSoundTest, HasItsBeepsWhereThePicturesFlash) {
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    const auto playback = open(record_beeps(profile));
    Bytes film = playback->init_segment("room").bytes;
    for (std::uint64_t number = 0; number < 5; ++number) append(film, playback->piece("room", number));
    std::vector<double> flashes;
    for (const test::DecodedFrame& frame : test::decode_video(film).frames) {
      if (frame.brightness > 200) flashes.push_back(static_cast<double>(frame.pts) / kTicksPerSecond);
    }
    const std::vector<std::int64_t> beeps = test::beeps_of(sound_of(*playback, 0, 5));
    ASSERT_THAT(flashes, SizeIs(9));
    ASSERT_THAT(beeps, SizeIs(9));
    double largest = 0;
    for (std::size_t i = 0; i < beeps.size(); ++i) {
      largest = std::max(largest, std::abs(static_cast<double>(beeps[i]) / kRate - flashes[i]));
    }
    EXPECT_LT(largest, 0.001) << recorder::profile_name(profile);
    RecordProperty(std::string("beep_after_flash_us_") + std::string(recorder::profile_name(profile)),
                   std::to_string(std::lround(largest * 1e6)));
  }
}

TEST_F(ViewingSoundTest, APieceIsTheSameWhateverWasAskedBeforeAndCoversExactlyItsTwoSeconds) {
  const Recorded recorded = record_beeps(Profile::kMpeg2);
  const Bytes sought = open(recorded)->sound_piece("room", 3);
  cache_ = std::make_shared<EncryptedCache>(bench_ / "other", std::uint64_t{64} << 20);
  const auto playback = open(recorded);
  const DecodedSound whole = sound_of(*playback, 0, 5);
  EXPECT_EQ(playback->sound_piece("room", 3), sought);
  const DecodedSound alone = sound_of(*playback, 3, 4);
  EXPECT_EQ(alone.start, 6 * kRate);
  ASSERT_THAT(alone.samples, SizeIs(2U * kRate));
  for (std::int64_t at = alone.start; at < alone.end(); ++at) {
    ASSERT_EQ(alone.at(at), whole.at(at)) << at;
  }
}

TEST_F(ViewingSoundTest, IsSilentWhereTheRecordHasAGap) {
  const Recorded recorded =
      rewrite(record_beeps(Profile::kMpeg2, 12s), [](const archive::SegmentEntry& segment) {
        return segment.span.start_ns >= 2'700'000'000 && segment.span.start_ns < 8'400'000'000
                   ? Fate::kLeftOut
                   : Fate::kKept;
      });
  const auto playback = open(recorded);
  EXPECT_THAT(playback->sound_piece("room", 3), IsEmpty());
  EXPECT_THAT(playback->sound_piece("room", 9), IsEmpty()) << "after the end";
  const DecodedSound before = sound_of(*playback, 0, 2);
  for (std::int64_t at = kRate * 29 / 10; at < before.end(); ++at) ASSERT_EQ(before.at(at), 0) << at;
  EXPECT_THAT(test::beeps_of(before), SizeIs(3));
  const std::vector<std::int64_t> after = test::beeps_of(sound_of(*playback, 4, 6));
  ASSERT_THAT(after, SizeIs(3));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(static_cast<double>(after[i]), static_cast<double>((9 + i) * kRate), kRate / 1000.0);
  }
}

TEST_F(ViewingSoundTest, OfASegmentThatRecoveryFoundIsAtItsTime) {
  const Recorded recorded =
      rewrite(record("synthetic:endoscope?size=640x480&rate=25&beep=1&speed=max", Profile::kMpeg2, 4s, 1s),
              [](const archive::SegmentEntry& segment) {
                return segment.index == 3 ? Fate::kFoundCut : Fate::kKept;
              });
  const auto beeps = test::beeps_of(sound_of(*open(recorded), 0, 2));
  ASSERT_THAT(beeps, SizeIs(4)) << "the last one in what was cut";
  EXPECT_NEAR(static_cast<double>(beeps[3]), 3.0 * kRate, kRate / 1000.0);
}

TEST_F(ViewingSoundTest, IsHeardBesideASegmentThatIsNotWhatTheLedgerSays) {
  const Recorded recorded = record_beeps(Profile::kMpeg2, 9s);
  const archive::SegmentEntry last = recorded.contents.segments("room").back();
  std::filesystem::resize_file(recorded.folder / last.file.file,
                               std::filesystem::file_size(recorded.folder / last.file.file) - 1);
  const auto playback = open(recorded);
  EXPECT_THAT(test::beeps_of(sound_of(*playback, 0, 4)), SizeIs(8)) << "its neighbour as well";
  EXPECT_THROW((void)playback->sound_piece("room", 4), Error);
}

TEST_F(ViewingSoundTest, FasterThanBrowsersNeedIsReducedInPlace) {
  for (const int rate : {44'100, 96'000}) {
    const std::string film = test::make_film_with_sound(bench_ / "tone.mkv", rate).string();
    const auto playback = open(record(film + "?speed=max", Profile::kLossless, 2s, 1s));
    const DecodedSound sound = sound_of(*playback, 0, 1);
    EXPECT_EQ(sound.rate, rate == 96'000 ? 48'000 : 44'100);
    EXPECT_THAT(sound.breaks, IsEmpty());
    double largest = 0;
    for (std::int64_t at = sound.rate / 10; at < sound.rate * 18 / 10; ++at) {
      const double expected =
          0.25 * std::sin(2 * std::numbers::pi * test::kToneHz * static_cast<double>(at) / sound.rate);
      largest = std::max(largest, std::abs(sound.at(at) - expected));
    }
    EXPECT_LT(largest, 3.0 / 32'768) << rate;
  }
}

TEST_F(ViewingSoundTest, LeavesThePicturesToTheByteWhatTheyAreWithoutIt) {
  const std::string source = "synthetic:pattern?size=64x48&rate=25&beep=1&speed=max";
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    const auto with = open(record(source, profile, 5s, 1s));
    const auto without = open(record(source, profile, 5s, 1s, false));
    ASSERT_TRUE(with->sound_init_segment("room"));
    EXPECT_EQ(with->init_segment("room").bytes, without->init_segment("room").bytes);
    for (std::uint64_t number = 0; number < 3; ++number) {
      EXPECT_EQ(with->piece("room", number), without->piece("room", number)) << number;
    }
  }
}

TEST_F(ViewingSoundTest, IsNotThereWhereNoneWasRecorded) {
  const auto playback =
      open(record("synthetic:pattern?size=64x48&rate=25&beep=1&speed=max", Profile::kMpeg2, 3s, 1s, false));
  EXPECT_FALSE(playback->sound_init_segment("room"));
  EXPECT_THAT(playback->sound_piece("room", 0), IsEmpty());
  EXPECT_THAT(playback->piece("room", 0), Not(IsEmpty()));
  EXPECT_THROW((void)playback->sound_piece("nowhere", 0), UsageError);
}

}  // namespace
}  // namespace kiroku::playback
