// Somebody makes a folder that is dear to verify. What verifying it takes must grow with its bytes and no
// faster. Work is counted, never timed. KIROKU_HOSTILE_PART=N writes an Nth of the bytes: a sanitizer sees
// the same code read them, and what is bounded shows in the release build.
#include <algorithm>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/asked_number.h"
#include "tests/support/heap_count.h"
#include "tests/support/hostile_case.h"
#include "tests/support/report_text.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/token_maker.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::Verdict;
using archive::VerificationReport;

constexpr std::uint64_t kMegabyte = 1'000'000;

const HostileForm& form(const std::string& name) {
  const auto& forms = hostile_forms();
  const auto found =
      std::find_if(forms.begin(), forms.end(), [&](const HostileForm& each) { return each.name == name; });
  return found == forms.end() ? throw std::logic_error("there is no form " + name) : *found;
}

std::size_t bytes_of_findings(const VerificationReport& report) {
  std::size_t bytes = 0;
  for (const archive::Finding& each : report.findings) {
    bytes += sizeof(each) + each.file.size() + each.text.size();
  }
  return bytes;
}

bool tells(const VerificationReport& report, const std::string& code) {
  return std::any_of(report.findings.begin(), report.findings.end(),
                     [&](const archive::Finding& each) { return each.code == code; });
}

struct Work {
  VerificationReport report;
  std::uint64_t nodes = 0;  // of Merkle trees, hashed
  std::size_t memory = 0;   // most heap
};
Work work_of(const fs::path& parent) {
  Work work;
  const std::uint64_t nodes = crypto::merkle_nodes_hashed();
  start_heap_peak();
  work.report = verify_hostile(parent);
  work.memory = heap_peak();
  work.nodes = crypto::merkle_nodes_hashed() - nodes;
  return work;
}
Work work_of(const HostileForm& hostile, std::uint64_t bytes) {
  const TemporaryFolder folder(quick_parent());
  hostile.write(folder.path(), bytes);
  return work_of(folder.path());
}

std::uint64_t hostile_bytes(std::uint64_t usual) {
  return usual / std::max<std::size_t>(1, asked_number("KIROKU_HOSTILE_PART", 1));
}

class EveryHostileForm : public ::testing::TestWithParam<HostileForm> {};

TEST_P(EveryHostileForm, TakesBoundedMemory) {
  constexpr std::size_t kMost = 40'000'000;
  const Work work = work_of(GetParam(), hostile_bytes(3 * kMegabyte));
  EXPECT_LT(work.memory, kMost) << details(work.report).substr(0, 2'000);
  EXPECT_LT(bytes_of_findings(work.report), archive::kMaximumFindingBytes);
  EXPECT_NE(work.report.verdict, Verdict::kIntact);
  EXPECT_NE(work.report.verdict, Verdict::kIntactWithGaps);
}

INSTANTIATE_TEST_SUITE_P(Forms, EveryHostileForm, ::testing::ValuesIn(hostile_forms()),
                         [](const auto& tested) {
                           std::string name;
                           bool capital = true;
                           for (const char c : tested.param.name) {
                             const bool letter = std::isalnum(static_cast<unsigned char>(c)) != 0;
                             if (letter) {
                               name += capital
                                           ? static_cast<char>(std::toupper(static_cast<unsigned char>(c)))
                                           : c;
                             }
                             capital = !letter;
                           }
                           return name;
                         });

class LongTexts : public ::testing::TestWithParam<std::string> {};

// Each line has a text of 1 MiB: none of them may be kept.
TEST_P(LongTexts, TakeNoMoreMemoryTheMoreThereAre) {
  const Work few = work_of(form(GetParam()), hostile_bytes(2 * kMegabyte));
  const Work many = work_of(form(GetParam()), hostile_bytes(20 * kMegabyte));
  EXPECT_LT(many.memory, few.memory + kMegabyte) << "ten times as many";
  EXPECT_LT(bytes_of_findings(many.report), kMegabyte);
  EXPECT_EQ(many.report.verdict, few.report.verdict);
}

INSTANTIATE_TEST_SUITE_P(Texts, LongTexts,
                         ::testing::Values("causes of 1 MiB", "policies of 1 MiB", "recoveries of 1 MiB",
                                           "token names of 1 MiB", "segment names of 1 MiB",
                                           "time bases of 1 MiB", "openings of empty streams", "many keys",
                                           "many values", "many lists"),
                         [](const auto& tested) {
                           std::string name = tested.param;
                           std::erase_if(name, [](char c) { return c == ' '; });
                           return name;
                         });

class Proofs : public ::testing::TestWithParam<std::string> {};

TEST_P(Proofs, HashTwiceAsManyNodesForTwiceAsManyLines) {
  const Work once = work_of(form(GetParam()), kMegabyte / 4);
  const Work twice = work_of(form(GetParam()), kMegabyte / 2);
  EXPECT_GT(once.nodes, 1'000U);
  EXPECT_LT(twice.nodes, once.nodes * 5 / 2);
}

INSTANTIATE_TEST_SUITE_P(Trees, Proofs,
                         ::testing::Values("note a line", "excerpt: note a line", "excerpt: notes before it",
                                           "case with a log: a root a line"),
                         [](const auto& tested) {
                           std::string name = tested.param;
                           std::erase_if(name, [](char c) { return c == ' ' || c == ':'; });
                           return name;
                         });

// Signatures are checked by several threads; what is found must not depend on which of them was first.
TEST(Bounds, AnyNumberOfThreadsFindsTheSameOfManyNotesInTheSameOrder) {
  constexpr std::uint64_t kNotes = 400;
  const TemporaryFolder folder(quick_parent());
  HostileCase of(folder.path(), 1);
  for (std::uint64_t i = 0; i < kNotes; ++i) {
    of.add(archive::MarkEntry{});
    of.note();
  }
  of.finish();
  for (std::uint64_t size = 20; size < kNotes; size += 20) {
    const fs::path note = of.folder() / archive::note_path(size);
    if (size % 100 == 0) {
      fs::remove(note);
    } else if (size % 60 == 0) {
      fs::copy_file(of.folder() / archive::note_path(size + 1), note, fs::copy_options::overwrite_existing);
    } else {
      std::string text = read_file(note);
      text[text.size() - 20] = static_cast<char>(text[text.size() - 20] ^ 1);
      write_file(note, text);
    }
  }
  const std::string alone = details(verify_hostile(folder.path(), 1));
  EXPECT_THAT(alone, ::testing::HasSubstr("checkpoint-signature-invalid"));
  EXPECT_THAT(alone, ::testing::HasSubstr("checkpoint-size-differs"));
  for (const unsigned threads : {2U, 3U, 16U}) {
    EXPECT_EQ(details(verify_hostile(folder.path(), threads)), alone) << threads << " threads";
  }
}

TEST(Bounds, AFileIsReadOnceHoweverManyEntriesNameIt) {
  const Work work = work_of(form("one file of 64 MiB over and over"), kMegabyte);
  EXPECT_GT(work.report.entries, 2'000U);
  EXPECT_EQ(work.report.files, 1U + 1U + 1U) << "the segment, the note, the ledger";
  EXPECT_EQ(work.report.verdict, Verdict::kTampered);
  EXPECT_TRUE(tells(work.report, "segment-out-of-order"));
  EXPECT_TRUE(tells(work.report, "file-hash-differs"));
}

TEST(Bounds, ALedgerOfLinesThatAreNoEntriesIsNotReadToItsEnd) {
  const Work work = work_of(form("empty lines"), kMegabyte);
  EXPECT_EQ(work.report.verdict, Verdict::kTampered);
  EXPECT_EQ(work.report.entries, archive::kMostBrokenLines + 2) << "open, and one too many";
  EXPECT_TRUE(tells(work.report, "ledger-unreadable"));
  // Nothing is said that the rest of the ledger could gainsay.
  for (const std::string code :
       {"not-closed", "ledger-cut", "close-not-covered", "file-unnamed", "file-missing"}) {
    EXPECT_FALSE(tells(work.report, code)) << code;
  }
}

TEST(Bounds, AsManyBrokenLinesAsAllowedAreReadToTheEnd) {
  const TemporaryFolder folder(quick_parent());
  HostileCase of(folder.path(), 1);
  for (std::uint64_t i = 0; i < archive::kMostBrokenLines; ++i) {
    of.raw("");
  }
  of.add(archive::RecoveredEntry{"b", "crash", ""});
  of.finish();
  const VerificationReport report = verify_hostile(folder.path());
  EXPECT_EQ(report.entries, archive::kMostBrokenLines + 2);
  EXPECT_FALSE(tells(report, "ledger-unreadable"));
  EXPECT_TRUE(tells(report, "recovered"));
  EXPECT_TRUE(tells(report, "not-closed"));
}

TEST(Bounds, AnExcerptAndALogOfLinesThatAreNoEntriesAreNotReadToTheirEnds) {
  const TemporaryFolder folder(quick_parent());
  {
    HostileCase of(folder.path(), 1);
    HostileLog log(folder.path());
    of.add(archive::MarkEntry{});
    of.begin_excerpt();
    for (std::uint64_t i = 0; i < 2 * archive::kMostBrokenLines; ++i) {
      of.raw("{}");
    }
    of.finish();
  }
  const VerificationReport excerpt = verify_hostile(folder.path());
  EXPECT_EQ(excerpt.verdict, Verdict::kTampered);
  EXPECT_EQ(excerpt.entries, archive::kMostBrokenLines + 1);
  EXPECT_TRUE(tells(excerpt, "ledger-unreadable"));
  EXPECT_FALSE(tells(excerpt, "file-unnamed"));

  fs::remove_all(folder / HostileCase::kCaseId);
  std::ofstream(folder / "log/ledger.jsonl", std::ios::app)
      << std::string(2 * archive::kMostBrokenLines, '\n');
  const VerificationReport log = verify_hostile(folder.path());
  EXPECT_EQ(log.verdict, Verdict::kTampered);
  EXPECT_EQ(log.entries, archive::kMostBrokenLines + 2);
  EXPECT_TRUE(tells(log, "ledger-unreadable"));
}

// A log that was not read to its end has nothing to say of the case. It is tampered with, and the case is
// not.
TEST(Bounds, ALogThatIsNotReadToItsEndIsNotCompared) {
  AttackedCase victim;
  ASSERT_EQ(summary(victim.verify()), "intact");
  std::string text = read_file(victim.log() / "ledger.jsonl");
  const std::string boot = text.substr(0, text.find('\n') + 1);
  write_file(victim.log() / "ledger.jsonl", boot + std::string(2 * archive::kMostBrokenLines, '\n'));
  const VerificationReport report = victim.verify();
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  EXPECT_TRUE(tells(report, "log-not-sound"));
  EXPECT_FALSE(tells(report, "log-case-unknown"));
  EXPECT_EQ(archive::verify_log(victim.log(), SoundCases::get().archive.options()).verdict,
            Verdict::kTampered);
}

TEST(Bounds, WhatIsOnlyCountedDecides) {
  AttackedCase victim;
  const std::uint64_t entries = victim.lines().size();
  for (std::uint64_t i = 0; i < 2 * archive::kMostFindingsOfOneCode; ++i) {
    write_file(victim / ("checkpoints/" + archive::format_index(entries + 1 + i) + ".part"), "");
  }
  VerificationReport report = victim.verify();
  EXPECT_EQ(report.verdict, Verdict::kTampered);
  EXPECT_EQ(std::count_if(report.findings.begin(), report.findings.end(),
                          [](const archive::Finding& each) { return each.code == "file-unnamed"; }),
            static_cast<std::ptrdiff_t>(archive::kMostFindingsOfOneCode));
  EXPECT_TRUE(tells(report, "more-findings"));
}

// A stranger's key may be as slow as they like. So of their tokens some are judged wholly, and of the others
// it is told that their signature was not looked at.
TEST(StrangersTokens, AreJudgedWhollyUpToANumber) {
  const TemporaryFolder folder(quick_parent());
  form("tokens of a stranger").write(folder.path(), 2 * kMegabyte / 10);
  timestamp::TrustStore trust;
  trust.add_trusted(bytes_of(make_test_authority().root_pem()), "somebody else's");
  archive::VerifyOptions options;
  options.trust = &trust;
  options.threads = 1;
  const VerificationReport report = archive::verify_case(folder / HostileCase::kCaseId, options);
  std::uint64_t all = 0, not_looked_at = 0;
  for (const archive::Finding& each : report.findings) {
    all += each.code == "token-untrusted" ? 1U : 0U;
    not_looked_at += each.text.ends_with("whether its signature holds was not looked at") ? 1U : 0U;
  }
  EXPECT_GT(all, archive::kMostJudgedStrangers + 10);
  EXPECT_EQ(all - not_looked_at, archive::kMostJudgedStrangers);
  EXPECT_FALSE(tells(report, "token-refused"));
}

// Tokens may enclose as many certificates as they like, each of them another one.
TEST(StrangersTokens, AreNotJudgedWhereTheyEncloseMoreCertificatesThanAnyRecordingHas) {
  const TemporaryFolder folder(quick_parent());
  form("tokens with a certificate each").write(folder.path(), 6 * kMegabyte / 10);
  timestamp::TrustStore trust;
  trust.add_trusted(bytes_of(make_test_authority().root_pem()), "somebody else's");
  archive::VerifyOptions options;
  options.trust = &trust;
  options.threads = 1;
  const VerificationReport report = archive::verify_case(folder / HostileCase::kCaseId, options);
  std::uint64_t all = 0, too_many = 0;
  for (const archive::Finding& each : report.findings) {
    all += each.code == "token-untrusted" ? 1U : 0U;
    too_many += each.text.ends_with("and this one encloses more") ? 1U : 0U;
  }
  EXPECT_GT(too_many, 10U);
  EXPECT_EQ(all - too_many, timestamp::CertificatePool::kMostCertificates);
}

}  // namespace
}  // namespace kiroku::test
