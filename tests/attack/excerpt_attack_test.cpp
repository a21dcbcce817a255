// Folders that call themselves an excerpt, made from a sound case by somebody who holds no key: a case
// without its pictures must not come out as intact, and an excerpt never as a case.
#include <algorithm>
#include <regex>
#include <set>
#include <sstream>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/reading/excerpt.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attack_table.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::ExcerptDocument;
using archive::Verdict;
using ::testing::HasSubstr;

constexpr const char* kDocument = "excerpt.json";

std::string streams_json(const std::vector<std::string>& streams) {
  std::string text;
  for (const std::string& each : streams) {
    text += (text.empty() ? "\"" : ",\"") + each + "\"";
  }
  return "[" + text + "]";
}

struct Claim {
  std::int64_t from_ns = 0, to_ns = 7 * kSecond;
  std::vector<std::string> streams;
};

/// excerpt.json written by hand: also what a writer of the format would refuse.
void write_document(AttackedCase& c, const Claim& claim) {
  write_file(c / kDocument, R"({"format":"kiroku-excerpt/1","case":")" + c.folder().filename().string() +
                                R"(","from_ns":)" + std::to_string(claim.from_ns) + R"(,"to_ns":)" +
                                std::to_string(claim.to_ns) + R"(,"streams":)" + streams_json(claim.streams) +
                                R"(,"first_entry":0,"size":)" + std::to_string(c.lines().size()) +
                                R"(,"open_proof":[],"left":[],"earlier":[]})" + "\n");
}

/// Renames the whole ledger to an excerpt's part of one; all proofs are empty, since nothing is left out of
/// it.
void call_it_an_excerpt(AttackedCase& c, const Claim& claim) {
  write_document(c, claim);
  const std::string ledger = read_file(c / "ledger.jsonl");
  write_file(c / "ledger-open.jsonl", ledger.substr(0, ledger.find('\n') + 1));
  fs::rename(c / "ledger.jsonl", c / "ledger-part.jsonl");
  fs::remove(c / "subject.json.age");
}

void remove_segments(AttackedCase& c) { fs::remove_all(c / "segments"); }

/// A stream that pauses from 2 s to 3 s. The gap is entered before the last segment in front of it, and a
/// token between the two: what a slow disk does.
class ExcerptBehindAGap : public ::testing::Test {
 protected:
  ExcerptBehindAGap() {
    SampleCase sample(archive_);
    sample.stamp();
    archive_.now_ns = kSecond + 200'000'000;
    sample.writer().append({sample.segment(0, 0, {0, kSecond})}, archive_.now());
    sample.stamp();
    archive_.now_ns = 3 * kSecond + 100'000'000;
    sample.writer().append(
        {archive::GapEntry{"endoscope", {2 * kSecond, 3 * kSecond}, archive::GapCause::kSignalLost}},
        archive_.now());
    sample.stamp();
    archive_.now_ns += 100'000'000;
    sample.writer().append({sample.segment(0, 1, {kSecond, 2 * kSecond})}, archive_.now());
    archive_.now_ns = 5 * kSecond;
    sample.writer().append(
        {sample.segment(0, 2, {3 * kSecond, 4 * kSecond}), sample.segment(1, 0, {0, 4 * kSecond})},
        archive_.now());
    sample.close();
    folder_ = sample.folder();
  }
  SampleArchive archive_;
  fs::path folder_;
};

TEST_F(ExcerptBehindAGap, HoldsTheGapAndIsIntact) {
  ASSERT_THAT(summary(archive::verify_case(folder_, archive_.options())),
              ::testing::StartsWith("intact-with-gaps\n"));
  const fs::path excerpt = archive_.folder().parent_path() / "excerpt";
  archive::ExcerptOptions options;
  options.streams = {"endoscope"};
  options.from_ns = kSecond + kSecond / 2;
  options.to_ns = 3 * kSecond + kSecond / 2;
  archive::make_excerpt(folder_, options, excerpt);
  const archive::VerificationReport report = archive::verify_case(excerpt, archive_.options());
  EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt) << details(report);
  EXPECT_THAT(summary(report), HasSubstr("gap ledger"));
}

/// A monitor that goes on for 40 s, and a camera that has something from 10 s to 15 s and from 25 s to 30 s.
/// A token lies in each of the times between.
class ExcerptOfASilence : public ::testing::Test {
 protected:
  /// With the gaps of the camera that are stated, each when it ends.
  void record(const std::vector<archive::Span>& stated) {
    SampleCase sample(archive_);
    sample.stamp();
    std::uint64_t pictures = 0;
    for (std::uint64_t i = 0; i < 8; ++i) {
      const auto begins_ns = static_cast<std::int64_t>(i) * 5 * kSecond;
      const archive::Span span{begins_ns, begins_ns + 5 * kSecond};
      archive_.now_ns = span.end_ns + kSecond / 10;
      std::vector<archive::CaseEntryBody> entries;
      for (const archive::Span& gap : stated) {
        if (gap.end_ns == span.end_ns) {
          entries.emplace_back(archive::GapEntry{"endoscope", gap, archive::GapCause::kSignalLost});
        }
      }
      if (i == 2 || i == 5) entries.emplace_back(sample.segment(0, pictures++, span));
      entries.emplace_back(sample.segment(1, i, span));
      sample.writer().append(std::move(entries), archive_.now());
      if (i % 2 == 1) sample.stamp();
    }
    sample.close();
    folder_ = sample.folder();
  }
  archive::VerificationReport taken(std::int64_t from_s, std::int64_t to_s) {
    const fs::path excerpt = archive_.folder().parent_path() / "excerpt";
    fs::remove_all(excerpt);
    archive::ExcerptOptions options;
    options.from_ns = from_s * kSecond;
    options.to_ns = to_s * kSecond;
    archive::make_excerpt(folder_, options, excerpt);
    return archive::verify_case(excerpt, archive_.options());
  }

  SampleArchive archive_;
  fs::path folder_;
};

// Nothing of the camera lies in any of these times, or in a part of them.
TEST_F(ExcerptOfASilence, ThatNobodyStatedIsNotIntact) {
  record({});
  EXPECT_THAT(summary(taken(2, 4)), HasSubstr("stream-begins-late ledger-part.jsonl"));
  EXPECT_THAT(summary(taken(5, 12)), HasSubstr("stream-begins-late ledger-part.jsonl"));
  EXPECT_THAT(summary(taken(17, 18)), HasSubstr("tampered\nsegment-hole"));
  EXPECT_THAT(summary(taken(32, 33)), HasSubstr("stream-ends-early ledger-part.jsonl"));
  EXPECT_EQ(taken(26, 28).verdict, Verdict::kIntactExcerpt) << "it says nothing of the time before";
}

TEST_F(ExcerptOfASilence, ThatWasStatedIsIntactOnEachSideAndWithin) {
  record({{0, 5 * kSecond},
          {5 * kSecond, 10 * kSecond},
          {15 * kSecond, 25 * kSecond},
          {30 * kSecond, 40 * kSecond}});
  ASSERT_EQ(archive::verify_case(folder_, archive_.options()).verdict, Verdict::kIntactWithGaps)
      << details(archive::verify_case(folder_, archive_.options()));
  for (std::int64_t from_s = 0; from_s < 39; ++from_s) {
    for (const std::int64_t length_s : {1, 7, 16}) {
      const archive::VerificationReport report = taken(from_s, from_s + length_s);
      EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt) << from_s << " " << length_s << details(report);
    }
  }
}

struct Forgery {
  std::string name;
  Claim claim;
  std::string code;
  bool with_segments = false;
};
void PrintTo(const Forgery& forgery, std::ostream* out) { *out << forgery.name; }

class ExcerptOfNothing : public ::testing::TestWithParam<Forgery> {};

TEST_P(ExcerptOfNothing, IsTampered) {
  AttackedCase victim;
  ASSERT_EQ(summary(victim.verify()), "intact");
  if (!GetParam().with_segments) {
    remove_segments(victim);
  }
  call_it_an_excerpt(victim, GetParam().claim);
  for (const bool with_log : {false, true}) {
    const archive::VerificationReport report = victim.verify(with_log);
    EXPECT_EQ(report.verdict, Verdict::kTampered) << details(report);
    EXPECT_THAT(summary(report), HasSubstr(GetParam().code));
    for (const archive::StreamReport& stream : report.streams) {
      EXPECT_EQ(stream.segments, GetParam().with_segments ? stream.segments : 0U) << stream.info.name;
      EXPECT_EQ(stream.frames, GetParam().with_segments ? stream.frames : 0U) << stream.info.name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, ExcerptOfNothing,
    ::testing::Values(
        Forgery{"NoStreams", {0, 7 * kSecond, {}}, "excerpt-malformed excerpt.json"},
        Forgery{"NoStreamsBeforeTheEnd", {0, kSecond, {}}, "excerpt-malformed excerpt.json"},
        Forgery{"EmptyRange", {2 * kSecond, 2 * kSecond, {"vitals"}}, "excerpt-malformed excerpt.json"},
        Forgery{"EmptyRangeWithSegments",
                {2 * kSecond, 2 * kSecond, {"endoscope", "vitals"}},
                "excerpt-malformed excerpt.json",
                true},
        Forgery{"ReversedRange", {6 * kSecond, kSecond, {"endoscope"}}, "excerpt-malformed excerpt.json"},
        Forgery{"TimeToCome", {100 * kSecond, 200 * kSecond, {"endoscope"}}, "excerpt-outside-case"},
        Forgery{"TimeAfterTheLastPicture",
                {6 * kSecond, 7 * kSecond, {"endoscope", "vitals"}},
                "excerpt-empty excerpt.json"},
        Forgery{"TimeBeforeTheCase", {-9 * kSecond, -kSecond, {"endoscope"}}, "excerpt-outside-case"},
        Forgery{"BeginsBeforeTheCase",
                {-kSecond, 7 * kSecond, {"endoscope", "vitals"}},
                "excerpt-outside-case",
                true},
        Forgery{"UnknownStream", {0, 7 * kSecond, {"kitchen"}}, "excerpt-malformed excerpt.json"},
        Forgery{"UnknownStreamBesideOthers",
                {0, 7 * kSecond, {"endoscope", "vitals", "kitchen"}},
                "excerpt-malformed excerpt.json",
                true},
        Forgery{"AStreamTwice",
                {0, 7 * kSecond, {"endoscope", "vitals", "endoscope"}},
                "excerpt-malformed excerpt.json",
                true},
        Forgery{"PicturesTakenOut", {0, 7 * kSecond, {"endoscope", "vitals"}}, "file-missing"}),
    [](const auto& tested) { return tested.param.name; });

TEST(ExcerptAttack, AWholeCaseInTheFormOfAnExcerptIsNoCase) {
  AttackedCase victim;
  call_it_an_excerpt(victim, {0, 7 * kSecond, {"endoscope", "vitals"}});
  for (const bool with_log : {false, true}) {
    const archive::VerificationReport report = victim.verify(with_log);
    EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
    EXPECT_NE(archive::exit_status(report.verdict), 0);
  }
}

TEST(ExcerptAttack, TimeBeyondTheEndOfItsCaseIsNotToldAsHeld) {
  AttackedCase victim;
  call_it_an_excerpt(victim, {kSecond, 3600 * kSecond, {"endoscope", "vitals"}});
  const archive::VerificationReport report = victim.verify();
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
  ASSERT_TRUE(report.excerpt);
  EXPECT_EQ(report.excerpt->from_ns, kSecond);
  EXPECT_EQ(report.excerpt->to_ns, 7'100'000'000);
}

TEST(ExcerptAttack, TheFirstSecondTellsOnlyOfWhatItHolds) {
  AttackedCase victim;
  for (const char* gone : {"endoscope/00000001.ts.age", "endoscope/00000002.ts.age", "vitals"}) {
    fs::remove_all(victim / (std::string("segments/") + gone));
  }
  call_it_an_excerpt(victim, {0, kSecond, {"endoscope"}});
  const archive::VerificationReport report = victim.verify();
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
  ASSERT_EQ(report.streams.size(), 1U);
  EXPECT_EQ(report.streams[0].info.name, "endoscope");
  EXPECT_EQ(report.streams[0].segments, 1U);
  EXPECT_EQ(report.streams[0].frames, 50U);
}

TEST(ExcerptAttack, ASegmentThatItDoesNotSelectIsNotHidInIt) {
  AttackedCase victim;
  call_it_an_excerpt(victim, {0, kSecond, {"endoscope"}});
  EXPECT_THAT(summary(victim.verify()), HasSubstr("file-unnamed segments/endoscope/00000001.ts.age"));
}

TEST(ExcerptAttack, InPlaceOfItsCaseTheLogMissesTheCase) {
  AttackedCase victim;
  const fs::path archive = victim.folder().parent_path();
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log.reset();
  fs::copy(SoundCases::get().second, archive / SoundCases::get().second.filename(),
           fs::copy_options::recursive);
  ASSERT_EQ(summary(archive::verify_log(victim.log(), options)), "intact");
  call_it_an_excerpt(victim, {0, 7 * kSecond, {"endoscope", "vitals"}});
  EXPECT_THAT(summary(archive::verify_log(victim.log(), options)), HasSubstr("case-missing ledger.jsonl"));
}

/// Whoever makes an excerpt chooses its lines. This one takes the entries [first, size) of a sound case with
/// true proofs, and the segments that those lines name in the claimed time.
void take_lines(const fs::path& from, const Claim& claim, std::uint64_t first, std::uint64_t size,
                const fs::path& to) {
  std::vector<std::string> lines;
  std::istringstream text(read_file(from / "ledger.jsonl"));
  crypto::MerkleTree tree;
  for (std::string line; std::getline(text, line);) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    lines.push_back(line);
  }
  ExcerptDocument document;
  document.case_id = from.filename().string();
  document.from_ns = claim.from_ns;
  document.to_ns = claim.to_ns;
  document.streams = claim.streams;
  document.first_entry = first;
  document.size = size;
  document.open_proof = tree.inclusion_proof(0, size);
  document.left = tree.range_proof(first, size, size);
  for (const char* folder : {"checkpoints", "tokens", "segments"}) {
    fs::create_directories(to / folder);
  }
  const auto copy = [&](const std::string& file) {
    fs::create_directories((to / file).parent_path());
    fs::copy_file(from / file, to / file, fs::copy_options::overwrite_existing);
  };
  std::set<std::uint64_t> notes{size};
  std::string part;
  for (std::uint64_t number = first; number < size; ++number) {
    part += lines.at(number) + "\n";
    const archive::CaseEntry entry = archive::parse_case_entry(lines[number]).entry.value();
    if (const auto* token = std::get_if<archive::TokenEntry>(&entry.body)) {
      copy(token->file);
      notes.insert(token->checkpoint);
    } else if (const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body)) {
      const bool selected = std::count(claim.streams.begin(), claim.streams.end(), segment->stream) > 0;
      if (selected && archive::meets(segment->span, claim.from_ns, claim.to_ns)) {
        copy(segment->file.file);
      }
    }
  }
  for (const std::uint64_t note : notes) {
    copy(archive::note_path(note));
    if (note <= first) {
      document.earlier.push_back({note, tree.consistency_proof(note, size)});
    }
  }
  write_file(to / kDocument, archive::to_text(document));
  write_file(to / "ledger-open.jsonl", lines[0] + "\n");
  write_file(to / "ledger-part.jsonl", part);
  copy("device.pub");
}

std::string judged(const fs::path& excerpt, archive::VerifyOptions options) {
  options.log.reset();
  return summary(archive::verify_case(excerpt, options));
}

constexpr const char* kShort = "unproven\nexcerpt-range-short ledger-part.jsonl -";

// Entries of the sample case: 3, 4 and 7 are the endoscope's segments of 2 s each, 6 a token, 9 close.
TEST(ExcerptAttack, LinesThatBeginAfterASegmentOfItsTimeProveNothing) {
  const AttackedCase victim;
  const archive::VerifyOptions options = SoundCases::get().archive.options();
  const Claim claim{2 * kSecond, 6 * kSecond, {"endoscope"}};
  const std::uint64_t size = victim.lines().size();
  take_lines(victim.folder(), claim, 4, size, victim.outside("whole"));
  EXPECT_EQ(judged(victim.outside("whole"), options), "intact-excerpt");
  take_lines(victim.folder(), claim, 6, size, victim.outside("part"));
  EXPECT_EQ(judged(victim.outside("part"), options), kShort);
}

TEST(ExcerptAttack, LinesThatBeginAfterEventsOfItsTimeProveNothing) {
  AttackedCase victim;
  victim.edit_text(0, R"("kind":"video","media":"video/mp2t")",
                   R"("kind":"events","media":"application/jsonl")");
  victim.edit_text(0, R"("profile":"mpeg2")", R"("profile":"jsonl")");
  std::vector<std::string> lines = victim.lines();
  for (std::string& line : lines) {
    const std::size_t at = line.find(".ts.age");
    if (at == std::string::npos || line.find("segments/endoscope/") == std::string::npos) continue;
    const std::size_t begin = line.find("segments/endoscope/");
    const std::string file = line.substr(begin, at - begin);
    line.replace(at, 7, ".jsonl.age");
    // Lines are stamped with the case clock itself.
    line = std::regex_replace(line, std::regex(R"re(("start_ns":)(\d+)(.*"first_pts":)\d+)re"), "$1$2$3$2");
    line =
        std::regex_replace(line, std::regex(R"re("time_base":"[^"]*")re"), R"("time_base":"1/1000000000")");
    fs::rename(victim / (file + ".ts.age"), victim / (file + ".jsonl.age"));
  }
  victim.set_lines(lines);
  victim.forge(SoundCases::get().archive.key(), true);
  ASSERT_EQ(summary(victim.verify(false)), "intact");
  const archive::VerifyOptions options = SoundCases::get().archive.options();
  const Claim claim{2 * kSecond, 6 * kSecond, {"endoscope"}};
  take_lines(victim.folder(), claim, 6, victim.lines().size(), victim.outside("part"));
  EXPECT_EQ(judged(victim.outside("part"), options), kShort);
  archive::ExcerptOptions honest;
  honest.from_ns = claim.from_ns;
  honest.to_ns = claim.to_ns;
  honest.streams = claim.streams;
  archive::make_excerpt(victim.folder(), honest, victim.outside("honest"));
  EXPECT_EQ(judged(victim.outside("honest"), options), "intact-excerpt");
}

TEST(ExcerptAttack, AGapEnteredLateDoesNotStandForTheSegmentBeforeIt) {
  SampleArchive archive;
  SampleCase sample(archive);
  sample.stamp();
  archive.now_ns = 5 * kSecond;
  sample.writer().append(
      {sample.segment(0, 0, {0, 2 * kSecond}), sample.segment(0, 1, {3 * kSecond, 5 * kSecond}),
       archive::GapEntry{"endoscope", {2 * kSecond, 3 * kSecond}, {}}},
      archive.now());
  sample.stamp();
  archive.now_ns = 7 * kSecond;
  sample.writer().append({sample.segment(0, 2, {5 * kSecond, 7 * kSecond})}, archive.now());
  sample.close();
  const AttackedCase victim(sample.folder());
  // Entry 4 is the gap, which begins before the time that is claimed: segment 1 of that time is not shown.
  const Claim claim{2'500'000'000, 7 * kSecond, {"endoscope"}};
  take_lines(sample.folder(), claim, 4, victim.lines().size(), victim.outside("part"));
  EXPECT_EQ(judged(victim.outside("part"), archive.options()),
            "unproven\ngap ledger.jsonl 4\nexcerpt-range-short ledger-part.jsonl -");
}

// excerpt.json is unsigned: whoever has a copy of the case chooses where its lines begin.
TEST(ExcerptAttack, LinesThatBeginWithinAHoleDoNotHideIt) {
  SampleArchive archive;
  SampleCase sample(archive);
  sample.stamp();
  archive.now_ns = 5'100'000'000;
  sample.writer().append({sample.segment(0, 0, {0, 5 * kSecond}), sample.segment(1, 0, {0, 5 * kSecond})},
                         archive.now());
  archive.now_ns = 10'100'000'000;
  sample.writer().append({sample.segment(1, 1, {5 * kSecond, 10 * kSecond})}, archive.now());
  sample.stamp();
  const std::uint64_t first = sample.writer().covered() - 1;
  archive.now_ns = 20'100'000'000;
  sample.writer().append({sample.segment(1, 2, {10 * kSecond, 20 * kSecond}),
                          sample.segment(0, 1, {15 * kSecond, 20 * kSecond})},
                         archive.now());
  sample.close();
  EXPECT_EQ(archive::verify_case(sample.folder(), archive.options()).verdict, Verdict::kTampered);
  const AttackedCase victim(sample.folder());
  const std::uint64_t size = victim.lines().size();
  const Claim claim{11 * kSecond, 14 * kSecond, {"endoscope", "vitals"}};
  take_lines(sample.folder(), claim, first, size, victim.outside("part"));
  EXPECT_EQ(judged(victim.outside("part"), archive.options()), kShort);
  take_lines(sample.folder(), {11 * kSecond, 14 * kSecond, {"vitals"}}, first, size,
             victim.outside("monitor"));
  EXPECT_EQ(judged(victim.outside("monitor"), archive.options()), "intact-excerpt");
  take_lines(sample.folder(), {16 * kSecond, 19 * kSecond, {"endoscope"}}, first, size,
             victim.outside("behind"));
  EXPECT_EQ(judged(victim.outside("behind"), archive.options()), "intact-excerpt")
      << "it says nothing of the time before";
}

TEST(ExcerptAttack, AGapEnteredEarlyDoesNotStandForTheSegmentAroundIt) {
  SampleArchive archive;
  SampleCase sample(archive);
  sample.stamp();
  archive.now_ns = 4'500'000'000;
  sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond}),
                          archive::GapEntry{"endoscope", {4 * kSecond, 4'500'000'000}, {}}},
                         archive.now());
  sample.stamp();
  sample.stamp();
  const std::uint64_t size = sample.writer().covered();
  archive.now_ns = 5 * kSecond;
  sample.writer().append({sample.segment(0, 1, {3 * kSecond, 5 * kSecond})}, archive.now());
  sample.close();
  const AttackedCase victim(sample.folder());
  take_lines(sample.folder(), {0, 4'400'000'000, {"endoscope"}}, 0, size, victim.outside("part"));
  EXPECT_EQ(judged(victim.outside("part"), archive.options()),
            "unproven\ngap ledger.jsonl 3\nexcerpt-range-short ledger-part.jsonl -");
}

}  // namespace
}  // namespace kiroku::test
