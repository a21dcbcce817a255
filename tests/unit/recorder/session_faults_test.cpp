// What a session does when the world does not behave: pipes that end and come back, slow and full disks,
// films that stop early.
#include <array>
#include <csignal>
#include <fstream>
#include <sys/stat.h>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/segmenter.h"
#include "recorder/session.h"
#include "tests/support/decoded_video.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/film_with_sound.h"
#include "tests/support/media_maker.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/pipe_camera.h"
#include "tests/support/recording.h"
#include "tests/support/shared_data.h"
#include "tests/support/slow_file_system.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;
using test::decode_video;
using test::RecordedCase;
using test::RecorderBench;
using testing::Contains;
using testing::Each;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

struct Sums {
  std::uint64_t frames = 0, dropped = 0;
};
Sums sums(const std::vector<archive::SegmentEntry>& segments) {
  Sums sum;
  for (const auto& segment : segments) {
    sum.frames += segment.frames;
    sum.dropped += segment.dropped;
  }
  return sum;
}

// Real time: a writer that stays away for a while, as seen by a session on the machine's clock.
class FifoSessionRealTime : public testing::Test {
 protected:
  void SetUp() override {
    std::signal(SIGPIPE, SIG_IGN);
    ASSERT_EQ(::mkfifo((bench / "camera").c_str(), 0600), 0);
  }
  RecorderBench bench;
};

TEST_F(FifoSessionRealTime, StatesTheGapWhileAPipeHasNoWriterAndGoesOnWhenItIsBack) {
  std::thread camera([&] {
    test::write_film(bench / "camera", 12);
    std::this_thread::sleep_for(600ms);
    test::write_film(bench / "camera", 1000);
  });
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", (bench / "camera").string())};
  options.duration = 2500ms;
  const RecordedCase recorded = bench.record(options);
  camera.join();
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kSignalLost);
  EXPECT_GE(gaps[0].span.end_ns - gaps[0].span.start_ns, kSecond / 2);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.all<archive::CloseEntry>(), SizeIs(1));
  EXPECT_GT(recorded.segments("endoscope").back().span.start_ns, gaps[0].span.end_ns - 1);
  // The joins are clean although the source was opened twice.
  const auto video = decode_video(recorded.joined("endoscope"));
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_EQ(video.frames.size(), sums(recorded.segments("endoscope")).frames);
}

// Pictures that arrive all at once are coded one after the other, so their time line runs ahead of the clock;
// what another camera sends next must not fall behind it.
TEST_F(FifoSessionRealTime, GoesOnWithOtherPicturesAfterABurst) {
  std::thread camera([&] {
    test::write_film(bench / "camera", 80, 64, 0ms);
    std::this_thread::sleep_for(200ms);
    test::write_film(bench / "camera", 1000, 128);
  });
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", (bench / "camera").string())};
  options.duration = 3500ms;
  const RecordedCase recorded = bench.record(options);
  camera.join();
  EXPECT_EQ(recorded.all<archive::CloseEntry>().at(0).reason, "duration");
  EXPECT_THAT(recorded.gaps("endoscope"), SizeIs(1));
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_GT(sums(recorded.segments("endoscope")).frames, 100U);
  EXPECT_EQ(sums(recorded.segments("endoscope")).dropped, 0U);
}

TEST_F(FifoSessionRealTime, CanBeStoppedWhileAPipeHasNoWriter) {
  std::thread camera([&] { test::write_film(bench / "camera", 12); });
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", (bench / "camera").string())};
  Session session(options);
  std::thread operator_thread([&] {
    camera.join();
    std::this_thread::sleep_for(300ms);
    session.stop();
  });
  const SessionResult result = session.run();
  operator_thread.join();
  EXPECT_EQ(result.close_reason, "operator");
  const RecordedCase recorded = bench.read(result.folder);
  ASSERT_THAT(recorded.gaps("endoscope"), SizeIs(1));
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

/// A camera that says nothing of its rate and sends pictures as fast as they are taken: `run` of one size,
/// then as many of another, until nobody reads any more.
void flicker(const std::filesystem::path& pipe, const std::array<Bytes, 2>& pictures, int run) {
  std::ofstream out(pipe, std::ios::binary);
  for (int i = 0; out; ++i) {
    out << text_of(pictures.at(static_cast<std::size_t>(i / run % 2))) << std::flush;
  }
}

class FlickeringCamera : public testing::Test {
 protected:
  void SetUp() override {
    std::signal(SIGPIPE, SIG_IGN);
    ASSERT_EQ(::mkfifo((bench / "camera").c_str(), 0600), 0);
  }
  /// Until `pictures` have come.
  RecordedCase record(int run, std::uint64_t pictures) {
    const std::array<Bytes, 2> pictures_of_two_sizes{test::make_jpeg(64, 48), test::make_jpeg(96, 64)};
    std::thread camera([&] { flicker(bench / "camera", pictures_of_two_sizes, run); });
    SessionOptions options = bench.options();
    options.video = {bench.stream("endoscope", (bench / "camera").string())};
    Session session(options);
    const SessionResult result = session.run([&](const SessionStatus& status) {
      const StreamStatus& stream = status.streams.at(0);
      if (stream.frames + stream.dropped >= pictures) session.stop();
    });
    camera.join();
    return bench.read(result.folder);
  }
  RecorderBench bench;
};

TEST_F(FlickeringCamera, FasterThanItsStatedRateLeavesNoOverlap) {
  const RecordedCase recorded = record(200, 1000);
  EXPECT_GT(recorded.gaps("endoscope").size(), 1U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(FlickeringCamera, MakesFewSegmentsAndStatesTheRest) {
  const RecordedCase recorded = record(1, 4000);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  const auto segments = recorded.segments("endoscope");
  const std::int64_t lasted_ns = recorded.entries().back().at.mono_ns;
  // In 200 ms each, and one more for each change of the pictures.
  const auto times = static_cast<std::size_t>(lasted_ns / ChangePace::kWithinNs + 1);
  EXPECT_LE(segments.size(),
            times * ChangePace::kMostChanges + static_cast<std::size_t>(lasted_ns * 5 / kSecond) + 1);
  EXPECT_LT(sums(segments).frames, 4000U) << "the rest is left out";
  ASSERT_FALSE(recorded.gaps("endoscope").empty());
  EXPECT_EQ(recorded.gaps("endoscope").back().cause, GapCause::kFormatChange);
}

// Real time: disks that are slow beside cameras that are not, and how long the ledger's own end takes.
TEST(SessionUnderLoadRealTime, DropsWholeFramesAndStatesThemWhenTheDiskIsTooSlow) {
  const RecorderBench bench;
  test::SlowFileSystem files("segments/room", 150ms);
  SessionOptions options = bench.options();
  options.files = &files;
  options.queue_bytes = 300'000;  // two pictures
  options.video = {bench.stream("room", "synthetic:pattern?size=320x240&rate=20", Profile::kUncompressed)};
  options.duration = 1500ms;
  const RecordedCase recorded = bench.record(options);
  const auto segments = recorded.segments("room");
  EXPECT_GT(sums(segments).dropped, 0U);
  EXPECT_EQ(sums(segments).frames + sums(segments).dropped, 30U);
  const auto gaps = recorded.gaps("room");
  ASSERT_THAT(gaps, testing::Not(IsEmpty()));
  for (const auto& gap : gaps) {
    EXPECT_EQ(gap.cause, GapCause::kOverload);
    EXPECT_LT(gap.span.start_ns, gap.span.end_ns);
  }
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  for (const auto& segment : segments) {
    EXPECT_THAT(decode_video(recorded.plaintext(segment)).frames, SizeIs(segment.frames));
  }
}

TEST(SessionUnderLoadRealTime, NeverDropsWhatASourceStatesAtItsOwnTimes) {
  const RecorderBench bench;
  test::SlowFileSystem files("segments/room", 20ms);
  SessionOptions options = bench.options();
  options.files = &files;
  options.queue_bytes = 300'000;
  options.video = {
      bench.stream("room", "synthetic:pattern?size=320x240&rate=20&speed=max", Profile::kUncompressed)};
  options.duration = 1s;
  const RecordedCase recorded = bench.record(options);
  EXPECT_EQ(sums(recorded.segments("room")).frames, 20U);
  EXPECT_EQ(sums(recorded.segments("room")).dropped, 0U);
}

TEST(SessionUnderLoadRealTime, KeepsFewFilesOpenWhenTheDiskIsSlowerThanTheSource) {
  const RecorderBench bench;
  test::SlowFileSystem files("segments/room", 0ms, 25ms);
  SessionOptions options = bench.options();
  options.files = &files;
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=5&speed=max")};
  options.duration = 12s;  // 60 segments
  const RecordedCase recorded = bench.record(options);
  EXPECT_THAT(recorded.segments("room"), SizeIs(60));
  EXPECT_EQ(sums(recorded.segments("room")).dropped, 0U);
  EXPECT_GE(files.most_open(), 10);
  EXPECT_LE(files.most_open(), 18);
}

// The disk takes seconds for the last files while the theatre goes on: the record says so, and none of its
// marks' streams does, which have segments only where somebody did something.
TEST(SessionUnderLoadRealTime, StatesTheTimeThatASlowDiskNeedsForClosing) {
  const RecorderBench bench;
  test::SlowFileSystem files("segments/room", 0ms, 3500ms);
  SessionOptions options = bench.options();
  options.files = &files;
  options.segment_duration = 5s;
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20")};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0")};
  options.duration = 500ms;
  const RecordedCase recorded = bench.record(options);
  for (const char* stream : {"room", "vitals"}) {
    const auto gaps = recorded.gaps(stream);
    ASSERT_THAT(gaps, SizeIs(1)) << stream;
    EXPECT_EQ(gaps[0].cause, GapCause::kOverload);
    EXPECT_GE(gaps[0].span.start_ns, recorded.segments(stream).back().span.end_ns);
    EXPECT_GE(gaps[0].span.end_ns - gaps[0].span.start_ns, 3 * kSecond);
  }
  EXPECT_THAT(recorded.gaps("events"), IsEmpty());
}

TEST(SessionUnderLoadRealTime, StatesTheTimeThatTheLedgerNeedsForItsOwnEnd) {
  const RecorderBench bench;
  test::SlowFileSystem files("ledger.jsonl", 0ms);
  SessionOptions options = bench.options();
  options.files = &files;
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20")};
  Session session(options);
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams.front().frames < 10) return;
    files.delay_syncs(4s);
    session.stop();
  });
  const RecordedCase recorded = bench.read(result.folder);
  const auto gaps = recorded.gaps("room");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kOverload);
  std::int64_t close_ns = 0;
  for (const archive::CaseEntry& entry : recorded.entries()) {
    if (std::holds_alternative<archive::CloseEntry>(entry.body)) close_ns = entry.at.mono_ns;
  }
  EXPECT_EQ(gaps[0].span.end_ns, close_ns) << "also where the gap itself takes as long";
}

TEST(SessionUnderLoadRealTime, StatesWhatIsNotRecordedWhileAFilmIsStillCoded) {
  const RecorderBench bench;
  test::SlowFileSystem files("segments/film", 450ms);
  SessionOptions options = bench.options();
  options.files = &files;
  options.queue_bytes = 400'000;  // so the film's pictures are taken as they are coded
  options.video = {bench.stream("film", "synthetic:pattern?size=320x240&rate=5&speed=max"),
                   bench.stream("room", "synthetic:pattern?size=64x48&rate=20")};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0")};
  options.duration = 2s;
  const RecordedCase recorded = bench.record(options);
  for (const char* stream : {"room", "vitals"}) {
    const auto gaps = recorded.gaps(stream);
    ASSERT_FALSE(gaps.empty()) << stream;
    EXPECT_EQ(gaps[0].cause, GapCause::kPaused);
    EXPECT_EQ(gaps[0].span.start_ns, recorded.segments(stream).back().span.end_ns);
  }
  EXPECT_THAT(recorded.gaps("film"), IsEmpty());
}

TEST(SessionOnAFullDisk, KeepsWhatIsThereStatesTheGapAndCloses) {
  const RecorderBench bench;
  test::FaultFileSystem files(bench / "archive");
  SessionOptions options = bench.options();
  options.files = &files;
  options.video = {bench.stream("room", "synthetic:pattern?size=320x240&rate=20", Profile::kUncompressed)};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0")};
  options.duration = 20s;
  Session session(options);
  files.fail("write " + session.case_id() + "/segments/room", ENOSPC, 12);
  const SessionResult result = session.run();
  EXPECT_EQ(result.close_reason, "disk-full");
  EXPECT_FALSE(result.last.last_problem.empty());
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_EQ(recorded.all<archive::CloseEntry>().at(0).reason, "disk-full");
  const auto segments = recorded.segments("room");
  ASSERT_GE(segments.size(), 2U);
  EXPECT_FALSE(segments.back().complete);
  EXPECT_THAT(decode_video(recorded.plaintext(segments.back())).frames, testing::Not(IsEmpty()));
  const auto gaps = recorded.gaps("room");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kDiskFull);
  EXPECT_EQ(gaps[0].span.start_ns, segments.back().span.end_ns);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  // The other stream is whole.
  EXPECT_TRUE(recorded.segments("vitals").back().complete);
}

TEST(SessionThatMayDie, SealsWhatNeedsFewBitsWithinASecond) {
  const RecorderBench bench;
  test::FaultFileSystem files(bench / "archive");
  SessionOptions options = bench.options();
  options.files = &files;
  options.segment_duration = 4s;
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20&speed=max")};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0&speed=max")};
  options.duration = 4s;
  const RecordedCase recorded = bench.record(options);
  ASSERT_THAT(recorded.segments("room"), SizeIs(1));
  const std::vector<std::string> calls = files.calls();
  constexpr const char* kWholeChunk = " 65552";
  const auto chunks = std::count_if(calls.begin(), calls.end(), [&](const std::string& call) {
    return call.starts_with("write ") && call.find("/room/") != std::string::npos &&
           call.ends_with(kWholeChunk);
  });
  EXPECT_GE(chunks, 4) << "one each second at least";
  const auto decoded = decode_video(recorded.plaintext(recorded.segments("room")[0]));
  EXPECT_THAT(decoded.frames, SizeIs(80)) << "what fills a chunk up is skipped";
  for (const auto& segment : recorded.segments("vitals")) {
    EXPECT_LE(segment.span.end_ns - segment.span.start_ns, kSecond);
  }
}

TEST(SessionOnABrokenDisk, ClaimsNothingAfterAFailedFlush) {
  const RecorderBench bench;
  test::FaultFileSystem files(bench / "archive");
  SessionOptions options = bench.options();
  options.files = &files;
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20")};
  options.duration = 20s;
  Session session(options);
  files.fail("sync_all " + session.case_id() + "/segments/room", EIO, 2);
  const SessionResult result = session.run();
  EXPECT_THAT(result.close_reason, StartsWith("error: "));
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.segments("room"), SizeIs(2));
  ASSERT_THAT(recorded.gaps("room"), SizeIs(1));
  EXPECT_EQ(recorded.gaps("room")[0].cause, GapCause::kOverload);
  EXPECT_EQ(recorded.gaps("room")[0].span.start_ns, recorded.segments("room").back().span.end_ns);
  EXPECT_THAT(recorded.all<archive::CloseEntry>(), SizeIs(1));
}

/// A film of two seconds, 20 pictures a second, made by the recorder itself.
std::filesystem::path make_film(const RecorderBench& bench) {
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:endoscope?size=64x48&rate=20&speed=max")};
  options.duration = 2s;
  const Bytes film = bench.record(options).joined("room");
  std::ofstream(bench / "film.ts", std::ios::binary) << text_of(film);
  return bench / "film.ts";
}

TEST(SessionFromAFile, EndsWithTheFilmAtItsOwnPace) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", make_film(bench).string())};
  Session session(options);
  const SessionResult result = session.run();
  EXPECT_EQ(result.close_reason, "sources-ended");
  EXPECT_GE(result.duration_ns, 2 * kSecond - kSecond / 20);
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_EQ(sums(recorded.segments("room")).frames, 40U);
  EXPECT_EQ(recorded.segments("room").back().span.end_ns, 2 * kSecond);
  EXPECT_GE(recorded.entries().back().at.mono_ns, 2 * kSecond - kSecond / 20);
}

TEST(SessionFromAFile, RepeatsTheFilmWithoutAHole) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", make_film(bench).string() + "?loop=1&speed=max")};
  options.duration = 5s;
  Session session(options);
  EXPECT_EQ(session.run().close_reason, "duration");
  const RecordedCase recorded = bench.read(session.folder());
  EXPECT_EQ(sums(recorded.segments("room")).frames, 100U);
  EXPECT_THAT(recorded.gaps("room"), IsEmpty());
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST(SessionWithSound, KeepsItBesideThePictures) {
  const RecorderBench bench;
  const std::string film = test::make_film_with_sound(bench / "sound.mkv").string() + "?speed=max";
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    SessionOptions options = bench.options();
    options.segment_duration = 1s;
    options.video = {bench.stream("room", film, profile)};
    options.video[0].video.audio = true;
    const RecordedCase recorded = bench.record(options);
    std::int64_t samples = 0;
    for (const auto& segment : recorded.segments("room")) {
      const auto video = decode_video(recorded.plaintext(segment));
      EXPECT_THAT(video.frames, SizeIs(segment.frames));
      EXPECT_EQ(video.sound_codec, profile == Profile::kMpeg2 ? "mp2" : "flac");
      EXPECT_THAT(video.complaints, IsEmpty());
      EXPECT_GT(video.sound_samples, 0);
      samples += video.sound_samples;
    }
    // Two seconds, to a packet.
    const double rate = profile == Profile::kMpeg2 ? 48'000 : 44'100;
    EXPECT_NEAR(static_cast<double>(samples), 2 * rate, 5000) << profile_name(profile);
    EXPECT_EQ(sums(recorded.segments("room")).frames, 40U);
  }
}

TEST(SessionWithSound, LeavesItOutUnlessAsked) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {
      bench.stream("room", test::make_film_with_sound(bench / "sound.mkv").string() + "?speed=max")};
  const RecordedCase recorded = bench.record(options);
  EXPECT_EQ(decode_video(recorded.joined("room")).sound_codec, "");
}

TEST(SessionFromAFile, KeepsEveryPictureOfARealFilmBitForBit) {
  KIROKU_NEEDS_SHARED_DATA("recording/video/rvimlab_endo.mp4");
  const auto film = test::shared_data("recording/video/rvimlab_endo.mp4");
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.segment_duration = 2s;
  options.video = {bench.stream("endoscope", film.string() + "?speed=max", Profile::kLossless)};
  options.duration = 1s;
  const RecordedCase recorded = bench.record(options);
  const auto original = decode_video(test::read_whole(film), 25);
  const auto kept = decode_video(recorded.plaintext(recorded.segments("endoscope").at(0)));
  ASSERT_THAT(kept.frames, SizeIs(25));
  for (std::size_t i = 0; i < kept.frames.size(); ++i)
    EXPECT_EQ(kept.frames[i].sha256, original.frames[i].sha256) << i;
}

}  // namespace
}  // namespace kiroku::recorder
