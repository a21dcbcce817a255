// Pointing as a stream of a case: recorded line by line, and never at the cost of anything else.
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/pointing_stream.h"
#include "recorder/pointing_lane.h"
#include "recorder/session.h"
#include "tests/support/eventually.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::RecordedCase;
using test::RecorderBench;
using testing::IsEmpty;
using testing::SizeIs;

media::PointedAt at(const std::string& by, double x = 0.5) {
  return {by, "guest", "room", x, 0.5, std::nullopt};
}

class Pointing : public testing::Test {
 protected:
  [[nodiscard]] SessionOptions options() const {
    SessionOptions options = bench.options();
    options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10")};
    options.pointing = true;
    options.duration = 1500ms;
    return options;
  }
  const RecorderBench bench;
};

TEST_F(Pointing, StandsInTheCaseLineByLineInOrderOfTime) {
  SessionOptions asked = options();
  asked.duration.reset();
  Session session(asked);
  std::vector<std::thread> people;
  std::atomic<int> done = 0;
  for (const char* name : {"Dr. Sato", "anna"}) {
    people.emplace_back([&session, &done, name] {
      for (int i = 0; i < 20; ++i) {
        EXPECT_TRUE(session.point(at(name, i / 20.0)));
        const std::int64_t then_ns = session.status().now_ns;
        EXPECT_TRUE(test::eventually([&] { return session.status().now_ns > then_ns + 50'000'000; }));
      }
      ++done;
    });
  }
  const SessionResult result = session.run([&](const SessionStatus& /*status*/) {
    if (done == 2) session.stop();
  });
  for (std::thread& person : people) person.join();
  EXPECT_FALSE(session.point(at("Dr. Sato"))) << "the case is over";

  const RecordedCase recorded = bench.read(result.folder);
  const auto lines = recorded.lines(std::string(archive::kPointingStream));
  ASSERT_THAT(lines, SizeIs(40));
  std::int64_t last_ns = 0;
  std::map<std::string, int> of_each;
  for (const std::string& text : lines) {
    const auto line = media::parse_pointing_line(text);
    ASSERT_TRUE(line) << text;
    EXPECT_GE(line->time_ns, last_ns);
    last_ns = line->time_ns;
    EXPECT_EQ(line->at.x, of_each[line->at.by]++ / 20.0);
  }
  EXPECT_THAT(recorded.all<archive::MarkEntry>(), IsEmpty()) << "no entry of the ledger for each";
  const auto segments = recorded.segments("pointing");
  EXPECT_LE(static_cast<std::int64_t>(segments.size()), 2 + result.duration_ns / 200'000'000)
      << "one each 200 ms at most";
  std::size_t next = 0;
  for (const archive::SegmentEntry& segment : segments) {
    for (std::uint64_t i = 0; i < segment.frames; ++i) {
      const std::int64_t time_ns = media::parse_pointing_line(lines.at(next++))->time_ns;
      EXPECT_GE(time_ns, segment.span.start_ns);
      EXPECT_LT(time_ns, segment.span.end_ns);
    }
  }
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(Pointing, IsNoPartOfACaseThatNobodyWatches) {
  SessionOptions asked = options();
  asked.pointing = false;
  Session session(asked);
  EXPECT_FALSE(session.point(at("anna")));
  const SessionResult result = session.run();
  const RecordedCase recorded = bench.read(result.folder);
  const archive::OpenEntry opening = recorded.all<archive::OpenEntry>().at(0);
  for (const archive::StreamInfo& stream : opening.streams) EXPECT_NE(stream.name, "pointing");
}

TEST_F(Pointing, BeginsWithTheCase) {
  SessionOptions asked = options();
  asked.pre_roll = 10s;
  asked.duration.reset();
  Session session(asked);
  std::uint64_t frames_then = 0;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    const std::uint64_t frames = status.streams.at(0).frames;
    if (frames_then == 0 && frames > 3) {
      EXPECT_FALSE(session.point(at("anna"))) << "there is no case yet";
      session.begin({});
      EXPECT_TRUE(session.point(at("anna")));
      frames_then = frames;
    } else if (frames_then > 0 && frames > frames_then + 3) {
      session.stop("operator");
    }
  });
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.lines("pointing"), SizeIs(1));
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST_F(Pointing, CountsWhatComesTooFast) {
  Session session(options());
  constexpr std::uint64_t kAll = 3 * PointingLane::kMostWaiting;
  for (std::uint64_t i = 0; i < kAll; ++i) ASSERT_TRUE(session.point(at("anna")));
  const RecordedCase recorded = bench.read(session.run().folder);
  std::uint64_t kept = 0, dropped = 0;
  for (const archive::SegmentEntry& segment : recorded.segments("pointing")) {
    kept += segment.frames;
    dropped += segment.dropped;
  }
  EXPECT_EQ(kept, PointingLane::kMostWaiting);
  EXPECT_EQ(kept + dropped, kAll);
  EXPECT_THAT(recorded.lines("pointing"), SizeIs(kept));
}

TEST_F(Pointing, ThatCannotBeWrittenIsAGapAndEndsNoRecording) {
  test::FaultFileSystem files(bench / "archive");
  SessionOptions asked = options();
  asked.files = &files;
  Session session(asked);
  files.fail("create " + session.case_id() + "/segments/pointing", EIO, 1);
  const SessionResult result =
      session.run([&](const SessionStatus& /*status*/) { session.point(at("anna")); });
  EXPECT_EQ(result.close_reason, "duration");
  EXPECT_THAT(result.last.last_problem, testing::HasSubstr("where people point is recorded no more"));
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.segments("pointing"), SizeIs(1));
  ASSERT_THAT(recorded.gaps("pointing"), SizeIs(1));
  EXPECT_EQ(recorded.gaps("pointing")[0].span.start_ns, recorded.segments("pointing")[0].span.end_ns);
  EXPECT_THAT(recorded.gaps_but_overload("room"), IsEmpty());
  std::uint64_t pictures = 0;
  for (const archive::SegmentEntry& segment : recorded.segments("room")) pictures += segment.frames;
  EXPECT_EQ(pictures, 15U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

}  // namespace
}  // namespace kiroku::recorder
