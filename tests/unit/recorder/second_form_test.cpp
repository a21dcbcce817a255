// The pictures of one source, archived in two forms at once.
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/session.h"
#include "tests/support/decoded_video.h"
#include "tests/support/pipe_camera.h"
#include "tests/support/recording.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::RecordedCase;
using test::RecorderBench;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr const char* kFirst = "endoscope";
constexpr const char* kSecondForm = "endoscope-lossless";

/// A stream of that source as MPEG-2, and its pictures without loss.
std::vector<StreamRequest> both_forms(const RecorderBench& bench, const std::string& source) {
  std::vector<StreamRequest> both{bench.stream(kFirst, source)};
  both.push_back(second_of(both.front(), Profile::kLossless));
  return both;
}

std::vector<std::string> pictures(const RecordedCase& recorded, const std::string& stream) {
  std::vector<std::string> found;
  for (const archive::SegmentEntry& segment : recorded.segments(stream)) {
    const auto video = test::decode_video(recorded.plaintext(segment));
    EXPECT_THAT(video.complaints, IsEmpty());
    EXPECT_THAT(video.frames, SizeIs(segment.frames)) << segment.file.file;
    for (const auto& frame : video.frames) found.push_back(frame.sha256);
  }
  return found;
}

/// Start and end of each segment.
std::vector<std::pair<std::int64_t, std::int64_t>> spans(const RecordedCase& recorded,
                                                         const std::string& stream) {
  std::vector<std::pair<std::int64_t, std::int64_t>> found;
  for (const archive::SegmentEntry& segment : recorded.segments(stream))
    found.emplace_back(segment.span.start_ns, segment.span.end_ns);
  return found;
}

TEST(SecondForm, HoldsThePicturesAndTimesThatAStreamOfItsOwnWould) {
  constexpr const char* kSource = "synthetic:pattern?size=64x48&rate=20&speed=max";
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.duration = 2s;
  options.video = both_forms(bench, kSource);
  const RecordedCase both = bench.record(options);
  options.video = {bench.stream(kFirst, kSource, Profile::kLossless)};
  const RecordedCase lossless = bench.record(options);

  EXPECT_THAT(both.broken_rules(), IsEmpty());
  ASSERT_THAT(pictures(both, kSecondForm), SizeIs(40));
  EXPECT_EQ(pictures(both, kSecondForm), pictures(lossless, kFirst));
  EXPECT_THAT(pictures(both, kFirst), SizeIs(40));
  EXPECT_EQ(spans(both, kFirst), spans(both, kSecondForm));
  const auto streams = both.all<archive::OpenEntry>().at(0).streams;
  EXPECT_EQ(streams.at(0).profile, "mpeg2");
  EXPECT_EQ(streams.at(1).name, kSecondForm);
  EXPECT_EQ(streams.at(1).profile, "lossless");
  EXPECT_EQ(streams.at(1).timing, streams.at(0).timing);
  EXPECT_EQ(streams.at(1).recipients, streams.at(0).recipients);
  EXPECT_EQ(streams.at(1).source, streams.at(0).source + "; the pictures of stream endoscope");
}

TEST(SecondForm, OfASourceThatGoesAndComesHasTheSameGap) {
  const RecorderBench bench;
  ASSERT_EQ(::mkfifo((bench / "camera").c_str(), 0600), 0);
  SessionOptions options = bench.options();
  options.video = both_forms(bench, (bench / "camera").string());
  test::ReturningCamera camera(bench / "camera", 12);
  Session session(options);
  std::uint64_t before = 0;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    const StreamStatus& second = status.streams.at(1);
    EXPECT_EQ(second.stuck, 0U);
    if (camera.is_away()) {
      if (second.frames == 0 || second.live) return;
      before = second.frames;
      camera.come_back();
    } else if (second.frames >= before + 3) {
      session.stop();
    }
  });
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  for (const char* stream : {kFirst, kSecondForm}) {
    ASSERT_THAT(recorded.gaps(stream), SizeIs(1)) << stream;
    EXPECT_EQ(recorded.gaps(stream)[0].cause, archive::GapCause::kSignalLost);
  }
  const archive::Span first = recorded.gaps(kFirst)[0].span, second = recorded.gaps(kSecondForm)[0].span;
  EXPECT_EQ(std::pair(first.start_ns, first.end_ns), std::pair(second.start_ns, second.end_ns));
}

TEST(SecondForm, StaysAsItIsUnlessAChangeNamesIt) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = both_forms(bench, "synthetic:pattern?size=64x48&rate=50");
  Session session(options);
  bool asked = false;
  std::vector<std::string> forms;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams.at(0).frames < 5) return;
    if (!asked) session.change_profile({{}, Profile::kUncompressed, "operator", ""});
    asked = true;
    forms = {status.streams.at(0).profile, status.streams.at(1).profile};
    if (forms.front() == "uncompressed") session.stop();
  });
  EXPECT_THAT(forms, ElementsAre("uncompressed", "lossless"));
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.lines("events"), testing::Contains(HasSubstr(R"(\"streams\":[\"endoscope\"])")))
      << "all would be both";

  std::vector<StreamRequest> requests = options.video;
  apply_decision({{}, Profile::kUncompressed, "rule", ""}, requests);
  EXPECT_EQ(requests[0].video.profile, Profile::kUncompressed);
  EXPECT_EQ(requests[1].video.profile, Profile::kLossless);
  apply_decision({{kSecondForm}, Profile::kMpeg2, "rule", ""}, requests);
  EXPECT_EQ(requests[1].video.profile, Profile::kMpeg2);
}

TEST(SecondForm, IsOfAStreamBeforeItThatHasASource) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  const std::vector<StreamRequest> both = both_forms(bench, "synthetic:pattern?size=64x48");
  const auto refusal = [&]() -> std::string {
    try {
      const Session session(options);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "taken";
  };
  options.video = {both[1], both[0]};
  EXPECT_THAT(refusal(), HasSubstr("no stream before it has that name"));
  options.video = {both[0], both[1], second_of(both[1], Profile::kMpeg2)};
  EXPECT_THAT(refusal(), HasSubstr("and a source of its own"));
  EXPECT_EQ(bench.cases(), 0U);
}

TEST(SecondForm, ThatCannotHoldThePicturesIsRefusedBeforeACaseBegins) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream(kFirst, "synthetic:pattern?size=4224x16&rate=20", Profile::kUncompressed)};
  options.video.push_back(second_of(options.video.front(), Profile::kMpeg2));
  EXPECT_THROW(const Session session(options), UsageError);
  EXPECT_EQ(bench.cases(), 0U);

  // Nobody stands before an unattended recorder: the form that can is recorded.
  for (StreamRequest& stream : options.video) stream.may_be_absent = true;
  options.duration = 500ms;
  options.video.front().source += "&speed=max";
  const RecordedCase recorded = bench.record(options);
  EXPECT_EQ(pictures(recorded, kFirst).size(), 10U);
  EXPECT_THAT(recorded.segments("endoscope-mpeg2"), IsEmpty());
  EXPECT_THAT(recorded.gaps("endoscope-mpeg2"), SizeIs(1));
}

}  // namespace
}  // namespace kiroku::recorder
