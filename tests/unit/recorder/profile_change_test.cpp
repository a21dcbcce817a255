// A stream whose pictures are archived in another form from some moment on.
#include <atomic>
#include <sys/stat.h>
#include <thread>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "recorder/segmenter.h"
#include "recorder/session.h"
#include "tests/support/decoded_video.h"
#include "tests/support/pipe_camera.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::decode_video;
using test::RecordedCase;
using test::RecorderBench;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr const char* kCamera = "synthetic:pattern?size=64x48&rate=50";

/// In the order of the segments; each as often as it follows another one.
std::vector<std::string> forms(const RecordedCase& recorded, const std::string& stream = "endoscope") {
  std::vector<std::string> forms;
  for (const archive::SegmentEntry& segment : recorded.segments(stream)) {
    const std::string form = segment.profile.empty() ? "as opened" : segment.profile;
    if (forms.empty() || forms.back() != form) forms.push_back(form);
  }
  return forms;
}

std::vector<nlohmann::json> decisions(const RecordedCase& recorded) {
  std::vector<nlohmann::json> found;
  for (const std::string& line : recorded.lines("events")) {
    const auto event = nlohmann::json::parse(nlohmann::json::parse(line)["event"].get<std::string>());
    if (event["kind"] == "profile") found.push_back(event["profile"]);
  }
  return found;
}

/// Every segment decodes alone to the pictures that its entry states, in the form that it states.
void expect_whole(const RecordedCase& recorded, const std::string& stream = "endoscope") {
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  const auto& open = std::get<archive::OpenEntry>(recorded.entries().front().body);
  for (const archive::SegmentEntry& segment : recorded.segments(stream)) {
    const std::string form = segment.profile.empty() ? open.streams.front().profile : segment.profile;
    EXPECT_THAT(segment.file.file, testing::EndsWith(form == "mpeg2" ? ".ts.age" : ".mkv.age"));
    const auto video = decode_video(recorded.plaintext(segment));
    EXPECT_THAT(video.complaints, IsEmpty());
    ASSERT_THAT(video.frames, SizeIs(segment.frames)) << segment.file.file;
    EXPECT_TRUE(video.frames.front().key);
    EXPECT_EQ(video.frames.front().pts, segment.first_pts);
  }
}

TEST(ProfileChange, GoesThereAndBackWithoutAGapAndWithEachPictureOnce) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", kCamera)};
  Session session(options);
  std::uint64_t frames = 0;
  int asked = 0;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    frames = status.streams.at(0).frames;
    const std::string& now = status.streams.at(0).profile;
    if (asked == 0 && frames >= 10) {
      session.change_profile({{"endoscope"}, Profile::kLossless, "operator", "resection begins"});
      ++asked;
    } else if (asked == 1 && now == "lossless") {
      session.change_profile({{}, Profile::kUncompressed, "footswitch", ""});
      ++asked;
    } else if (asked == 2 && now == "uncompressed") {
      session.change_profile({{}, Profile::kMpeg2, "operator", ""});
      ++asked;
    } else if (asked == 3 && now == "mpeg2") {
      session.stop();
    }
  });
  const RecordedCase recorded = bench.read(result.folder);
  expect_whole(recorded);
  EXPECT_THAT(recorded.gaps("endoscope"), IsEmpty());
  EXPECT_THAT(forms(recorded), ElementsAre("as opened", "lossless", "uncompressed", "as opened"));
  std::uint64_t recorded_frames = 0;
  for (const auto& segment : recorded.segments("endoscope")) {
    recorded_frames += segment.frames;
    EXPECT_EQ(segment.dropped, 0U);
  }
  EXPECT_EQ(recorded_frames, result.last.streams.at(0).frames);
  const std::vector<nlohmann::json> said = decisions(recorded);
  ASSERT_THAT(said, SizeIs(3));
  EXPECT_EQ(said[0],
            nlohmann::json::parse(
                R"({"streams":["endoscope"],"to":"lossless","by":"operator","why":"resection begins"})"));
  EXPECT_EQ(said[1]["by"], "footswitch");
  EXPECT_EQ(said[2]["to"], "mpeg2");
}

TEST(ProfileChange, TheLastOfTwoWithinASecondCounts) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", kCamera)};
  Session session(options);
  bool asked = false;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (!asked && status.streams.at(0).frames >= 5) {
      session.change_profile({{}, Profile::kUncompressed, "operator", ""});
      session.change_profile({{}, Profile::kLossless, "operator", ""});
      asked = true;
    }
    const auto& stream = status.streams.at(0);
    if (asked && stream.profile == "lossless" && stream.profile_to_come.empty()) session.stop();
  });
  const RecordedCase recorded = bench.read(result.folder);
  expect_whole(recorded);
  EXPECT_EQ(forms(recorded).back(), "lossless");
  EXPECT_THAT(recorded.gaps("endoscope"), IsEmpty());
  EXPECT_THAT(decisions(recorded), SizeIs(2));
}

// Each change costs a file and lines of the ledger.
TEST(ProfileChange, WhoPressesAgainAndAgainMakesFewFiles) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.segment_duration = 9s;
  options.video = {bench.stream("endoscope", kCamera)};
  Session session(options);
  std::atomic<bool> over = false;
  std::thread presser([&] {
    for (std::uint64_t seen = 0; !over;) {
      const std::uint64_t frames = session.status().streams.at(0).frames;
      if (std::exchange(seen, frames) == frames) {
        std::this_thread::yield();
        continue;
      }
      for (const Profile profile : {Profile::kUncompressed, Profile::kMpeg2}) {
        try {
          session.change_profile({{}, profile, "footswitch", ""});
        } catch (const Error&) {  // it has that form, or the case has ended
        }
      }
    }
  });
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams.at(0).frames >= 100) session.stop();
  });
  over = true;
  presser.join();
  const RecordedCase recorded = bench.read(result.folder);
  expect_whole(recorded);
  EXPECT_LE(recorded.segments("endoscope").size(), ChangePace::kMostChanges + 2);
}

TEST(ProfileChange, OfASourceThatIsAwayHoldsFromItsNextPictureOn) {
  const RecorderBench bench;
  ASSERT_EQ(::mkfifo((bench / "camera").c_str(), 0600), 0);
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", (bench / "camera").string())};
  test::ReturningCamera camera(bench / "camera", 12);
  Session session(options);
  std::uint64_t before = 0;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    const StreamStatus& stream = status.streams.at(0);
    if (camera.is_away()) {
      // The last pictures of a source that is away may still wait to be recorded.
      const bool all_recorded = stream.frames > 0 && stream.frames == std::exchange(before, stream.frames);
      if (stream.live || !all_recorded) return;
      session.change_profile({{}, Profile::kLossless, "operator", ""});
      camera.come_back();
    } else if (stream.frames < before + 3) {
      EXPECT_TRUE(stream.profile_to_come == "lossless" || stream.profile == "lossless");
    } else {
      session.stop();
    }
  });
  const RecordedCase recorded = bench.read(result.folder);
  expect_whole(recorded);
  EXPECT_THAT(forms(recorded), ElementsAre("as opened", "lossless"));
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, archive::GapCause::kSignalLost);
}

TEST(ProfileChange, ToAFormThatCannotHoldThePicturesCostsNone) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {
      bench.stream("endoscope", "synthetic:pattern?size=4224x16&rate=20", Profile::kUncompressed)};
  Session session(options);
  std::uint64_t before = 0;
  std::string problem;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    const StreamStatus& stream = status.streams.at(0);
    if (before == 0 && stream.frames >= 5) {
      session.change_profile({{}, Profile::kMpeg2, "operator", ""});
      before = stream.frames;
    } else if (before > 0 && stream.frames >= before + 5 && stream.profile_to_come.empty()) {
      problem = status.last_problem;
      session.stop();
    }
  });
  EXPECT_THAT(problem, HasSubstr("goes on as uncompressed"));
  const RecordedCase recorded = bench.read(result.folder);
  expect_whole(recorded);
  EXPECT_THAT(recorded.gaps("endoscope"), IsEmpty());
  EXPECT_THAT(forms(recorded), ElementsAre("as opened"));
  const auto said = decisions(recorded);
  ASSERT_THAT(said, SizeIs(2));
  EXPECT_EQ(said[0]["to"], "mpeg2");
  EXPECT_EQ(said[1]["refused"], "mpeg2");
}

TEST(ProfileChange, OfAPreRollHoldsFromTheCasesBeginningOn) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", kCamera)};
  options.pre_roll = 10s;
  Session session(options);
  EXPECT_THROW(session.change_profile({{}, Profile::kLossless, "operator", ""}), Error);
  bool begun = false;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (!begun && status.streams.at(0).segments >= 2) {
      session.begin({});
      session.decide_profile({{}, Profile::kLossless, "rule mucosa", "the word 'EMR'"});
      begun = true;
    }
    if (status.streams.at(0).profile == "lossless" && status.streams.at(0).segments >= 5) session.stop();
  });
  const RecordedCase recorded = bench.read(result.folder);
  expect_whole(recorded);
  EXPECT_THAT(forms(recorded), ElementsAre("as opened", "lossless"));
  EXPECT_THAT(recorded.gaps("endoscope"), IsEmpty());
}

TEST(ProfileChange, RefusesWhatIsNoChange) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", kCamera)};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0")};
  Session session(options);
  const auto refusal = [&](const ProfileDecision& decision) -> std::string {
    try {
      session.change_profile(decision);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_THAT(refusal({{}, Profile::kMpeg2, "operator", ""}), HasSubstr("archived as mpeg2 already"));
  EXPECT_THAT(refusal({{"room"}, Profile::kLossless, "operator", ""}),
              HasSubstr("'room' is no stream of pictures of this case; there are: endoscope"));
  EXPECT_THAT(refusal({{"vitals"}, Profile::kLossless, "operator", ""}), HasSubstr("no stream of pictures"));
}

}  // namespace
}  // namespace kiroku::recorder
