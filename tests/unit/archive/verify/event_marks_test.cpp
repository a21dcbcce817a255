#include "archive/verify/event_marks.h"

#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/event_line.h"
#include "base/utc_time.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::string marking_line(std::int64_t time_ns, const std::string& text = "clip") {
  return R"({"salt":")" + std::string(64, 'a') + R"(","event":"{\"time_ns\":)" + std::to_string(time_ns) +
         R"(,\"text\":\")" + text + R"(\"}"})";
}

/// A ledger's marks and events segments, in its order, and what comes of comparing them.
class MarksOfALedger {
 public:
  MarksOfALedger& stream() {
    marks_.take_stream();
    return *this;
  }
  MarksOfALedger& mark(const std::string& line, std::int64_t mono_ns) {
    CaseEntry entry;
    entry.at.mono_ns = mono_ns;
    marks_.take_mark({parse_event_line(line)->commitment}, entry, next_++);
    return *this;
  }
  MarksOfALedger& segment(Span span, const std::vector<std::string>& lines, bool complete = true,
                          bool counted = true) {
    SegmentEntry entry;
    entry.file.file = "segments/events/" + std::to_string(next_);
    entry.span = span;
    entry.complete = complete;
    entry.counted = counted;
    marks_.take_segment(entry, next_++);
    EventLines taken;
    for (const std::string& line : lines) taken.add(bytes_of(line + "\n"));
    marks_.take_lines(taken, entry.file.file);
    return *this;
  }
  MarksOfALedger& unopened(Span span) {
    SegmentEntry entry;
    entry.file.file = "segments/events/" + std::to_string(next_);
    entry.span = span;
    marks_.take_segment(entry, next_++);
    return *this;
  }
  MarksOfALedger& recovered(std::int64_t before_ns) {
    marks_.take_recovered(before_ns);
    ++next_;
    return *this;
  }
  std::vector<std::string> codes(const EventsShown& shown = {}) {
    FindingList findings;
    marks_.finish(shown, findings);
    std::vector<std::string> codes;
    for (const Finding& each : findings.take()) codes.push_back(each.code);
    return codes;
  }

 private:
  EventMarks marks_;
  std::uint64_t next_ = 1;
};

EventsShown whole() { return {.is_whole = true, .begins_ns = {}, .stretch = {}}; }
/// An excerpt from 50 s to 100 s whose lines begin at this time.
EventsShown part(std::int64_t begins_ns) {
  return {.is_whole = false, .begins_ns = begins_ns, .stretch = Span{50 * kSecond, 100 * kSecond}};
}

TEST(EventMarks, OfACaseThatWasCutOffALineNeedsItsEntryAllTheSame) {
  const std::string line = marking_line(3 * kSecond);
  EXPECT_THAT(MarksOfALedger().mark(line, 3 * kSecond).segment({0, 5 * kSecond}, {line}).codes(), IsEmpty());
  EXPECT_THAT(MarksOfALedger().segment({0, 5 * kSecond}, {line}).codes(), ElementsAre("event-not-committed"));
  EXPECT_THAT(MarksOfALedger().segment({0, 5 * kSecond}, {line}, false).codes(),
              ElementsAre("event-not-committed"));
}

TEST(EventMarks, OfACaseThatWasCutOffAMarkNeedsItsEventWhereASegmentMustHoldIt) {
  const std::string line = marking_line(3 * kSecond);
  EXPECT_THAT(MarksOfALedger().mark(line, 3 * kSecond).segment({0, 5 * kSecond}, {}).codes(),
              ElementsAre("event-missing"));
  EXPECT_THAT(MarksOfALedger().mark(line, 6 * kSecond).segment({0, 5 * kSecond}, {}).codes(),
              ElementsAre("events-not-compared"))
      << "it was not sealed yet";
  EXPECT_THAT(MarksOfALedger().mark(line, 6 * kSecond).segment({0, 5 * kSecond}, {}).codes(whole()),
              ElementsAre("event-missing"));
  EXPECT_THAT(MarksOfALedger().mark(line, 3 * kSecond).segment({0, 5 * kSecond}, {}, false).codes(),
              ElementsAre("events-not-compared"))
      << "it may be in what was cut off";
}

TEST(EventMarks, OfASegmentThatNobodyOpenedNothingIsSaid) {
  const std::string line = marking_line(3 * kSecond), later = marking_line(7 * kSecond, "cut");
  EXPECT_THAT(MarksOfALedger()
                  .mark(line, 3 * kSecond)
                  .unopened({0, 5 * kSecond})
                  .segment({5 * kSecond, 9 * kSecond}, {})
                  .codes(whole()),
              ElementsAre("events-not-compared"));
  EXPECT_THAT(MarksOfALedger()
                  .unopened({0, 5 * kSecond})
                  .mark(later, 7 * kSecond)
                  .segment({5 * kSecond, 9 * kSecond}, {})
                  .codes(),
              ElementsAre("event-missing"))
      << "the other segment was entered before the mark";
  EXPECT_THAT(MarksOfALedger().mark(line, 3 * kSecond).unopened({0, 5 * kSecond}).codes(whole()), IsEmpty())
      << "another finding says that none was opened";
}

TEST(EventMarks, AMarkOfAWholeCaseWithoutAnySegmentLacksItsEvent) {
  const std::string line = marking_line(3 * kSecond);
  EXPECT_THAT(MarksOfALedger().stream().mark(line, 3 * kSecond).codes(whole()), ElementsAre("event-missing"));
  EXPECT_THAT(MarksOfALedger().stream().mark(line, 3 * kSecond).codes(), ElementsAre("events-not-compared"));
  EXPECT_THAT(MarksOfALedger().stream().mark(line, 60 * kSecond).codes(part(0)), IsEmpty())
      << "an excerpt need not be of events";
  EXPECT_THAT(MarksOfALedger().mark(line, 3 * kSecond).codes(whole()), IsEmpty()) << "no stream is for them";
}

TEST(EventMarks, WhatACrashLeftMayLackTheEntriesOfItsLastMoments) {
  const auto found = [](std::int64_t time_ns) {
    return MarksOfALedger()
        .recovered(30 * kSecond)
        .segment({0, 5 * kSecond}, {marking_line(time_ns)}, true, false)
        .codes();
  };
  EXPECT_THAT(found(20 * kSecond - 1), ElementsAre("event-not-committed"));
  EXPECT_THAT(found(20 * kSecond), ElementsAre("events-not-compared"));
  EXPECT_THAT(MarksOfALedger().segment({0, 5 * kSecond}, {marking_line(kSecond)}, true, false).codes(),
              ElementsAre("events-not-compared"));
}

TEST(EventMarks, AnExcerptIsAskedOfWhatItsLinesShow) {
  const std::string line = marking_line(60 * kSecond);
  const auto alone = [&](std::int64_t begins_ns, std::int64_t start_ns = 0) {
    return MarksOfALedger().segment({start_ns, 70 * kSecond}, {line}).codes(part(begins_ns));
  };
  EXPECT_THAT(alone(59 * kSecond), ElementsAre("event-not-committed"));
  EXPECT_THAT(alone(59 * kSecond + 1), ElementsAre("events-not-compared"));
  EXPECT_THAT(alone(62 * kSecond, 63 * kSecond), ElementsAre("event-not-committed"))
      << "the segment began behind the first line";
  const auto mark = [&](std::int64_t mono_ns) {
    return MarksOfALedger().mark(line, mono_ns).segment({40 * kSecond, 70 * kSecond}, {}).codes(part(0));
  };
  EXPECT_THAT(mark(60 * kSecond), ElementsAre("event-missing"));
  EXPECT_THAT(mark(75 * kSecond), ElementsAre("events-not-compared"));
  EXPECT_THAT(mark(105 * kSecond), IsEmpty()) << "of another time";
}

TEST(EventMarks, TheUtcOfAnEventIsThatOfItsEntry) {
  const UtcTime began = *parse_utc("2026-08-05T09:00:00.000000Z");
  const auto codes = [&](const std::string& utc, std::int64_t step_ns = -1) {
    const std::string line = R"({"salt":")" + std::string(64, 'a') +
                             R"(","event":"{\"time_ns\":3000000000,\"utc\":\")" + utc + R"(\"}"})";
    EventMarks marks;
    CaseEntry entry;
    entry.at = {began + std::chrono::seconds(4), 4 * kSecond};
    marks.take_mark({parse_event_line(line)->commitment}, entry, 1);
    if (step_ns >= 0) marks.take_step(step_ns);
    SegmentEntry segment;
    segment.file.file = "segments/events/0";
    segment.span = {0, 5 * kSecond};
    marks.take_segment(segment, 2);
    EventLines lines;
    lines.add(bytes_of(line + "\n"));
    marks.take_lines(lines, segment.file.file);
    FindingList findings;
    marks.finish({}, findings);
    return findings.has("event-time-differs");
  };
  EXPECT_FALSE(codes("2026-08-05T09:00:03.000000Z"));
  EXPECT_FALSE(codes("2026-08-05T09:00:08.000000Z"));
  EXPECT_TRUE(codes("2026-08-05T09:00:08.000001Z"));
  EXPECT_TRUE(codes("2026-08-05T08:00:03.000000Z"));
  EXPECT_TRUE(codes("yesterday"));
  EXPECT_FALSE(codes("2026-08-05T08:00:03.000000Z", 5 * kSecond)) << "the clock was set in between";
  EXPECT_TRUE(codes("2026-08-05T08:00:03.000000Z", 20 * kSecond));
}

TEST(EventMarks, TheEndOfALineThatWasCutOffIsNoLine) {
  const std::string line = marking_line(3 * kSecond);
  for (const bool is_whole : {true, false}) {
    EventMarks marks;
    CaseEntry entry;
    entry.at.mono_ns = 3 * kSecond;
    marks.take_mark({parse_event_line(line)->commitment}, entry, 1);
    SegmentEntry segment;
    segment.file.file = "segments/events/0";
    segment.span = {0, 5 * kSecond};
    segment.complete = is_whole;
    marks.take_segment(segment, 2);
    EventLines lines;
    lines.add(bytes_of(line + "\n" + line.substr(0, 20)));
    if (is_whole) lines.end();
    marks.take_lines(lines, segment.file.file);
    FindingList findings;
    marks.finish({}, findings);
    EXPECT_EQ(findings.has("event-not-committed"), is_whole);
  }
}

}  // namespace
}  // namespace kiroku::archive
