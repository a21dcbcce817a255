// The device's key in hardware, as a person sets it up and loses it.
#include <csignal>
#include <filesystem>
#include <optional>

#include "tests/support/build_paths.h"
#include "tests/support/software_token.h"
#include "tests/support/software_tpm.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class HardwareKey : public ProgramTest {
 protected:
  [[nodiscard]] std::string identity() const { return (home() / "device.identity").string(); }
  /// As somebody judges who has the identity and no home.
  [[nodiscard]] ProcessResult verify(const std::filesystem::path& folder, const std::string& device,
                                     bool as_log = false) const {
    Process::Options run;
    run.command = {built_file("kiroku-verify"),
                   "--json",
                   "--device",
                   device,
                   "--own-authority",
                   (home() / "own-authority.pem").string(),
                   folder.string()};
    if (as_log) run.command.emplace_back("--as-log");
    return run_process(run);
  }
  [[nodiscard]] static std::string signatures_of(const ProcessResult& result) {
    return nlohmann::json::parse(result.out).at("signatures");
  }
};

TEST_F(HardwareKey, OfATpmSignsWhatIsRecordedAndNothingReadsAsSignedWhenItIsAway) {
  if (!SoftwareTpm::is_installed()) GTEST_SKIP() << SoftwareTpm::kWhySkipped;
  SoftwareTpm tpm(folder() / "t");
  make_demo_home();
  const std::filesystem::path old_case = record();
  ASSERT_TRUE(kiroku_json({"init", "--add-tpm", "--tcti", tpm.tcti(), "--json"})["added"].get<bool>());
  EXPECT_FALSE(kiroku_json({"init", "--add-tpm", "--tcti", tpm.tcti(), "--json"})["added"].get<bool>());
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("signs checkpoints beside Ed25519"));
  EXPECT_EQ(kiroku_json({"verify", "--json", old_case.string()})["signatures"], "ed25519+ecdsa-p256")
      << "by the log, which the TPM signed at the ceremony";
  EXPECT_EQ(verify(old_case, identity()).status, 3) << "without the log it may be from before, or forged";

  const std::filesystem::path made = record();
  const ProcessResult by_all = verify(made, identity());
  EXPECT_EQ(by_all.status, 0) << by_all.out;
  EXPECT_EQ(signatures_of(by_all), "ed25519+ecdsa-p256");
  const ProcessResult by_one = verify(made, (home() / "device.pub").string());
  EXPECT_EQ(by_one.status, 0);
  EXPECT_THAT(by_one.out, HasSubstr("checkpoint-hardware-unchecked"));
  EXPECT_EQ(verify(home() / "archive/log", identity(), true).status, 0);

  tpm.take_away();
  const std::filesystem::path without = record();
  const ProcessResult unproven = verify(without, identity());
  EXPECT_EQ(unproven.status, 3) << "the recording is there, and could be a thief's";
  EXPECT_THAT(unproven.out, HasSubstr("checkpoint-not-by-hardware"));
  EXPECT_THAT(read_text(home() / "archive/log/ledger.jsonl"), HasSubstr("device-hardware-silent"));
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("does not sign"));
  const ProcessResult warned = kiroku({"record", "--duration", "00:00:01", "--endoscope",
                                       "synthetic:endoscope?size=64x48&rate=10&speed=max"});
  EXPECT_EQ(warned.status, 0);
  EXPECT_THAT(warned.err, HasSubstr("warning: the key in hardware does not sign"));

  tpm.start();
  EXPECT_EQ(verify(record(), identity()).status, 0) << "and it is back by itself";

  std::filesystem::remove(home() / "device-hardware.json");
  EXPECT_REFUSED(kiroku({"init", "--add-tpm", "--tcti", tpm.tcti()}), "put it back from the backup");
  EXPECT_EQ(verify(record(), identity()).status, 3) << "what was refused took nothing away from recording";
}

TEST_F(HardwareKey, ANewHomeMayHaveAllThreeKeys) {
  if (!SoftwareTpm::is_installed()) GTEST_SKIP() << SoftwareTpm::kWhySkipped;
  const SoftwareTpm tpm(folder() / "t");
  ASSERT_EQ(kiroku({"init", "--demo", "--ml-dsa", "--tpm", "--tcti", tpm.tcti()}).status, 0);
  EXPECT_EQ(signatures_of(verify(record(), identity())), "ed25519+ml-dsa-65+ecdsa-p256");
}

TEST_F(HardwareKey, OfATpmQuotesTheBootIntoTheLog) {
  if (!SoftwareTpm::is_installed()) GTEST_SKIP() << SoftwareTpm::kWhySkipped;
  SoftwareTpm tpm(folder() / "t");
  const ProcessResult made = kiroku({"init", "--demo", "--tpm", "--tcti", tpm.tcti()});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, Not(HasSubstr("does not quote")));
  EXPECT_THAT(
      kiroku({"doctor"}).out,
      HasSubstr("its quotes say nothing of the boot, as the firmware measures nothing into register 0, 1, "
                "2, 3, 4, 5, 6, 7"));
  for (unsigned pcr = 0; pcr < 8; ++pcr) tpm.measure(pcr, 0x11);
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("and quotes the measured boot"));
  EXPECT_EQ(verify(record(), identity()).status, 0);
  const ProcessResult log = kiroku({"log", "--verify"});
  EXPECT_EQ(log.status, 0) << log.out;
  EXPECT_THAT(log.out, HasSubstr("these quotes hold"));
  EXPECT_THAT(log.out, HasSubstr("boot-not-measured"))
      << "no firmware had measured anything when it was asked";
  const ProcessResult alone = verify(home() / "archive/log", identity(), true);
  EXPECT_EQ(alone.status, 0);
  EXPECT_THAT(alone.out, HasSubstr("boot-quotes-hold"));
}

TEST_F(HardwareKey, OfATpmThatDoesNotQuoteMakesAHomeAllTheSameWhichQuotesLater) {
  if (!SoftwareTpm::is_installed()) GTEST_SKIP() << SoftwareTpm::kWhySkipped;
  SoftwareTpm tpm(folder() / "t");
  const auto start_with_registers = [&](bool there) {
    tpm.keep_sha256_bank(there);
    tpm.take_away();
    tpm.start();
  };
  start_with_registers(false);
  const ProcessResult made = kiroku({"init", "--demo", "--tpm", "--tcti", tpm.tcti()});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("SHA-256 bank is switched off"));
  EXPECT_EQ(verify(record(), identity()).status, 0) << "nothing that is recorded is affected";
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("does not have it quote the measured boot"));
  start_with_registers(true);
  const ProcessResult added = kiroku({"init", "--add-tpm"});
  ASSERT_EQ(added.status, 0) << added.err;
  EXPECT_THAT(added.out, HasSubstr("quotes the measured boot into the log"));
  EXPECT_THAT(kiroku({"log", "--verify"}).out, HasSubstr("these quotes hold"));
}

TEST_F(HardwareKey, OfATokenSignsLikewiseBesideAnMlDsaKeyThatWasThere) {
  if (!SoftwareToken::is_installed()) GTEST_SKIP() << SoftwareToken::kWhySkipped;
  const SoftwareToken token(folder() / "token");
  ASSERT_EQ(token.made().status, 0) << token.made().err;
  ASSERT_EQ(kiroku({"init", "--demo", "--ml-dsa"}).status, 0);
  ASSERT_TRUE(kiroku_json({"init", "--add-pkcs11", token.uri(), "--json"})["added"].get<bool>());
  EXPECT_THAT(read_text(home() / "device-hardware.json"), Not(HasSubstr("12345678")));
  EXPECT_EQ(signatures_of(verify(record(), identity())), "ed25519+ml-dsa-65+ecdsa-p256");
}

TEST_F(HardwareKey, ThatIsNotThereMakesNoHome) {
  EXPECT_REFUSED(kiroku({"init", "--demo", "--tpm", "--tcti", "swtpm:path=" + path("nowhere")}),
                 "no way to a TPM");
  EXPECT_FALSE(std::filesystem::exists(home()));
  EXPECT_REFUSED(kiroku({"init", "--demo", "--pkcs11", "token"}), "no PKCS#11 URI");
  EXPECT_REFUSED(kiroku({"init", "--demo", "--tpm", "--pkcs11", "pkcs11:token=a"}), "not both");
  EXPECT_REFUSED(kiroku({"init", "--demo", "--tcti", "device:/dev/tpm0"}), "--tpm");
}

/// Of an approval that showed what it would approve, and made nothing.
#define EXPECT_REFUSED_AFTER_SHOWING(result, part)                        \
  do {                                                                    \
    const auto& refused = (result);                                       \
    EXPECT_EQ(refused.status, 2) << refused.out << refused.err;           \
    EXPECT_THAT(refused.out, testing::StartsWith("To be approved for ")); \
    EXPECT_THAT(refused.out, Not(HasSubstr("Approved.")));                \
    EXPECT_THAT(refused.err, testing::HasSubstr(part));                   \
  } while (false)

/// A home whose TPM signs only in approved states of the boot.
class SealedKey : public HardwareKey {
 protected:
  void SetUp() override {
    if (!SoftwareTpm::is_installed()) GTEST_SKIP() << SoftwareTpm::kWhySkipped;
    tpm_.emplace(folder() / "t");
    boot(0x11);
    ASSERT_EQ(kiroku({"boot", "new-key", approval_key(), "--no-passphrase"}).status, 0);
  }
  /// The machine starts with this boot loader.
  void boot(unsigned char loader) {
    tpm_->take_away();
    tpm_->start();
    for (unsigned pcr = 0; pcr < 10; ++pcr) tpm_->measure(pcr, pcr == 4 ? loader : 0x01);
  }
  [[nodiscard]] std::string approval_key() const { return path("approval.pem"); }
  void make_sealed_home() {
    const ProcessResult made =
        kiroku({"init", "--demo", "--tpm", "--tcti", tpm_->tcti(), "--seal-to-boot", approval_key()});
    ASSERT_EQ(made.status, 0) << made.err;
    EXPECT_THAT(made.out, HasSubstr("registers 0,2,4,7,8,9"));
    EXPECT_THAT(made.out, testing::ContainsRegex("Its seal is [0-9a-f]{16}:"));
  }
  /// Of the machine, approved or not, into a file for whoever approves.
  void write_state(const std::string& name) const {
    EXPECT_NE(kiroku({"boot", "state", "-o", path(name)}).status, 2);
  }
  /// As the administrator does it, with the state taken to where the key is.
  void approve_state() {
    write_state("state.json");
    const ProcessResult approved =
        kiroku({"boot", "approve", path("state.json"), "--key", approval_key(), "-o", path("a.approval")});
    ASSERT_EQ(approved.status, 0) << approved.err;
    EXPECT_EQ(kiroku({"boot", "accept", path("a.approval")}).status, 0);
    std::filesystem::remove(path("state.json"));
    std::filesystem::remove(path("a.approval"));
  }
  std::optional<SoftwareTpm> tpm_;
};

TEST_F(SealedKey, RecordsThroughABootThatNobodyApprovedAndSignsAgainAfterApproval) {
  make_sealed_home();
  EXPECT_EQ(verify(record(), identity()).status, 0);
  EXPECT_EQ(kiroku({"boot", "state"}).status, 0);
  EXPECT_THAT(
      kiroku({"doctor"}).out,
      HasSubstr("sealed to registers 0,2,4,7,8,9 of the boot, whose state is approved; whether that of "
                "the next boot is cannot be known"));

  boot(0x22);
  const std::filesystem::path meanwhile = record();
  const ProcessResult unproven = verify(meanwhile, identity());
  EXPECT_EQ(unproven.status, 3) << "all is there, and another boot could have made it";
  EXPECT_THAT(unproven.out, HasSubstr("checkpoint-not-by-hardware"));
  const std::string log = read_text(home() / "archive/log/ledger.jsonl");
  EXPECT_THAT(log, HasSubstr("device-hardware-silent"));
  EXPECT_THAT(log, HasSubstr("this one is not approved: register 4 differs"));
  const ProcessResult state = kiroku({"boot", "state"});
  EXPECT_EQ(state.status, 1);
  EXPECT_THAT(state.out, HasSubstr("NOT approved"));
  EXPECT_THAT(state.out, testing::ContainsRegex("register 4 .boot loader.: [0-9a-f]+  DIFFERS"));
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("register 4 differs"));

  approve_state();
  EXPECT_EQ(kiroku_json({"boot", "state", "--json"})["approved"], true);
  EXPECT_EQ(verify(record(), identity()).status, 0);
  EXPECT_EQ(verify(meanwhile, identity()).status, 3) << "what is approved later proves nothing of before";
  EXPECT_EQ(verify(home() / "archive/log", identity(), true).status, 0);
}

TEST_F(SealedKey, KirokudRecordsOnTellsItEverywhereAndSignsAgainByItself) {
  make_sealed_home();
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "synthetic:patient"
[daemon]
socket = ")" + path("s") + "\"\n");
  boot(0x22);
  write_state("state.json");
  ASSERT_EQ(kiroku({"boot", "approve", path("state.json"), "--key", approval_key(), "-o", path("a.approval")})
                .status,
            0);
  Process::Options started = options({});
  started.command.front() = built_file("kirokud");
  Process daemon(started);
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_TRUE(daemon.wait_for("the key in hardware does not sign"));
  EXPECT_TRUE(daemon.wait_for("register 4 differs"));
  EXPECT_THAT(kiroku_json({"status", "--json"})["hardware_silent"].get<std::string>(),
              HasSubstr("this one is not approved"));
  EXPECT_THAT(kiroku({"status"}).out, HasSubstr("what is recorded is unproven"));
  const std::string meanwhile = kiroku_json({"case", "start", "--json"})["case"];
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  EXPECT_EQ(verify(home() / "archive" / meanwhile, identity()).status, 3);

  EXPECT_EQ(kiroku({"boot", "accept", path("a.approval")}).status, 0);
  EXPECT_TRUE(daemon.wait_for("the key in hardware signs again"));
  EXPECT_EQ(kiroku_json({"status", "--json"})["hardware_silent"], "");
  const std::string after = kiroku_json({"case", "start", "--json"})["case"];
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait().status, 0);
  EXPECT_EQ(verify(home() / "archive" / after, identity()).status, 0);
  EXPECT_EQ(verify(home() / "archive" / meanwhile, identity()).status, 3);
}

TEST_F(SealedKey, OfAHomeThatIsThereIsAddedOnceAndStays) {
  make_demo_home();
  const Arguments add{"init", "--add-tpm", "--tcti", tpm_->tcti()};
  const auto with = [&](Arguments more) {
    more.insert(more.begin(), add.begin(), add.end());
    return kiroku(more);
  };
  ASSERT_EQ(with({"--seal-to-boot", approval_key(), "--pcrs", "4,0"}).status, 0);
  EXPECT_THAT(read_text(home() / "device-hardware.json"), HasSubstr("sealed_to_boot"));
  EXPECT_EQ(with({"--seal-to-boot", approval_key(), "--pcrs", "0,4"}).status, 0) << "it is so already";
  EXPECT_REFUSED(with({"--seal-to-boot", approval_key()}), "sealed to the registers 0,4, not to 0,2,4,7,8,9");
  ASSERT_EQ(kiroku({"boot", "new-key", path("other.pem"), "--no-passphrase"}).status, 0);
  EXPECT_REFUSED(with({"--seal-to-boot", path("other.pem"), "--pcrs", "0,4"}), "another approval key");
  EXPECT_EQ(verify(record(), identity()).status, 0);
}

TEST_F(SealedKey, OfAHomeWhoseKeyIsNotSealedNeedsANewHome) {
  make_demo_home();
  ASSERT_EQ(kiroku({"init", "--add-tpm", "--tcti", tpm_->tcti()}).status, 0);
  EXPECT_REFUSED(kiroku({"init", "--add-tpm", "--seal-to-boot", approval_key()}),
                 "in every state of the boot");
  EXPECT_REFUSED(kiroku({"boot", "state"}), "is not sealed");
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("it is not sealed"));
}

TEST_F(SealedKey, IsRefusedWhereTheSealWouldHoldNothingOff) {
  const auto sealed = [&](const Arguments& more) {
    Arguments all{"init", "--demo", "--tpm", "--tcti", tpm_->tcti(), "--seal-to-boot", approval_key()};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(sealed({"--pcrs", "0,two"}), "'two' is no number of a register");
  EXPECT_REFUSED(sealed({"--pcrs", "0,24"}), "no 24");
  EXPECT_REFUSED(sealed({"--pcrs", "0,10"}), "no key can be sealed to register 10");
  EXPECT_REFUSED(sealed({"--pcrs", "8,9"}), "without register 4");
  EXPECT_REFUSED(sealed({"--pcrs", "0,4,14"}), "nothing was measured into register 14");
  EXPECT_REFUSED(sealed({"--pcrs", "0,4,14"}), "give --pcrs 0,4,");
  tpm_->take_away();
  tpm_->start();
  EXPECT_REFUSED(sealed({}), "nothing was measured into register 0,2,4,7,8,9");
  tpm_->keep_sha256_bank(false);
  tpm_->take_away();
  tpm_->start();
  EXPECT_REFUSED(sealed({}), "SHA-256 bank is switched off");
  EXPECT_FALSE(std::filesystem::exists(home()));
  EXPECT_REFUSED(kiroku({"init", "--demo", "--seal-to-boot", approval_key()}), "--tpm");
  EXPECT_REFUSED(kiroku({"init", "--demo", "--tpm", "--pcrs", "0"}), "--seal-to-boot");
}

TEST_F(SealedKey, ApprovesWithAKeyThatNobodyElseCanRead) {
  make_sealed_home();
  write_state("state.json");
  const auto approve = [&](const std::string& key, const Arguments& more = {}) {
    Arguments all{"boot", "approve", path("state.json"), "--key", key, "-o", path("a.approval")};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  std::filesystem::permissions(approval_key(), std::filesystem::perms(0640));
  EXPECT_REFUSED_AFTER_SHOWING(approve(approval_key()), "chmod 600");
  EXPECT_REFUSED(kiroku({"boot", "new-key", approval_key(), "--no-passphrase"}), "not overwritten");
  std::filesystem::permissions(approval_key(), std::filesystem::perms(0600));
  EXPECT_REFUSED(approve(approval_key(), {"--pcrs", "0,4"}), "approve nothing otherwise");
  ASSERT_EQ(kiroku({"boot", "new-key", path("other.pem"), "--no-passphrase"}).status, 0);
  EXPECT_EQ(std::filesystem::status(path("other.pem")).permissions(), std::filesystem::perms(0600));
  EXPECT_REFUSED_AFTER_SHOWING(approve(path("other.pem")), "sealed to another approval key");
  EXPECT_REFUSED_AFTER_SHOWING(approve((home() / "device.key").string()), "P-256");
  EXPECT_REFUSED_AFTER_SHOWING(approve(path("nowhere.pem")), "nowhere.pem");
  EXPECT_FALSE(std::filesystem::exists(path("a.approval")));
  write_text(path("state.json"), read_text(path("state.json")).substr(0, 100));
  EXPECT_REFUSED(approve(approval_key()), "cut off");
}

TEST_F(SealedKey, AsksForThePassphraseOfTheApprovalKey) {
  Process::Options with = options({"boot", "new-key", path("locked.pem")});
  with.environment["KIROKU_PASSPHRASE"] = "locked away";
  ASSERT_EQ(run_process(with).status, 0);
  EXPECT_THAT(read_text(path("locked.pem")), HasSubstr("ENCRYPTED"));
  Process::Options made =
      options({"init", "--demo", "--tpm", "--tcti", tpm_->tcti(), "--seal-to-boot", path("locked.pem")});
  made.environment["KIROKU_PASSPHRASE"] = "something else";
  EXPECT_REFUSED(run_process(made), "passphrase does not open");
  made.environment["KIROKU_PASSPHRASE"] = "locked away";
  EXPECT_EQ(run_process(made).status, 0);
}

TEST_F(SealedKey, TakesInNoApprovalOfAnotherDeviceOrKeyAndNoneThatIsTorn) {
  make_sealed_home();
  write_state("state.json");
  ASSERT_EQ(
      kiroku({"boot", "approve", path("state.json"), "--key", approval_key(), "-o", path("good")}).status, 0);
  const auto written = nlohmann::json::parse(read_text(path("good")));
  const auto accept = [&](const std::string& text) {
    write_text(path("other"), text);
    return kiroku({"boot", "accept", path("other")});
  };
  auto changed = written;
  changed["tag"] = std::string(64, '0');
  EXPECT_REFUSED(accept(changed.dump()), "another device");
  changed = written;
  changed["pcrs"][2] = "4:" + std::string(64, '2');
  EXPECT_REFUSED(accept(changed.dump()), "was changed");
  EXPECT_REFUSED(accept(read_text(path("good")).substr(0, 200)), "cut off");
  EXPECT_REFUSED(kiroku({"boot", "accept", path("nowhere")}), "nowhere");

  // One that was torn in its place is told of, and the others count.
  write_text(home() / "boot-approvals" / "torn.approval", read_text(path("good")).substr(0, 200));
  EXPECT_EQ(kiroku({"boot", "state"}).status, 0);
  EXPECT_THAT(kiroku({"boot", "state"}).out, HasSubstr("torn.approval does not count"));
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("torn.approval does not count"));
  EXPECT_EQ(verify(record(), identity()).status, 0);
}

TEST_F(SealedKey, IsApprovedAheadOfAnUpdateByARecorderThatHasIt) {
  make_sealed_home();
  write_state("before.json");
  boot(0x22);
  write_state("after.json");
  boot(0x11);
  ASSERT_EQ(
      kiroku({"boot", "approve", path("before.json"), "--key", approval_key(), "-o", path("now")}).status, 0);
  Arguments approve{
      "boot",         "approve", path("before.json"), "--values-of", path("after.json"), "--key",
      approval_key(), "-o",      path("next")};
  const ProcessResult by_twin = kiroku(approve);
  ASSERT_EQ(by_twin.status, 0) << by_twin.err;
  EXPECT_THAT(by_twin.out, testing::ContainsRegex("register 4 .boot loader.: [0-9a-f]+  DIFFERS"));
  std::filesystem::remove(path("next"));
  approve.insert(approve.end(), {"--against", path("now")});
  EXPECT_REFUSED_AFTER_SHOWING(kiroku(approve), "give --yes");
  EXPECT_FALSE(std::filesystem::exists(path("next")));
  approve.emplace_back("--yes");
  const ProcessResult ahead = kiroku(approve);
  ASSERT_EQ(ahead.status, 0) << ahead.err;
  EXPECT_THAT(ahead.out, testing::ContainsRegex("register 4 .boot loader.: [0-9a-f]+  DIFFERS"));
  EXPECT_THAT(ahead.out, testing::ContainsRegex("register 0 .firmware.: [0-9a-f]+  as before"));
  EXPECT_EQ(kiroku({"boot", "accept", path("next")}).status, 0);
  boot(0x22);
  EXPECT_EQ(verify(record(), identity()).status, 0) << "nothing between the update and its approval";
}

TEST_F(SealedKey, IsApprovedWhereItDiffersOnceSomebodyWhoSawThatSaysYes) {
  make_sealed_home();
  write_state("before.json");
  ASSERT_EQ(
      kiroku({"boot", "approve", path("before.json"), "--key", approval_key(), "-o", path("now")}).status, 0);
  boot(0x22);
  write_state("after.json");
  const auto answered = [&](const std::string& answer) {
    Process::Options run = options({"boot", "approve", path("after.json"), "--against", path("now"), "--key",
                                    approval_key(), "-o", path("next")});
    run.terminal = true;
    Process process(run);
    EXPECT_TRUE(process.wait_for("Approve? [yes/no] "));
    EXPECT_THAT(process.out(), HasSubstr("DIFFERS"));
    process.type(answer + "\n");
    return process.wait().status;
  };
  EXPECT_EQ(answered("no"), 2);
  EXPECT_EQ(answered(""), 2);
  EXPECT_FALSE(std::filesystem::exists(path("next")));
  EXPECT_EQ(answered("yes"), 0);
  EXPECT_TRUE(std::filesystem::exists(path("next")));
}

TEST_F(SealedKey, IsNamedAlikeWhereItIsMadeToldAndApproved) {
  make_demo_home();
  const std::string seal = kiroku_json(
      {"init", "--add-tpm", "--tcti", tpm_->tcti(), "--seal-to-boot", approval_key(), "--json"})["seal"];
  EXPECT_EQ(seal.size(), 16U);
  EXPECT_EQ(kiroku_json({"boot", "state", "--json", "-o", path("state.json")})["seal"], seal);
  EXPECT_THAT(kiroku({"boot", "state"}).out, HasSubstr(seal));
  const Arguments approve{"boot", "approve", path("state.json"), "--key", approval_key(), "-o", path("a")};
  EXPECT_THAT(kiroku(approve).out, HasSubstr("with the seal " + seal));
  Arguments as_json = approve;
  as_json.emplace_back("--json");
  EXPECT_EQ(kiroku_json(as_json)["seal"], seal);
}

TEST_F(SealedKey, IsApprovedIntoNoFileThatIsRead) {
  make_sealed_home();
  write_state("state.json");
  const std::string key = read_text(approval_key());
  const auto into = [&](const std::string& output) {
    return kiroku({"boot", "approve", path("state.json"), "--key", approval_key(), "-o", output});
  };
  EXPECT_REFUSED(into(approval_key()), "name another file");
  EXPECT_REFUSED(into(path("state.json")), "name another file");
  std::filesystem::create_symlink(approval_key(), path("link"));
  EXPECT_REFUSED(into(path("link")), "name another file");
  EXPECT_EQ(read_text(approval_key()), key);
}

}  // namespace
}  // namespace kiroku::test
