#include "recorder/microphone.h"

#include <cmath>
#include <condition_variable>
#include <cstdlib>
#include <fstream>
#include <numbers>

extern "C" {
#include <libavutil/frame.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/source/sound_source.h"
#include "tests/support/decoded_sound.h"
#include "tests/support/recording.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr int kRate = 48'000;
constexpr int kSeconds = 30;
constexpr int kBeep = kRate / 20;

/// ALSA with a configuration of its own: "tone" is a file of samples, a beep at each whole second; "null" is
/// silence. Neither has a clock, and both give as much as is asked for.
class AlsaTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    static const test::TemporaryFolder folder;
    const std::string samples = (folder / "tone.raw").string();
    std::ofstream raw(samples, std::ios::binary);
    for (int at = 0; at < kSeconds * kRate; ++at) {
      const std::int16_t sample = sample_at(at);
      raw.write(reinterpret_cast<const char*>(&sample), sizeof sample);
    }
    std::ofstream(folder / "asound.conf")
        << "pcm.null { type null }\n"
        << "pcm.tone { type file slave.pcm null file /dev/null infile \"" << samples << "\" format raw }\n";
    ::setenv("ALSA_CONFIG_PATH", (folder / "asound.conf").c_str(),
             1);  // NOLINT(concurrency-mt-unsafe): no threads yet
  }
  static std::int16_t sample_at(int at) {
    const int in_second = at % kRate;
    return in_second < kBeep
               ? static_cast<std::int16_t>(20'000 * std::sin(2 * std::numbers::pi * 1000 * in_second / kRate))
               : std::int16_t{0};
  }
  static SourceAddress address(const std::string& text) {
    return parse_source_address(text, Presence::kNotLookedAt);
  }

  CaseClock clock;
};

TEST_F(AlsaTest, GivesTheSamplesOfTheDeviceAtTheirPace) {
  const auto source = open_sound_source(address("alsa:tone"), clock, {});
  const auto format = source->sound_format();
  ASSERT_TRUE(format);
  EXPECT_EQ(format->sample_rate, kRate);
  EXPECT_EQ(format->channels, 1);
  EXPECT_TRUE(source->is_live());
  EXPECT_EQ(source->input(), "48000 Hz, 1 channel");
  int samples = 0;
  std::int64_t first_ns = -1, last_ns = -1;
  while (samples < kRate) {
    const auto sound = source->read();
    ASSERT_TRUE(sound && sound->is_sound);
    ASSERT_EQ(sound->frame->format, AV_SAMPLE_FMT_S16);
    const auto* values = reinterpret_cast<const std::int16_t*>(sound->frame->data[0]);
    for (int i = 0; i < sound->frame->nb_samples; ++i)
      ASSERT_EQ(values[i], sample_at(samples + i)) << samples + i;
    samples += sound->frame->nb_samples;
    EXPECT_GE(sound->time_ns, last_ns);
    EXPECT_LE(sound->time_ns, clock.now_ns());
    if (first_ns < 0) first_ns = sound->time_ns;
    last_ns = sound->time_ns;
  }
  // What has no clock is held to one. A busy machine takes longer.
  EXPECT_GE(last_ns - first_ns, 900'000'000);
}

TEST_F(AlsaTest, TakesRateAndChannelsFromTheAddress) {
  const auto source = open_sound_source(address("alsa:null?rate=16000&channels=2"), clock, {});
  EXPECT_EQ(source->input(), "16000 Hz, 2 channels");
  const auto sound = source->read();
  ASSERT_TRUE(sound);
  EXPECT_EQ(sound->frame->sample_rate, 16'000);
  source->interrupt();
  EXPECT_FALSE(source->read());
}

TEST_F(AlsaTest, RefusesWhatIsNoDeviceInASentence) {
  for (const char* text :
       {"alsa:none", "alsa:null?rate=7000", "alsa:null?channels=9", "alsa:null?volume=3"}) {
    try {
      open_sound_source(address(text), clock, {});
      FAIL() << text;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(text)) << error.what();
    }
  }
  EXPECT_THROW(address("alsa:"), UsageError);
}

TEST_F(AlsaTest, StandsBesideThePicturesOfACase) {
  const test::RecorderBench bench;
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    SessionOptions options = bench.options();
    options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20", profile)};
    options.video[0].microphone = "alsa:tone";
    options.segment_duration = 9s;
    options.duration = 4s;
    const test::RecordedCase recorded = bench.record(std::move(options));
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    EXPECT_THAT(recorded.gaps("room"), IsEmpty());
    const auto opened = recorded.all<archive::OpenEntry>();
    EXPECT_EQ(opened.at(0).streams.at(0).source,
              "synthetic:pattern?size=64x48&rate=20; sound from alsa:tone");
    // The first segment may have begun before the device gave anything; the sound stands in the next one
    // then.
    const test::DecodedSound sound = test::decode_sound(recorded.joined("room"), kRate / 500);
    EXPECT_EQ(sound.rate, kRate);
    EXPECT_EQ(sound.channels, 1);
    const auto beeps = test::beeps_of(sound);
    ASSERT_GE(beeps.size(), 2U);
    for (std::size_t i = 1; i < beeps.size(); ++i) {
      EXPECT_NEAR(static_cast<double>(beeps[i] - beeps[i - 1]), kRate, 0.05 * kRate);
    }
  }
}

TEST_F(AlsaTest, PicturesGoOnWithoutAnAbsentMicrophone) {
  const test::RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20")};
  options.video[0].microphone = "alsa:none";
  options.duration = 1s;
  const test::RecordedCase recorded = bench.record(std::move(options));
  EXPECT_THAT(recorded.gaps("room"), IsEmpty());
  EXPECT_THAT(recorded.segments("room"), testing::Not(IsEmpty()));
}

TEST_F(AlsaTest, IsNoSourceOfPicturesAndNoMicrophoneOfAFilm) {
  const test::RecorderBench bench;
  const auto refusal = [&](const std::string& source, const std::string& microphone) {
    SessionOptions options = bench.options();
    options.video = {bench.stream("room", source)};
    options.video[0].microphone = microphone;
    options.duration = 1s;
    try {
      static_cast<void>(bench.record(std::move(options)));
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refusal("alsa:tone", ""), HasSubstr("has no pictures"));
  EXPECT_THAT(refusal("synthetic:pattern", "hw:1,0"), HasSubstr("write alsa:hw:1,0"));
  EXPECT_THAT(refusal("synthetic:pattern?speed=max", "alsa:tone"), HasSubstr("states its own times"));
}

class MicrophoneTest : public AlsaTest {
 protected:
  template <typename Condition>
  bool until(const Condition& holds) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, 60s, holds);
  }
  Microphone::Take take() {
    return [this](TimedFrame /*sound*/) {
      const std::lock_guard lock(mutex);
      ++taken;
      changed.notify_all();
    };
  }
  Microphone::Tell tell() {
    return [this](const std::string& sentence) {
      const std::lock_guard lock(mutex);
      told.push_back(sentence);
      changed.notify_all();
    };
  }

  std::mutex mutex;
  std::condition_variable changed;
  int taken = 0;
  std::vector<std::string> told;
};

TEST_F(MicrophoneTest, IsTakenUpAgainAndItsLossAndReturnAreTold) {
  std::atomic<int> openings = 0;
  const auto guard = std::make_shared<SourceGuard>(
      SourceGuard::Limits{}, SourceGuard::Tell{},
      [&](const SourceAddress& asked, const CaseClock& its_clock, const OpeningTerms& terms) {
        if (++openings == 1) throw Error("sound 'alsa:tone' is held by another program");
        return open_sound_source(asked, its_clock, terms);
      });
  Microphone microphone(address("alsa:tone"), clock, guard, take(), tell());
  microphone.start();
  ASSERT_TRUE(until([&] { return taken > 3; }));
  microphone.stop();
  const std::lock_guard lock(mutex);
  ASSERT_THAT(told, SizeIs(2));
  EXPECT_THAT(told[0], AllOf(HasSubstr("held by another program"), HasSubstr("recorded without its sound")));
  EXPECT_EQ(told[1], "sound 'alsa:tone' is back: 48000 Hz, 1 channel");
}

TEST_F(MicrophoneTest, ADriverThatDoesNotComeBackHoldsNobody) {
  std::mutex driver;
  std::condition_variable let_go;
  bool free = false;
  SourceGuard::Limits limits;
  limits.silence = limits.ending = 100ms;
  const auto guard = std::make_shared<SourceGuard>(
      limits, SourceGuard::Tell{},
      [&](const SourceAddress& asked, const CaseClock& its_clock, const OpeningTerms& terms) {
        std::unique_lock lock(driver);
        let_go.wait(lock, [&] { return free; });
        return open_sound_source(asked, its_clock, terms);
      });
  {
    Microphone microphone(address("alsa:tone"), clock, guard, take(), tell());
    microphone.start();
    ASSERT_TRUE(until([&] { return !told.empty(); }));
    EXPECT_THAT(told[0], HasSubstr("does not come back from being opened"));
  }
  EXPECT_GE(guard->given_up(), 1U);
  {
    const std::lock_guard lock(driver);
    free = true;
    let_go.notify_all();
  }
  while (guard->stuck() > 0) std::this_thread::sleep_for(5ms);
}

}  // namespace
}  // namespace kiroku::recorder
