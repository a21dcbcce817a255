// What stands in the appliance log behind the newest checkpoint of its device, and is not the device's: who
// can write to the archive's disk, and has no key, adds it. Nothing of it keeps anybody from recording.
#include <algorithm>
#include <cerrno>
#include <fstream>
#include <functional>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;
using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr const char* kCase = "20260805T091502Z-3f9c21ab";
constexpr std::int64_t kFarAhead = 8'000'000'000'000'000;
crypto::Sha256Digest some_hash() { return crypto::sha256(bytes_of("abc")); }

std::string text_of_file(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class ForeignLines : public testing::Test {
 protected:
  [[nodiscard]] fs::path log_folder() const { return root() / "log"; }
  [[nodiscard]] fs::path ledger() const { return log_folder() / kLedgerFile; }
  [[nodiscard]] virtual fs::path root() const { return folder_.path(); }

  std::unique_ptr<ApplianceLog> open(FileSystem& files, const crypto::SigningKey& key,
                                     const std::optional<crypto::Checkpoint>& kept = {}) const {
    return ApplianceLog::open(files, log_folder(), key, "theatre-1", kept);
  }
  std::unique_ptr<ApplianceLog> open() const { return open(real_file_system(), key_); }

  [[nodiscard]] std::vector<std::string> types() const {
    std::vector<std::string> types;
    for_each_readable_log_line(log_folder(), [&](const LogLine& line) { types.push_back(line.type); });
    return types;
  }
  [[nodiscard]] LogEntry last() const {
    return parse_log_entry(read_log(log_folder()).back().json).entry.value();
  }
  /// A line as it would follow, of this body.
  [[nodiscard]] std::string next_line(const LogEntryBody& body) const {
    LogEntry entry = last();
    ++entry.seq;
    entry.body = body;
    return to_line(entry);
  }
  void add_text(const std::string& text) const { std::ofstream(ledger(), std::ios::app) << text; }
  void add(const LogEntryBody& body) const { add_text(next_line(body) + "\n"); }
  /// A checkpoint over the lines as they are.
  void sign(const std::string& name, const crypto::SigningKey& key) const {
    crypto::MerkleFrontier tree;
    for (const LogLine& line : read_log(log_folder()))
      tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    const crypto::Checkpoint text{log_origin(name), tree.size(), tree.root()};
    std::ofstream(log_folder() / note_path(text.size), std::ios::binary)
        << crypto::sign_note(text.to_text(), name, key);
  }
  [[nodiscard]] crypto::Sha256Digest root_of_all() const {
    return root_of_log(log_folder(), read_log(log_folder()).size());
  }
  /// What lies beside the log.
  [[nodiscard]] std::vector<std::string> aside() const {
    std::vector<std::string> texts;
    if (!fs::exists(root() / kLogAsideFolder)) return texts;
    for (const auto& file : fs::directory_iterator(root() / kLogAsideFolder)) {
      const std::string text = text_of_file(file.path());
      EXPECT_THAT(file.path().filename().string(),
                  testing::EndsWith("-" + crypto::to_hex(crypto::sha256(bytes_of(text))) + ".jsonl"));
      texts.push_back(text);
    }
    return texts;
  }
  [[nodiscard]] VerificationReport verify() const {
    VerifyOptions options;
    options.devices = {device_};
    return verify_log(log_folder(), options);
  }
  [[nodiscard]] std::string codes() const {
    const VerificationReport report = verify();
    std::string codes(verdict_name(report.verdict));
    for (const Finding& each : report.findings) codes += " " + each.code;
    return codes;
  }
  [[nodiscard]] std::vector<std::string> deeds() const {
    std::vector<std::string> deeds;
    for (const LogLine& line : read_log(log_folder())) {
      const LogEntryParse parsed = parse_log_entry(line.json);
      const auto* access = std::get_if<AccessEntry>(&parsed.entry->body);
      if (access != nullptr && access->who == "kiroku") deeds.push_back(access->what);
    }
    return deeds;
  }

  TemporaryFolder folder_{test::quick_parent()};
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  crypto::SigningKey stranger_ =
      crypto::SigningKey::generate().with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  crypto::VerifierKey device_{"theatre-1", key_.public_key()};
};

/// What somebody adds, by how many lines and signatures are there.
struct Forgery {
  std::string_view name;
  std::function<std::string(const std::function<std::string(LogEntryBody)>& line, const LogEntry& last)> text;
};

std::string changed(LogEntry entry, const std::function<void(LogEntry&)>& change) {
  ++entry.seq;
  entry.body = ConfigChangedEntry{some_hash()};
  change(entry);
  return to_line(entry) + "\n";
}

const crypto::VerifierKey& a_strangers_key() {
  static const crypto::SigningKey key =
      crypto::SigningKey::generate().with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  static const crypto::VerifierKey verifier = crypto::verifier_key_of("theatre-1", key);
  return verifier;
}

constexpr std::string_view kALongLine = "ALongLine";

/// No writer of this device leaves any of them.
const std::vector<Forgery>& forgeries() {
  const auto with = [](LogEntryBody body) {
    return [body](const auto& line, const LogEntry&) { return line(body); };
  };
  static const std::vector<Forgery> all{
      {"BootOfAnotherDevice", with(BootEntry{"b1", a_strangers_key().to_string()})},
      {"BootOfNoDevice", with(BootEntry{"b1", "theatre-1"})},
      {"BootWithAQuote",
       [](const auto& line, const LogEntry&) {
         BootEntry boot{"b1", "theatre-1"};
         boot.quote = StatedQuote{"AAAA", "AAAA", {"0:" + std::string(64, '0')}};
         return line(boot);
       }},
      {"KeyOfAnotherDevice", with(DeviceKeyChangedEntry{a_strangers_key().to_string()})},
      {"MlDsaKey", with(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()})},
      {"NoMlDsaKey", with(DeviceMlDsaEntry{"theatre-1"})},
      {"HardwareKey", with(DeviceHardwareEntry{"theatre-1+ecdsa"})},
      {"AttestationKey",
       with(DeviceAttestationEntry{"AAAA", {"AAAA", "AAAA", {"0:" + std::string(64, '0')}}})},
      {"SilenceOfNoHardware", with(DeviceHardwareSilentEntry{"it was taken away"})},
      {"Damage",
       [](const auto& line, const LogEntry& last) {
         return line(LogDamageEntry{last.seq + 1, some_hash(), some_hash()});
       }},
      {"DamageOfAnEnd",
       [](const auto& line, const LogEntry& last) {
         return line(LogDamageEntry{last.seq + 9, some_hash(), {}});
       }},
      {"Nonsense", [](const auto&, const LogEntry&) { return std::string("nonsense\n"); }},
      {"AnUnknownType",
       [](const auto&, const LogEntry& last) {
         return R"({"type":"praised","seq":)" + std::to_string(last.seq + 1) +
                R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9})" + "\n";
       }},
      {"AnotherNumber",
       [](const auto&, const LogEntry& last) { return changed(last, [](LogEntry& entry) { ++entry.seq; }); }},
      {"AnEarlierMoment",
       [](const auto&, const LogEntry& last) {
         return changed(last, [](LogEntry& entry) { entry.at.mono_ns = 1; });
       }},
      {kALongLine,
       [](const auto&, const LogEntry&) { return std::string(kMaximumLineBytes + 300'000, 'x') + "\n"; }},
      {"BehindAStatement",
       [](const auto& line, const LogEntry&) { return line(ShutdownEntry{}) + "nonsense\n"; }},
  };
  return all;
}

class EachForgery : public ForeignLines, public testing::WithParamInterface<Forgery> {
 protected:
  [[nodiscard]] std::string forged() const {
    return GetParam().text([this](const LogEntryBody& body) { return next_line(body) + "\n"; }, last());
  }
};

/// Those behind which something can be written.
class EachThatIsLeft : public EachForgery {};

TEST_P(EachForgery, IsPutAsideAndTheLogIsSoundAndGoesOn) {
  const std::uint64_t hold = open()->case_held(kCase, "court order", "anna");
  const std::string before = text_of_file(ledger()), text = forged();
  add_text(text);
  const auto log = open();
  EXPECT_THAT(types(), ElementsAre("boot", "case-held", "recovered", "access")) << "at once";
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(before));
  EXPECT_EQ(log->damage(), "");
  EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("this device did not write")));
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "case-held", "recovered", "access", "access"));
  // What stands before it may be a crash's.
  const bool is_first = text.find("shutdown") == std::string::npos;
  EXPECT_THAT(deeds(), ElementsAre(testing::StartsWith("set aside what stood from entry " +
                                                       std::to_string(is_first ? hold + 1 : hold + 2))));
  EXPECT_THAT(aside(), Contains(is_first ? text : "nonsense\n"));
  EXPECT_THAT(aside(), SizeIs(is_first ? 1 : 2));
  EXPECT_EQ(codes(), "intact");
  EXPECT_THAT(open()->remarks(), IsEmpty());
}

TEST_P(EachForgery, IsPutAsideWhileTheLogIsOpen) {
  const auto log = open();
  log->boot("b1");
  log->config_changed(some_hash());
  log->access("*", "unlocked", "sato");
  std::vector<std::string> told;
  log->tell_of_remarks([&](const std::string& remark) { told.push_back(remark); });
  add_text(forged());
  log->case_opened(kCase, some_hash());
  EXPECT_THAT(told, SizeIs(1));
  EXPECT_THAT(types(), ElementsAre("boot", "config-changed", "access", "recovered", "access", "case-opened"));
  log->tell_of_remarks({});
  log->case_closed(kCase, 9, some_hash(), {});
  EXPECT_THAT(codes(), Not(AnyOf(HasSubstr("tampered log-"), HasSubstr("entry-"), HasSubstr("late"))));
}

TEST_P(EachForgery, IsLostNowhereAndNeverSignedWhereverTheNextStartIsKilled) {
  for (const bool power : {false, true}) {
    bool through = false;
    for (std::size_t at = 0; !through; ++at) {
      fs::remove_all(log_folder());
      fs::remove_all(root() / kLogAsideFolder);
      open()->access("*", "unlocked", "sato");
      const std::string text = forged();
      add_text(text);
      FaultFileSystem files(root());
      files.kill_at(at);
      try {
        const auto log = open(files, key_);
        log->boot("b2");
        log->access("*", "locked", "sato");
        through = true;
      } catch (const test::Killed&) {
        if (power) files.lose_power();
      }
      open()->access("*", "unlocked", "mori");
      EXPECT_THAT(codes(), AnyOf("intact", "intact part-file")) << "kill at call " << at;
      const bool is_whole = std::ranges::any_of(aside(), [&](const std::string& kept) {
        return kept.find("nonsense") != std::string::npos || kept == text;
      });
      EXPECT_TRUE(is_whole) << "kill at call " << at;
      ASSERT_FALSE(HasFailure());
    }
  }
}

// What was changed and what was added are both left to whoever asks what happened.
TEST_P(EachThatIsLeft, IsLeftWhereLinesBeforeItWereChangedAndKeepsNobodyFromRecording) {
  open()->access("*", "unlocked", "sato");
  std::string text = text_of_file(ledger());
  text.replace(text.find("unlocked"), 8, "unlockeD");
  std::ofstream(ledger(), std::ios::binary) << text;
  add_text(forged());
  text = text_of_file(ledger());
  for (int i = 0; i < 3; ++i) {
    const auto log = open();
    EXPECT_THAT(log->damage(), testing::StartsWith(i == 0 ? "the appliance log" : ""));
    log->access("*", "unlocked", "sato");
    EXPECT_THAT(log->stated_keys().ml_dsa, std::nullopt);
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(types(), Contains("damage-found"));
  EXPECT_THAT(text_of_file(ledger()), HasSubstr("found no signature of this device over entries "));
  EXPECT_THAT(codes(), AnyOf(HasSubstr("log-damage-stated"), HasSubstr("checkpoint-root-differs")));
}

// Else the changed lines would be signed with what says that the added one was put aside.
TEST_P(EachThatIsLeft, IsLeftWhereLinesBeforeItAreChangedWhileTheLogIsOpen) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  log->access("*", "locked", "sato");
  std::string text = text_of_file(ledger());
  text.replace(text.find("unlocked"), 8, "unlockeD");
  std::ofstream(ledger(), std::ios::binary) << text;
  add_text(forged());
  text = text_of_file(ledger());
  log->access("*", "unlocked", "mori");
  log->access("*", "locked", "mori");
  EXPECT_THAT(log->remarks(), Contains(HasSubstr("were changed while it was open")));
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(types(), Contains("damage-found"));
  EXPECT_THAT(aside(), IsEmpty());
  EXPECT_THAT(codes(), AnyOf(HasSubstr("log-damage-stated"), HasSubstr("checkpoint-root-differs")));
  EXPECT_EQ(open()->damage(), "") << "it is stated";
}

// What this object signs then goes on from the lines that the other one signed.
TEST_F(ForeignLines, ThatAnotherProgramFoundChangedAreReadAnewByThisOne) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  log->access("*", "locked", "sato");
  std::string text = text_of_file(ledger());
  text.replace(text.find("unlocked"), 8, "unlockeD");
  std::ofstream(ledger(), std::ios::binary) << text;
  open()->access("*", "unlocked", "mori");
  log->access("*", "locked", "mori");
  EXPECT_EQ(open()->damage(), "") << "the newest checkpoint fits";
  EXPECT_EQ(std::ranges::count(types(), "damage-found"), 1);
  EXPECT_THAT(codes(), HasSubstr("log-damage-stated"));
}

TEST_F(ForeignLines, AreToldOnceToWhoeverListensLater) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  add_text("nonsense\n");
  log->access("*", "locked", "sato");
  std::vector<std::string> told;
  log->tell_of_remarks([&](const std::string& remark) { told.push_back(remark); });
  log->tell_of_remarks({});
  log->tell_of_remarks([&](const std::string& remark) { told.push_back(remark); });
  EXPECT_THAT(told, ElementsAre(HasSubstr("this device did not write")));
}

TEST_P(EachThatIsLeft, OnADiskWithoutRoomIsLeftAndNamedAndKeepsNobodyFromRecording) {
  open()->access("*", "unlocked", "sato");
  add_text(forged());
  const std::string text = text_of_file(ledger());
  FaultFileSystem files(root());
  files.fail("create log-aside", ENOSPC);
  {
    const auto log = open(files, key_);
    log->access("*", "unlocked", "sato");
    EXPECT_THAT(log->remarks(), Contains(HasSubstr("cannot be put aside")));
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(text_of_file(ledger()), HasSubstr("found no signature of this device over entries "));
  // Covered by a checkpoint of the device now; what it states counts for nothing all the same.
  for (int i = 0; i < 3; ++i) open()->access("*", "unlocked", "sato");
  EXPECT_EQ(open()->stated_keys().ml_dsa, std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(Of, EachForgery, testing::ValuesIn(forgeries()),
                         [](const auto& each) { return std::string(each.param.name); });

INSTANTIATE_TEST_SUITE_P(Of, EachThatIsLeft, testing::ValuesIn([] {
                           std::vector<Forgery> all = forgeries();
                           std::erase_if(all, [](const Forgery& each) { return each.name == kALongLine; });
                           return all;
                         }()),
                         [](const auto& each) { return std::string(each.param.name); });

TEST_F(ForeignLines, ALongLineOnADiskWithoutRoomIsCutOffAllTheSame) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  for (const bool at_a_start : {false, true}) {
    add_text(std::string(kMaximumLineBytes + 300'000, 'x') + "\n");
    FaultFileSystem files(root());
    files.fail("create log-aside", ENOSPC);
    const auto started = at_a_start ? open(files, key_) : nullptr;
    if (!started) std::ofstream(root() / kLogAsideFolder) << "in the way";
    (started ? *started : *log).access("*", "unlocked", "sato");
    if (!started) fs::remove(root() / kLogAsideFolder);
    EXPECT_EQ(codes(), "intact");
    EXPECT_THAT((started ? *started : *log).remarks(), Contains(HasSubstr("cut off all the same")));
  }
}

/// What a writer of this device that dies leaves as well: one line that has no checkpoint.
class EachStatement : public ForeignLines, public testing::WithParamInterface<LogEntryBody> {};

TEST_P(EachStatement, IsTakenBackAndKeptBesideTheLog) {
  open()->case_opened(kCase, some_hash());
  for (const bool with_a_boot_behind_it : {false, true}) {
    for (const char* in_its_place : {"", "x"}) {
      const std::string before = text_of_file(ledger());
      add(GetParam());
      if (*in_its_place != '\0') std::ofstream(log_folder() / note_path(last().seq + 1)) << in_its_place;
      if (with_a_boot_behind_it) add(BootEntry{"b1", device_.to_string()});
      const std::string text = text_of_file(ledger()).substr(before.size());
      const auto log = open();
      EXPECT_EQ(text_of_file(ledger()), before);
      EXPECT_THAT(log->remarks(), IsEmpty()) << "a crash does that";
      EXPECT_THAT(aside(), Contains(text));
      log->access("*", "unlocked", "sato");
      EXPECT_THAT(codes(), Not(HasSubstr("late")));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Of, EachStatement,
    testing::Values(
        LogEntryBody(ShutdownEntry{}), LogEntryBody(PlanSealedEntry{some_hash()}),
        LogEntryBody(CaseCheckpointEntry{kCase, 900, some_hash()}),
        LogEntryBody(CaseClosedEntry{kCase, 900, some_hash(), {}}),
        LogEntryBody(ReplicatedEntry{kCase, "s3"}), LogEntryBody(CaseErasedEntry{kCase, {}, "p"}),
        LogEntryBody(AccessEntry{"*", "unlocked", "sato", {}}),
        LogEntryBody(AccessEntry{"*", "found no signature of this device over entries 0 to 1", "kiroku", {}}),
        LogEntryBody(PreRollDiscardedEntry{1, {}}), LogEntryBody(CaseHeldEntry{kCase, "court order", "anna"}),
        LogEntryBody(CaseReleasedEntry{kCase, 1, "over", "anna"})));

TEST_F(ForeignLines, AreNotPutAsideOverALink) {
  open()->access("*", "unlocked", "sato");
  add_text("nonsense\n");
  fs::create_directory(root() / "elsewhere");
  fs::create_directory_symlink(root() / "elsewhere", root() / kLogAsideFolder);
  const auto log = open();
  EXPECT_THAT(log->remarks(), Contains(HasSubstr("cannot be put aside")));
  log->access("*", "unlocked", "sato");
  EXPECT_TRUE(fs::is_empty(root() / "elsewhere"));
  EXPECT_THAT(text_of_file(ledger()), HasSubstr("nonsense"));
}

TEST_F(ForeignLines, WhatComesWithTheNextEntryStays) {
  open()->access("*", "unlocked", "sato");
  add(BootEntry{"b1", device_.to_string()});
  add(LogRecoveredEntry{9});
  add(ConfigChangedEntry{some_hash()});
  const std::string text = text_of_file(ledger());
  const auto log = open();
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(log->remarks(), IsEmpty());
  EXPECT_EQ(codes(), "intact");
}

// The clock of later lines would go back.
TEST_F(ForeignLines, ALaterMomentOfThisBootIsFollowedByABoot) {
  open()->access("*", "unlocked", "sato");
  add_text(changed(last(), [](LogEntry& entry) { entry.at.mono_ns = kFarAhead; }));
  open()->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "access", "config-changed", "boot", "access"));
  EXPECT_EQ(codes(), "intact");
}

TEST_F(ForeignLines, SeveralThatLackTheirCheckpointStayAndTheLogSaysSo) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  fs::remove(log_folder() / note_path(4));
  fs::remove(log_folder() / note_path(5));
  const std::string text = text_of_file(ledger());
  const auto log = open();
  EXPECT_EQ(log->size(), 5U);
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(deeds(), ElementsAre("found no signature of this device over entries 3 to 4"));
  EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("from 3 to 4")));
  EXPECT_THAT(open()->remarks(), IsEmpty()) << "once";
}

// The home keeps the newest checkpoint: without its note in the archive the lines are the device's all the
// same.
TEST_F(ForeignLines, WhatACheckpointThatWasKeptElsewhereCoversIsTheDevices) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  const crypto::Checkpoint kept{log_origin("theatre-1"), 5, root_of_all()};
  fs::remove(log_folder() / note_path(4));
  fs::remove(log_folder() / note_path(5));
  const std::string text = text_of_file(ledger());
  add_text("nonsense\n");
  const auto log = open(real_file_system(), key_, kept);
  EXPECT_EQ(log->lacks(), "");
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(deeds(), ElementsAre(HasSubstr("from entry 5 on")));
}

// Whoever has a copy of the log and a key of their own carries it on.
TEST_F(ForeignLines, UnderAnotherKeyArePutAsideWithTheirCheckpoints) {
  open()->case_opened(kCase, some_hash());
  const std::string before = text_of_file(ledger());
  for (const LogEntryBody& body : {LogEntryBody(DeviceKeyChangedEntry{
                                       crypto::VerifierKey("stranger", stranger_.public_key()).to_string()}),
                                   LogEntryBody(CaseClosedEntry{kCase, 900, some_hash(), {}})}) {
    add(body);
    sign("stranger", stranger_);
  }
  add(BootEntry{"b1", device_.to_string()});
  const auto log = open();
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(before));
  EXPECT_EQ(log->case_state(kCase), ApplianceLog::CaseState::kOpened);
  log->case_closed(kCase, 9, some_hash(), {});
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "recovered", "access", "case-closed"));
  EXPECT_THAT(codes(), Not(HasSubstr("device-not-trusted")));
  EXPECT_THAT(aside(), ElementsAre(HasSubstr("stranger+")));
}

TEST_F(ForeignLines, ALogOfAnotherDeviceIsLeftAndSaysWhoseItIsFromNowOn) {
  {
    const auto others = ApplianceLog::open(real_file_system(), log_folder(), stranger_, "theatre-2");
    others->case_opened(kCase, some_hash());
    others->case_closed(kCase, 9, some_hash(), {});
  }
  const std::string text = text_of_file(ledger());
  const auto log = open();
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(aside(), IsEmpty());
  EXPECT_EQ(parse_log_entry(read_log(log_folder())[4].json).entry->seq, 4U);
  EXPECT_EQ(std::get<BootEntry>(parse_log_entry(read_log(log_folder())[4].json).entry->body).device,
            device_.to_string());
  EXPECT_THAT(deeds(), ElementsAre("found no signature of this device over entries 0 to 3"));
  EXPECT_THAT(codes(), Not(HasSubstr("checkpoint-unknown-key")));
}

// A case that is here must not be lost to the log, whoever stands before its line.
TEST_F(ForeignLines, BeforeTheOpeningOfACaseThatIsHereAreLeftAndNamed) {
  open()->access("*", "unlocked", "sato");
  add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
  fs::create_directory(root() / kCase);
  std::ofstream(root() / kCase / kLedgerFile) << "abc\n";
  add(CaseOpenedEntry{kCase, some_hash()});
  const std::string text = text_of_file(ledger());
  {
    const auto log = open();
    EXPECT_EQ(log->case_state(kCase), ApplianceLog::CaseState::kOpened);
    log->access("*", "unlocked", "sato");
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(deeds(), ElementsAre("found no signature of this device over entries 2 to 3"));
  const auto log = open();
  log->access("*", "unlocked", "sato");
  EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt) << "though a checkpoint covers that line now";
}

TEST_F(ForeignLines, ACaseThatIsKnownAlreadyKeepsNone) {
  open()->case_opened(kCase, some_hash());
  fs::create_directory(root() / kCase);
  std::ofstream(root() / kCase / kLedgerFile) << "abc\n";
  add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
  add(CaseOpenedEntry{kCase, some_hash()});
  open()->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "recovered", "access", "access"));
}

// Somebody says of the line that states the device's key that nobody signed it.
TEST_F(ForeignLines, WhatSomebodySaysToBeUnsignedIsTheDevicesAllTheSame) {
  const crypto::SigningKey both = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
                                      .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  open(real_file_system(), both)->access("*", "unlocked", "sato");
  add(AccessEntry{"*", "found no signature of this device over entries 0 to 2", "kiroku", {}});
  add(AccessEntry{"*", "unlocked", "sato", {}});
  open(real_file_system(), both)->access("*", "unlocked", "sato");
  EXPECT_THAT(types(),
              ElementsAre("boot", "device-ml-dsa-added", "access", "access", "access", "access", "access"));
  EXPECT_THAT(deeds(), Contains("found no signature of this device over entries 3 to 4"));
  EXPECT_THAT([&] { open(); }, testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
}

// Whoever takes all checkpoints away, or those that show it, does not have the recorder put its own lines
// aside.
TEST_F(ForeignLines, AreLeftWhereTheDevicesOwnLinesWouldGoWithThem) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  const crypto::Checkpoint kept{log_origin("theatre-1"), 5, root_of_all()};
  std::string text = text_of_file(ledger());
  text.replace(text.find("court order"), 11, "court\x01order");
  std::ofstream(ledger(), std::ios::binary) << text;
  for (const std::uint64_t size : {5U, 4U, 3U, 2U}) fs::remove(log_folder() / note_path(size));
  EXPECT_THAT(open()->remarks(), ElementsAre(HasSubstr("are left")));
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  const auto log = open(real_file_system(), key_, kept);
  EXPECT_THAT(log->lacks(), Not(IsEmpty()));
  EXPECT_THAT(aside(), IsEmpty());
}

// Another program of the same home, with fewer keys, would take it for somebody else's.
TEST_F(ForeignLines, AProgramWithAnotherMlDsaKeyPutsNothingAside) {
  const auto with_one_more = [&] {
    return crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
        .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  };
  const crypto::SigningKey first = with_one_more(), second = with_one_more();
  open(real_file_system(), first)->access("*", "unlocked", "sato");
  const std::string text = text_of_file(ledger());
  EXPECT_THAT([&] { open(real_file_system(), second); },
              testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
  EXPECT_EQ(text_of_file(ledger()), text);
  EXPECT_THAT(aside(), IsEmpty());
}

TEST_F(ForeignLines, TheOwnKeyIsSignedAsSoonAsItIsStated) {
  const crypto::SigningKey both = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
                                      .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  open(real_file_system(), both)->boot("b1");
  EXPECT_TRUE(fs::exists(log_folder() / note_path(2)));
  EXPECT_THAT([&] { open(); }, testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
  EXPECT_THAT(types(), ElementsAre("boot", "device-ml-dsa-added"));
}

}  // namespace
}  // namespace kiroku::archive
