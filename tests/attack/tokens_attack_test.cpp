// Attacks on tokens and on time.
#include "tests/attack/attack_table.h"
#include "timestamp/request.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::CaseEntry;
using archive::Verdict;

constexpr const char* kLedgerFile = "ledger.jsonl";
constexpr const char* kToken1 = "tokens/00000001.embedded.tsr";
constexpr const char* kToken6 = "tokens/00000006.embedded.tsr";

archive::TokenEntry& token(CaseEntry& entry) { return std::get<archive::TokenEntry>(entry.body); }

/// Puts a response in place of a token and makes its entry fit.
void exchange_token(AttackedCase& c, std::uint64_t entry, const std::string& file,
                    const std::string& response) {
  write_file(c / file, response);
  c.edit(entry, [&](CaseEntry& e) {
    const archive::TokenEntry facts = SampleArchive::facts_of(bytes_of(response));
    token(e).sha256 = crypto::sha256(bytes_of(response));
    token(e).gen_time = facts.gen_time;
    token(e).accuracy_ns = facts.accuracy_ns;
    token(e).serial = facts.serial;
  });
}

/// A token of an authority nobody trusts, over the note that the trusted one stamped.
std::string foreign_token(AttackedCase& c) {
  SampleArchive stranger;
  stranger.authority_time = [](std::int64_t) { return SampleArchive::opened_at() + std::chrono::seconds(5); };
  return std::string(text_of(stranger.stamp(read_file(c / "checkpoints/00000006.note"))));
}

class AttackOnTokens : public ::testing::TestWithParam<Attack> {};

TEST_P(AttackOnTokens, IsTold) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    Table, AttackOnTokens,
    ::testing::Values(
        Attack{"TokenRemoved", [](AttackedCase& c) { fs::remove(c / kToken6); }, "file-missing", kToken6, 6},
        Attack{"TokensSwapped",
               [](AttackedCase& c) {
                 const std::string first = read_file(c / kToken1);
                 write_file(c / kToken1, read_file(c / kToken6));
                 write_file(c / kToken6, first);
               },
               "file-hash-differs", kToken1, 1},
        Attack{"TokensSwappedWithTheirEntries",
               [](AttackedCase& c) {
                 const std::string first = read_file(c / kToken1);
                 exchange_token(c, 1, kToken1, read_file(c / kToken6));
                 exchange_token(c, 6, kToken6, first);
               },
               "token-imprint-differs", kToken1, 1},
        Attack{"TokenReplayedForALaterCheckpoint",
               [](AttackedCase& c) {
                 exchange_token(c, 6, kToken6, read_file(c / kToken1));
                 c.sign_again();
               },
               "token-imprint-differs", kToken6, 6},
        Attack{"TokenOfAnotherCase",
               [](AttackedCase& c) {
                 exchange_token(c, 6, kToken6, read_file(SoundCases::get().second / kToken6));
                 c.sign_again();
               },
               "token-imprint-differs", kToken6, 6},
        Attack{"TokenEnteredTwice",
               [](AttackedCase& c) {
                 c.append(archive::parse_case_entry(c.lines()[10]).entry->body);
                 c.write_note(12, c.origin(), 12, c.root(12), SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "token-repeated", "tokens/00000010.embedded.tsr", 11},
        Attack{"TokenOfALaterCheckpointInAnEarlierEntry",
               [](AttackedCase& c) {
                 c.edit(1, [](CaseEntry& e) {
                   token(e).checkpoint = 6;
                   token(e).file = kToken6;
                 });
                 c.sign_again();
               },
               "token-covers-later", kToken6, 1},
        Attack{"TokenOutsideTheCase",
               [](AttackedCase& c) {
                 c.edit(6, [](CaseEntry& e) { token(e).file = "../token"; });
                 c.forge(SoundCases::get().archive.key(), false);
               },
               "token-name-differs", "../token", 6},
        Attack{"TokenUnderAnotherAuthoritysName",
               [](AttackedCase& c) {
                 c.edit(6, [](CaseEntry& e) { token(e).authority = "famous"; });
                 c.sign_again();
               },
               "token-name-differs", kToken6, 6},
        Attack{"GenTimeEdited",
               [](AttackedCase& c) {
                 c.edit(10, [](CaseEntry& e) { token(e).gen_time -= std::chrono::milliseconds(1); });
               },
               "token-entry-differs", kLedgerFile, 10},
        Attack{"AccuracyEdited",
               [](AttackedCase& c) { c.edit(10, [](CaseEntry& e) { token(e).accuracy_ns += 1; }); },
               "token-entry-differs", kLedgerFile, 10},
        Attack{"SerialEdited",
               [](AttackedCase& c) { c.edit(10, [](CaseEntry& e) { token(e).serial += "0"; }); },
               "token-entry-differs", kLedgerFile, 10},
        Attack{"TokenOfAnotherAuthority",
               [](AttackedCase& c) {
                 exchange_token(c, 6, kToken6, foreign_token(c));
                 for (const std::uint64_t size : {10U, 11U}) {
                   c.write_note(size, c.origin(), size, c.root(size), SoundCases::get().archive.key(),
                                SampleArchive::kDeviceName);
                 }
               },
               "token-untrusted", kToken6, 6},
        Attack{"RejectionInPlaceOfAToken",
               [](AttackedCase& c) {
                 const Bytes rejection = SoundCases::get().archive.authority().respond(to_bytes("no query"));
                 write_file(c / kToken6, std::string(text_of(rejection)));
                 c.edit(6, [&](CaseEntry& e) { token(e).sha256 = crypto::sha256(rejection); });
                 c.sign_again();
               },
               "token-refused", kToken6, 6},
        Attack{"PageOfAPortalInPlaceOfAToken",
               [](AttackedCase& c) {
                 write_file(c / kToken6, "<html>");
                 c.edit(6, [&](CaseEntry& e) { token(e).sha256 = crypto::sha256(bytes_of("<html>")); });
                 c.sign_again();
               },
               "token-refused", kToken6, 6},
        Attack{"EmptyTokenFile", [](AttackedCase& c) { fs::resize_file(c / kToken6, 0); },
               "file-hash-differs", kToken6, 6},
        Attack{"AllTokensTakenOut",
               [](AttackedCase& c) {
                 for (const std::uint64_t entry : {10U, 6U, 1U}) {
                   c.remove_line(entry);
                 }
                 c.renumber();
                 fs::remove_all(c / "tokens");
                 fs::remove_all(c / "checkpoints");
                 fs::create_directory(c / "checkpoints");
                 c.write_note(8, c.origin(), 8, c.root(8), SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "no-token",
               "",
               {},
               Verdict::kUnproven},
        Attack{"LastTokenTakenOut",
               [](AttackedCase& c) {
                 c.cut(10);
                 c.write_note(10, c.origin(), 10, c.root(10), SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "end-not-stamped", kLedgerFile, 9, Verdict::kUnproven}),
    name_of);

/// A case whose authority's clock is wrong by `wrong` from the second token on.
archive::VerificationReport with_clock(std::chrono::milliseconds wrong) {
  SampleArchive archive;
  const auto right = archive.authority_time;
  archive.authority_time = [&](std::int64_t mono_ns) {
    return right(mono_ns) + (mono_ns > 2'000'000'000 ? wrong : std::chrono::milliseconds(0));
  };
  return archive::verify_case(SampleCase::write(archive), archive.options());
}

TEST(AttackOnTime, ASmallDifferenceOfClocksIsNone) {
  EXPECT_EQ(summary(with_clock(std::chrono::milliseconds(500))), "intact");
  EXPECT_EQ(summary(with_clock(std::chrono::milliseconds(-500))), "intact");
}

TEST(AttackOnTime, AClockSetBackIsTold) {
  const archive::VerificationReport report = with_clock(std::chrono::hours(-1));
  EXPECT_EQ(summary(report), "unproven\nclock-disagreement tokens/00000006.embedded.tsr 6")
      << details(report);
}

TEST(AttackOnTime, AClockSetForwardIsTold) {
  const archive::VerificationReport report = with_clock(std::chrono::hours(1));
  EXPECT_EQ(summary(report), "unproven\nclock-disagreement tokens/00000006.embedded.tsr 6")
      << details(report);
}

/// Two segments of the endoscope with a second of nothing between them, and a stated gap or not.
archive::VerificationReport with_hole(bool stated, bool before) {
  SampleArchive archive;
  SampleCase sample(archive);
  sample.stamp();
  constexpr std::int64_t kSecond = 1'000'000'000;
  const archive::GapEntry gap{"endoscope", {2 * kSecond, 3 * kSecond}, archive::GapCause::kSignalLost};
  std::vector<archive::CaseEntryBody> bodies{sample.segment(0, 0, {0, 2 * kSecond})};
  if (stated && before) {
    bodies.emplace_back(gap);
  }
  bodies.emplace_back(sample.segment(0, 1, {3 * kSecond, 5 * kSecond}));
  if (stated && !before) {
    bodies.emplace_back(gap);
  }
  archive.now_ns = 5 * kSecond;
  bodies.emplace_back(sample.segment(1, 0, {0, 5 * kSecond}));
  sample.writer().append(bodies, archive.now());
  sample.close();
  return archive::verify_case(sample.folder(), archive.options());
}

TEST(AttackOnGaps, AStatedGapIsAGap) {
  EXPECT_EQ(summary(with_hole(true, true)), "intact-with-gaps\ngap ledger.jsonl 3");
  EXPECT_EQ(summary(with_hole(true, false)), "intact-with-gaps\ngap ledger.jsonl 4");
}

// Pictures that a decoder dated hours ahead.
TEST(AttackOnGaps, ASegmentOfTimeThatHasNotComeIsTold) {
  SampleArchive archive;
  SampleCase sample(archive);
  sample.stamp();
  constexpr std::int64_t kSecond = 1'000'000'000;
  archive.now_ns = 5 * kSecond;
  sample.writer().append({sample.segment(0, 0, {0, 9 * kSecond}), sample.segment(1, 0, {0, 5 * kSecond})},
                         archive.now());
  sample.close();
  EXPECT_EQ(summary(archive::verify_case(sample.folder(), archive.options())),
            "unproven\nsegment-in-future ledger.jsonl 2");
}

TEST(AttackOnGaps, AGapTakenOutIsTold) {
  EXPECT_EQ(summary(with_hole(false, false)), "tampered\nsegment-hole ledger.jsonl 3");
}

}  // namespace
}  // namespace kiroku::test
