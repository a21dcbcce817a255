// The device's key in hardware, as a person sets it up and loses it.
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

}  // namespace
}  // namespace kiroku::test
