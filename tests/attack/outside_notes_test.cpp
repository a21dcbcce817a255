// The holder of the device's key cuts off or rewrites what it signed, and signs the rest anew. Nothing in the
// folder tells; a note that was kept elsewhere does.
#include <algorithm>
#include <array>
#include <sstream>

#include "archive/format/case_layout.h"
#include "archive/verify/outside_copy.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

SampleArchive& sound() { return SoundCases::get().archive; }

/// A copy of the sound log outside any archive, to be rewritten.
class RewrittenLog : public ::testing::Test {
 protected:
  // Not where an archive keeps it: cases are not looked for beside it.
  RewrittenLog() { fs::rename(victim_.log(), log()); }
  [[nodiscard]] fs::path log() const { return victim_.outside("rewritten"); }
  [[nodiscard]] std::string ledger() const { return read_file(log() / archive::kLedgerFile); }
  [[nodiscard]] std::vector<std::string> lines() const {
    std::vector<std::string> all;
    std::istringstream text(ledger());
    for (std::string line; std::getline(text, line);) {
      all.push_back(line);
    }
    return all;
  }
  /// The sound log's note over its first `size` entries, as it was seen outside.
  static archive::OutsideNote kept(std::uint64_t size) {
    return {"kept.note", read_file(sound().log_folder() / archive::note_path(size))};
  }
  static std::string signed_note(std::uint64_t size, const crypto::Sha256Digest& root,
                                 const crypto::SigningKey& key, const std::string& origin) {
    return crypto::sign_note(crypto::Checkpoint{origin, size, root}.to_text(), SampleArchive::kDeviceName,
                             key);
  }
  static std::string origin() { return archive::log_origin(SampleArchive::kDeviceName); }
  /// Writes these lines and signs a note over all of them, as the key's holder can.
  void rewrite(const std::vector<std::string>& all) const {
    std::string text;
    crypto::MerkleFrontier tree;
    for (const std::string& line : all) {
      text += line + "\n";
      tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    }
    write_file(log() / archive::kLedgerFile, text);
    fs::remove_all(log() / archive::kCheckpointsFolder);
    fs::create_directory(log() / archive::kCheckpointsFolder);
    write_file(log() / archive::note_path(all.size()),
               signed_note(all.size(), tree.root(), sound().key(), origin()));
  }
  [[nodiscard]] archive::VerificationReport verify(std::vector<archive::OutsideNote> against) const {
    archive::VerifyOptions options = sound().options();
    options.against = std::move(against);
    return archive::verify_log(log(), options);
  }
  [[nodiscard]] std::uint64_t size() const { return lines().size(); }

  AttackedCase victim_;
};

TEST_F(RewrittenLog, ThatWasNotRewrittenHoldsAgainstEveryNoteThatWasKept) {
  const archive::VerificationReport report = verify({kept(2), kept(size())});
  EXPECT_EQ(summary_alone(report), "intact\noutside-note-holds - -\noutside-note-holds - -")
      << details(report);
  EXPECT_THAT(report.findings[0].text, HasSubstr("kept.note holds: the first 2 entries"));
}

/// A copy of the sound log that somebody keeps elsewhere, while others can add files to it: a backup takes
/// over what lies in the archive.
class LogBesideACopy : public RewrittenLog {
 protected:
  LogBesideACopy() { fs::copy(sound().log_folder(), copy(), fs::copy_options::recursive); }
  [[nodiscard]] fs::path copy() const { return victim_.outside("copy"); }
  void put(std::uint64_t name, const std::string& note) const {
    write_file(copy() / archive::note_path(name), note);
  }
  [[nodiscard]] archive::VerificationReport verify_by_copy() const {
    archive::VerifyOptions options = sound().options();
    options.copies = {archive::read_outside_copy(copy())};
    return archive::verify_log(log(), options);
  }
  void cut_to(std::size_t entries) const {
    std::vector<std::string> rest = lines();
    rest.resize(entries);
    rewrite(rest);
  }
  static std::string junk(std::uint64_t size) {
    return signed_note(size, {}, crypto::SigningKey::generate(), origin());
  }
};

TEST_F(LogBesideACopy, HoldsByItsNewestNote) {
  const archive::VerificationReport report = verify_by_copy();
  EXPECT_EQ(summary_alone(report), "intact\noutside-note-holds - -") << details(report);
  EXPECT_THAT(report.findings[0].text, HasSubstr("copy/" + archive::note_path(size()) + " holds: the first " +
                                                 std::to_string(size()) + " entries"));
}

// The name of a file says nothing of what is in it.
TEST_F(LogBesideACopy, IsNotHiddenByAnOldNoteUnderALargeNumber) {
  const std::uint64_t before = size();
  put(99'999'999, kept(2).text);
  const archive::VerificationReport sound_yet = verify_by_copy();
  EXPECT_EQ(summary_alone(sound_yet), "intact\noutside-note-holds - -") << details(sound_yet);
  EXPECT_THAT(sound_yet.findings[0].text, HasSubstr("the first " + std::to_string(before) + " entries"));
  EXPECT_THAT(sound_yet.findings[0].text,
              HasSubstr("beside it lies 1 file that is no checkpoint of the size that its name states: "
                        "checkpoints/99999999.note"));
  cut_to(6);
  const archive::VerificationReport report = verify_by_copy();
  EXPECT_EQ(report.verdict, archive::Verdict::kTampered);
  EXPECT_THAT(summary_alone(report), HasSubstr("outside-note-rolled-back ledger.jsonl 6")) << details(report);
}

TEST_F(LogBesideACopy, IsNotHiddenByNotesThatNobodySigned) {
  put(99'999'999, junk(99'999'999));
  put(99'999'998, "nothing");
  put(99'999'997, kept(2).text + kept(2).text);
  EXPECT_EQ(summary_alone(verify_by_copy()), "intact\noutside-note-holds - -");
  cut_to(6);
  EXPECT_THAT(summary_alone(verify_by_copy()), HasSubstr("outside-note-rolled-back ledger.jsonl 6"));
}

TEST_F(LogBesideACopy, IsNotHiddenByANoteOfAnotherRecordOfTheDevice) {
  put(99'999'999, signed_note(99'999'999, {}, sound().key(), "kiroku/or3/20260805T091502Z-3f9c21ab"));
  EXPECT_EQ(summary_alone(verify_by_copy()), "intact\noutside-note-holds - -");
  cut_to(6);
  EXPECT_THAT(summary_alone(verify_by_copy()), HasSubstr("outside-note-rolled-back ledger.jsonl 6"));
}

// The key's holder writes another history, and puts its end into the copy beside what the copy had.
TEST_F(LogBesideACopy, IsAForkThoughItsOwnNewestNoteWasAddedThere) {
  std::vector<std::string> other = lines();
  std::string& line = other[5];
  line.replace(line.find("\"utc\":\"") + 7, 4, "2001");
  std::string more = other[2];
  more.replace(more.find("\"seq\":2"), 7, "\"seq\":" + std::to_string(other.size()));
  other.push_back(more);
  rewrite(other);
  put(other.size(), read_file(log() / archive::note_path(other.size())));
  const archive::VerificationReport report = verify_by_copy();
  EXPECT_EQ(report.verdict, archive::Verdict::kTampered);
  EXPECT_THAT(summary_alone(report), HasSubstr("outside-note-forked ledger.jsonl 5")) << details(report);
}

TEST_F(LogBesideACopy, WithTwoNotesOfOneSizeSignedTwoHistories) {
  put(99'999'999, signed_note(6, {}, sound().key(), origin()));
  EXPECT_THAT(summary_alone(verify_by_copy()), HasSubstr("outside-notes-contradict - -"));
}

// A note by Ed25519 alone lies between those that do accuse.
TEST_F(LogBesideACopy, WithTwoHistoriesByAllKeysAccusesWhateverLiesBetween) {
  const crypto::SigningKey all = crypto::SigningKey::from_pem(sound().key().to_pem(nullptr).text(), nullptr)
                                     .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  const auto note = [&](const std::string& history, const crypto::SigningKey& key) {
    const crypto::Checkpoint text{origin(), 6, crypto::sha256(bytes_of(history))};
    return crypto::sign_note_by_all(text.to_text(), SampleArchive::kDeviceName, key).note;
  };
  put(99'999'998, note("another", sound().key()));
  archive::VerifyOptions options = sound().options();
  options.devices = {crypto::verifier_key_of(SampleArchive::kDeviceName, all)};
  options.against = {{"kept.note", note("one", all)}};
  options.copies = {archive::read_outside_copy(copy())};
  const std::string by_ed25519 = summary_alone(archive::verify_log(log(), options));
  EXPECT_THAT(by_ed25519, HasSubstr("outside-note-not-by-both - -"));
  EXPECT_THAT(by_ed25519, ::testing::Not(HasSubstr("outside-notes-contradict")));
  put(99'999'999, note("a third", all));
  options.copies = {archive::read_outside_copy(copy())};
  EXPECT_THAT(summary_alone(archive::verify_log(log(), options)), HasSubstr("outside-notes-contradict - -"));
}

TEST_F(LogBesideACopy, ThatNobodySignedIsNotCompared) {
  fs::remove_all(copy() / archive::kCheckpointsFolder);
  fs::create_directory(copy() / archive::kCheckpointsFolder);
  put(3, junk(3));
  EXPECT_THAT(summary_alone(verify_by_copy()), HasSubstr("unproven\noutside-note-untrusted - -"));
  put(3, "nothing");
  EXPECT_THAT(summary_alone(verify_by_copy()), HasSubstr("unproven\noutside-note-invalid - -"));
}

TEST_F(RewrittenLog, WithItsLastEntriesCutOffIsToldByANoteOverThem) {
  const std::uint64_t before = size();
  std::vector<std::string> rest = lines();
  rest.resize(6);  // the second case was never opened
  rewrite(rest);
  // Alone it is not believed, for one checkpoint is over many lines; what was cut off only a note can tell.
  ASSERT_EQ(summary_alone(verify({})), "unproven\nlog-signed-late checkpoints/00000006.note 5");
  const archive::VerificationReport report = verify({kept(2), kept(before)});
  EXPECT_EQ(summary_alone(report),
            "tampered\nlog-signed-late checkpoints/00000006.note 5"
            "\noutside-note-rolled-back ledger.jsonl 6\noutside-note-holds - -")
      << details(report);
  EXPECT_THAT(report.findings[1].text,
              HasSubstr("the last " + std::to_string(before - 6) + " entries were removed"));
}

TEST_F(RewrittenLog, WithAnotherEntryIsAForkFromTheNewestNoteThatHolds) {
  const std::uint64_t end = size();
  std::vector<std::string> other = lines();
  std::string& line = other[5];
  line.replace(line.find("\"utc\":\"") + 7, 4, "2001");
  rewrite(other);
  ASSERT_THAT(summary_alone(verify({})), ::testing::StartsWith("unproven\nlog-signed-late"));
  const archive::VerificationReport report = verify({kept(end), kept(3)});
  EXPECT_EQ(summary_alone(report),
            "tampered\noutside-note-forked ledger.jsonl 3"
            "\nlog-signed-late checkpoints/00000011.note 10\noutside-note-holds - -")
      << details(report);
  EXPECT_THAT(report.findings[0].text, HasSubstr("parts from this one at entry 3 or later"));
}

TEST_F(RewrittenLog, ThatGrewAgainAfterTheCutIsAForkToo) {
  const std::uint64_t before = size();
  std::vector<std::string> other = lines();
  other.resize(3);
  while (other.size() < before + 2) {
    std::string more = lines()[2];
    more.replace(more.find("\"seq\":2"), 7, "\"seq\":" + std::to_string(other.size()));
    other.push_back(more);
  }
  rewrite(other);
  EXPECT_THAT(summary_alone(verify({kept(before)})),
              HasSubstr("tampered\noutside-note-forked ledger.jsonl 0"));
}

TEST_F(RewrittenLog, IsNotJudgedByANoteOfAnotherLog) {
  SampleArchive other;
  SampleCase::write(other);
  archive::VerifyOptions options = sound().options();
  // Of another trusted device's log, and signed by its key in this device's name.
  options.against = {{"other.note", signed_note(2, {}, other.key(), "kiroku/or4/log")}};
  options.devices.emplace_back("or4", other.key().public_key());
  EXPECT_EQ(summary_alone(archive::verify_log(log(), options)), "unproven\noutside-note-untrusted - -");
  options.against = {{"other.note", crypto::sign_note(crypto::Checkpoint{"kiroku/or4/log", 2, {}}.to_text(),
                                                      "or4", other.key())}};
  EXPECT_EQ(summary_alone(archive::verify_log(log(), options)), "unproven\noutside-note-of-other-origin - -");
  // A note of one of the device's cases is none of its log.
  options.against = {{"case.note", read_file(SoundCases::get().first / "checkpoints/00000011.note")}};
  EXPECT_EQ(summary_alone(archive::verify_log(log(), options)), "unproven\noutside-note-of-other-origin - -");
}

// Two machines of one name, whose keys the verifier trusts: each speaks for what it signed itself.
class BesideItsNamesake : public RewrittenLog {
 protected:
  [[nodiscard]] archive::VerificationReport verify_with_both(
      std::vector<archive::OutsideNote> against) const {
    archive::VerifyOptions options = sound().options();
    options.devices.insert(options.devices.begin(), key());
    options.against = std::move(against);
    return archive::verify_log(log(), options);
  }
  [[nodiscard]] archive::OutsideNote of_namesake(std::uint64_t size,
                                                 const crypto::Sha256Digest& root = {}) const {
    return {"namesake.note", signed_note(size, root, namesake_, origin())};
  }
  [[nodiscard]] crypto::VerifierKey key() const {
    return {SampleArchive::kDeviceName, namesake_.public_key()};
  }
  crypto::SigningKey namesake_ = crypto::SigningKey::generate();
};

TEST_F(BesideItsNamesake, IsNotAccusedByANoteOfThat) {
  for (const std::uint64_t each : {std::uint64_t{2}, size(), size() + 100}) {
    const archive::VerificationReport report = verify_with_both({of_namesake(each)});
    EXPECT_EQ(summary_alone(report), "unproven\noutside-note-of-other-origin - -") << details(report);
    EXPECT_THAT(report.findings[0].text,
                HasSubstr("by another trusted key of that name, " + key().to_string()));
  }
}

TEST_F(BesideItsNamesake, IsNoSecondHistoryOfThat) {
  const archive::VerificationReport report = verify_with_both({kept(2), of_namesake(2)});
  EXPECT_EQ(summary_alone(report), "unproven\noutside-note-holds - -\noutside-note-of-other-origin - -")
      << details(report);
}

// Nor does it hide those that the device signed itself, in a copy as by themselves.
TEST_F(BesideItsNamesake, IsAccusedByTwoHistoriesOfItsOwnBesideTwoOfThat) {
  const crypto::Sha256Digest root = crypto::sha256(bytes_of("another history"));
  const archive::OutsideNote other{"other.note", signed_note(2, root, sound().key(), origin())};
  const archive::OutsideNote of_that = of_namesake(2, root);
  EXPECT_THAT(summary_alone(verify_with_both({of_namesake(2), of_that, kept(2), other})),
              HasSubstr("outside-notes-contradict - -"));
  const fs::path copy = victim_.outside("copy");
  fs::copy(sound().log_folder(), copy, fs::copy_options::recursive);
  const std::array<std::string, 3> texts{of_namesake(2).text, of_that.text, other.text};
  for (std::size_t i = 0; i < texts.size(); ++i) write_file(copy / archive::note_path(900 + i), texts.at(i));
  archive::VerifyOptions options = sound().options();
  options.devices.insert(options.devices.begin(), key());
  options.copies = {archive::read_outside_copy(copy)};
  EXPECT_THAT(summary_alone(archive::verify_log(log(), options)), HasSubstr("outside-notes-contradict - -"));
}

// Whoever has that key can sign two histories of its own, and hand both over.
TEST_F(BesideItsNamesake, IsNotAccusedByTwoHistoriesOfThat) {
  const archive::OutsideNote other = of_namesake(2, crypto::sha256(bytes_of("another history")));
  const archive::VerificationReport report = verify_with_both({of_namesake(2), other});
  EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary_alone(report), ::testing::Not(HasSubstr("contradict")));
  EXPECT_THAT(details(report), HasSubstr("what was shown is another device's"));
  // Without a log nobody knows whose it would be, and the notes prove what they prove.
  fs::remove_all(log());
  EXPECT_THAT(summary(verify_with_both({of_namesake(2), other})), HasSubstr("outside-notes-contradict - -"));
}

TEST_F(BesideItsNamesake, IsAccusedByANoteOfItsOwnAllTheSame) {
  const archive::OutsideNote before = kept(size());
  std::vector<std::string> rest = lines();
  rest.resize(6);
  rewrite(rest);
  const archive::VerificationReport report = verify_with_both({of_namesake(3), before});
  EXPECT_EQ(report.verdict, archive::Verdict::kTampered);
  EXPECT_THAT(summary_alone(report), HasSubstr("outside-note-rolled-back ledger.jsonl 6")) << details(report);
}

// What another key signed shows nothing of how far an own history goes.
TEST_F(BesideItsNamesake, PartsFromItsOwnHistoryWhereItsOwnNotesSay) {
  const archive::OutsideNote before = kept(size());
  std::vector<std::string> other = lines();
  other[3].replace(other[3].find("\"utc\":\"") + 7, 4, "2001");
  rewrite(other);
  crypto::MerkleFrontier tree;
  for (std::size_t i = 0; i < 6; ++i) tree.append(crypto::merkle_leaf_hash(bytes_of(other[i])));
  EXPECT_THAT(summary_alone(verify_with_both({kept(2), of_namesake(6, tree.root()), before})),
              HasSubstr("outside-note-forked ledger.jsonl 2"));
}

TEST_F(BesideItsNamesake, IsTheOneOfACopyThatHoldsBothMachinesNotes) {
  const fs::path copy = victim_.outside("copy");
  fs::copy(sound().log_folder(), copy, fs::copy_options::recursive);
  for (const std::uint64_t each : {size() + 1, size() + 100})
    write_file(copy / archive::note_path(each), of_namesake(each).text);
  const auto verify_by_copy = [&] {
    archive::VerifyOptions options = sound().options();
    options.devices.push_back(key());
    options.copies = {archive::read_outside_copy(copy)};
    return archive::verify_log(log(), options);
  };
  EXPECT_EQ(summary_alone(verify_by_copy()), "intact\noutside-note-holds - -");
  // At one size it has another root by that.
  write_file(copy / archive::note_path(999), of_namesake(2).text);
  EXPECT_EQ(summary_alone(verify_by_copy()), "intact\noutside-note-holds - -");
  fs::remove_all(copy / archive::kCheckpointsFolder);
  fs::create_directory(copy / archive::kCheckpointsFolder);
  write_file(copy / archive::note_path(2), of_namesake(2).text);
  EXPECT_EQ(summary_alone(verify_by_copy()), "unproven\noutside-note-of-other-origin - -");
}

// Anybody can add a line that names it.
TEST_F(BesideItsNamesake, IsNotAccusedByThatWhereALineNamesItsKey) {
  std::string text = ledger();
  text +=
      R"({"type":"boot","seq":)" + std::to_string(size()) +
      R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":1,"boot_id":"00000000-0000-4000-8000-000000000000",)"
      R"("device":")" +
      key().to_string() + "\"}\n";
  write_file(log() / archive::kLedgerFile, text);
  const archive::VerificationReport report = verify_with_both({of_namesake(3)});
  EXPECT_NE(report.verdict, archive::Verdict::kTampered) << details(report);
  EXPECT_THAT(summary_alone(report), HasSubstr("outside-note-of-other-origin - -"));
}

TEST_F(RewrittenLog, IsNotAccusedByANoteThatAnybodyCouldWrite) {
  const crypto::SigningKey forger = crypto::SigningKey::generate();
  const crypto::Sha256Digest root = crypto::sha256(bytes_of("another history"));
  // By another key, in the device's name.
  EXPECT_EQ(summary_alone(verify({{"forged.note", signed_note(4, root, forger, origin())}})),
            "unproven\noutside-note-untrusted - -");
  // The device's own signature, over another text.
  std::string changed = kept(2).text;
  changed.replace(changed.find("\n2\n"), 3, "\n9\n");
  EXPECT_EQ(summary_alone(verify({{"changed.note", changed}})), "unproven\noutside-note-invalid - -");
  for (const std::string& other : {std::string(), std::string("x"), kept(2).text + "x"}) {
    EXPECT_EQ(summary_alone(verify({{"none.note", other}})), "unproven\noutside-note-invalid - -");
  }
  // A device speaks for its own log alone, also where another one is trusted.
  archive::VerifyOptions options = sound().options();
  options.devices.emplace_back("or4", forger.public_key());
  options.against = {
      {"or4.note", crypto::sign_note(crypto::Checkpoint{origin(), 4, root}.to_text(), "or4", forger)}};
  EXPECT_EQ(summary_alone(archive::verify_log(log(), options)), "unproven\noutside-note-untrusted - -");
}

TEST_F(RewrittenLog, IsNotJudgedWithoutATrustedDevice) {
  archive::VerifyOptions options;
  options.against = {kept(2)};
  EXPECT_THAT(summary_alone(archive::verify_log(log(), options)),
              HasSubstr("unproven\nno-trusted-device - 0\noutside-note-untrusted - -"));
}

TEST_F(RewrittenLog, OfWhichTwoNotesContradictEachOtherIsAForkWhateverIsShown) {
  const std::string other =
      signed_note(2, crypto::sha256(bytes_of("another history")), sound().key(), origin());
  const archive::VerificationReport report = verify({kept(2), {"other.note", other}});
  EXPECT_EQ(
      summary_alone(report),
      "tampered\noutside-note-forked ledger.jsonl 0\noutside-note-holds - -\noutside-notes-contradict - -")
      << details(report);
  fs::remove_all(log());
  const archive::VerificationReport without = verify({kept(2), {"other.note", other}});
  EXPECT_EQ(without.verdict, archive::Verdict::kTampered);
  EXPECT_THAT(summary(without), HasSubstr("outside-notes-contradict - -"));
  EXPECT_THROW((void)verify({kept(2)}), Error);
  // The same note twice is one.
  EXPECT_THROW((void)verify({kept(2), kept(2)}), Error);
}

TEST_F(RewrittenLog, WithALineThatCannotBeHashedCouldNotBeCompared) {
  write_file(log() / archive::kLedgerFile, ledger() + std::string((1U << 20U) + 1, 'x') + "\n");
  const archive::OutsideNote beyond{
      "kept.note", signed_note(size(), crypto::sha256(bytes_of("x")), sound().key(), origin())};
  EXPECT_THAT(summary_alone(verify({beyond})), HasSubstr("outside-note-unchecked - -"));
}

// -- a case against its receipt

class RewrittenCase : public ::testing::Test {
 protected:
  static archive::OutsideNote receipt() {
    return {"receipt.note", read_file(SoundCases::get().first / "checkpoints/00000011.note")};
  }
  [[nodiscard]] archive::VerificationReport verify(std::vector<archive::OutsideNote> against) const {
    archive::VerifyOptions options = sound().options();
    options.log.reset();
    options.against = std::move(against);
    return archive::verify_case(victim_.folder(), options);
  }
  AttackedCase victim_;
};

TEST_F(RewrittenCase, ThatWasNotRewrittenHolds) {
  EXPECT_EQ(summary(verify({receipt()})), "intact\noutside-note-holds - -");
}

TEST_F(RewrittenCase, ForgedByDeviceAndAuthorityIsAFork) {
  victim_.edit(5, [](archive::CaseEntry& e) { std::get<archive::MarkEntry>(e.body).commitment = {}; });
  victim_.forge(sound().key(), true);
  ASSERT_EQ(summary(verify({})), "intact");  // only the note can tell
  EXPECT_EQ(summary(verify({receipt()})), "tampered\noutside-note-forked ledger.jsonl 0");
}

TEST_F(RewrittenCase, IsNotHiddenByAnOldNoteUnderALargeNumberInACopyOfIt) {
  const fs::path copy = victim_.outside("copy");
  fs::copy(SoundCases::get().first, copy, fs::copy_options::recursive);
  std::uint64_t least = ~std::uint64_t{0};
  for (const auto& note : fs::directory_iterator(copy / archive::kCheckpointsFolder))
    least = std::min(least, archive::size_of_note_name(note.path().filename().string()).value());
  fs::copy(copy / archive::note_path(least), copy / archive::note_path(99'999'999));
  archive::VerifyOptions options = sound().options();
  options.log.reset();
  options.copies = {archive::read_outside_copy(copy)};
  EXPECT_EQ(summary(archive::verify_case(victim_.folder(), options)), "intact\noutside-note-holds - -");
  victim_.edit(5, [](archive::CaseEntry& e) { std::get<archive::MarkEntry>(e.body).commitment = {}; });
  victim_.forge(sound().key(), true);
  EXPECT_THAT(summary(archive::verify_case(victim_.folder(), options)),
              HasSubstr("tampered\noutside-note-forked ledger.jsonl"));
}

TEST_F(RewrittenCase, CutBehindAClaimedPowerCutIsRolledBack) {
  victim_.cut(7);
  EXPECT_THAT(summary(verify({receipt()})), HasSubstr("outside-note-rolled-back ledger.jsonl 7"));
  EXPECT_EQ(verify({receipt()}).verdict, archive::Verdict::kTampered);
}

TEST_F(RewrittenCase, IsNotJudgedByTheReceiptOfAnother) {
  EXPECT_EQ(
      summary(verify({{"other.note", read_file(SoundCases::get().second / "checkpoints/00000011.note")}})),
      "unproven\noutside-note-of-other-origin - -");
}

TEST_F(RewrittenCase, IsNotJudgedByAReceiptThatAnotherMachineOfItsNameSigned) {
  const crypto::SigningKey namesake = crypto::SigningKey::generate();
  const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(receipt().text, {}).text);
  ASSERT_TRUE(checkpoint);
  archive::VerifyOptions options = sound().options();
  options.log.reset();
  options.devices.emplace_back(SampleArchive::kDeviceName, namesake.public_key());
  for (const std::uint64_t size : {std::uint64_t{3}, checkpoint->size, std::uint64_t{900}}) {
    const std::string text = crypto::Checkpoint{checkpoint->origin, size, {}}.to_text();
    options.against = {{"other.note", crypto::sign_note(text, SampleArchive::kDeviceName, namesake)}};
    EXPECT_EQ(summary(archive::verify_case(victim_.folder(), options)),
              "unproven\noutside-note-of-other-origin - -");
  }
}

TEST_F(RewrittenCase, WithoutItsLedgerLeavesTheReceiptUnanswered) {
  fs::remove(victim_ / "ledger.jsonl");
  fs::create_directory(victim_ / "ledger.jsonl");
  EXPECT_THAT(summary(verify({receipt()})), HasSubstr("outside-note-unchecked - -"));
}

}  // namespace
}  // namespace kiroku::test
