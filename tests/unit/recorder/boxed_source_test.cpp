// Sources whose decoder, a process in a box, is killed or hangs while it works.
#include "recorder/source/boxed_source.h"

#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <mutex>
#include <sys/stat.h>
#include <thread>

extern "C" {
#include <libavutil/frame.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "recorder/session.h"
#include "recorder/source/resolved_location.h"
#include "recorder/source/source_guard.h"
#include "tests/support/child_processes.h"
#include "tests/support/decoded_video.h"
#include "tests/support/eventually.h"
#include "tests/support/film_with_sound.h"
#include "tests/support/pipe_camera.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;
using test::child_processes;
using test::line_of_process;
using test::RecordedCase;
using test::RecorderBench;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr int kFrames = 24;

/// 0 where there is none.
pid_t decoder_of_now() {
  const std::vector<pid_t> found = child_processes();
  return found.empty() ? 0 : found.front();
}

class BoxedSession : public testing::Test {
 protected:
  void SetUp() override {
    std::signal(SIGPIPE, SIG_IGN);
    ASSERT_EQ(::mkfifo((bench_ / "camera").c_str(), 0600), 0);
  }

  /// Records a camera of which the decoder gets a signal after some pictures, until the next decoder has
  /// given some, too.
  RecordedCase record_with(int signal) {
    std::atomic<bool> ended = false;
    test::ReturningCamera camera(bench_ / "camera", 1000);
    camera.come_back();
    SessionOptions options = bench_.options();
    options.video = {bench_.stream("endoscope", (bench_ / "camera").string())};
    SourceGuard::Limits limits;
    limits.silence = 700ms;
    options.video[0].guard = std::make_shared<SourceGuard>(limits);
    const auto tap = options.video[0].tap = std::make_shared<PictureTap>();
    tap->watch(true);
    Session session(options);
    std::atomic<int> pictures = 0;
    std::thread counter([&] {
      while (!ended) {
        if (tap->take(20ms)) ++pictures;
      }
    });
    std::thread attacker([&] {
      const auto until = [](const auto& holds) { EXPECT_TRUE(test::eventually(holds)); };
      until([&] { return pictures >= 10; });
      first_ = decoder_of_now();
      if (first_ > 0) ::kill(first_, signal);  // else the signal would be for this process and its group
      until([&] { return decoder_of_now() != 0 && decoder_of_now() != first_; });
      second_ = decoder_of_now();
      const int before = pictures;
      until([&] { return pictures >= before + 10; });
      session.stop();
    });
    const std::filesystem::path folder = session.run().folder;
    attacker.join();
    ended = true;
    counter.join();
    return bench_.read(folder);
  }

  static void expect_one_gap_and_more_after(const RecordedCase& recorded) {
    const auto gaps = recorded.gaps("endoscope");
    ASSERT_THAT(gaps, SizeIs(1));
    EXPECT_EQ(gaps[0].cause, GapCause::kSignalLost);
    EXPECT_GT(gaps[0].span.end_ns, gaps[0].span.start_ns);
    EXPECT_GT(recorded.segments("endoscope").back().span.start_ns, gaps[0].span.end_ns - 1);
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    EXPECT_THAT(recorded.all<archive::CloseEntry>(), SizeIs(1));
  }

  RecorderBench bench_;
  pid_t first_ = 0, second_ = 0;
};

TEST_F(BoxedSession, ADecoderThatIsKilledCostsAGap) {
  expect_one_gap_and_more_after(record_with(SIGKILL));
  EXPECT_NE(first_, second_);
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(BoxedSession, ADecoderThatHangsIsKilledAndReplaced) {
  expect_one_gap_and_more_after(record_with(SIGSTOP));
  EXPECT_NE(::kill(first_, 0), 0) << "the one that hung is still there";
}

TEST_F(BoxedSession, ADecoderThatCrashesCostsAGap) { expect_one_gap_and_more_after(record_with(SIGSEGV)); }

class BoxedSourceTest : public testing::Test {
 protected:
  void SetUp() override { test::write_film(film_, kFrames, 64, 0ms); }
  std::unique_ptr<Source> open(const OpeningTerms& terms = {}) {
    return open_boxed_source(parse_source_address(film_.string() + "?speed=max"), clock_, terms);
  }
  RecorderBench bench_;
  const std::filesystem::path film_ = bench_ / "film.y4m";
  CaseClock clock_;
};

TEST_F(BoxedSourceTest, GivesEveryPictureInItsOwnMemory) {
  const auto source = open();
  EXPECT_EQ(source->format().to_string(), "64x48 yuv420p");
  EXPECT_EQ(source->frame_rate().numerator, 20);
  EXPECT_FALSE(source->is_live());
  // All of them at once: none may be written over while it is held.
  std::vector<TimedFrame> frames;
  while (auto frame = source->read()) frames.push_back(std::move(*frame));
  ASSERT_THAT(frames, SizeIs(kFrames));
  for (int i = 0; i < kFrames; ++i) {
    const TimedFrame& frame = frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(frame.time_ns, i * 50'000'000LL);
    EXPECT_EQ(frame.lost_before, 0U);
    EXPECT_EQ(frame.frame->data[0][0], i);
    EXPECT_EQ(frame.frame->data[0][47 * frame.frame->linesize[0] + 63], i);
    EXPECT_FALSE(av_frame_is_writable(frame.frame.get()));
  }
}

TEST_F(BoxedSourceTest, PicturesOutliveTheirSource) {
  auto source = open();
  const auto frame = source->read();
  source.reset();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->frame->data[0][5], 0);
}

TEST_F(BoxedSourceTest, TheDecoderHasNothingButWhatItNeeds) {
  ::setenv("KIROKU_PASSPHRASE", "secret", 1);
  const Descriptor key(::open("/dev/null", O_RDONLY));  // not closed on exec
  const auto source = open();
  ASSERT_TRUE(source->read());
  ::unsetenv("KIROKU_PASSPHRASE");
  ASSERT_THAT(child_processes(), SizeIs(1));
  const pid_t decoder = decoder_of_now();
  EXPECT_EQ(line_of_process(decoder, "status", "NoNewPrivs:"), "1");
  EXPECT_EQ(line_of_process(decoder, "status", "Seccomp:"), "2");
  EXPECT_THAT(line_of_process(decoder, "limits", "Max core file size"), testing::StartsWith("0 "));
  EXPECT_THAT(line_of_process(decoder, "limits", "Max file size"), testing::StartsWith("0 "));
  if (::geteuid() != 0) GTEST_SKIP() << "what it has, it shows to root alone";
  std::ifstream environment("/proc/" + std::to_string(decoder) + "/environ");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(environment), {}),
            std::string("OPENBLAS_NUM_THREADS=1\0", 23));
  std::vector<std::string> held;
  for (const auto& each : std::filesystem::directory_iterator("/proc/" + std::to_string(decoder) + "/fd")) {
    const int number = std::stoi(each.path().filename());
    if (number > 2) held.push_back(std::filesystem::read_symlink(each.path()).string().substr(0, 7));
  }
  EXPECT_THAT(held, testing::UnorderedElementsAre(film_.string().substr(0, 7), "/memfd:", "socket:"));
}

TEST_F(BoxedSourceTest, SaysWhatEndedTheDecoder) {
  const auto source = open();
  ASSERT_TRUE(source->read());
  ASSERT_THAT(child_processes(), testing::SizeIs(1));
  ::kill(child_processes().front(), SIGSYS);
  try {
    while (source->read()) {
    }
    ADD_FAILURE() << "it goes on without a decoder";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("was killed by SIGSYS, as it asked for what it may not"));
  }
}

TEST_F(BoxedSourceTest, ErrorsCrossTheBoxAsTheyAre) {
  try {
    (void)open_boxed_source(parse_source_address(film_.string() + "?speed=fast"), clock_, {});
    ADD_FAILURE();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("speed can only be 'max'"));
  }
  std::ofstream(bench_ / "text.mp4") << "no film\n";
  EXPECT_THROW((void)open_boxed_source(parse_source_address((bench_ / "text.mp4").string()), clock_, {}),
               Error);
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(BoxedSourceTest, OpeningEndsWhenNobodyWaitsForIt) {
  ASSERT_EQ(::mkfifo((bench_ / "silent").c_str(), 0600), 0);
  std::atomic<bool> cancelled = false;
  OpeningTerms terms;
  terms.cancelled = &cancelled;
  std::thread canceller([&] {
    EXPECT_TRUE(test::eventually([] { return decoder_of_now() != 0; }));
    cancelled = true;
  });
  EXPECT_THROW((void)open_boxed_source(parse_source_address((bench_ / "silent").string()), clock_, terms),
               Error);
  canceller.join();
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST(ResolvedLocation, FindsTheHost) {
  const auto host = [](const std::string& location) {
    const HostPlace place = host_place(location);
    return location.substr(place.begin, place.length);
  };
  EXPECT_EQ(host("rtsp://camera.local:554/x"), "camera.local");
  EXPECT_EQ(host("rtsp://user:a@b@camera/x@y"), "camera");
  EXPECT_EQ(host("udp://239.1.1.1:5000?ttl=2"), "239.1.1.1");
  EXPECT_EQ(host("http://[::1]:80/x"), "::1");
  EXPECT_EQ(host("udp://:5000"), "");
  EXPECT_EQ(host("nothing"), "");
  EXPECT_EQ(host_and_port("http://u:p@camera:80/x"), "camera:80");
  EXPECT_EQ(host_and_port("http://[::1]:80/x"), "[::1]:80");
}

TEST(ResolvedLocation, KeepsWhatHasNoNameOrAnUnknownOne) {
  EXPECT_THAT(resolved_locations("udp://:5000"), ElementsAre("udp://:5000"));
  EXPECT_THAT(resolved_locations("rtsp://[::1]/x"), ElementsAre("rtsp://[::1]/x"));
  EXPECT_THAT(resolved_locations("rtsp://u:p@192.0.2.1:9/x"), ElementsAre("rtsp://u:p@192.0.2.1:9/x"));
  EXPECT_THAT(resolved_locations("rtsp://nowhere.invalid/x"), ElementsAre("rtsp://nowhere.invalid/x"));
  EXPECT_THAT(resolved_locations("rtsp://localhost:7/x"), testing::Contains("rtsp://127.0.0.1:7/x"));
}

}  // namespace
}  // namespace kiroku::recorder
