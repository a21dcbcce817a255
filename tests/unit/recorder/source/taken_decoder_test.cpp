// Decoders that were taken over by what they decode (tests/support/taken_decoder.cpp): what they say of their
// source, and how long they keep whoever waits for it.
#include <csignal>
#include <future>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/byte_source.h"
#include "media/box/boxed_jobs.h"
#include "media/segment_input.h"
#include "recorder/daemon/room.h"
#include "recorder/picture_tap.h"
#include "recorder/procedure/worklist.h"
#include "recorder/session.h"
#include "recorder/source/boxed_source.h"
#include "recorder/source/source_guard.h"
#include "tests/support/child_processes.h"
#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"
#include "tests/support/recorded_case.h"
#include "tests/support/recording.h"
#include "tests/support/temporary_folder.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::child_processes;
using test::eventually;
using test::RecordedCase;
using test::RecorderBench;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr const char* kRoomCamera = "synthetic:pattern?size=64x48&rate=20";

class TakenDecoder : public testing::Test {
 protected:
  void SetUp() override { std::signal(SIGPIPE, SIG_IGN); }

  /// A pipe, whose name tells the decoder what to do.
  std::string camera(const std::string& manner) const {
    const std::string path = (bench_ / manner).string();
    EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
    return path;
  }
  std::unique_ptr<Source> open(const std::string& manner, const OpeningTerms& terms = {}) const {
    return open_boxed_source(parse_source_address(camera(manner)), clock_, terms);
  }
  std::string refusal_of(const std::string& manner, const OpeningTerms& terms = {}) const {
    try {
      (void)open(manner, terms);
    } catch (const DecoderLost& error) {
      return error.what();
    }
    return "";
  }
  /// Two streams: what the decoder gives, and a camera of the room that needs none.
  SessionOptions beside_a_room(const std::string& manner) const {
    SessionOptions options = bench_.options();
    options.video = {bench_.stream("endoscope", camera(manner)), bench_.stream("room", kRoomCamera)};
    options.video[0].may_be_absent = true;
    SourceGuard::Limits limits;
    limits.silence = 400ms;
    options.video[0].guard = std::make_shared<SourceGuard>(limits);
    return options;
  }

  const RecorderBench bench_;
  const CaseClock clock_;
};

// Real time: how long somebody waits for a program that does nothing, or says nothing but that it lives.
class TakenDecoderRealTime : public TakenDecoder {
 protected:
  static OpeningTerms short_terms() {
    OpeningTerms terms;
    terms.patience = 300ms;
    terms.silence = 400ms;
    return terms;
  }
};

TEST_F(TakenDecoderRealTime, SignsOfLifeDoNotKeepASourceOpening) {
  EXPECT_THAT(refusal_of("pulses", short_terms()), HasSubstr("has not been opened for 0."));
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(TakenDecoderRealTime, SignsOfLifeAreNoPictures) {
  OpeningTerms terms;
  terms.silence = 400ms;
  const auto source = open("opens-and-pulses", terms);
  try {
    (void)source->read();
    ADD_FAILURE() << "something was read";
  } catch (const DecoderLost& error) {
    EXPECT_THAT(error.what(), HasSubstr("has not given picture or sound for 4."));
  }
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(TakenDecoderRealTime, NobodyWaitsForOneThatTakesNothing) {
  OpeningTerms terms;
  terms.silence = 400ms;
  const auto source = open("deaf", terms);
  EXPECT_THROW(
      {
        while (source->read()) {
        }
      },
      DecoderLost);
}

TEST_F(TakenDecoder, ALiveSourceDoesNotEndByItsWord) {
  const auto source = open("ends");
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(source->read());
  EXPECT_THROW((void)source->read(), DecoderLost);
}

TEST_F(TakenDecoder, WhetherItIsLiveFollowsFromTheAddressAndNoTimeLiesAhead) {
  const auto source = open("future");
  EXPECT_TRUE(source->is_live());
  std::int64_t before_ns = -1;
  for (int i = 0; i < 5; ++i) {
    const auto frame = source->read();
    ASSERT_TRUE(frame);
    EXPECT_GT(frame->time_ns, before_ns);
    EXPECT_LE(frame->time_ns, clock_.now_ns());
    before_ns = frame->time_ns;
  }
}

TEST_F(TakenDecoder, AFilmAtItsOwnPaceHasNoPictureBeforeItIsDue) {
  const std::string path = (bench_ / "future").string();
  std::ofstream(path) << "film";
  const auto source = open_boxed_source(parse_source_address(path), clock_, {});
  EXPECT_FALSE(source->is_live());
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->read();
    ASSERT_TRUE(frame);
    EXPECT_LE(frame->time_ns, clock_.now_ns());
  }
}

TEST_F(TakenDecoder, TimesNeverGoBack) {
  const auto source = open("past");
  for (std::int64_t i = 0; i < 3; ++i) EXPECT_EQ(source->read()->time_ns, i);
}

TEST_F(TakenDecoder, IsNotBelievedWhatCannotBe) {
  EXPECT_THAT(refusal_of("slow"), HasSubstr("says that a picture comes 1/2147483647 times a second"));
  EXPECT_THAT(refusal_of("fast"), HasSubstr("says that a picture comes 2147483647/1 times a second"));
  for (const char* manner : {"hardware", "talks", "deep"})
    EXPECT_THAT(refusal_of(manner), HasSubstr("says what it may not: it was killed")) << manner;
  EXPECT_EQ(open("controls")->input(), "64x64\\u{001B}[2J\\u{202E}");
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(TakenDecoderRealTime, TheCaseBeginsWithTheOtherCameras) {
  SessionOptions options = beside_a_room("pulses");
  options.duration = 1s;
  const RecordedCase recorded = bench_.record(std::move(options));
  EXPECT_THAT(recorded.gaps("endoscope"), SizeIs(1));
  EXPECT_THAT(recorded.segments("endoscope"), IsEmpty());
  EXPECT_THAT(recorded.segments("room"), testing::Not(IsEmpty()));
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(TakenDecoder, NoStreamIsLongerThanItsCase) {
  SessionOptions options = beside_a_room("future");
  // The case ends by pictures, and not by time: the decoder is a program, and a busy machine starts it late.
  const auto tap = options.video[0].tap = std::make_shared<PictureTap>();
  tap->watch(true);
  Session session(std::move(options));
  const auto ended = std::async(std::launch::async, [&] {
    for (int pictures = 0; pictures < 3; ++pictures) {
      EXPECT_TRUE(eventually([&] { return bool(tap->take(20ms)); }));
    }
    session.stop();
  });
  const std::filesystem::path folder = session.run().folder;
  ended.wait();
  const RecordedCase recorded = bench_.read(folder);
  ASSERT_THAT(recorded.segments("endoscope"), testing::Not(IsEmpty()));
  const std::int64_t close_ns = recorded.entries().back().at.mono_ns;
  for (const char* stream : {"endoscope", "room"})
    EXPECT_LE(recorded.segments(stream).back().span.end_ns, close_ns) << stream;
  EXPECT_THAT(recorded.gaps_but_overload("room"), IsEmpty());
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(TakenDecoder, AnOpeningEndsWhenNothingIsToBeRecordedAnyMore) {
  SessionOptions options = beside_a_room("pulses");
  options.video[0].may_be_absent = false;
  options.video[0].guard = std::make_shared<SourceGuard>(SourceGuard::Limits{.silence = 1h});
  std::atomic<bool> cancelled = false;
  options.cancelled = &cancelled;
  const auto ended = std::async(std::launch::async, [&] {
    EXPECT_TRUE(eventually([] { return !child_processes().empty(); }));
    cancelled = true;
  });
  try {
    const Session session(std::move(options));
    ADD_FAILURE() << "a case began";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("ended before its sources were open"));
  }
  EXPECT_EQ(bench_.cases(), 0U);
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(TakenDecoder, ARoomEndsWhileItsSourcesAreOpening) {
  RoomPlan plan;
  plan.name = "or-1";
  plan.session = beside_a_room("pulses");
  plan.session.video[0].may_be_absent = false;
  plan.session.video[0].guard = std::make_shared<SourceGuard>(SourceGuard::Limits{.silence = 1h});
  Room room(std::move(plan), {});
  auto started = std::async(std::launch::async, [&] { return room.start("operator"); });
  EXPECT_TRUE(eventually([] { return !child_processes().empty(); }));
  room.shut_down();
  EXPECT_THROW((void)started.get(), Error);
  EXPECT_EQ(room.status().state, RoomState::kIdle);
  EXPECT_EQ(bench_.cases(), 0U);
}

TEST_F(TakenDecoder, AWorklistThatBeginsAgainAndAgainIsNotWaitedFor) {
  WorklistOptions options;
  options.host = "127.0.0.1";
  options.port = 9;
  options.called_ae = "RIS";
  EXPECT_THAT(ask_worklist(options, utc_now()).problem, HasSubstr("says what it may not"));
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(TakenDecoder, AJobIsNotLongerForBeingRefusedAgainAndAgain) {
  test::MovedClock clock;
  media::BoxedJobs box;
  const auto door = [&](std::uint64_t) -> std::unique_ptr<crypto::ByteSource> {
    clock.move(10s);
    throw UsageError("there is no such segment");
  };
  try {
    (void)box.ask("ask", {}, door, "a film", nullptr, {.whole = 60s, .clock = &clock});
    ADD_FAILURE() << "it was answered";
  } catch (const media::MediaError& error) {
    EXPECT_THAT(error.what(), HasSubstr("takes too long"));
  }
}

TEST_F(TakenDecoder, AJobIsRefusedSoOftenInOtherWordsAlone) {
  media::BoxedJobs box;
  int asked = 0;
  const auto door = [&](std::uint64_t) -> std::unique_ptr<crypto::ByteSource> {
    throw UsageError("there is no segment " + std::to_string(asked++));
  };
  EXPECT_THROW((void)box.ask("ask", {}, door, "a film"), media::MediaError);
  EXPECT_LT(asked, 100);
}

TEST_F(TakenDecoder, AJobThatMakesNothingWithoutEndIsEnded) {
  media::BoxedJobs box;
  Bytes made;
  try {
    (void)box.ask("make nothing", {}, {}, "a film", &made);
    ADD_FAILURE() << "it was answered";
  } catch (const media::MediaError& error) {
    EXPECT_THAT(error.what(), HasSubstr("says what it may not"));
  }
}

/// Pictures of a stream whose name tells the decoder what to say, until it is not believed any more.
std::string refusal_of_span(const std::string& manner) {
  const test::TemporaryFolder folder;
  const test::Reader reader = test::make_reader();
  const auto recording = archive::CaseReader::open(test::record_case(
      folder / "archive", {{manner, "video", "video/x-matroska", {Bytes(100)}, {25}}}, reader.recipients));
  playback::PictureSpan pictures(recording, reader.identities, manner);
  try {
    while (pictures.next()) {
      if (manner != "endless" && manner != "backwards") (void)pictures.rgb();
    }
  } catch (const media::MediaError& error) {
    return error.what();
  }
  return "";
}

TEST(TakenSpan, IsNotBelievedWhatCannotBe) {
  std::signal(SIGPIPE, SIG_IGN);
  for (const char* const manner : {"backwards", "huge", "far", "text", "short", "endless"})
    EXPECT_THAT(refusal_of_span(manner), HasSubstr("its decoder says what cannot be")) << manner;
  EXPECT_THAT(refusal_of_span("long"), HasSubstr("the decoder says what it may not"));
}

}  // namespace
}  // namespace kiroku::recorder
