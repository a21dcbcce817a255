// Sound of an ALSA device, read by the real alsa-lib from a card that the test plays
// (tests/support/sound_card.h).
#include "recorder/microphone.h"

#include <cmath>
#include <condition_variable>
#include <cstdlib>
#include <fstream>
#include <thread>

extern "C" {
#include <libavutil/frame.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/source/sound_source.h"
#include "tests/support/decoded_sound.h"
#include "tests/support/moved_clock.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recording.h"
#include "tests/support/sound_card.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;
using test::CardFault;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kMicrophoneRate = 48'000;

SourceAddress address(const std::string& text) { return parse_source_address(text, Presence::kNotLookedAt); }

class AlsaTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    static const test::TemporaryFolder folder;
    static const test::SoundCard only_card(folder.path());
    // NOLINTNEXTLINE(concurrency-mt-unsafe): no threads yet
    ::setenv("ALSA_CONFIG_PATH", only_card.configuration().c_str(), 1);
    page_ = &*only_card;
  }
  void SetUp() override {
    page_->taken = 0;
    page_->runs = false;
    page_->wrong_by_ppm = 0;
    page_->transferred_at_once = 1;
    page_->fault = CardFault::kNone;
    page_->plugged_ns = 0;
    page_->openings = 0;
  }
  static test::SoundCardPage& card() { return *page_; }

 private:
  inline static test::SoundCardPage* page_ = nullptr;
};

/// Read by a clock and a card that the test moves. The reader is a thread of its own, which always waits when
/// the test goes on.
class MovedCard : public AlsaTest {
 protected:
  static constexpr int kSlow = 8'000;  // samples a second: hours of them are to be read

  struct Piece {
    std::int64_t time_ns = 0, first = 0;
    int samples = 0;
    bool after_loss = false;
  };

  ~MovedCard() override { end(); }

  void open(const std::string& text = "alsa:card?rate=8000") {
    passed_ns = 0;
    clock.restart();
    source = open_sound_source(address(text), clock, {});
    reader = std::thread([this] {
      try {
        std::int64_t read = 0;
        while (const auto piece = source->read()) {
          const std::lock_guard guard(mutex);
          pieces.push_back({piece->time_ns, read, piece->frame->nb_samples, piece->lost_before > 0});
          read += piece->frame->nb_samples;
        }
      } catch (const std::exception& error) {
        const std::lock_guard guard(mutex);
        failure = std::current_exception();
      }
      ended = true;
    });
    settle();
  }
  /// Time goes on, and the card takes samples, by its own crystal.
  void pass(std::int64_t time_ns) {
    passed_ns += time_ns;
    card().taken = static_cast<std::int64_t>(static_cast<double>(passed_ns) / 1e9 * true_rate());
    time.move(std::chrono::nanoseconds(time_ns));
    settle();
  }
  void pass_in_steps(std::int64_t time_ns, std::int64_t step_ns = 200 * kMs) {
    for (; time_ns > 0 && !ended; time_ns -= step_ns) pass(step_ns);
  }
  /// Until the reader waits for what comes, or has ended.
  void settle() {
    while (!ended && time.waiting() == 0) std::this_thread::yield();
  }
  void end() {
    if (!reader.joinable()) return;
    source->interrupt();
    while (!ended) time.move(kInterruption);
    reader.join();
  }
  std::vector<Piece> taken() {
    const std::lock_guard guard(mutex);
    return std::exchange(pieces, {});
  }
  void rethrow() {
    const std::lock_guard guard(mutex);
    if (failure) std::rethrow_exception(std::exchange(failure, nullptr));
  }

  [[nodiscard]] double true_rate() const { return kSlow * (1 + card().wrong_by_ppm / 1e6); }

  static constexpr std::chrono::milliseconds kInterruption{100};
  test::MovedClock time;
  CaseClock clock{time};
  std::unique_ptr<Source> source;
  std::int64_t passed_ns = 0;
  std::thread reader;
  std::atomic<bool> ended = false;
  std::mutex mutex;  // guards the next two
  std::vector<Piece> pieces;
  std::exception_ptr failure;
};

class WrongCard : public MovedCard, public testing::WithParamInterface<int> {};

TEST_P(WrongCard, SaysWhenSamplesWereTakenOverTenHours) {
  card().wrong_by_ppm = GetParam();
  card().transferred_at_once = kSlow / 100;  // 10 ms, as of many a USB device
  open();
  double worst_ns = 0;
  std::int64_t samples = 0;
  while (passed_ns < 10 * 3'600 * kSecond) {
    pass(250 * kMs);
    ASSERT_NO_THROW(rethrow());
    for (const Piece& piece : taken()) {
      ASSERT_EQ(piece.first, samples);
      samples += piece.samples;
      const double truth_ns = static_cast<double>(piece.first) / true_rate() * 1e9;
      worst_ns = std::max(worst_ns, std::abs(static_cast<double>(piece.time_ns) - truth_ns));
    }
  }
  EXPECT_GT(samples, static_cast<std::int64_t>(10 * 3'600 * true_rate()) - kSlow);
  EXPECT_LT(worst_ns, 15e6) << "not followed, it would be 3.6 s";
}

INSTANTIATE_TEST_SUITE_P(By, WrongCard, testing::Values(-100, 100),
                         [](const auto& tested) { return tested.param < 0 ? "Minus100Ppm" : "Plus100Ppm"; });

TEST_F(MovedCard, GivesEachSampleOnceAndInOrder) {
  const auto direct = open_sound_source(address("alsa:card"), clock, {});
  EXPECT_EQ(direct->input(), "48000 Hz, 1 channel");
  EXPECT_TRUE(direct->is_live());
  ASSERT_TRUE(direct->sound_format());
  EXPECT_EQ(direct->sound_format()->sample_rate, kMicrophoneRate);
  std::vector<std::int16_t> samples;
  std::thread thread([&] {
    while (const auto piece = direct->read()) {
      ASSERT_TRUE(piece->is_sound);
      ASSERT_EQ(piece->frame->format, AV_SAMPLE_FMT_S16);
      const auto* const values = reinterpret_cast<const std::int16_t*>(piece->frame->data[0]);
      samples.insert(samples.end(), values, values + piece->frame->nb_samples);
      if (samples.size() >= kMicrophoneRate) direct->interrupt();
    }
  });
  for (int i = 1; i <= 10; ++i) {
    time.await_waiting(1);
    card().taken = std::int64_t{i} * kMicrophoneRate / 10;
    time.move(100ms);
  }
  thread.join();
  ASSERT_GE(samples.size(), std::size_t{kMicrophoneRate});
  for (std::size_t i = 0; i < samples.size(); ++i)
    ASSERT_EQ(samples[i], test::card_sample(static_cast<std::int64_t>(i), kMicrophoneRate)) << i;
}

TEST_F(MovedCard, GivesTheRateAndChannelsThatAreAskedFor) {
  EXPECT_EQ(open_sound_source(address("alsa:card?rate=16000&channels=2"), clock, {})->input(),
            "16000 Hz, 2 channels");
}

TEST_F(MovedCard, SaysThatNobodyReadInTimeAndGoesOn) {
  open();
  pass_in_steps(kSecond);
  taken();
  pass(5 * kSecond);  // what waits to be read is a second at most
  pass_in_steps(kSecond);
  const std::vector<Piece> after = taken();
  ASSERT_FALSE(after.empty());
  EXPECT_TRUE(after.front().after_loss);
  EXPECT_FALSE(after.back().after_loss);
  EXPECT_NEAR(static_cast<double>(after.front().time_ns), 6e9, 0.3e9);
  EXPECT_NEAR(static_cast<double>(after.back().time_ns), 7e9, 0.3e9);
}

TEST_F(MovedCard, IsGoneWhenItIsUnplugged) {
  open();
  pass_in_steps(kSecond);
  card().fault = CardFault::kUnplugged;
  pass(200 * kMs);
  EXPECT_TRUE(ended);
  try {
    rethrow();
    FAIL();
  } catch (const SoundDeviceGone& error) {
    EXPECT_STREQ(error.what(), "sound 'alsa:card?rate=8000' is gone: it was unplugged");
  }
  EXPECT_THROW(open_sound_source(address("alsa:card"), clock, {}), Error);
}

TEST_F(MovedCard, IsLostWhenItFallsSilent) {
  open();
  pass_in_steps(kSecond);
  card().fault = CardFault::kSilent;
  pass_in_steps(4 * kSecond);
  EXPECT_FALSE(ended);
  pass_in_steps(2 * kSecond);
  EXPECT_TRUE(ended);
  EXPECT_THROW(rethrow(), Error);
}

TEST_F(MovedCard, IsLostWhenItDoesNothingButOverrun) {
  card().fault = CardFault::kOverrun;
  open();
  pass_in_steps(6 * kSecond);
  EXPECT_TRUE(ended);
  EXPECT_THROW(rethrow(), Error);
}

TEST_F(MovedCard, IsRefusedWhereItHasNoClock) {
  const auto null = open_sound_source(address("alsa:null"), clock, {});
  try {
    for (int i = 0; i < 1'000; ++i) {
      if (!null->read()) break;
    }
    FAIL() << "hours of sound in no time";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "sound 'alsa:null' gives more sound than time passes: it has no clock");
  }
}

TEST_F(MovedCard, IsRefusedInASentence) {
  const auto refusal = [&](const std::string& text) {
    try {
      open_sound_source(address(text), clock, {});
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refusal("alsa:none"), AllOf(HasSubstr("alsa:none"), HasSubstr("kiroku devices")));
  EXPECT_THAT(refusal("alsa:card?rate=96000"), AllOf(HasSubstr("no 96000 Hz"), HasSubstr("alsa:plughw")));
  EXPECT_THAT(refusal("alsa:card?channels=8"), HasSubstr("no 8 channels"));
  EXPECT_THAT(refusal("alsa:card?rate=7000"), HasSubstr("from 8000 to 192000"));
  EXPECT_THAT(refusal("alsa:card?volume=3"), HasSubstr("it knows rate,channels"));
  EXPECT_THROW(address("alsa:"), UsageError);
}

class MicrophoneTest : public AlsaTest {
 protected:
  Microphone::Listener listener() {
    return {[this](const TimedFrame& /*sound*/) { note([this] { ++taken; }); },
            [this](GapCause cause) { note([&] { causes.push_back(cause); }); },
            [this](const std::string& sentence) { note([&] { told.push_back(sentence); }); }};
  }
  template <typename Condition>
  void await(const Condition& holds) {
    std::unique_lock lock(mutex);
    changed.wait(lock, holds);
  }

  test::MovedClock time;
  CaseClock clock{time};
  std::mutex mutex;  // guards what follows
  std::condition_variable changed;
  int taken = 0;
  std::vector<GapCause> causes;
  std::vector<std::string> told;

 private:
  template <typename Change>
  void note(const Change& change) {
    const std::lock_guard lock(mutex);
    change();
    changed.notify_all();
  }
};

/// Gives one piece, and is lost then, for a reason.
class BriefMicrophone : public Source {
 public:
  explicit BriefMicrophone(bool unplugged) : unplugged_(unplugged) {}
  [[nodiscard]] PictureFormat format() const override { return {}; }
  [[nodiscard]] Rational frame_rate() const override { return {}; }
  [[nodiscard]] bool is_live() const override { return true; }
  [[nodiscard]] std::string input() const override { return "sound of a test"; }
  std::optional<TimedFrame> read() override {
    if (std::exchange(given_, true)) {
      if (unplugged_) throw SoundDeviceGone("it was unplugged");
      throw Error("it gives nothing");
    }
    TimedFrame piece;
    piece.is_sound = true;
    piece.frame = media::make_frame();
    return piece;
  }

 private:
  const bool unplugged_;
  bool given_ = false;
};

TEST_F(MicrophoneTest, IsTakenUpAgainAndItsLossAndReturnAreTold) {
  int openings = 0;
  const auto guard = std::make_shared<SourceGuard>(
      SourceGuard::Limits{}, SourceGuard::Tell{},
      [&](const SourceAddress&, const CaseClock&, const OpeningTerms&) -> std::unique_ptr<Source> {
        if (++openings == 2) throw Error("no such device");
        return std::make_unique<BriefMicrophone>(openings == 1);
      });
  Microphone microphone(address("alsa:card"), clock, guard, guard->open(address("alsa:card"), clock, {}),
                        listener());
  microphone.start();
  await([&] { return told.size() == 1; });
  time.await_waiting(1);
  time.move(1s);  // the second opening fails
  time.await_waiting(1);
  time.move(2s);
  await([&] { return told.size() == 3; });
  microphone.stop();
  time.move(1s);
  microphone.join();
  EXPECT_EQ(taken, 2);
  EXPECT_THAT(told,
              ElementsAre("it was unplugged. Pictures are recorded without its sound until it is there",
                          "sound 'alsa:card' is back: sound of a test",
                          "it gives nothing. Pictures are recorded without its sound until it is there"));
  EXPECT_THAT(causes, ElementsAre(GapCause::kDeviceRemoved, GapCause::kSignalLost));
}

TEST_F(MicrophoneTest, ADriverThatDoesNotComeBackHoldsNobody) {
  card().fault = CardFault::kStuck;
  SourceGuard::Limits limits;
  limits.silence = limits.ending = 100ms;
  const auto guard = std::make_shared<SourceGuard>(limits);
  {
    Microphone microphone(address("alsa:card"), clock, guard, nullptr, listener());
    microphone.start();
    while (guard->given_up() == 0) std::this_thread::yield();
    time.await_waiting(1);
    microphone.stop();
    time.move(1s);
  }
  card().fault = CardFault::kNone;
  while (guard->stuck() > 0) std::this_thread::yield();
}

class SessionWithMicrophone : public AlsaTest {
 protected:
  [[nodiscard]] SessionOptions options(Profile profile = Profile::kMpeg2) const {
    SessionOptions options = bench.options();
    options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20", profile)};
    options.video[0].microphone = "alsa:card";
    return options;
  }
  /// Of the sound beside pictures, and of the pictures.
  static std::pair<std::vector<archive::GapEntry>, std::vector<archive::GapEntry>> gaps_of(
      const test::RecordedCase& recorded) {
    std::pair<std::vector<archive::GapEntry>, std::vector<archive::GapEntry>> gaps;
    for (const archive::GapEntry& gap : recorded.gaps("room"))
      (gap.of_sound ? gaps.first : gaps.second).push_back(gap);
    return gaps;
  }

  test::RecorderBench bench;
};

// Real time: the card is a thread of this process, and says how far it is by the machine's clock. Where that
// thread is kept waiting, so is what it says.
class SessionWithMicrophoneRealTime : public SessionWithMicrophone {};

TEST_F(SessionWithMicrophoneRealTime, SoundStandsWhereItWasHeardBesideThePictures) {
  // By two thousandths, so that four seconds show what hours of 100 ppm do.
  for (const int ppm : {-500, 500}) {
    for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
      SetUp();
      card().runs = true;
      card().wrong_by_ppm = ppm;
      SessionOptions asked = options(profile);
      asked.segment_duration = 9s;
      asked.duration = 4s;
      const test::RecordedCase recorded = bench.record(std::move(asked));
      EXPECT_THAT(recorded.broken_rules(), IsEmpty());
      const auto [of_sound, of_pictures] = gaps_of(recorded);
      EXPECT_THAT(of_pictures, IsEmpty());
      EXPECT_EQ(recorded.all<archive::OpenEntry>().at(0).streams.at(0).source,
                "synthetic:pattern?size=64x48&rate=20; sound from alsa:card");
      const test::DecodedSound sound = test::decode_sound(recorded.joined("room"), kMicrophoneRate / 500);
      EXPECT_EQ(sound.rate, kMicrophoneRate);
      EXPECT_EQ(sound.channels, 1);
      const auto beeps = test::beeps_of(sound);
      // A busy machine may not read in time: then the sound that is missing is stated.
      if (of_sound.empty()) {
        EXPECT_GE(beeps.size(), 3U);
      }
      const archive::SegmentEntry first = recorded.segments("room").at(0);
      const double ticks_a_second = std::stod(first.time_base.substr(2));  // of "1/90000"
      const double film_ahead_s = static_cast<double>(first.first_pts) / ticks_a_second -
                                  static_cast<double>(first.span.start_ns) / 1e9;
      const auto& opened = recorded.entries().front();
      const std::int64_t zero_utc_ns =
          opened.at.utc.time_since_epoch() / std::chrono::nanoseconds(1) - opened.at.mono_ns;
      const std::int64_t utc_ahead_ns = utc_now().time_since_epoch() / std::chrono::nanoseconds(1) -
                                        Clock::system().now().time_since_epoch().count();
      const double plugged_ns = static_cast<double>(card().plugged_ns + utc_ahead_ns - zero_utc_ns);
      for (const std::int64_t beep : beeps) {
        if (beep - sound.start < kMicrophoneRate / 10) continue;  // it may have begun before the sound
        const double stated_s = static_cast<double>(beep) / kMicrophoneRate - film_ahead_s;
        const double of_card = (stated_s - plugged_ns / 1e9) * (1 + ppm / 1e6);
        EXPECT_NEAR(of_card, std::round(of_card), 0.02) << ppm << " ppm, " << stated_s << " s";
      }
    }
  }
}

TEST_F(SessionWithMicrophone, ThatIsUnpluggedCostsAStatedGapOfSoundAndNoPicture) {
  card().runs = true;
  std::int64_t back_ns = 0;
  Session session(options());
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.now_ns > kSecond) card().fault = CardFault::kUnplugged;
    if (status.last_problem.find("unplugged") != std::string::npos) card().fault = CardFault::kNone;
    if (status.last_problem.find("is back") == std::string::npos) return;
    if (back_ns == 0) back_ns = status.now_ns;
    if (status.now_ns > back_ns + kSecond) session.stop();
  });
  const test::RecordedCase recorded = bench.read(result.folder);
  const auto [of_sound, of_pictures] = gaps_of(recorded);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(of_pictures, IsEmpty());
  ASSERT_FALSE(of_sound.empty());
  const auto unplugged = std::ranges::find(of_sound, GapCause::kDeviceRemoved, &archive::GapEntry::cause);
  ASSERT_NE(unplugged, of_sound.end());
  EXPECT_GT(unplugged->span.start_ns, kSecond / 2);
  EXPECT_LE(unplugged->span.end_ns, back_ns);
  EXPECT_GE(unplugged->span.end_ns - unplugged->span.start_ns, kSecond - kSecond / 10) << "the first pause";
}

TEST_F(SessionWithMicrophone, ThatIsAbsentIsToldToAPersonAndStatedWhereNobodySits) {
  card().fault = CardFault::kUnplugged;
  SessionOptions asked = options();
  asked.duration = 2s;
  EXPECT_THROW(static_cast<void>(bench.record(asked)), Error);
  EXPECT_EQ(bench.cases(), 0U);
  asked.video[0].may_be_absent = true;
  const test::RecordedCase recorded = bench.record(std::move(asked));
  const auto [of_sound, of_pictures] = gaps_of(recorded);
  EXPECT_THAT(of_pictures, IsEmpty());
  ASSERT_EQ(of_sound.size(), 1U);
  EXPECT_EQ(of_sound[0].span.start_ns, 0);
  EXPECT_GE(of_sound[0].span.end_ns, 2 * kSecond);
}

TEST_F(SessionWithMicrophone, IsNoSourceOfPicturesAndNoMicrophoneOfAFilm) {
  const auto refusal = [&](const std::string& source, const std::string& microphone) {
    SessionOptions asked = bench.options();
    asked.video = {bench.stream("room", source)};
    asked.video[0].microphone = microphone;
    asked.duration = 1s;
    try {
      static_cast<void>(bench.record(std::move(asked)));
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refusal("alsa:card", ""), HasSubstr("has no pictures"));
  EXPECT_THAT(refusal("synthetic:pattern", "hw:1,0"), HasSubstr("write alsa:hw:1,0"));
  EXPECT_THAT(refusal("synthetic:pattern?speed=max", "alsa:card"), HasSubstr("states its own times"));
}

}  // namespace
}  // namespace kiroku::recorder
