#include <sys/stat.h>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kAlice = "age1ql3z7hjy54pw3hyww5ayyfg7zqgvc7w3j2elw8zmrj2kg5sfn9aqmcac8p";
constexpr const char* kBob = "age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwj";

class Init : public ProgramTest {
 protected:
  static unsigned mode_of(const std::filesystem::path& file) {
    struct stat facts {};
    return ::stat(file.c_str(), &facts) == 0 ? facts.st_mode & 0777U : 0;
  }
};

TEST_F(Init, MakesADemonstrationHomeWithKeysThatOnlyTheOwnerReads) {
  const ProcessResult made = kiroku({"init", "--demo", "--device-name", "or-3"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("or-3+"));
  EXPECT_THAT(made.out, HasSubstr("kiroku record"));
  for (const char* name : {"kiroku.toml", "device.pub", "trust.pem", "own-authority.pem", "recipients.txt",
                           "catalogue.sqlite", "authority/ca.pem", "archive/log/ledger.jsonl"}) {
    EXPECT_TRUE(std::filesystem::is_regular_file(home() / name)) << name;
  }
  for (const char* name : {"device.key", "identity.txt", "authority/ca.key", "authority/tsa.key"}) {
    EXPECT_EQ(mode_of(home() / name), 0600U) << name;
  }
  EXPECT_EQ(mode_of(home()), 0700U);
  EXPECT_THAT(read_text(home() / "trust.pem"), Not(HasSubstr("BEGIN CERTIFICATE")))
      << "the own authority is none of the outside ones";
  EXPECT_EQ(read_text(home() / "own-authority.pem"), read_text(home() / "authority/ca.pem"));
  EXPECT_THAT(files_below(folder()), testing::Contains("home"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder()), {}), 1)
      << "something was left beside the home";
}

TEST_F(Init, RefusesAHomeThatIsThereAndLeavesItAsItIs) {
  make_demo_home();
  const std::string before = read_text(home() / "device.pub");
  EXPECT_REFUSED(kiroku({"init", "--demo"}), "is a home already");
  EXPECT_EQ(read_text(home() / "device.pub"), before);
}

TEST_F(Init, AHomeThatIsThereGetsAnMlDsaKeyAndItsOldCasesStandByItsLog) {
  make_demo_home();
  const std::string old_case = record().string();
  EXPECT_EQ(kiroku_json({"verify", "--json", old_case})["signatures"], "ed25519");
  std::filesystem::copy(home() / "device.pub", path("before.pub"));

  ASSERT_TRUE(kiroku_json({"init", "--add-ml-dsa", "--json"})["added"].get<bool>());
  EXPECT_FALSE(kiroku_json({"init", "--add-ml-dsa", "--json"})["added"].get<bool>()) << "what is there stays";
  EXPECT_EQ(mode_of(home() / "device-ml-dsa.key"), 0600U);
  EXPECT_EQ(kiroku_json({"verify", "--json", old_case})["signatures"], "ed25519+ml-dsa-65")
      << "by the log, which goes on";

  const std::string identity = (home() / "device.identity").string();
  const auto verify = [&](const std::string& device, const std::filesystem::path& folder,
                          bool as_log = false) {
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
  };
  EXPECT_EQ(verify(path("before.pub"), old_case).status, 0) << "an old identity judges as it did";
  const ProcessResult unbound = verify(identity, old_case);
  EXPECT_EQ(unbound.status, 3);
  EXPECT_THAT(unbound.out, HasSubstr("checkpoint-not-by-both"));

  const std::filesystem::path made = record();
  EXPECT_EQ(verify(identity, made).status, 0);
  const ProcessResult by_one = verify(path("before.pub"), made);
  EXPECT_EQ(by_one.status, 0);
  EXPECT_THAT(by_one.out, HasSubstr("checkpoint-ml-dsa-unchecked"));
  EXPECT_EQ(verify(identity, home() / "archive/log", true).status, 0);
  EXPECT_EQ(kiroku({"report", made.string(), "--receipt", "-o", path("receipt.pdf")}).status, 0)
      << "the QR code holds the Ed25519 signature alone";

  // A home that was put back without the key records nothing that counts as forged.
  std::filesystem::rename(home() / "device-ml-dsa.key", path("kept.key"));
  const ProcessResult refused =
      kiroku({"record", "--endoscope", "synthetic:endoscope?size=64x48&rate=10", "--duration", "1s"});
  EXPECT_NE(refused.status, 0);
  EXPECT_THAT(refused.err, HasSubstr("device-ml-dsa.key"));
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("device-ml-dsa.key"));
}

TEST_F(Init, ANewHomeMaySignWithBothFromTheBeginning) {
  ASSERT_EQ(kiroku({"init", "--demo", "--ml-dsa", "--device-name", "or-3"}).status, 0);
  EXPECT_THAT(read_text(home() / "device.identity"), HasSubstr("\n0\n"));
  EXPECT_EQ(kiroku_json({"verify", "--json", record().string()})["signatures"], "ed25519+ml-dsa-65");
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(Init, RefusesAFolderWithSomethingInIt) {
  std::filesystem::create_directory(home());
  write_text(home() / "notes.txt", "mine");
  EXPECT_REFUSED(kiroku({"init", "--demo"}), "not empty");
  EXPECT_THAT(files_below(home()), ElementsAre("notes.txt"));
}

TEST_F(Init, TakesTheRootOfANewDisk) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root makes what mkfs leaves";
  std::filesystem::create_directories(home() / "lost+found");
  ASSERT_EQ(kiroku({"init", "--demo"}).status, 0);
  EXPECT_TRUE(std::filesystem::is_regular_file(home() / "device.pub"));
  EXPECT_TRUE(std::filesystem::is_directory(home() / "lost+found"));
  EXPECT_THAT(files_below(home()), testing::Not(testing::Contains(HasSubstr(".kiroku-init"))));
}

TEST_F(Init, RefusesAFolderThatOnlyLooksLikeTheRootOfADisk) {
  std::filesystem::create_directory(home());
  write_text(home() / "lost+found", "mine");
  EXPECT_REFUSED(kiroku({"init", "--demo"}), "not empty");
  std::filesystem::remove(home() / "lost+found");
  std::filesystem::create_directory(home() / "lost+found");
  write_text(home() / "notes.txt", "mine");
  EXPECT_REFUSED(kiroku({"init", "--demo"}), "not empty");
  EXPECT_THAT(files_below(home()), testing::Contains("notes.txt"));
}

TEST_F(Init, AsksForTwoRecipients) {
  EXPECT_REFUSED(kiroku({"init", "--recipient", kAlice}), "at least two recipients");
  EXPECT_FALSE(std::filesystem::exists(home()));
  EXPECT_EQ(kiroku({"init", "--recipient", kAlice, "--recipient", kBob}).status, 0);
  EXPECT_THAT(read_text(home() / "recipients.txt"), HasSubstr(kBob));
  EXPECT_FALSE(std::filesystem::exists(home() / "identity.txt"));
}

TEST_F(Init, WritesNewIdentitiesWhereTheOperatorSaysReadyForStockAge) {
  const ProcessResult made =
      kiroku({"init", "--no-passphrase", "--new-identity", "a.txt", "--new-identity", "b.txt"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_EQ(mode_of(folder() / "a.txt"), 0600U);
  EXPECT_THAT(read_text(folder() / "a.txt"), HasSubstr("AGE-SECRET-KEY-1"));
  EXPECT_THAT(made.out, Not(HasSubstr("AGE-SECRET-KEY")));
  if (!has_tool("age-keygen")) GTEST_SKIP() << "age-keygen is not installed";
  std::string recipient = tool({"age-keygen", "-y", "a.txt"}).out;
  EXPECT_THAT(read_text(home() / "recipients.txt"), HasSubstr(recipient));
}

TEST_F(Init, SealsNewIdentitiesWithAPassphrase) {
  Process::Options run = options({"init", "--new-identity", "a.txt", "--recipient", kBob});
  run.environment["KIROKU_PASSPHRASE"] = "correct horse";
  const ProcessResult made = run_process(run);
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(read_text(folder() / "a.txt"), testing::StartsWith("age-encryption.org/v1\n-> scrypt "));

  write_text(folder() / "secret.txt", "what was said");
  ASSERT_EQ(
      kiroku({"seal", "-R", (home() / "recipients.txt").string(), "-o", "secret.age", "secret.txt"}).status,
      0);
  Process::Options open = options({"unseal", "-i", "a.txt", "secret.age"});
  open.environment["KIROKU_PASSPHRASE"] = "correct horse";
  EXPECT_EQ(run_process(open).out, "what was said");
  open.environment["KIROKU_PASSPHRASE"] = "wrong horse";
  EXPECT_REFUSED(run_process(open), "passphrase");
}

TEST_F(Init, AsksForAPassphraseTwiceOnATerminalWithoutShowingIt) {
  Process::Options run = options({"init", "--new-identity", "a.txt", "--recipient", kBob});
  run.terminal = true;
  Process process(run);
  ASSERT_TRUE(process.wait_for("New passphrase for the identity a.txt: "));
  process.type("battery staple\n");
  ASSERT_TRUE(process.wait_for("The same once more: "));
  process.type("battery staple\n");
  const ProcessResult made = process.wait();
  EXPECT_EQ(made.status, 0) << made.out;
  EXPECT_THAT(made.out, Not(HasSubstr("battery")));
}

TEST_F(Init, LeavesNothingWhenTheTwoPassphrasesDiffer) {
  Process::Options run = options({"init", "--new-identity", "a.txt", "--recipient", kBob});
  run.terminal = true;
  Process process(run);
  ASSERT_TRUE(process.wait_for("New passphrase"));
  process.type("battery\n");
  ASSERT_TRUE(process.wait_for("once more"));
  process.type("staple\n");
  const ProcessResult refused = process.wait();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.out, HasSubstr("differ"));
  EXPECT_THAT(files_below(folder()), ElementsAre());
}

TEST_F(Init, LeavesNothingWhenOneIdentityCannotBeWritten) {
  write_text(folder() / "b.txt", "precious");
  EXPECT_REFUSED(kiroku({"init", "--no-passphrase", "--new-identity", "a.txt", "--new-identity", "b.txt"}),
                 "b.txt is there already");
  EXPECT_THAT(files_below(folder()), ElementsAre("b.txt"));
  EXPECT_EQ(read_text(folder() / "b.txt"), "precious");
}

TEST_F(Init, ProtectsTheDeviceKeyWithAPassphraseThatRecordingNeeds) {
  Process::Options run = options({"init", "--demo", "--passphrase"});
  run.environment["KIROKU_PASSPHRASE"] = "open sesame";
  ASSERT_EQ(run_process(run).status, 0);
  EXPECT_THAT(read_text(home() / "device.key"), HasSubstr("ENCRYPTED PRIVATE KEY"));
  const Arguments recording{"record", "--vitals", "synthetic:patient?speed=max", "--duration", "2s"};
  EXPECT_REFUSED(kiroku(recording), "KIROKU_PASSPHRASE");
  Process::Options record = options(recording);
  record.environment["KIROKU_PASSPHRASE"] = "open sesame";
  EXPECT_EQ(run_process(record).status, 0);
}

}  // namespace
}  // namespace kiroku::test
