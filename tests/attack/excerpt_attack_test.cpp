// Folders that call themselves an excerpt, made from a sound case by somebody who holds no key: a case
// without its pictures must not come out as intact, and an excerpt never as a case.
#include <algorithm>

#include "archive/case_layout.h"
#include "archive/excerpt.h"
#include "archive/excerpt_document.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::ExcerptDocument;
using archive::Verdict;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::int64_t kSecond = 1'000'000'000;
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

}  // namespace
}  // namespace kiroku::test
