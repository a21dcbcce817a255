#include "viewer/playback/case_timeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "tests/support/recording.h"
#include "tests/unit/viewer/playback/rewritten_case.h"

namespace kiroku::playback {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

class CaseTimelineTest : public testing::Test {
 protected:
  std::filesystem::path record(const std::vector<std::string>& marks) {
    recorder::SessionOptions options = bench_.options();
    options.video = {bench_.stream("room", "synthetic:pattern?size=64x48&rate=10")};
    options.video[0].recipients = options.event_recipients = reader_.recipients;
    options.duration = 1500ms;
    recorder::Session session(std::move(options));
    std::size_t marked = 0;
    return session
        .run([&](const recorder::SessionStatus& status) {
          const bool is_due = status.now_ns - status.begins_ns >= kFirstMarkNs;
          if (is_due && marked < marks.size()) session.mark(marks[marked++]);
        })
        .folder;
  }

  static constexpr std::int64_t kFirstMarkNs = 150'000'000;
  test::RecorderBench bench_;
  test::Reader reader_ = test::make_reader();
};

TEST_F(CaseTimelineTest, SaysWhatTheLedgerSaysOfTime) {
  const auto folder = record({});
  const Timeline timeline = timeline_of(archive::CaseReader::open(folder), *bench_.options().trust);
  std::int64_t until_ns = 0;
  for (const TimelineSegment& segment : timeline.segments) {
    if (segment.stream != "room") continue;
    EXPECT_GE(segment.span.start_ns, until_ns);
    EXPECT_TRUE(segment.complete);
    EXPECT_FALSE(segment.erased);
    until_ns = segment.span.end_ns;
  }
  EXPECT_GT(until_ns, 1'000'000'000);
  ASSERT_THAT(timeline.tokens, Not(IsEmpty()));
  EXPECT_EQ(timeline.tokens.front().authority, "embedded");
  EXPECT_EQ(timeline.tokens.front().kind, TimelineToken::Kind::kSelfIssued);
  ASSERT_THAT(timeline.checkpoints, Not(IsEmpty()));
  EXPECT_EQ(timeline.checkpoints.front().size, timeline.tokens.front().checkpoint);
  ASSERT_THAT(timeline.brackets, Not(IsEmpty()));
  std::int64_t covered_ns = timeline.brackets.front().start_ns;
  for (const TimelineBracket& bracket : timeline.brackets) {
    EXPECT_EQ(bracket.start_ns, covered_ns) << "without a hole";
    covered_ns = bracket.end_ns;
    const bool bound = bracket.not_before || bracket.not_after;
    EXPECT_EQ(bracket.time, bound ? archive::TimeProof::kSelfIssued : archive::TimeProof::kNone);
  }
  EXPECT_FALSE(timeline.brackets.front().not_before) << "nothing outside was before the first";
  EXPECT_TRUE(timeline.brackets.front().not_after);
}

TEST_F(CaseTimelineTest, TokensAreJudgedByTheRootsThatAreGivenAndNotByWhatStandsInThem) {
  const auto folder = record({});
  const auto reader = archive::CaseReader::open(folder);
  // Nothing is trusted: nobody can say whose tokens these are, and they make no bracket.
  const Timeline unknown = timeline_of(reader, timestamp::TrustStore());
  ASSERT_THAT(unknown.tokens, Not(IsEmpty()));
  for (const TimelineToken& token : unknown.tokens) EXPECT_EQ(token.kind, TimelineToken::Kind::kNotJudged);
  EXPECT_THAT(unknown.brackets, IsEmpty());
  // A token over another checkpoint than its entry names is not judged either.
  const Timeline known = timeline_of(reader, *bench_.options().trust);
  ASSERT_GE(known.tokens.size(), 2U);
  const auto note = [&](std::size_t token) {
    return folder / archive::note_path(known.tokens.at(token).checkpoint);
  };
  std::filesystem::permissions(note(0), std::filesystem::perms::owner_all);
  std::filesystem::copy_file(note(1), note(0), std::filesystem::copy_options::overwrite_existing);
  const Timeline exchanged = timeline_of(reader, *bench_.options().trust);
  EXPECT_EQ(exchanged.tokens[0].kind, TimelineToken::Kind::kNotJudged);
  EXPECT_EQ(exchanged.tokens[1].kind, TimelineToken::Kind::kSelfIssued);
}

TEST_F(CaseTimelineTest, GapsAndErasedSegmentsAreThere) {
  const auto folder = record({});
  const test::RecordedCase recorded(folder, reader_.identities);
  const auto rewritten = test::rewrite_case(bench_ / "rewritten", recorded, reader_.recipients,
                                            [](const archive::SegmentEntry& segment) {
                                              if (segment.stream != "room") return test::Fate::kKept;
                                              return segment.index == 1   ? test::Fate::kLeftOut
                                                     : segment.index == 0 ? test::Fate::kErased
                                                                          : test::Fate::kKept;
                                            });
  const Timeline timeline = timeline_of(archive::CaseReader::open(rewritten), *bench_.options().trust);
  ASSERT_THAT(timeline.gaps, SizeIs(1));
  EXPECT_EQ(timeline.gaps[0].stream, "room");
  EXPECT_TRUE(timeline.segments.at(0).erased);
  EXPECT_FALSE(timeline.segments.at(1).erased);
  EXPECT_THAT(timeline.tokens, IsEmpty());
  EXPECT_THAT(timeline.brackets, IsEmpty());
}

TEST_F(CaseTimelineTest, MarksAreThoseThatWereCommittedTo) {
  const auto folder = record({"clip placed", "鉗子"});
  const CaseMedia media(archive::CaseReader::open(folder), reader_.identities);
  EXPECT_THAT(marks_of(media).marks,
              ElementsAre(Field(&TimelineMark::text, "clip placed"), Field(&TimelineMark::text, "鉗子")));
  EXPECT_GE(marks_of(media).marks[0].time_ns, kFirstMarkNs);
  EXPECT_EQ(marks_of(media).events_lacking, 0U);
  // Without the ledger's commitments (the rewritten case has none) nobody can tell that they were marked.
  const test::RecordedCase recorded(folder, reader_.identities);
  const auto rewritten = test::rewrite_case(bench_ / "rewritten", recorded, reader_.recipients,
                                            [](const archive::SegmentEntry&) { return test::Fate::kKept; });
  EXPECT_THAT(marks_of(CaseMedia(archive::CaseReader::open(rewritten), reader_.identities)).marks, IsEmpty());
}

TEST_F(CaseTimelineTest, EventsWhoseLinesAreNotThereAreCounted) {
  const auto line = [](const std::string& kind) {
    return to_bytes(R"({"salt":")" + std::string(64, '0') + R"(","event":"{\"time_ns\":1,\"kind\":\")" +
                    kind + R"(\",\"text\":\"x\"}"})" + "\n");
  };
  const auto folder = test::record_case(bench_ / "lacking",
                                        {{.name = "events",
                                          .kind = "events",
                                          .media = "application/jsonl",
                                          .segments = {line("subject-missing"), line("mark")},
                                          .units = {1, 1},
                                          .first_is_erased = true}},
                                        reader_.recipients);
  const TimelineMarks found = marks_of(CaseMedia(archive::CaseReader::open(folder), reader_.identities));
  EXPECT_THAT(found.marks, ElementsAre(Field(&TimelineMark::text, "x")));
  EXPECT_EQ(found.events_lacking, 1U);
}

}  // namespace
}  // namespace kiroku::playback
