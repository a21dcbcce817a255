#include "archive/verify/stream_rules.h"

#include <algorithm>
#include <optional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

StreamInfo room() { return {"room", "video", "video/mp2t", "x", "mpeg2", "", {}, "arrival", "ts"}; }
StreamInfo monitor() {
  return {"room", "vitals", std::string(kLinesMedia), "x", "jsonl", "", {}, "arrival", "jsonl"};
}

SegmentEntry segment(std::uint64_t index, Span span, const std::string& extension = "ts") {
  SegmentEntry entry;
  entry.stream = "room";
  entry.index = index;
  entry.file.file = segment_path("room", index, extension);
  entry.span = span;
  const bool is_film = extension == "ts";
  entry.first_pts = is_film              ? (span.start_ns * 9 + 50'000) / 100'000
                    : extension == "mkv" ? span.start_ns / kMs
                                         : span.start_ns;
  entry.time_base = is_film ? "1/90000" : extension == "mkv" ? "1/1000" : "1/1000000000";
  entry.frames = 1;
  return entry;
}

std::vector<std::string> holes_of(FindingList& findings) {
  std::vector<std::string> texts;
  for (const Finding& each : findings.take()) {
    if (each.code == "segment-hole") {
      texts.push_back(each.text);
    }
  }
  return texts;
}

/// What is left of a hole, as docs/reference/format.md says it: a gap that begins within the tolerance goes
/// on.
Span left_of(Span hole, const std::vector<Span>& gaps) {
  for (bool moved = true; moved;) {
    moved = false;
    for (const Span& gap : gaps) {
      if (gap.start_ns <= hole.start_ns + kSeamToleranceNs && gap.end_ns > hole.start_ns) {
        hole.start_ns = gap.end_ns;
        moved = true;
      }
    }
  }
  return hole;
}

TEST(StreamRules, GapsThatAddUpToMoreThanANumberHoldsAreNoShortGap) {
  constexpr std::int64_t kLongest = (std::int64_t{1} << 53U) - 1;
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t entry = 1; entry <= 1'300; ++entry) {
    rules.take(GapEntry{"room", {0, kLongest}, GapCause::kSignalLost, false}, entry);
  }
  rules.finish();
  EXPECT_EQ(rules.report().gap_ns, INT64_MAX);
}

// Else whoever holds the device key could have pictures missing and say that only a microphone was.
TEST(StreamRules, AGapOfSoundExcusesNoPictures) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  rules.take(segment(0, {0, 10 * kMs}), 1);
  SegmentEntry cut = segment(1, {10 * kMs, 20 * kMs});
  cut.complete = false;
  cut.file.file += ".part";
  rules.take(cut, 2);
  rules.take(GapEntry{"room", {20 * kMs, 5'000 * kMs}, GapCause::kSignalLost, true}, 3);
  rules.take(segment(2, {5'000 * kMs, 5'010 * kMs}), 4);
  rules.finish();
  std::vector<std::string> codes;
  for (const Finding& each : findings.take()) codes.push_back(each.code);
  EXPECT_THAT(codes, testing::IsSupersetOf({"sound-gap", "segment-hole", "segment-cut-unexplained"}));
  EXPECT_THAT(codes, testing::Not(testing::Contains("gap")));
}

// A gap may be entered before the segment in front of it: an excerpt whose lines begin in between shows none.
TEST(StreamRules, APauseBeforeAnExcerptsLinesIsNotShownToBeAHole) {
  for (const std::int64_t begin_ms : {40, 20}) {
    FindingList findings;
    StreamRules rules(room(), false, findings);
    SegmentEntry cut = segment(5, {10 * kMs, 20 * kMs});
    cut.complete = false;
    cut.file.file += ".part";
    rules.take(cut, 50);
    rules.take(segment(6, {40 * kMs, 50 * kMs}), 51);
    rules.finish(std::nullopt, begin_ms * kMs);
    std::vector<std::string> codes;
    for (const Finding& each : findings.take()) codes.push_back(each.code);
    EXPECT_THAT(codes, testing::UnorderedElementsAre(
                           "segment-incomplete", begin_ms == 40 ? "excerpt-range-short" : "segment-hole"));
  }
}

TEST(StreamRules, LeavesOfAHoleWhatNoGapGoesOnOver) {
  std::mt19937_64 random(3);
  const auto number = [&](std::uint64_t below) { return static_cast<std::int64_t>(random() % below); };
  int covered = 0;
  int open = 0;
  for (int round = 0; round < 3'000; ++round) {
    FindingList findings;
    StreamRules rules(room(), true, findings);
    std::vector<Span> gaps;
    const std::int64_t count = number(12);
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t start_ns = number(40) * kMs / 2;
      gaps.push_back({start_ns, start_ns + number(10) * kMs / 2});
      rules.take(GapEntry{"room", gaps.back(), GapCause::kOverload}, 0);
    }
    const Span hole{number(10) * kMs / 2, 10 * kMs + number(20) * kMs / 2};
    rules.take(segment(0, {0, hole.start_ns}), 1);
    rules.take(segment(1, {hole.end_ns, hole.end_ns}), 2);
    rules.finish();
    const Span left = left_of(hole, gaps);
    const std::vector<std::string> told = holes_of(findings);
    if (left.end_ns - left.start_ns <= kSeamToleranceNs) {
      ++covered;
      EXPECT_THAT(told, testing::IsEmpty());
    } else {
      ++open;
      const std::string us = std::to_string(left.start_ns / 1'000);
      const std::string from = "from 0." + std::string(6 - us.size(), '0') + us + " s to";
      EXPECT_THAT(told, testing::ElementsAre(testing::HasSubstr(from)));
    }
  }
  EXPECT_GT(covered, 100);
  EXPECT_GT(open, 100);
}

// A walk over all gaps for each would take a million million steps: no machine does that before this test's
// time is over.
TEST(StreamRules, FindsTheWayThroughAMillionGapsInWhateverOrder) {
  constexpr std::int64_t kGaps = 1'000'000;
  FindingList findings;
  StreamRules rules(room(), true, findings);
  rules.take(segment(0, {0, kMs}), 0);
  for (std::int64_t i = kGaps; i > 0; --i) {
    rules.take(GapEntry{"room", {i * kMs, (i + 1) * kMs}, GapCause::kOverload}, 1);
  }
  rules.take(segment(1, {(kGaps + 1) * kMs, (kGaps + 2) * kMs}), 2);
  rules.finish();
  EXPECT_THAT(holes_of(findings), testing::IsEmpty());
}

TEST(StreamRules, TellsWhatAMillionEntriesEraseAndAHundredThousandHoles) {
  constexpr std::uint64_t kRanges = 1'000'000;
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < kRanges; ++i) {
    rules.take(ErasedEntry{"room", 3 * (kRanges - i), 3 * (kRanges - i) + 1, "p"}, i);
  }
  std::uint64_t erased = 0;
  for (std::uint64_t index = 0; index < 3 * kRanges; ++index) {
    erased += rules.erased(index) ? 1U : 0U;
  }
  EXPECT_EQ(erased, 2 * (kRanges - 1));
  for (std::int64_t i = 0; i < 100'000; ++i) {
    rules.take(GapEntry{"room", {(4 * i + 1) * kMs, (4 * i + 2) * kMs}, GapCause::kOverload}, 1);
    rules.take(segment(static_cast<std::uint64_t>(i), {4 * i * kMs, (4 * i + 1) * kMs}), 2);
  }
  rules.finish();
  EXPECT_EQ(holes_of(findings).size(), 1'000U) << "the rest is counted";
}

TEST(StreamRules, LetsAFileBeReadOnce) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  EXPECT_TRUE(rules.take(segment(0, {0, kMs}), 0));
  EXPECT_TRUE(rules.take(segment(1, {kMs, 2 * kMs}), 1));
  EXPECT_FALSE(rules.take(segment(0, {2 * kMs, 3 * kMs}), 2)) << "read already";
  SegmentEntry part = segment(1, {3 * kMs, 4 * kMs});
  part.file.file += kPartSuffix;
  part.complete = false;
  EXPECT_TRUE(rules.take(part, 3)) << "another file";
  EXPECT_FALSE(rules.take(part, 4));
  EXPECT_EQ(findings.worst(), Severity::kTampered) << "each repetition is out of order";
}

TEST(StreamRules, KeepsNoLongTextOfWhatIsErasedOrCutOff) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  SegmentEntry part = segment(0, {0, kMs});
  part.file.file = std::string(1'000'000, 'f');
  part.complete = false;
  EXPECT_FALSE(rules.take(part, 0));
  EXPECT_TRUE(rules.take(segment(1, {kMs, 2 * kMs}), 1));
  for (const Finding& each : findings.take()) {
    EXPECT_LE(each.file.size() + each.text.size(), 2'000U);
  }
}

/// What is found, as codes, of a case of a minute of which one stream has this recorded, in segments of 10 s,
/// and these gaps.
std::vector<std::string> codes_of(const StreamInfo& info, const std::vector<Span>& segments,
                                  const std::vector<Span>& gaps, std::int64_t longest_ns = 10 * kSecond) {
  FindingList findings;
  StreamRules rules(info, true, findings);
  std::uint64_t index = 0;
  for (const Span& recorded : segments) {
    for (std::int64_t start_ns = recorded.start_ns; start_ns < recorded.end_ns; start_ns += longest_ns) {
      const Span span{start_ns, std::min(start_ns + longest_ns, recorded.end_ns)};
      SegmentEntry entry = segment(index, span);
      entry.frames = static_cast<std::uint64_t>((span.end_ns - span.start_ns) / (40 * kMs));
      rules.take(entry, index++);
    }
  }
  for (const Span& gap : gaps) {
    rules.take(GapEntry{info.name, gap, GapCause::kSignalLost}, 9);
  }
  rules.finish(Span{0, 60 * kSecond});
  std::vector<std::string> codes;
  for (const Finding& each : findings.take()) {
    if (each.code != "gap") {
      codes.push_back(each.code);
    }
  }
  return codes;
}

TEST(StreamRules, DemandsAGapWhereACameraHasNothingAtTheBeginningOrTheEnd) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  EXPECT_THAT(codes_of(room(), {}, {}), ElementsAre("stream-empty"));
  EXPECT_THAT(codes_of(room(), {{30 * kSecond, 31 * kSecond}}, {}),
              ElementsAre("stream-begins-late", "stream-ends-early"));
  EXPECT_THAT(codes_of(room(), {}, {{0, 5 * kSecond}}), ElementsAre("stream-ends-early"));
  EXPECT_THAT(codes_of(room(), {{0, 40 * kSecond}}, {{45 * kSecond, 60 * kSecond}}),
              ElementsAre("stream-ends-early"))
      << "a gap that does not go on from its end";
  // Stated, or as long as a recorder takes to begin and to close.
  EXPECT_THAT(codes_of(room(), {}, {{0, 58 * kSecond}}), IsEmpty());
  EXPECT_THAT(
      codes_of(room(), {{30 * kSecond, 31 * kSecond}}, {{0, 30 * kSecond}, {31 * kSecond, 60 * kSecond}}),
      IsEmpty());
  EXPECT_THAT(codes_of(room(), {{1 * kSecond, 55 * kSecond}}, {}), IsEmpty());
}

/// Of an excerpt that states [from, to) seconds: the stream's segments, the first of the given index, and its
/// gaps, all in seconds; `closed` at 60 s.
std::vector<std::string> codes_of_part(std::vector<Span> segments, std::uint64_t index,
                                       const std::vector<Span>& gaps, Span stated, bool closed,
                                       bool from_open = false, const StreamInfo& info = room()) {
  FindingList findings;
  StreamRules rules(info, false, findings);
  if (from_open) rules.begin_at_open();
  std::uint64_t entry = 10;
  for (const Span& each : segments) {
    rules.take(segment(index++, {each.start_ns * kSecond, each.end_ns * kSecond}), entry++);
  }
  for (const Span& each : gaps) {
    rules.take(
        GapEntry{"room", {each.start_ns * kSecond, each.end_ns * kSecond}, GapCause::kSignalLost, false},
        entry++);
  }
  rules.finish();
  rules.check_stated_time({stated.start_ns * kSecond, stated.end_ns * kSecond},
                          {0, 0, closed ? std::optional(60 * kSecond) : std::nullopt, std::nullopt});
  std::vector<std::string> codes;
  for (const Finding& each : findings.take()) {
    const bool of_its_own =
        each.code == "gap" || each.code == "segments-sparse" || each.code == "segment-too-long";
    if (!of_its_own) codes.push_back(each.code);
  }
  return codes;
}

// An excerpt's maker writes any numbers.
TEST(StreamRules, OfATimeThatEndsBeforeRecordingBeganNothingIsDemanded) {
  FindingList findings;
  StreamRules rules(room(), false, findings);
  rules.begin_at_open();
  rules.finish();
  rules.check_stated_time({INT64_MIN, INT64_MIN + 1}, {0, 5 * kSecond, std::nullopt, std::nullopt});
  EXPECT_TRUE(findings.take().empty());
}

TEST(StreamRules, DemandsOfTheTimeOfAnExcerptWhatACaseMustHave) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  const auto is_short = ElementsAre("excerpt-range-short");
  const auto ends_early = ElementsAre("stream-ends-early");
  // Lines that begin behind the stream's first segment show nothing of the time before theirs.
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {}, {15, 28}, false), is_short);
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {}, {15, 18}, false), is_short) << "within the hole";
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {}, {20, 28}, false), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {{14, 20}}, {15, 28}, false), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {{14, 19}}, {15, 28}, false), is_short);
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {{14, 19}}, {15, 19}, false), IsEmpty()) << "all of it is stated";
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {{16, 20}}, {15, 28}, false), is_short);
  // A case may begin 2 s late, whatever part of them the excerpt states.
  EXPECT_THAT(codes_of_part({{2, 9}}, 0, {}, {0, 8}, false), IsEmpty());
  EXPECT_THAT(codes_of_part({{3, 9}}, 0, {}, {2, 8}, false), is_short);
  EXPECT_THAT(codes_of_part({{3, 9}}, 0, {}, {2, 8}, false, true), ElementsAre("stream-begins-late"));
  EXPECT_THAT(codes_of_part({{3, 9}}, 0, {}, {3, 8}, false, true), IsEmpty());
  EXPECT_THAT(codes_of_part({{33, 39}}, 0, {{0, 32}}, {5, 35}, false), IsEmpty());
  // And end 10 s early.
  EXPECT_THAT(codes_of_part({{20, 50}}, 3, {}, {25, 60}, true), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 49}}, 3, {}, {25, 60}, true), ends_early);
  EXPECT_THAT(codes_of_part({{20, 49}}, 3, {}, {55, 58}, true), ends_early);
  EXPECT_THAT(codes_of_part({{20, 49}}, 3, {}, {25, 49}, true), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 49}}, 3, {{49, 55}}, {25, 60}, true), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {{30, 45}}, {25, 60}, true), ends_early);
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {{30, 45}}, {25, 45}, true), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 49}}, 3, {}, {25, 900}, true), ends_early) << "time beyond the case";
  // Of a stream without a segment among the lines.
  EXPECT_THAT(codes_of_part({}, 0, {}, {25, 30}, true), is_short);
  EXPECT_THAT(codes_of_part({}, 0, {}, {25, 30}, true, true), ElementsAre("stream-empty"));
  EXPECT_THAT(codes_of_part({}, 0, {{10, 60}}, {25, 30}, true), IsEmpty());
  EXPECT_THAT(codes_of_part({}, 0, {{10, 60}}, {5, 30}, true), is_short);
  EXPECT_THAT(codes_of_part({}, 0, {{10, 45}}, {25, 50}, true), ends_early);
  EXPECT_THAT(codes_of_part({}, 0, {{0, 60}}, {25, 30}, true, true), IsEmpty());
  // Nothing of marks and of files.
  StreamInfo marks = room();
  marks.kind = "events";
  marks.media = kLinesMedia;
  EXPECT_THAT(codes_of_part({}, 0, {}, {25, 30}, true, false, marks), IsEmpty());
  StreamInfo file = room();
  file.timing = "source";
  EXPECT_THAT(codes_of_part({}, 0, {}, {25, 30}, true, false, file), IsEmpty());
  EXPECT_THAT(codes_of_part({}, 0, {}, {25, 30}, true, true, file), ElementsAre("stream-empty"));
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {}, {15, 28}, true, false, file), IsEmpty());
  EXPECT_THAT(codes_of_part({{20, 30}}, 0, {}, {15, 28}, false, false, file), ElementsAre("stream-shorter"));
  EXPECT_THAT(codes_of_part({{20, 30}}, 3, {}, {25, 31}, true, false, file), ElementsAre("stream-shorter"));
}

// No longer than a silence may be, and nothing else lies in the excerpt.
TEST(StreamRules, DemandsAPictureInTheTimeOfAnExcerpt) {
  const auto codes = [](Span stated) {
    FindingList findings;
    StreamRules rules(room(), false, findings);
    for (std::uint64_t i = 10; i < 18; ++i) {
      const auto at = static_cast<std::int64_t>(i) * kSecond;
      SegmentEntry entry = segment(i, {at, at + kSecond});
      entry.frames = i >= 12 && i < 16 ? 0 : 1;
      rules.take(entry, i);
    }
    rules.finish(std::nullopt, 10 * kSecond);
    rules.check_stated_time(stated, {10 * kSecond, 0, std::nullopt, std::nullopt});
    std::vector<std::string> found;
    for (const Finding& each : findings.take()) {
      if (each.code != "segments-sparse") found.push_back(each.code);
    }
    return found;
  };
  EXPECT_THAT(codes({13 * kSecond, 15 * kSecond}), testing::ElementsAre("segments-empty"));
  EXPECT_THAT(codes({12 * kSecond, 16 * kSecond}), testing::ElementsAre("segments-empty"));
  EXPECT_THAT(codes({11 * kSecond, 15 * kSecond}), testing::IsEmpty()) << "a second's pictures are there";
  EXPECT_THAT(codes({13 * kSecond, 17 * kSecond}), testing::IsEmpty());
}

TEST(StreamRules, TellsOfAGapThatLastsBeyondTheCasesEnd) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  const std::vector<Span> recorded{{0, 55 * kSecond}};
  EXPECT_THAT(codes_of(room(), recorded, {{55 * kSecond, 36'000 * kSecond}}), ElementsAre("gap-beyond-end"));
  EXPECT_THAT(codes_of(room(), recorded, {{55 * kSecond, 62 * kSecond}}), IsEmpty()) << "as clocks differ";
  EXPECT_THAT(codes_of(room(), recorded, {{55 * kSecond, 63 * kSecond}}), ElementsAre("gap-beyond-end"));

  // A film that is read faster than time passes has pictures, and holes, beyond the case's end.
  StreamInfo film = room();
  film.timing = "source";
  EXPECT_THAT(codes_of(film, {{0, 80 * kSecond}}, {{75 * kSecond, 80 * kSecond}}), IsEmpty());
  EXPECT_THAT(codes_of(film, {{0, 80 * kSecond}}, {{80 * kSecond, 90 * kSecond}}),
              ElementsAre("gap-beyond-end"));

  // Of sound alike.
  FindingList findings;
  StreamRules rules(room(), true, findings);
  rules.take(GapEntry{"room", {0, 36'000 * kSecond}, GapCause::kSignalLost, true}, 7);
  rules.finish(Span{0, 60 * kSecond});
  const std::vector<Finding> found = findings.take();
  EXPECT_TRUE(std::ranges::any_of(
      found, [](const Finding& each) { return each.code == "gap-beyond-end" && each.entry == 7U; }));
}

// Whoever reads the gap believes that there is no film of it.
TEST(StreamRules, TellsOfPicturesInTimeThatAGapSaysWasNotRecorded) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  const std::vector<Span> recorded{{0, 60 * kSecond}};
  EXPECT_THAT(codes_of(room(), recorded, {{5 * kSecond, 25 * kSecond}}), ElementsAre("segment-within-gap"));
  EXPECT_THAT(codes_of(room(), recorded, {{10 * kSecond, 15 * kSecond}, {15 * kSecond, 20 * kSecond}}),
              ElementsAre("segment-within-gap"))
      << "two that touch are one";
  EXPECT_THAT(codes_of(room(), recorded, {{11 * kSecond, 29 * kSecond}}), IsEmpty())
      << "none lies wholly within";

  FindingList findings;
  StreamRules rules(room(), true, findings);
  SegmentEntry empty;
  empty.stream = "room";
  empty.file.file = segment_path("room", 0, "ts");
  empty.span = {0, kSecond};
  rules.take(empty, 1);
  rules.take(GapEntry{"room", {0, kSecond}, GapCause::kOverload}, 2);
  rules.finish();
  for (const Finding& each : findings.take()) EXPECT_NE(each.code, "segment-within-gap") << "it has none";
}

// A reader believes that there was film once, and that a rule removed it.
TEST(StreamRules, WhatWasNeverRecordedWasNotErased) {
  const auto erased = [](std::uint64_t first, std::uint64_t last, bool whole_case) {
    FindingList findings;
    StreamRules rules(room(), whole_case, findings);
    for (std::uint64_t i = 0; i < 4; ++i) {
      SegmentEntry segment;
      segment.stream = "room";
      segment.index = i;
      segment.file.file = segment_path("room", i, "ts");
      segment.span = {static_cast<std::int64_t>(i) * kSecond, static_cast<std::int64_t>(i + 1) * kSecond};
      rules.take(segment, i + 1);
    }
    rules.take(ErasedEntry{"room", first, last, "p"}, 9);
    std::string found;
    for (const Finding& each : findings.take()) {
      if (each.code.find("erased") != std::string::npos) found += each.code + ": " + each.text + "\n";
    }
    return found;
  };
  EXPECT_THAT(erased(0, 3, true), testing::StartsWith("segments-erased: 4 segments of room (0 to 3)"));
  EXPECT_THAT(erased(4, 900, true), testing::StartsWith("erased-never-recorded: entry 9"));
  EXPECT_THAT(erased(4, 900, true), testing::Not(testing::HasSubstr("segments-erased")));
  EXPECT_THAT(erased(2, 900, true),
              testing::AllOf(testing::HasSubstr("erased-never-recorded: entry 9"),
                             testing::HasSubstr("segments-erased: 2 segments of room (2 to 3)")));
  EXPECT_THAT(erased(4, 900, false), testing::Not(testing::HasSubstr("never")))
      << "an excerpt does not show how many there are";
}

TEST(StreamRules, DemandsNothingOfMarksAndOfAFileOnlyThatItHasSomething) {
  StreamInfo marks = room();
  marks.kind = "events";
  EXPECT_THAT(codes_of(marks, {}, {}), testing::ElementsAre("stream-empty")) << "no pictures are marks";
  marks.media = kLinesMedia;
  EXPECT_THAT(codes_of(marks, {}, {}), testing::IsEmpty());
  StreamInfo file = room();
  file.timing = "source";
  EXPECT_THAT(codes_of(file, {{20 * kSecond, 30 * kSecond}}, {}), testing::ElementsAre("stream-shorter"));
  EXPECT_THAT(codes_of(file, {{1 * kSecond, 55 * kSecond}}, {}), testing::IsEmpty());
  EXPECT_THAT(codes_of(file, {}, {}), testing::ElementsAre("stream-empty"));
}

/// The texts of "segments-sparse".
std::vector<std::string> sparse_of(StreamRules& rules, FindingList& findings) {
  rules.finish();
  std::vector<std::string> texts;
  for (const Finding& each : findings.take()) {
    if (each.code == "segments-sparse") {
      texts.push_back(each.text);
    }
  }
  return texts;
}

TEST(StreamRules, CountsWhatASegmentLacksAgainstTheRateOfItsStream) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < 10; ++i) {
    const auto at_ns = static_cast<std::int64_t>(i) * 2 * kSecond;
    SegmentEntry entry = segment(i, {at_ns, at_ns + 2 * kSecond});
    entry.frames = i == 4 ? 8 : i == 6 ? 45 : 50;
    rules.take(entry, i);
  }
  EXPECT_THAT(sparse_of(rules, findings),
              testing::ElementsAre(
                  testing::AllOf(testing::HasSubstr("1 of the segments of room hold fewer frames"),
                                 testing::HasSubstr("about 42 fewer; segment 4 holds 8 in 2.000000 s"))));
}

TEST(StreamRules, WhatWasDroppedAndStatedIsNotCountedAgain) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < 3; ++i) {
    SegmentEntry entry =
        segment(i, {static_cast<std::int64_t>(i) * kSecond, (static_cast<std::int64_t>(i) + 1) * kSecond});
    entry.frames = i == 1 ? 1 : 25;
    entry.dropped = i == 1 ? 24 : 0;
    rules.take(entry, i);
  }
  EXPECT_THAT(sparse_of(rules, findings), testing::IsEmpty());
}

TEST(StreamRules, TellsOfAMonitorAndOfACameraThatSaidNothing) {
  for (const StreamInfo& info : {room(), monitor()}) {
    FindingList findings;
    StreamRules rules(info, true, findings);
    SegmentEntry empty = segment(0, {0, kSecond});
    empty.frames = 0;
    rules.take(empty, 0);
    EXPECT_THAT(
        sparse_of(rules, findings),
        testing::ElementsAre(testing::HasSubstr("none of the 1 segments of room holds a " +
                                                std::string(info.kind == "video" ? "frame" : "sample"))));
  }
}

TEST(StreamRules, TellsOfASegmentThatNoRecorderWrites) {
  EXPECT_THAT(codes_of(room(), {{0, 60 * kSecond}}, {}, 11 * kSecond), testing::IsEmpty());
  EXPECT_THAT(codes_of(room(), {{0, 60 * kSecond}}, {}, 30 * kSecond),
              testing::ElementsAre("segment-too-long", "segment-too-long"));
}

// Nobody knows when what recovery found was recorded, but recovery bounds it.
TEST(StreamRules, TellsOfAFoundSegmentThatNoRecoveryStates) {
  StreamInfo file = room();
  file.timing = "source";
  StreamInfo marks = monitor();
  marks.kind = "events";
  for (const StreamInfo& info : {room(), monitor(), file, marks}) {
    for (const std::int64_t length : {10 * kSecond, 12 * kSecond}) {
      FindingList findings;
      StreamRules rules(info, true, findings);
      rules.take_recovered();
      SegmentEntry found = segment(0, {0, length});
      found.file.file = segment_path("room", 0, info.extension);
      found.counted = false;
      rules.take(found, 1);
      std::vector<std::string> codes;
      for (const Finding& each : findings.take()) codes.push_back(each.code);
      EXPECT_EQ(std::ranges::count(codes, "segment-too-long"), length > 10 * kSecond ? 1 : 0) << info.kind;
    }
  }
}

// Else a case could state as many frames as it likes by the rest that is left.
TEST(StreamRules, CountsThatAddUpToMoreThanANumberHoldsAreNoFew) {
  constexpr std::uint64_t kMost = (std::uint64_t{1} << 53U) - 1;
  constexpr std::uint64_t kSegments = 2'049;
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < kSegments; ++i) {
    const auto at_ns = static_cast<std::int64_t>(i) * kSecond;
    SegmentEntry entry = segment(i, {at_ns, at_ns + kSecond});
    entry.frames = entry.dropped = entry.file.bytes = kMost;
    rules.take(entry, i);
  }
  EXPECT_EQ(rules.report().frames, UINT64_MAX);
  const std::uint64_t rest = kSegments * kMost;  // of what a number holds
  const StreamTotal stated{kSegments, rest, rest, rest};
  rules.check_totals(&stated, kSegments);
  std::vector<std::string> codes;
  for (const Finding& each : findings.take()) codes.push_back(each.code);
  EXPECT_THAT(codes, testing::ElementsAre("totals-differ"));
}

// An excerpt's maker chooses its lines, and `close` says how many segments the case has.
TEST(StreamRules, TotalsAreNoLessThanThePartThatIsShown) {
  const auto codes = [](std::optional<StreamTotal> stated) {
    FindingList findings;
    StreamRules rules(room(), false, findings);
    for (std::uint64_t i = 2; i < 4; ++i) {
      const auto at_ns = static_cast<std::int64_t>(i) * kSecond;
      SegmentEntry entry = segment(i, {at_ns, at_ns + kSecond});
      entry.frames = entry.dropped = entry.file.bytes = 5;
      rules.take(entry, i);
    }
    rules.check_totals(stated ? &*stated : nullptr, 9);
    std::vector<std::string> found;
    for (const Finding& each : findings.take()) found.push_back(each.code);
    return found;
  };
  EXPECT_THAT(codes(StreamTotal{4, 10, 10, 10}), testing::IsEmpty());
  EXPECT_THAT(codes(StreamTotal{99, 900, 900, 900}), testing::IsEmpty());
  for (const auto& stated :
       {std::optional(StreamTotal{3, 10, 10, 10}), std::optional(StreamTotal{4, 9, 10, 10}),
        std::optional(StreamTotal{4, 10, 9, 10}), std::optional(StreamTotal{4, 10, 10, 9}),
        std::optional<StreamTotal>()}) {
    EXPECT_THAT(codes(stated), testing::ElementsAre("totals-differ"));
  }
}

// What a stream is called is chosen by whoever holds the device key.
TEST(StreamRules, JudgesByWhatFilesHoldAndByNoNameOfTheStream) {
  for (const std::string kind : {"audio", "events", "vitals"}) {
    StreamInfo camera = room();
    camera.kind = kind;
    EXPECT_THAT(codes_of(camera, {{0, 60 * kSecond}}, {}, 30 * kSecond),
                testing::ElementsAre("segment-too-long", "segment-too-long"))
        << kind;
    FindingList findings;
    StreamRules rules(camera, true, findings);
    for (std::uint64_t i = 0; i < 3; ++i) {
      const auto at_ns = static_cast<std::int64_t>(i) * 10 * kSecond;
      SegmentEntry entry = segment(i, {at_ns, at_ns + 10 * kSecond});
      entry.frames = i == 1 ? 8 : 250;
      rules.take(entry, i);
    }
    EXPECT_THAT(sparse_of(rules, findings), testing::ElementsAre(testing::HasSubstr("1 of the segments")))
        << kind;
  }
  EXPECT_THAT(codes_of(monitor(), {{0, 60 * kSecond}}, {}, 30 * kSecond),
              testing::Contains("segment-too-long").Times(2))
      << "a monitor's are no longer";
}

TEST(StreamRules, TellsOfAStreamThatHasLessThanAPictureASecondHoweverShortItsSegments) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < 30; ++i) {
    const auto at_ns = static_cast<std::int64_t>(i) * 2 * kSecond;
    rules.take(segment(i, {at_ns, at_ns + 2 * kSecond}), i);
  }
  EXPECT_THAT(sparse_of(rules, findings), testing::ElementsAre(testing::HasSubstr("hold 30 frames in 60 s")));
}

TEST(StreamRules, TellsOfPicturesThatAreFewerThanOneASecond) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < 6; ++i) {
    const auto at_ns = static_cast<std::int64_t>(i) * 10 * kSecond;
    rules.take(segment(i, {at_ns, at_ns + 10 * kSecond}), i);
  }
  EXPECT_THAT(sparse_of(rules, findings), testing::ElementsAre(testing::HasSubstr("6 of the segments")));
}

TEST(StreamRules, TellsOfAMonitorThatIsSilentForMoreThanAMinute) {
  for (const int silent : {6, 7}) {
    FindingList findings;
    StreamRules rules(monitor(), true, findings);
    for (int i = 0; i < 20; ++i) {
      SegmentEntry each =
          segment(static_cast<std::uint64_t>(i), {i * 10 * kSecond, (i + 1) * 10 * kSecond}, "jsonl");
      each.frames = i >= 5 && i < 5 + silent ? 0 : 3;
      rules.take(each, static_cast<std::uint64_t>(i));
    }
    rules.finish();
    std::vector<std::string> texts;
    for (const Finding& each : findings.take()) texts.push_back(each.code + " " + each.text);
    if (silent == 6) {
      EXPECT_THAT(texts, testing::IsEmpty()) << "what sends a value a minute";
    } else {
      EXPECT_THAT(texts, testing::ElementsAre(
                             testing::AllOf(testing::StartsWith("monitor-silent "),
                                            testing::HasSubstr("from 50.000000 s to 120.000000 s"))));
    }
  }
}

std::vector<std::string> codes_in(FindingList& findings) {
  std::vector<std::string> codes;
  for (const Finding& each : findings.take()) codes.push_back(each.code);
  return codes;
}

/// What is said of pictures in [0, 10) seconds, behind which come segments of that length without one until
/// `end_ns`, each so far behind the one before it, and then again pictures; with these gaps.
std::vector<std::string> codes_of_blind(std::int64_t length_ns, std::int64_t end_ns,
                                        const std::vector<Span>& gaps = {}, std::int64_t apart_ns = 0,
                                        bool complete = true) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  std::uint64_t index = 0;
  const auto take = [&](Span span, std::uint64_t frames, bool is_whole) {
    SegmentEntry entry = segment(index++, span);
    entry.frames = frames;
    entry.complete = is_whole;
    if (!is_whole) entry.file.file += ".part";
    rules.take(entry, index);
    if (!is_whole) rules.take_interruption();
  };
  for (std::int64_t at = 0; at < 10; ++at) take({at * kSecond, (at + 1) * kSecond}, 25, true);
  for (std::int64_t at = 10 * kSecond; at < end_ns; at += length_ns + apart_ns) {
    take({at + apart_ns, at + apart_ns + length_ns}, 0, complete);
  }
  for (int i = 0; i < 10; ++i) take({end_ns + i * kSecond, end_ns + (i + 1) * kSecond}, 25, true);
  for (const Span& gap : gaps) rules.take(GapEntry{"room", gap, GapCause::kOverload}, 1);
  rules.finish();
  std::vector<std::string> codes;
  for (const Finding& each : findings.take()) {
    const bool is_other = each.code == "gap" || each.code == "segments-sparse" ||
                          each.code == "segment-incomplete" || each.code == "segment-within-gap";
    if (!is_other) codes.push_back(each.code);
  }
  return codes;
}

// Whoever holds the device key could else state an hour of nothing, a second at a time.
TEST(StreamRules, SegmentsWithoutAPictureAddUp) {
  using testing::ElementsAre;
  using testing::IsEmpty;
  const auto are_empty = ElementsAre("segments-empty");
  EXPECT_THAT(codes_of_blind(kSecond, 16 * kSecond), are_empty);
  EXPECT_THAT(codes_of_blind(kSecond, 15 * kSecond), IsEmpty()) << "a recorder waits for so long";
  EXPECT_THAT(codes_of_blind(10 * kMs, 16 * kSecond), are_empty);
  EXPECT_THAT(codes_of_blind(kSecond, 16 * kSecond, {}, 0, false), are_empty) << "cut off";
  EXPECT_THAT(codes_of_blind(kSecond, 16 * kSecond, {{10 * kSecond, 16 * kSecond}}), IsEmpty());
  EXPECT_THAT(codes_of_blind(kSecond, 17 * kSecond, {{10 * kSecond, 11 * kSecond}}), are_empty);
  EXPECT_THAT(codes_of_blind(kSecond, 17 * kSecond, {{10 * kSecond, 12 * kSecond}}), IsEmpty());
  std::vector<Span> gaps;
  for (std::int64_t at = 10'000; at < 16'000; at += 20) gaps.push_back({at * kMs, at * kMs});
  EXPECT_THAT(codes_of_blind(kSecond, 16 * kSecond, gaps), are_empty) << "gaps of no length";
}

TEST(StreamRules, SegmentsThatLackPicturesOneAfterTheOtherCountTogether) {
  for (const std::uint64_t few : {1U, 2U}) {
    FindingList findings;
    StreamRules rules(room(), true, findings);
    for (std::uint64_t i = 0; i < 10; ++i) {
      const auto at = static_cast<std::int64_t>(i) * kSecond;
      SegmentEntry entry = segment(i, {at, at + kSecond});
      entry.frames = i >= 4 && i < 4 + few ? 5 : 25;
      rules.take(entry, i);
    }
    const std::vector<std::string> texts = sparse_of(rules, findings);
    if (few == 1) {
      EXPECT_THAT(texts, testing::IsEmpty()) << "no more than a second's";
    } else {
      EXPECT_THAT(texts, testing::ElementsAre(
                             testing::AllOf(testing::HasSubstr("2 of the segments of room hold fewer frames"),
                                            testing::HasSubstr("about 40 fewer"))));
    }
  }
}

TEST(StreamRules, SeamsAddUp) {
  const auto is_hole = testing::ElementsAre("segment-hole");
  EXPECT_THAT(codes_of_blind(0, 10 * kSecond + 90 * kMs, {}, kMs), testing::IsEmpty());
  EXPECT_THAT(codes_of_blind(0, 10 * kSecond + 120 * kMs, {}, kMs), is_hole);
  std::vector<Span> gaps;
  for (std::int64_t at = 10'000; at < 10'200; ++at) gaps.push_back({at * kMs, at * kMs});
  EXPECT_THAT(codes_of_blind(0, 10 * kSecond + 200 * kMs, gaps, 200 * kMs), is_hole)
      << "of gaps of no length";
  gaps = {{10 * kSecond, 10 * kSecond + 200 * kMs}};
  EXPECT_THAT(codes_of_blind(0, 10 * kSecond + 200 * kMs, gaps, kMs), testing::IsEmpty()) << "in a gap";
  // What rounds to a millisecond has segments of a second or more, as many as it likes.
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::uint64_t i = 0; i < 1'000; ++i) {
    const auto at = static_cast<std::int64_t>(i) * (kSecond + kMs);
    rules.take(segment(i, {at, at + kSecond}), i);
  }
  rules.finish();
  EXPECT_THAT(holes_of(findings), testing::IsEmpty());
}

// All gaps for each of them would be a million million steps.
TEST(StreamRules, AMillionTimesWithoutAPictureAreJudgedByTheirGapsAtOnce) {
  constexpr std::int64_t kTimes = 300'000;
  FindingList findings;
  StreamRules rules(room(), true, findings);
  for (std::int64_t i = 0; i < kTimes; ++i) {
    SegmentEntry entry = segment(static_cast<std::uint64_t>(i), {0, kTimes * kSecond});
    entry.frames = i % 2 == 0 ? 0 : 1;
    rules.take(entry, 1);
    rules.take(GapEntry{"room", {i * kSecond, i * kSecond + kMs}, GapCause::kOverload}, 2);
  }
  rules.finish();
  std::uint64_t told = 0;
  for (const Finding& each : findings.take()) told += each.code == "segments-empty" ? 1U : 0U;
  EXPECT_EQ(told, 1U);
}

TEST(StreamRules, ASegmentIsNamedByTheProfileThatItStates) {
  FindingList findings;
  StreamRules rules(room(), true, findings);
  const auto take = [&](std::uint64_t index, const std::string& profile, const std::string& extension) {
    const auto at = static_cast<std::int64_t>(index) * 100 * kMs;
    SegmentEntry entry = segment(index, {at, at + 100 * kMs}, extension);
    entry.profile = profile;
    return rules.take(entry, index + 1);
  };
  EXPECT_TRUE(take(0, "", "ts"));
  EXPECT_TRUE(take(1, "lossless", "mkv"));
  EXPECT_TRUE(take(2, "uncompressed", "mkv"));
  EXPECT_TRUE(take(3, "mpeg2", "ts"));
  EXPECT_THAT(codes_in(findings), testing::IsEmpty());
  EXPECT_FALSE(take(4, "", "mkv")) << "nothing says that it is no MPEG-TS";
  EXPECT_FALSE(take(5, "lossless", "ts"));
  EXPECT_FALSE(take(6, "mpeg2", "jsonl"));
  EXPECT_THAT(codes_in(findings),
              testing::ElementsAre("segment-name-differs", "segment-name-differs", "segment-name-differs"));
  EXPECT_TRUE(rules.has_name("segments/room/00000009.mkv.age"));
  EXPECT_FALSE(rules.has_name("segments/room/00000009.jsonl.age"));
}

TEST(StreamRules, WhatHasNoPicturesHasNoProfile) {
  FindingList findings;
  StreamRules rules({"room", "vitals", "application/jsonl", "x", "jsonl", "", {}, "arrival", "jsonl"}, true,
                    findings);
  SegmentEntry entry = segment(0, {0, kMs});
  entry.profile = "lossless";
  entry.file.file = segment_path("room", 0, "mkv");
  EXPECT_FALSE(rules.take(entry, 1));
  EXPECT_THAT(codes_in(findings), testing::ElementsAre("segment-name-differs"));
  EXPECT_FALSE(rules.has_name("segments/room/00000009.mkv.age"));
}

}  // namespace
}  // namespace kiroku::archive
