// Attacks on the ledger and its checkpoints: by somebody without any key, and by the owner of the device.
#include <algorithm>
#include <cstdio>
#include <sys/resource.h>

#include "archive/format/case_layout.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::CaseEntry;
using archive::Verdict;

constexpr const char* kLedger = "ledger.jsonl";

/// Replaces the whole of one line, whatever it was.
void set_line(AttackedCase& c, std::uint64_t entry, const std::string& line) {
  std::vector<std::string> lines = c.lines();
  lines.at(entry) = line;
  c.set_lines(lines);
}

void swap_lines(AttackedCase& c, std::size_t a, std::size_t b) {
  std::vector<std::string> lines = c.lines();
  std::swap(lines.at(a), lines.at(b));
  c.set_lines(lines);
}

void insert_line(AttackedCase& c, std::size_t before, const std::string& line) {
  std::vector<std::string> lines = c.lines();
  lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(before), line);
  c.set_lines(lines);
}

archive::SegmentEntry& segment(CaseEntry& entry) { return std::get<archive::SegmentEntry>(entry.body); }

class AttackOnLedger : public ::testing::TestWithParam<Attack> {};

TEST_P(AttackOnLedger, IsTold) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    WithoutAnyKey, AttackOnLedger,
    ::testing::Values(
        Attack{"LineRemoved", [](AttackedCase& c) { c.remove_line(5); }, "entry-out-of-sequence", kLedger, 5},
        Attack{"LineRemovedAndRenumbered",
               [](AttackedCase& c) {
                 c.remove_line(5);
                 c.renumber();
               },
               "ledger-changed", kLedger, 1},
        Attack{"LinesSwapped", [](AttackedCase& c) { swap_lines(c, 3, 4); }, "entry-out-of-sequence", kLedger, 3},
        Attack{"LineRepeated", [](AttackedCase& c) { insert_line(c, 6, c.lines()[5]); }, "entry-out-of-sequence", kLedger,
               6},
        Attack{"DuplicateSequenceNumber", [](AttackedCase& c) { c.edit(5, [](CaseEntry& e) { e.seq = 4; }); },
               "entry-out-of-sequence", kLedger, 5},
        Attack{"LineOfAnotherCase",
               [](AttackedCase& c) { set_line(c, 5, AttackedCase(SoundCases::get().second).lines()[4]); },
               "entry-out-of-sequence", kLedger, 5},
        Attack{"TwoCasesSpliced",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = c.lines();
                 const std::vector<std::string> others = AttackedCase(SoundCases::get().second).lines();
                 std::copy(others.begin() + 6, others.end(), lines.begin() + 6);
                 c.set_lines(lines);
                 for (const char* part : {"checkpoints", "tokens", "segments"}) {
                   fs::copy(SoundCases::get().second / part, c / part,
                            fs::copy_options::recursive | fs::copy_options::overwrite_existing);
                 }
               },
               "checkpoint-of-other-origin", "checkpoints/00000006.note", {}},
        Attack{"PurposeEdited", [](AttackedCase& c) { c.edit_text(0, "monitor", "patient"); }, "ledger-changed", kLedger,
               0},
        Attack{"MarkEdited",
               [](AttackedCase& c) {
                 c.edit(5, [](CaseEntry& e) { std::get<archive::MarkEntry>(e.body).commitment = {}; });
               },
               "ledger-changed", kLedger, 1},
        Attack{"UtcEdited",
               [](AttackedCase& c) { c.edit(5, [](CaseEntry& e) { e.at.utc += std::chrono::hours(1); }); },
               "ledger-changed", kLedger, 1},
        Attack{"DroppedCounterEdited",
               [](AttackedCase& c) { c.edit(3, [](CaseEntry& e) { segment(e).dropped = 1; }); }, "ledger-changed",
               kLedger, 1},
        Attack{"Nul", [](AttackedCase& c) { c.edit_text(5, "commitment", std::string("commit\0ent", 10)); },
               "entry-malformed", kLedger, 5},
        Attack{"DeepNesting", [](AttackedCase& c) { set_line(c, 5, std::string(1'000'000, '[')); }, "entry-malformed",
               kLedger, 5},
        Attack{"DuplicateKey", [](AttackedCase& c) { c.edit_text(5, "{\"type\"", "{\"seq\":5,\"type\""); },
               "entry-malformed", kLedger, 5},
        Attack{"NumberOfTwoToThe53", [](AttackedCase& c) { c.edit_text(3, "\"dropped\":0", "\"dropped\":9007199254740992"); },
               "entry-malformed", kLedger, 3},
        Attack{"InvalidUtf8", [](AttackedCase& c) { c.edit_text(0, "monitor", "monit\xFFr"); }, "entry-malformed", kLedger,
               0},
        Attack{"CarriageReturn", [](AttackedCase& c) { set_line(c, 5, c.lines()[5] + "\r"); }, "entry-malformed",
               kLedger, 5},
        Attack{"BlankLine", [](AttackedCase& c) { insert_line(c, 5, ""); }, "entry-malformed", kLedger, 5},
        Attack{"ByteOrderMark", [](AttackedCase& c) { set_line(c, 0, "\xEF\xBB\xBF" + c.lines()[0]); },
               "entry-malformed", kLedger, 0},
        Attack{"SpaceInALine", [](AttackedCase& c) { c.edit_text(5, ":", ": "); }, "ledger-changed", kLedger, 1},
        Attack{"LineOfMoreThanAMebibyte", [](AttackedCase& c) { set_line(c, 5, std::string((1U << 20U) + 1, ' ')); },
               "entry-too-long", kLedger, 5},
        Attack{"LastLineEndRemoved",
               [](AttackedCase& c) { fs::resize_file(c / kLedger, fs::file_size(c / kLedger) - 1); },
               "ledger-end-damaged", kLedger, 10},
        // As of a recorder that dies there: nobody signed them, and whoever writes them gains a question.
        Attack{"BytesBehindTheEnd", [](AttackedCase& c) { write_file(c / kLedger, read_file(c / kLedger) + "{"); },
               "ledger-torn", kLedger, 11, Verdict::kIncomplete},
        Attack{"ZerosInPlaceOfTheEnd",
               [](AttackedCase& c) {
                 const auto bytes = fs::file_size(c / kLedger);
                 fs::resize_file(c / kLedger, bytes - 40);
                 fs::resize_file(c / kLedger, bytes);
               },
               "ledger-end-damaged", kLedger, 10},
        Attack{"LedgerCutInTheMiddleOfALine",
               [](AttackedCase& c) { fs::resize_file(c / kLedger, fs::file_size(c / kLedger) / 2); }, "ledger-cut",
               "checkpoints/00000011.note", {}},
        Attack{"LedgerEmptied", [](AttackedCase& c) { write_file(c / kLedger, ""); }, "open-missing", kLedger, {}},
        Attack{"OpenRemoved", [](AttackedCase& c) { c.remove_line(0); }, "open-missing", kLedger, 0},
        Attack{"EndCutButNotTheCheckpoints",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = c.lines();
                 lines.resize(9);
                 c.set_lines(lines);
               },
               "ledger-cut", "checkpoints/00000010.note", {}},
        Attack{"EndCutConsistently", [](AttackedCase& c) { c.cut(7); }, "not-closed", kLedger, {}, Verdict::kIncomplete},
        Attack{"EndCutConsistentlyWithTheLogAtHand", [](AttackedCase& c) { c.cut(7); }, "log-knows-more", kLedger, 7,
               Verdict::kTampered, true},
        // A recorder that died before it wrote the last checkpoint leaves the same: only the log can tell.
        Attack{"LastCheckpointRemoved", [](AttackedCase& c) { fs::remove(c / "checkpoints/00000011.note"); },
               "token-not-covered", kLedger, 10, Verdict::kIncomplete},
        Attack{"LastCheckpointRemovedWithTheLogAtHand",
               [](AttackedCase& c) { fs::remove(c / "checkpoints/00000011.note"); }, "ledger-not-covered", kLedger, 10,
               Verdict::kTampered, true},
        Attack{"TokenEntryBehindTheLastCheckpointMadeUp",
               [](AttackedCase& c) {
                 fs::remove(c / "checkpoints/00000011.note");
                 c.edit_text(10, "\"serial\":\"", "\"serial\":\"1");
               },
               "ledger-not-covered", kLedger, 10},
        Attack{"TokenBehindTheLastCheckpointOverSomethingElse",
               [](AttackedCase& c) {
                 fs::remove(c / "checkpoints/00000011.note");
                 const std::string other = read_file(c / "tokens/00000006.embedded.tsr");
                 write_file(c / "tokens/00000010.embedded.tsr", other);
                 c.edit(10, [&](archive::CaseEntry& entry) {
                   std::get<archive::TokenEntry>(entry.body).sha256 = crypto::sha256(bytes_of(other));
                 });
               },
               "ledger-not-covered", kLedger, 10},
        // What a recorder leaves that dies before the next checkpoint. Nothing is believed for its sake.
        Attack{"MissedTokenBehindTheLastCheckpoint",
               [](AttackedCase& c) { c.append(archive::TokenMissedEntry{11, "embedded", "x"}); },
               "end-not-covered", kLedger, 11, Verdict::kIncomplete},
        Attack{"MissedTokenBehindALastCheckpointThatTheLogKnows",
               [](AttackedCase& c) {
                 fs::remove(c / "checkpoints/00000011.note");
                 c.append(archive::TokenMissedEntry{11, "embedded", "x"});
               },
               "ledger-not-covered", kLedger, 10, Verdict::kTampered, true},
        Attack{"FilmRemovedForAnErasureBehindTheLastCheckpoint",
               [](AttackedCase& c) {
                 c.append(archive::ErasedEntry{"endoscope", 0, 2, "room: 30 days"});
                 fs::remove(c / "segments/endoscope/00000000.ts.age");
               },
               "file-missing",
               "segments/endoscope/00000000.ts.age",
               {}},
        Attack{"CheckpointOfATokenRemoved", [](AttackedCase& c) { fs::remove(c / "checkpoints/00000006.note"); },
               "checkpoint-missing", "checkpoints/00000006.note", 6},
        Attack{"CheckpointEmptied", [](AttackedCase& c) { write_file(c / "checkpoints/00000011.note", ""); },
               "checkpoint-malformed", "checkpoints/00000011.note", {}},
        Attack{"CheckpointOfAnotherCase",
               [](AttackedCase& c) {
                 write_file(c / "checkpoints/00000011.note",
                            read_file(SoundCases::get().second / "checkpoints/00000011.note"));
               },
               "checkpoint-of-other-origin", "checkpoints/00000011.note", {}},
        Attack{"CheckpointByAnUnknownKeyOnly",
               [](AttackedCase& c) {
                 c.write_note(11, c.origin(), 11, c.root(11), crypto::SigningKey::generate(), "somebody");
               },
               "checkpoint-unknown-key", "checkpoints/00000011.note", {}},
        Attack{"CheckpointInTheDevicesNameByAnotherKey",
               [](AttackedCase& c) {
                 c.write_note(11, c.origin(), 11, c.root(11), crypto::SigningKey::generate(), SampleArchive::kDeviceName);
               },
               "checkpoint-unknown-key", "checkpoints/00000011.note", {}},
        Attack{"CheckpointWithAForeignSignature",
               [](AttackedCase& c) {
                 // The signature of one note under the text of another.
                 const std::string text = read_file(c / "checkpoints/00000011.note");
                 const std::string other = read_file(c / "checkpoints/00000010.note");
                 write_file(c / "checkpoints/00000011.note",
                            text.substr(0, text.find("\n\n")) + other.substr(other.find("\n\n")));
               },
               "checkpoint-signature-invalid", "checkpoints/00000011.note", {}},
        Attack{"CheckpointUnderAnotherSize",
               [](AttackedCase& c) { fs::rename(c / "checkpoints/00000011.note", c / "checkpoints/00000009.note"); },
               "checkpoint-size-differs", "checkpoints/00000009.note", {}},
        Attack{"CheckpointUnderAShorterName",
               [](AttackedCase& c) { fs::rename(c / "checkpoints/00000011.note", c / "checkpoints/11.note"); },
               "file-unnamed", "checkpoints/11.note", {}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    WithTheDevicesKey, AttackOnLedger,
    ::testing::Values(
        Attack{"ExtraCheckpointOverAnotherTree",
               [](AttackedCase& c) {
                 c.write_note(4, c.origin(), 4, {}, SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "ledger-changed", kLedger, 1},
        Attack{"SignedAgainAfterTheFact",
               [](AttackedCase& c) {
                 c.edit(3, [](CaseEntry& e) { segment(e).frames = 49; });
                 c.sign_again();
               },
               "token-imprint-differs", "tokens/00000006.embedded.tsr", 6},
        Attack{"DroppedCounterEditedAndSigned",
               [](AttackedCase& c) {
                 c.edit(3, [](CaseEntry& e) {
                   segment(e).dropped = 0;
                   segment(e).first_pts = 7;
                 });
                 c.sign_again();
               },
               "token-imprint-differs", "tokens/00000010.embedded.tsr", 10},
        Attack{"TotalsEdited",
               [](AttackedCase& c) {
                 c.edit(9, [](CaseEntry& e) {
                   std::get<archive::CloseEntry>(e.body).totals["endoscope"].frames = 151;
                 });
                 c.sign_again();
               },
               "totals-differ", kLedger, 9},
        Attack{"TotalsOfAStreamLeftOut",
               [](AttackedCase& c) {
                 c.edit(9,
                        [](CaseEntry& e) { std::get<archive::CloseEntry>(e.body).totals.erase("vitals"); });
                 c.sign_again();
               },
               "totals-differ", kLedger, 9},
        Attack{"EntryAfterClose",
               [](AttackedCase& c) {
                 c.append(archive::MarkEntry{});
                 c.write_note(12, c.origin(), 12, c.root(12), SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "entry-after-close", kLedger, 11},
        Attack{"SecondOpen",
               [](AttackedCase& c) {
                 c.append(archive::parse_case_entry(c.lines()[0]).entry->body);
                 c.write_note(12, c.origin(), 12, c.root(12), SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "open-repeated", kLedger, 11},
        Attack{"SecondClose",
               [](AttackedCase& c) {
                 c.append(archive::parse_case_entry(c.lines()[9]).entry->body);
                 c.write_note(12, c.origin(), 12, c.root(12), SoundCases::get().archive.key(),
                              SampleArchive::kDeviceName);
               },
               "entry-after-close", kLedger, 11},
        Attack{"CaseClockSetBack",
               [](AttackedCase& c) {
                 c.edit(5, [](CaseEntry& e) { e.at.mono_ns = 1; });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "clock-went-back", kLedger, 5},
        Attack{"SegmentTakenOutOfTheLedger",
               [](AttackedCase& c) {
                 c.remove_line(4);
                 c.renumber();
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-out-of-order", "segments/endoscope/00000002.ts.age", 6},
        Attack{"SegmentNumberedAnew",
               [](AttackedCase& c) {
                 c.edit(4, [](CaseEntry& e) { segment(e).index = 3; });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-name-differs", kLedger, 4},
        Attack{"SegmentOutsideTheCase",
               [](AttackedCase& c) {
                 fs::copy_file(c / "segments/endoscope/00000001.ts.age", c.outside("film"));
                 c.edit(4, [](CaseEntry& e) { segment(e).file.file = "../film"; });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-name-differs", kLedger, 4},
        Attack{"SegmentByAbsolutePath",
               [](AttackedCase& c) {
                 c.edit(4, [&](CaseEntry& e) {
                   segment(e).file.file = c / "segments/endoscope/00000001.ts.age";
                 });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-name-differs", kLedger, 4},
        Attack{"SegmentsThatOverlap",
               [](AttackedCase& c) {
                 c.edit(4, [](CaseEntry& e) { segment(e).span.start_ns -= 500'000'000; });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-overlap", "segments/endoscope/00000001.ts.age", 4},
        Attack{"TimeMissingBetweenSegments",
               [](AttackedCase& c) {
                 c.edit(4, [](CaseEntry& e) { segment(e).span.start_ns += 40'000'000; });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-hole", kLedger, 4},
        Attack{"SegmentOfAnUnknownStream",
               [](AttackedCase& c) {
                 c.edit(4, [](CaseEntry& e) { segment(e).stream = "surgeon"; });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "stream-unknown", kLedger, 4},
        Attack{"CutOffSegmentWithoutAReason",
               [](AttackedCase& c) {
                 const std::string file = "segments/endoscope/00000001.ts.age";
                 fs::rename(c / file, c / (file + ".part"));
                 c.edit(4, [&](CaseEntry& e) {
                   segment(e).complete = false;
                   segment(e).file.file = file + ".part";
                 });
                 c.forge(SoundCases::get().archive.key(), true);
               },
               "segment-cut-unexplained", "segments/endoscope/00000001.ts.age.part", 4},
        Attack{"CloseTakenOut",
               [](AttackedCase& c) {
                 c.cut(9);
                 c.sign_again();
               },
               "not-closed",
               kLedger,
               {},
               Verdict::kIncomplete},
        Attack{"AnotherDeviceInOpen",
               [](AttackedCase& c) {
                 const crypto::SigningKey key = crypto::SigningKey::generate();
                 c.edit(0, [&](CaseEntry& e) {
                   std::get<archive::OpenEntry>(e.body).device =
                       crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()).to_string();
                 });
                 c.forge(key, false);
               },
               "token-imprint-differs", "tokens/00000001.embedded.tsr", 1},
        Attack{"AnotherDeviceInOpenWithNewTokens",
               [](AttackedCase& c) {
                 const crypto::SigningKey key = crypto::SigningKey::generate();
                 c.edit(0, [&](CaseEntry& e) {
                   std::get<archive::OpenEntry>(e.body).device =
                       crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()).to_string();
                 });
                 c.forge(key, true);
               },
               "device-not-trusted", "", 0, Verdict::kUnproven},
        Attack{"DeviceThatIsNoKey",
               [](AttackedCase& c) {
                 c.edit(0, [](CaseEntry& e) { std::get<archive::OpenEntry>(e.body).device = "or3"; });
               },
               "device-invalid", kLedger, 0}),
    name_of);

// Whoever changes a line leaves the tokens beside it: they say when other lines existed.
TEST(ChangedLedger, HasNoTimeByTokensOverOtherEntries) {
  AttackedCase victim;
  const archive::VerificationReport sound = victim.verify();
  ASSERT_EQ(sound.time, archive::TimeProof::kSelfIssued);
  ASSERT_GT(sound.proving_tokens.size(), 1U);
  victim.edit(3, [](CaseEntry& e) { segment(e).dropped = 1; });
  const archive::VerificationReport changed = victim.verify();
  EXPECT_EQ(changed.verdict, Verdict::kTampered);
  EXPECT_EQ(changed.proving_tokens.size(), 1U) << "that over the beginning, which is as it was";
  EXPECT_EQ(changed.own_tokens, 1U);
  EXPECT_EQ(changed.authorities.at(0).tokens, 1U);
  for (const archive::Bracket& bracket : changed.brackets) {
    EXPECT_TRUE(!bracket.not_after || bracket.last_entry < 3) << "up to entry " << bracket.last_entry;
  }
  EXPECT_EQ(changed.tokens, sound.tokens) << "they are there and were checked";
}

class LongLine : public ::testing::TestWithParam<std::uintmax_t> {};

TEST_P(LongLine, IsRefusedInBoundedMemoryAndTime) {
  AttackedCase victim;
  fs::resize_file(victim / kLedger,
                  fs::file_size(victim / kLedger) + GetParam());  // a hole: zeros without a disk
  std::FILE* file = std::fopen((victim / kLedger).c_str(), "ab");
  ASSERT_NE(file, nullptr);
  ASSERT_EQ(std::fputc('\n', file), '\n');
  ASSERT_EQ(std::fclose(file), 0);
  const auto most_memory = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;  // kB
  };
  const long before = most_memory();
  const archive::VerificationReport report = victim.verify();
  EXPECT_LT(most_memory() - before, 64 * 1024);
  EXPECT_EQ(report.verdict, Verdict::kTampered);
  EXPECT_THAT(summary(report), ::testing::HasSubstr(GetParam() < archive::kMostBytesOfLine
                                                        ? "entry-too-long ledger.jsonl 11"
                                                        : "ledger-end-damaged ledger.jsonl 11"));
}

INSTANTIATE_TEST_SUITE_P(Sizes, LongLine,
                         ::testing::Values(std::uintmax_t{32} << 20U, std::uintmax_t{1} << 30U,
                                           std::uintmax_t{1} << 40U));

}  // namespace
}  // namespace kiroku::test
