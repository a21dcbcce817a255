// Attacks on what the appliance log makes evident, and on the log.
#include <algorithm>
#include <map>
#include <sstream>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/reading/log_proving.h"
#include "archive/verify/case_against_log.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::CaseEntry;
using archive::Verdict;

constexpr const char* kLedgerName = "ledger.jsonl";
constexpr const char* kLog = "log/ledger.jsonl";

std::vector<std::string> log_lines(const fs::path& log) {
  std::vector<std::string> lines;
  std::istringstream text(read_file(log / kLedgerName));
  for (std::string line; std::getline(text, line);) {
    lines.push_back(line);
  }
  return lines;
}

/// Writes a log's lines and signs all its checkpoints anew.
void sign_log(const fs::path& log, const std::vector<std::string>& lines, const crypto::SigningKey& key) {
  std::string text;
  crypto::MerkleFrontier tree;
  std::vector<crypto::Sha256Digest> roots{tree.root()};
  for (const std::string& line : lines) {
    text += line + "\n";
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    roots.push_back(tree.root());
  }
  write_file(log / kLedgerName, text);
  std::vector<fs::path> notes;
  for (const auto& each : fs::directory_iterator(log / "checkpoints")) {
    notes.push_back(each.path());
  }
  for (const fs::path& note : notes) {
    const std::uint64_t size = archive::size_of_note_name(note.filename().string()).value();
    if (size >= roots.size()) {
      fs::remove(note);
      continue;
    }
    const crypto::Checkpoint checkpoint{archive::log_origin(SampleArchive::kDeviceName), size, roots[size]};
    write_file(note, crypto::sign_note(checkpoint.to_text(), SampleArchive::kDeviceName, key));
  }
}

/// More lines, for sign_log(), that tell of no case.
void go_on(const fs::path& log, std::vector<std::string>& lines, std::size_t more) {
  for (std::size_t i = 0; i < more; ++i) {
    lines.push_back(R"({"type":"shutdown","seq":)" + std::to_string(lines.size()) +
                    R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9000000000000000})");
    write_file(log / archive::note_path(lines.size()), "");
  }
}

constexpr const char* kStranger = "stranger";

/// The log goes on under a stranger's key, of this name, with `says`, and then again under the device's. Each
/// signs its own.
struct CarriedOnByAStranger {
  CarriedOnByAStranger(const fs::path& log, const std::string& says, const std::string& name = kStranger,
                       const crypto::SigningKey& key = crypto::SigningKey::generate()) {
    const SampleArchive& archive = SoundCases::get().archive;
    std::vector<std::string> lines = log_lines(log);
    const auto add = [&](const std::string& type, const std::string& rest) {
      lines.push_back(R"({"type":")" + type + R"(","seq":)" + std::to_string(lines.size()) +
                      R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9000000000000000)" + rest + "}");
    };
    const auto boot = [&](const std::string& named, const crypto::SigningKey& of) {
      add("boot", R"(,"boot_id":"00000000-0000-4000-8000-000000000000","device":")" +
                      crypto::VerifierKey(named, of.public_key()).to_string() + "\"");
      write_file(log / archive::note_path(lines.size()), "");
    };
    boot(name, key);
    add("case-closed", says);
    const std::uint64_t strangers = lines.size();
    write_file(log / archive::note_path(strangers), "");
    boot(SampleArchive::kDeviceName, archive.key());
    go_on(log, lines, 1);
    sign_log(log, lines, archive.key());
    crypto::MerkleFrontier tree;
    for (std::uint64_t i = 0; i < strangers; ++i) {
      tree.append(crypto::merkle_leaf_hash(bytes_of(lines[i])));
      if (i + 2 < strangers) continue;
      const crypto::Checkpoint checkpoint{archive::log_origin(name), tree.size(), tree.root()};
      write_file(log / archive::note_path(tree.size()), crypto::sign_note(checkpoint.to_text(), name, key));
    }
  }
};

std::string end_of(const std::string& case_id, std::uint64_t size) {
  return R"(,"case":")" + case_id + R"(","size":)" + std::to_string(size) + R"(,"root":")" +
         std::string(64, '0') + "\"";
}

/// What the owner of the device can do.
void set_log(const fs::path& log, const std::vector<std::string>& lines) {
  sign_log(log, lines, SoundCases::get().archive.key());
}

/// All that the owner of device and authority can make fit in the case, without the log.
void forge_all(AttackedCase& c) { c.forge(SoundCases::get().archive.key(), true); }

class AttackBesideTheLog : public ::testing::TestWithParam<Attack> {};

TEST_P(AttackBesideTheLog, IsTold) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    Table, AttackBesideTheLog,
    ::testing::Values(
        Attack{"EverythingForgedWithDeviceAndAuthority",
               [](AttackedCase& c) {
                 c.edit(5, [](CaseEntry& e) { std::get<archive::MarkEntry>(e.body).commitment = {}; });
                 forge_all(c);
                 ASSERT_EQ(summary(c.verify(false)), "intact");  // only the log can tell
               },
               "log-checkpoint-differs",
               kLog,
               {},
               Verdict::kTampered,
               true},
        Attack{"OpenForgedWithDeviceAndAuthority",
               [](AttackedCase& c) {
                 c.edit_text(0, "monitor", "patient");
                 forge_all(c);
               },
               "log-opening-differs", kLog, 1, Verdict::kTampered, true},
        Attack{
            "LastMinutesDroppedAndAPowerCutClaimed",
            [](AttackedCase& c) {
              c.cut(7);
              c.append(archive::RecoveredEntry{"boot", "power-loss", ""});
              c.append(archive::GapEntry{"vitals", {0, 6'000'000'000}, archive::GapCause::kInterrupted});
              c.append(archive::CloseEntry{
                  "power-loss",
                  {{"endoscope", {2, 100, 0, 2 * fs::file_size(c / "segments/endoscope/00000000.ts.age")}},
                   {"vitals", {}}}});
              SampleArchive& archive = SoundCases::get().archive;
              c.write_note(10, c.origin(), 10, c.root(10), archive.key(), SampleArchive::kDeviceName);
              const auto clock = archive.authority_time;
              archive.authority_time = [](std::int64_t) {
                return SampleArchive::opened_at() + std::chrono::seconds(6);
              };
              const Bytes response = archive.stamp(read_file(c / "checkpoints/00000010.note"));
              archive.authority_time = clock;
              write_file(c / "tokens/00000010.embedded.tsr", std::string(text_of(response)));
              archive::TokenEntry token = SampleArchive::facts_of(response);
              token.checkpoint = 10;
              token.authority = SampleArchive::kAuthorityName;
              token.file = "tokens/00000010.embedded.tsr";
              token.sha256 = crypto::sha256(response);
              c.append(token);
              c.write_note(11, c.origin(), 11, c.root(11), archive.key(), SampleArchive::kDeviceName);
              ASSERT_EQ(
                  summary(c.verify(false)),
                  "intact-with-gaps\nrecovered ledger.jsonl 7\ngap ledger.jsonl 8");  // only the log can tell
            },
            "log-checkpoint-differs",
            kLog,
            {},
            Verdict::kTampered,
            true},
        Attack{"EndCutBehindAClaimedPowerCut", [](AttackedCase& c) { c.cut(7); }, "log-knows-more",
               kLedgerName, 7, Verdict::kTampered, true},
        Attack{"TwoCasesOfOneIdentifier",
               [](AttackedCase& c) {
                 const fs::path other = SoundCases::get().second;
                 for (const char* part :
                      {"ledger.jsonl", "checkpoints", "tokens", "segments", "subject.json.age"}) {
                   fs::remove_all(c / part);
                   fs::copy(other / part, c / part, fs::copy_options::recursive);
                 }
                 c.edit(0, [&](CaseEntry& e) {
                   std::get<archive::OpenEntry>(e.body).case_id = c.folder().filename().string();
                 });
                 forge_all(c);
               },
               "log-opening-differs", kLog, 1, Verdict::kTampered, true},
        Attack{"LogTruncated",
               [](AttackedCase& c) {
                 fs::resize_file(c.log() / kLedgerName, fs::file_size(c.log() / kLedgerName) / 2);
               },
               "log-not-sound",
               "log/checkpoints/00000010.note",
               {},
               Verdict::kUnproven,
               true},
        Attack{"LogCutConsistently",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = log_lines(c.log());
                 lines.resize(1);
                 set_log(c.log(), lines);
               },
               "log-silent",
               kLog,
               {},
               Verdict::kUnproven,
               true},
        Attack{"CaseTakenOutOfTheLogThatGoesOn",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = log_lines(c.log());
                 std::erase_if(lines, [&](const std::string& line) {
                   return line.find(c.folder().filename()) != std::string::npos;
                 });
                 for (std::size_t i = 0; i < lines.size(); ++i) {
                   const std::size_t at = lines[i].find("\"seq\":") + 6;
                   lines[i].replace(at, lines[i].find(',', at) - at, std::to_string(i));
                 }
                 ASSERT_GT(lines.size(), 2U);
                 go_on(c.log(), lines, 65);
                 set_log(c.log(), lines);
               },
               "log-case-unknown",
               kLog,
               {},
               Verdict::kTampered,
               true},
        Attack{"CaseTakenOutOfTheLogThatHardlyGoesOn",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = log_lines(c.log());
                 lines.resize(1);
                 go_on(c.log(), lines, 63);  // the case was opened over none
                 set_log(c.log(), lines);
               },
               "log-silent",
               kLog,
               {},
               Verdict::kUnproven,
               true},
        Attack{"LogWithAnotherRoot",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = log_lines(c.log());
                 char& digit = lines[3][lines[3].find("\"root\":\"") + 8];
                 digit = digit == '0' ? '1' : '0';
                 set_log(c.log(), lines);
               },
               "log-checkpoint-differs", kLog, 3, Verdict::kTampered, true},
        Attack{"LogLineEditedWithoutTheKey",
               [](AttackedCase& c) {
                 std::string text = read_file(c.log() / kLedgerName);
                 text.replace(text.find("case-closed"), 11, "case-opened");
                 write_file(c.log() / kLedgerName, text);
               },
               "log-not-sound",
               kLog,
               {},
               Verdict::kUnproven,
               true},
        Attack{"LogWithAnotherFinalToken",
               [](AttackedCase& c) {
                 std::vector<std::string> lines = log_lines(c.log());
                 const auto closed = std::find_if(lines.begin(), lines.end(), [](const std::string& line) {
                   return line.find("case-closed") != std::string::npos;
                 });
                 const std::size_t at = closed->find("\"final_token\":\"") + 15;
                 (*closed)[at] = (*closed)[at] == '0' ? '1' : '0';
                 set_log(c.log(), lines);
               },
               "log-end-differs",
               kLog,
               {},
               Verdict::kTampered,
               true},
        Attack{"StrayFileInTheLog",
               [](AttackedCase& c) { write_file(c.log() / "x", ""); },
               "log-not-tidy",
               "log/x",
               {},
               Verdict::kIntact,
               true}),
    name_of);

// Whoever gives the wrong log has found out nothing about the case.
TEST(AttackBesideALogOfAnotherAppliance, IsToldAndAccusesNobody) {
  AttackedCase victim;
  SampleArchive other;
  SampleCase::write(other);
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = other.log_folder();
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  EXPECT_THAT(summary(report), ::testing::AllOf(::testing::HasSubstr("log-of-another-device"),
                                                ::testing::HasSubstr("device-not-trusted"),
                                                ::testing::Not(::testing::HasSubstr("log-case-unknown")),
                                                ::testing::Not(::testing::HasSubstr("log-head-differs"))));
  EXPECT_FALSE(report.in_log);
}

// Every entry but starts and configurations is signed at once: whoever rewrites the end takes the notes away.
TEST(AttackOnTheLog, EntriesThatNobodySignedAreNoProof) {
  const AttackedCase victim;
  const fs::path log = victim.outside("rewritten");  // no archive: cases are not looked for beside it
  fs::rename(victim.log(), log);
  const archive::VerifyOptions options = SoundCases::get().archive.options();
  const std::vector<std::string> lines = log_lines(log);
  const auto remove_notes_above = [&](std::uint64_t size) {
    for (std::uint64_t each = size + 1; each <= lines.size(); ++each) {
      fs::remove(log / archive::note_path(each));
    }
  };
  const std::uint64_t end = lines.size();
  remove_notes_above(end - 1);
  const std::string one_missing = summary_alone(archive::verify_log(log, options));
  EXPECT_EQ(one_missing, "intact\nlog-tail-not-covered ledger.jsonl " + std::to_string(end - 1));
  remove_notes_above(2);
  EXPECT_EQ(summary_alone(archive::verify_log(log, options)), "unproven\nlog-tail-unsigned ledger.jsonl 2");
  remove_notes_above(0);
  EXPECT_EQ(summary_alone(archive::verify_log(log, options)), "unproven\nlog-tail-unsigned ledger.jsonl 0");
}

/// Takes away the checkpoints of the newest `count` lines about the case.
void remove_notes_of_last_lines(const fs::path& log, const std::string& case_id, std::size_t count) {
  const std::vector<std::string> lines = log_lines(log);
  for (std::size_t number = lines.size(); number-- > 0 && count > 0;) {
    if (lines[number].find(case_id) != std::string::npos) {
      fs::remove(log / archive::note_path(number + 1));
      --count;
    }
  }
}

// What the log says of an end is signed line by line. Whoever cuts the end takes those signatures away, too.
TEST(AttackOnTheLog, ACutCaseIsTamperedAlsoWithoutTheCheckpointsOfWhatTheLogSaysOfItsEnd) {
  AttackedCase victim;
  victim.cut(7);
  remove_notes_of_last_lines(victim.log(), victim.folder().filename(), 2);
  const archive::VerificationReport report = victim.verify();
  EXPECT_EQ(report.verdict, Verdict::kTampered) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("log-knows-more ledger.jsonl 7"));
}

// And lines behind the case's last checkpoint that the log states otherwise.
TEST(AttackOnTheLog, RewrittenLinesThatNobodySignedAreTamperedAlsoWithoutTheCheckpointOfWhatTheLogSays) {
  AttackedCase victim;
  const std::vector<std::string> lines = log_lines(victim.log());
  std::uint64_t known = 0;
  for (const std::string& line : lines) {
    const auto entry = archive::parse_log_entry(line).entry.value();
    const auto* checkpoint = std::get_if<archive::CaseCheckpointEntry>(&entry.body);
    if (checkpoint != nullptr && checkpoint->case_id == victim.folder().filename()) {
      known = std::max(known, checkpoint->size);
    }
  }
  ASSERT_GT(known, 5U);
  victim.edit(4, [](CaseEntry& e) { e.at.utc += std::chrono::hours(1); });
  for (std::uint64_t size = 5; size <= victim.lines().size(); ++size) {
    fs::remove(victim / archive::note_path(size));
  }
  remove_notes_of_last_lines(victim.log(), victim.folder().filename(), 2);
  const archive::VerificationReport report = victim.verify();
  EXPECT_EQ(report.verdict, Verdict::kTampered) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("log-checkpoint-differs"));
}

// A closed case that the device signed speaks for itself: a line of the log without a signature does not
// accuse it, and a note that was kept elsewhere is that signature.
TEST(AttackOnTheLog, ANoteThatWasKeptElsewhereCountsForItsLine) {
  SampleArchive archive;
  const fs::path folder = SampleCase::write(archive);
  SampleCase::write(archive);
  const std::vector<std::string> lines = log_lines(archive.log_folder());
  std::uint64_t opened = 0;
  std::vector<archive::OutsideNote> kept;
  for (std::size_t number = 0; number < lines.size(); ++number) {
    if (lines[number].find(folder.filename()) != std::string::npos) {
      const fs::path note = archive.log_folder() / archive::note_path(number + 1);
      kept.push_back({"kept.note", read_file(note)});
      opened = opened == 0 ? number : opened;
      fs::remove(note);
    }
  }
  fs::remove_all(folder);
  archive::VerifyOptions options = archive.options();
  const std::string place = "ledger.jsonl " + std::to_string(opened);
  const archive::VerificationReport alone = archive::verify_log(archive.log_folder(), options);
  EXPECT_THAT(summary(alone), ::testing::HasSubstr("log-entry-doubted " + place)) << details(alone);
  options.against = {kept.front()};
  const archive::VerificationReport report = archive::verify_log(archive.log_folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kTampered) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("case-missing " + place));
}

TEST(AttackOnTheLog, ANoteOfTheLogIsComparedWithTheLogBesideACase) {
  const AttackedCase victim;
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  const std::string note = read_file(victim.log() / archive::note_path(log_lines(victim.log()).size()));
  options.against = {{"kept.note", note}};
  EXPECT_THAT(summary(archive::verify_case(victim.folder(), options)), ::testing::StartsWith("intact\n"));
  // Of a log that was cut back since.
  std::vector<std::string> lines = log_lines(victim.log());
  lines.pop_back();
  set_log(victim.log(), lines);
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("log-not-sound log/ledger.jsonl"));
  EXPECT_THAT(details(report), ::testing::HasSubstr("outside-note-rolled-back"));
  const archive::VerificationReport alone = archive::verify_log(victim.log(), options);
  EXPECT_EQ(alone.verdict, Verdict::kTampered) << details(alone);
}

// Whoever holds no key of a device names none.
TEST(AttackOnTheLog, ALogThatNamesNoDeviceIsTamperedWhoeverSignedIt) {
  const AttackedCase victim;
  std::vector<std::string> lines = log_lines(victim.log());
  const std::string named = "\"device\":\"" + SoundCases::get().archive.device().to_string() + "\"";
  const std::size_t at = lines.front().find(named);
  ASSERT_NE(at, std::string::npos);
  lines.front().replace(at, named.size(), "\"device\":\"\"");
  set_log(victim.log(), lines);
  const archive::VerificationReport report =
      archive::verify_log(victim.log(), SoundCases::get().archive.options());
  EXPECT_EQ(report.verdict, Verdict::kTampered) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("device-invalid ledger.jsonl 0"));
}

TEST(AttackOnTheLog, ALogThatWasEmptiedIsNotIntact) {
  const AttackedCase victim;
  fs::remove_all(victim.log() / "checkpoints");
  write_file(victim.log() / kLedgerName, "");
  const archive::VerificationReport report =
      archive::verify_log(victim.log(), SoundCases::get().archive.options());
  EXPECT_EQ(summary(report), "unproven\nlog-tail-unsigned ledger.jsonl 0") << details(report);
  ASSERT_FALSE(report.findings.empty());
  EXPECT_THAT(report.findings.front().text, ::testing::HasSubstr("the log holds no whole entry"));
}

TEST(AttackByAForgedDevice, ACaseWithGenuineTokensIsUnprovenAlsoBesideTheLogOfATrustedDevice) {
  SampleArchive& sound = SoundCases::get().archive;
  SampleArchive forger;
  const fs::path forged = SampleCase::write(forger);
  archive::VerifyOptions options = forger.options();
  options.devices = {sound.device()};
  options.log.reset();
  EXPECT_EQ(summary(archive::verify_case(forged, options)), "unproven\ndevice-not-trusted - 0");
  options.log = sound.log_folder();
  const archive::VerificationReport report = archive::verify_case(forged, options);
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("log-of-another-device log/ledger.jsonl"));
}

/// A case of a key of their own, that somebody put into the place of the victim.
void put_in_its_place(AttackedCase& victim, const crypto::SigningKey& key) {
  const std::string device = crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()).to_string();
  victim.edit(0, [&](CaseEntry& e) { std::get<archive::OpenEntry>(e.body).device = device; });
  write_file(victim / std::string(archive::kDeviceFile), device + "\n");
  victim.forge(key, true);
}

TEST(AttackByAForgedDevice, ACaseInThePlaceOfOneThatATrustedDevicesLogKnowsIsTampered) {
  AttackedCase victim;
  const crypto::SigningKey key = crypto::SigningKey::generate();
  put_in_its_place(victim, key);
  archive::VerifyOptions options = SoundCases::get().archive.options();
  const crypto::VerifierKey trusted = options.devices.front();
  const crypto::VerifierKey own(SampleArchive::kDeviceName, key.public_key());
  options.log.reset();
  EXPECT_EQ(summary(archive::verify_case(victim.folder(), options)), "unproven\ndevice-not-trusted - 0");
  options.log = victim.log();
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kTampered) << details(report);
  EXPECT_THAT(summary(report),
              ::testing::AllOf(::testing::HasSubstr("log-opening-differs log/ledger.jsonl 1"),
                               ::testing::Not(::testing::HasSubstr("log-of-another-device"))));
  EXPECT_FALSE(report.in_log);
  // Whom the verifier trusts as much as the log, or does not know, it accuses by nobody's word.
  for (const auto& devices :
       {std::vector{trusted, own}, std::vector{own}, std::vector<crypto::VerifierKey>{}}) {
    options.devices = devices;
    const archive::VerificationReport doubted = archive::verify_case(victim.folder(), options);
    EXPECT_EQ(doubted.verdict, Verdict::kUnproven) << details(doubted);
    EXPECT_THAT(summary(doubted), ::testing::HasSubstr("log-of-another-device log/ledger.jsonl 1"));
  }
  // An entry that nobody signed then anybody can have made.
  options.devices = {trusted};
  fs::remove(victim.log() / archive::note_path(2));
  const archive::VerificationReport unsigned_then = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(unsigned_then.verdict, Verdict::kUnproven) << details(unsigned_then);
  EXPECT_THAT(summary(unsigned_then), ::testing::HasSubstr("log-of-another-device log/ledger.jsonl 1"));
}

// Two devices' logs may tell of one case.
TEST(AttackByAForgedDevice, ACaseThatATrustedDevicesLogKnowsByItsOwnLineIsAccusedByNobody) {
  AttackedCase victim;
  put_in_its_place(victim, crypto::SigningKey::generate());
  std::vector<std::string> lines = log_lines(victim.log());
  const std::string name = "\"sha256\":\"";
  lines[1].replace(lines[1].find(name) + name.size(), 2 * sizeof(crypto::Sha256Digest),
                   crypto::to_hex(crypto::sha256(bytes_of(victim.lines().front()))));
  set_log(victim.log(), lines);
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("log-of-another-device log/ledger.jsonl 1"));
}

// What is called as the log's files are with a case is found of the log by that alone.
TEST(AttackOnTheReport, AFolderCalledLogInACaseIsNotTheLog) {
  const AttackedCase victim;
  fs::create_directory(victim / "log");
  write_file(victim / "log/x", "");
  write_file(victim.log() / "x", "");
  std::map<std::string, bool> of_log;
  for (const archive::Finding& finding : victim.verify().findings) {
    if (finding.file == "log/x") of_log[finding.code] = finding.of_log;
  }
  EXPECT_EQ(of_log, (std::map<std::string, bool>{{"file-unnamed", false}, {"log-not-tidy", true}}));
}

TEST(AttackOnTheArchive, ACaseTakenAwayIsToldByTheLog) {
  SampleArchive archive;
  const fs::path folder = SampleCase::write(archive);
  EXPECT_EQ(summary(archive::verify_log(archive.log_folder(), archive.options())), "intact");
  fs::remove_all(folder);
  const archive::VerificationReport report = archive::verify_log(archive.log_folder(), archive.options());
  EXPECT_EQ(summary(report), "tampered\ncase-missing ledger.jsonl 1") << details(report);
}

TEST(AttackOnTheArchive, ACaseAndItsLogEntriesTakenAwayAreToldByTheNextCase) {
  SampleArchive archive;
  const fs::path first = SampleCase::write(archive);
  const fs::path second = SampleCase::write(archive);
  AttackedCase victim(second);
  std::vector<std::string> lines = log_lines(victim.log());
  std::erase_if(lines,
                [&](const std::string& line) { return line.find(first.filename()) != std::string::npos; });
  // What is left is numbered anew.
  const std::string number = "\"seq\":";
  std::string text;
  for (std::size_t seq = 0; seq < lines.size(); ++seq) {
    const std::size_t at = lines[seq].find(number) + number.size();
    lines[seq].replace(at, lines[seq].find(',', at) - at, std::to_string(seq));
    text += lines[seq] + "\n";
  }
  write_file(victim.log() / kLedgerName, text);
  archive::VerifyOptions options = archive.options();
  options.log = victim.log();
  const archive::VerificationReport without_a_key = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(without_a_key.verdict, Verdict::kUnproven) << details(without_a_key);
  EXPECT_THAT(summary(without_a_key), ::testing::HasSubstr("log-silent log/ledger.jsonl"));
  EXPECT_EQ(archive::verify_log(victim.log(), options).verdict, Verdict::kTampered);
  // Signed anew, it is another state than that over which the next case was opened.
  sign_log(victim.log(), lines, archive.key());
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kTampered);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("log-head-differs ledger.jsonl 0")) << details(report);
}

/// What a log that says nothing of the case must be told as, whoever wrote it.
void expect_silent(const AttackedCase& victim, const archive::VerifyOptions& options) {
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), ::testing::AllOf(::testing::HasSubstr("log-silent log/ledger.jsonl"),
                                                ::testing::Not(::testing::HasSubstr("log-case-unknown")),
                                                ::testing::Not(::testing::HasSubstr("log-head-differs"))));
}

TEST(AttackWithoutAKey, ALogInTheDevicesNameThatNobodySignedAccusesNobody) {
  const AttackedCase victim;
  const std::string boot = log_lines(victim.log()).front();
  fs::remove_all(victim.log() / "checkpoints");
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  write_file(victim.log() / kLedgerName, boot + "\n");
  expect_silent(victim, options);
  std::string more = boot + "\n";
  for (int i = 1; i < 20; ++i) {
    more += R"({"type":"shutdown","seq":)" + std::to_string(i) +
            R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9000000000000000})" + "\n";
  }
  write_file(victim.log() / kLedgerName, more);
  expect_silent(victim, options);
}

TEST(AttackWithoutAKey, ACopyOfTheLogFromBeforeTheCaseAccusesNobody) {
  const AttackedCase victim(SoundCases::get().second);
  std::vector<std::string> lines = log_lines(victim.log());
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  const auto opening = std::ranges::find_if(lines, [&](const std::string& line) {
    return line.find("case-opened") != std::string::npos &&
           line.find(victim.folder().filename()) != std::string::npos;
  });
  ASSERT_NE(opening, lines.end());
  lines.erase(opening, lines.end());
  for (; !lines.empty(); lines.pop_back()) {  // just before, and ever earlier
    set_log(victim.log(), lines);
    expect_silent(victim, options);
  }
}

// Other rooms may enter something between the state that `open` has and the line of the case.
TEST(AttackWithoutAKey, ACopyOfTheLogFromWhileTheCaseWasBeingOpenedAccusesNobody) {
  const AttackedCase victim(SoundCases::get().second);
  std::vector<std::string> lines = log_lines(victim.log());
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  const auto opening = std::ranges::find_if(lines, [&](const std::string& line) {
    return line.find("case-opened") != std::string::npos &&
           line.find(victim.folder().filename()) != std::string::npos;
  });
  ASSERT_NE(opening, lines.end());
  lines.erase(opening, lines.end());
  for (const std::size_t more : {1U, 63U}) {
    go_on(victim.log(), lines, more);
    set_log(victim.log(), lines);
    expect_silent(victim, options);
  }
  go_on(victim.log(), lines, 1);
  set_log(victim.log(), lines);
  EXPECT_THAT(summary(archive::verify_case(victim.folder(), options)),
              ::testing::HasSubstr("log-case-unknown"));
}

TEST(AttackWithoutAKey, WhatStandsInALogUnderAnotherKeyAccusesNoCase) {
  for (const std::uint64_t size : {3U, 900U}) {
    const AttackedCase victim;
    CarriedOnByAStranger(victim.log(), end_of(victim.folder().filename(), size));
    archive::VerifyOptions options = SoundCases::get().archive.options();
    options.log = victim.log();
    const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
    EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
    EXPECT_THAT(summary(report), ::testing::HasSubstr("log-of-another-device"));
    ASSERT_TRUE(report.in_log);
    EXPECT_TRUE(report.in_log->end);  // what the device states itself was compared
  }
}

// Names of devices are not unique: that a verifier trusts both keys makes them no one device.
TEST(AttackByANamesake, WhatStandsInALogUnderAnotherTrustedKeyOfItsNameAccusesNoCase) {
  const crypto::SigningKey namesake = crypto::SigningKey::generate();
  for (const std::uint64_t size : {3U, 900U}) {
    const AttackedCase victim;
    CarriedOnByAStranger(victim.log(), end_of(victim.folder().filename(), size), SampleArchive::kDeviceName,
                         namesake);
    archive::VerifyOptions options = SoundCases::get().archive.options();
    options.devices.emplace_back(SampleArchive::kDeviceName, namesake.public_key());
    options.log = victim.log();
    const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
    EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
    EXPECT_THAT(summary(report), ::testing::HasSubstr("log-of-another-device"));
    ASSERT_TRUE(report.in_log);
    EXPECT_TRUE(report.in_log->end);
  }
}

TEST(AttackWithoutAKey, WhatStandsInALogUnderAnotherKeyKeepsNoCaseFromItsRecorder) {
  const AttackedCase victim;
  const std::string case_id = victim.folder().filename();
  CarriedOnByAStranger(victim.log(), end_of(case_id, 900));
  const crypto::SigningKey& key = SoundCases::get().archive.key();
  archive::CaseAgainstLog known(case_id, victim.log(),
                                crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()));
  std::uint64_t lines = 0;
  archive::for_each_whole_line(victim.folder(), [&](std::string_view line) {
    known.take(line);
    ++lines;
  });
  EXPECT_EQ(known.problem(lines), std::nullopt);
}

TEST(AttackWithoutAKey, TheProofOfACasesEndIsOfTheLineThatItsDeviceSigned) {
  const AttackedCase victim;
  const std::string case_id = victim.folder().filename();
  const auto prove = [&] {
    const crypto::SigningKey& key = SoundCases::get().archive.key();
    return archive::prove_case_in_log(victim.folder(), victim.log(),
                                      crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()), {},
                                      [&](const std::string&) { return victim.folder(); });
  };
  const std::uint64_t entry = prove().entry;
  CarriedOnByAStranger(victim.log(), end_of(case_id, 3));
  EXPECT_EQ(prove().entry, entry);
}

class ProofOfAnEnd : public ::testing::Test {
 protected:
  [[nodiscard]] archive::MadeLogProof prove(const std::vector<archive::OutsideNote>& kept = {}) const {
    const crypto::SigningKey& key = SoundCases::get().archive.key();
    return archive::prove_case_in_log(victim_.folder(), victim_.log(),
                                      crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()), kept,
                                      [&](const std::string&) { return victim_.folder(); });
  }
  /// What the verifier says of a proof that holds.
  [[nodiscard]] std::string told_of(const archive::MadeLogProof& made) const {
    archive::VerifyOptions options = SoundCases::get().archive.options();
    options.log_proof = archive::OutsideNote{"case.tlog-proof", made.proof.to_text()};
    for (const archive::Finding& finding : archive::verify_case(victim_.folder(), options).findings) {
      if (finding.code == "log-proof-holds") return finding.text;
    }
    return "";
  }

  AttackedCase victim_;
  std::string case_id_ = victim_.folder().filename();
};

TEST_F(ProofOfAnEnd, IsOfTheLineThatItsDeviceSigned) {
  const archive::MadeLogProof before = prove();
  EXPECT_TRUE(before.signed_then);
  const std::string own = archive::note_path(before.entry + 1);
  const std::vector<archive::OutsideNote> at_once{{own, read_file(victim_.log() / own)}};
  EXPECT_THAT(told_of(prove(at_once)),
              ::testing::HasSubstr("The device signed that entry before another followed"));
  CarriedOnByAStranger(victim_.log(), end_of(case_id_, 3));
  EXPECT_EQ(prove().entry, before.entry);
  EXPECT_THAT(told_of(prove()), ::testing::HasSubstr("under whose name it stood"));
  // Nor is it the stranger's where somebody took away what shows which one the device signed.
  fs::remove(victim_.log() / own);
  EXPECT_EQ(prove().entry, before.entry);
  EXPECT_FALSE(prove().signed_then);
}

TEST_F(ProofOfAnEnd, OfAnEndThatStandsUnderAnotherKeyAloneThereIsNone) {
  for (const char* const name : {kStranger, SampleArchive::kDeviceName}) {
    std::vector<std::string> lines = log_lines(victim_.log());
    std::erase_if(lines, [&](const std::string& line) {
      return line.find("\"case-closed\"") != std::string::npos && line.find(case_id_) != std::string::npos;
    });
    set_log(victim_.log(), lines);
    CarriedOnByAStranger(victim_.log(), end_of(case_id_, 3), name);
    EXPECT_THAT([&] { static_cast<void>(prove()); },
                ::testing::ThrowsMessage<Error>(::testing::HasSubstr("names another device")));
  }
}

// Two machines may have one name, and a proof has no line that says which of them the case is of.
TEST_F(ProofOfAnEnd, ByAnotherTrustedKeyOfTheDevicesNameIsNotUsed) {
  const crypto::SigningKey namesake = crypto::SigningKey::generate();
  archive::MadeLogProof made = prove();
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log.reset();
  const auto summary_of = [&](const std::string& note) {
    made.proof.note = note;
    options.log_proof = archive::OutsideNote{"case.tlog-proof", made.proof.to_text()};
    return summary(archive::verify_case(victim_.folder(), options));
  };
  const std::string own = made.proof.note;
  const std::string its = crypto::sign_note(made.log.to_text(), SampleArchive::kDeviceName, namesake);
  for (const bool first : {true, false}) {
    options.devices = SoundCases::get().archive.options().devices;
    options.devices.emplace(first ? options.devices.begin() : options.devices.end(),
                            SampleArchive::kDeviceName, namesake.public_key());
    EXPECT_EQ(summary_of(its), "unproven\nlog-proof-not-used - -");
    EXPECT_EQ(summary_of(own), "intact\nlog-proof-holds - -");
    // Where it signed beside the device, the device did sign.
    EXPECT_EQ(summary_of(own + its.substr(its.rfind("\u2014"))), "intact\nlog-proof-holds - -");
  }
  // Of a key that nobody trusts it vouches for nothing, whatever its name.
  options.devices = {crypto::VerifierKey(SampleArchive::kDeviceName, namesake.public_key())};
  EXPECT_THAT(summary_of(its), ::testing::HasSubstr("log-proof-not-used"));
}

/// What log-silent says.
std::string why_silent(const AttackedCase& victim, const archive::VerifyOptions& options) {
  std::string text;
  for (const archive::Finding& finding : archive::verify_case(victim.folder(), options).findings) {
    if (finding.code == "log-silent") text += finding.text;
  }
  return text;
}

TEST(AttackWithoutAKey, ALogThatSaysNothingSaysWhyAndNothingUntrue) {
  const AttackedCase victim(SoundCases::get().second);
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  const std::string text = read_file(victim.log() / kLedgerName);
  // The lines before the case were changed; those about the case stand there.
  std::string changed = text;
  const std::size_t at = changed.find("\"boot_id\":\"") + 11;
  changed[at] = changed[at] == '0' ? '1' : '0';
  write_file(victim.log() / kLedgerName, changed);
  EXPECT_THAT(why_silent(victim, options),
              ::testing::AllOf(
                  ::testing::HasSubstr("lines of the log given are broken or lack; which state the log had "
                                       "then was not checked"),
                  ::testing::Not(::testing::HasSubstr("knows this case"))));
  // As many lines as open states, of which one is broken.
  const std::string first = text.substr(0, text.find('\n') + 1);
  write_file(victim.log() / kLedgerName, first);
  EXPECT_THAT(why_silent(victim, options),
              ::testing::HasSubstr("broken or lack, of which one may tell of it"));
}

// Of the log of one device, another one may sign what follows: nobody trusts it to say what is not there.
TEST(AttackWithoutAKey, ALogThatAStrangerSignedOnAccusesNobody) {
  const AttackedCase victim;
  std::vector<std::string> lines = log_lines(victim.log());
  lines.resize(1);
  set_log(victim.log(), lines);
  const crypto::SigningKey key = crypto::SigningKey::generate();
  lines.push_back(R"({"type":"device-key-changed","seq":1,"utc":"2026-08-05T10:00:00.000000Z",)"
                  R"("mono_ns":9000000000000000,"device":")" +
                  crypto::VerifierKey(SampleArchive::kDeviceName, key.public_key()).to_string() + "\"}");
  lines.push_back(
      R"({"type":"shutdown","seq":2,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9000000000000000})");
  for (std::uint64_t size = 2; size <= 3; ++size) write_file(victim.log() / archive::note_path(size), "");
  const std::string first_note = read_file(victim.log() / archive::note_path(1));
  sign_log(victim.log(), lines, key);
  write_file(victim.log() / archive::note_path(1), first_note);
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.log = victim.log();
  expect_silent(victim, options);
}

}  // namespace
}  // namespace kiroku::test
