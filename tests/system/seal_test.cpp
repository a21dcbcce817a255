#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class Seal : public ProgramTest {
 protected:
  void SetUp() override {
    if (!has_tool("age-keygen")) GTEST_SKIP() << "age is not installed (package age)";
    ASSERT_EQ(tool({"age-keygen", "-o", "key.txt"}).status, 0);
    recipient_ = tool({"age-keygen", "-y", "key.txt"}).out;
    recipient_.pop_back();
    for (int i = 0; i < 40'000; ++i) plain_ += "line " + std::to_string(i) + "\n";
    write_text(folder() / "plain", plain_);
  }
  void seal() const { ASSERT_EQ(kiroku({"seal", "-r", recipient_, "-o", "sealed", "plain"}).status, 0); }

  std::string recipient_, plain_;
};

TEST_F(Seal, IsOpenedByStockAge) {
  seal();
  EXPECT_EQ(tool({"age", "-d", "-i", "key.txt", "sealed"}).out, plain_);
}

TEST_F(Seal, OpensWhatStockAgeSealed) {
  ASSERT_EQ(tool({"age", "-r", recipient_, "-o", "sealed", "plain"}).status, 0);
  ASSERT_EQ(kiroku({"unseal", "-i", "key.txt", "-o", "opened", "sealed"}).status, 0);
  EXPECT_EQ(read_text(folder() / "opened"), plain_);
}

TEST_F(Seal, WorksThroughPipes) {
  Process::Options sealing = options({"seal", "-r", recipient_});
  sealing.input = plain_;
  const ProcessResult sealed = run_process(sealing);
  ASSERT_EQ(sealed.status, 0) << sealed.err;
  Process::Options opening = options({"unseal", "-i", "key.txt", "-"});
  opening.input = sealed.out;
  EXPECT_EQ(run_process(opening).out, plain_);
}

TEST_F(Seal, TellsFiguresAsJson) {
  const auto answer = kiroku_json({"seal", "-r", recipient_, "-o", "sealed", "--json", "plain"});
  EXPECT_EQ(answer["plaintext_bytes"], plain_.size());
  EXPECT_EQ(answer["sealed_bytes"], std::filesystem::file_size(folder() / "sealed"));
  EXPECT_EQ(kiroku_json({"unseal", "-i", "key.txt", "-o", "opened", "--json", "sealed"})["bytes"],
            plain_.size());
}

TEST_F(Seal, SealsWithAPassphraseThatIsNoticedWhenOpening) {
  Process::Options sealing = options({"seal", "-p", "-o", "sealed", "plain"});
  sealing.environment["KIROKU_PASSPHRASE"] = "battery staple";
  ASSERT_EQ(run_process(sealing).status, 0);
  Process::Options opening = options({"unseal", "sealed"});
  opening.environment["KIROKU_PASSPHRASE"] = "battery staple";
  EXPECT_EQ(run_process(opening).out, plain_);
  opening.environment["KIROKU_PASSPHRASE"] = "wrong";
  EXPECT_REFUSED(run_process(opening), "");
}

TEST_F(Seal, AsksThePassphraseOnTheTerminal) {
  Process::Options sealing = options({"seal", "-p", "-o", "sealed", "plain"});
  sealing.environment["KIROKU_PASSPHRASE"] = "battery";
  ASSERT_EQ(run_process(sealing).status, 0);
  Process::Options opening = options({"unseal", "-o", "opened", "sealed"});
  opening.terminal = true;
  Process process(opening);
  ASSERT_TRUE(process.wait_for("Passphrase for sealed: "));
  // A mistyped character is taken back.
  process.type("batteryx\x7f\n");
  EXPECT_EQ(process.wait().status, 0);
  EXPECT_EQ(read_text(folder() / "opened"), plain_);
}

TEST_F(Seal, RefusesAPassphraseThatIsCancelledOnTheTerminal) {
  Process::Options sealing = options({"seal", "-p", "-o", "sealed", "plain"});
  sealing.terminal = true;
  Process process(sealing);
  ASSERT_TRUE(process.wait_for("New passphrase"));
  process.type("\x03");
  const ProcessResult cancelled = process.wait();
  EXPECT_EQ(cancelled.status, 2);
  EXPECT_THAT(cancelled.out, HasSubstr("nothing was done"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "sealed"));
}

TEST_F(Seal, RefusesWithoutARecipient) {
  EXPECT_REFUSED(kiroku({"seal", "-o", "sealed", "plain"}), "-r age1");
  EXPECT_REFUSED(kiroku({"seal", "-r", "age1nonsense", "-o", "sealed", "plain"}), "age1nonsense");
  EXPECT_REFUSED(kiroku({"seal", "-r", recipient_, "-o", "sealed", "absent"}), "absent");
  EXPECT_REFUSED(kiroku({"seal", "-r", recipient_, "-o", "no/folder/sealed", "plain"}), "no/folder/sealed");
  EXPECT_REFUSED(kiroku({"seal", "-r", recipient_, "-o", "plain", "plain"}), "same file");
  EXPECT_REFUSED(kiroku({"seal", "-r", recipient_, "-o", "sealed", "."}), "folder");
  EXPECT_THAT(files_below(folder()), ElementsAre("key.txt", "plain"));
}

TEST_F(Seal, DoesNotPrintSealedBytesOnATerminal) {
  Process::Options sealing = options({"seal", "-r", recipient_, "plain"});
  sealing.terminal = true;
  Process process(sealing);
  const ProcessResult refused = process.wait();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.out, HasSubstr("-o FILE"));
}

TEST_F(Seal, LeavesNothingOfADamagedFile) {
  seal();
  flip_byte(folder() / "sealed", -100);
  EXPECT_REFUSED(kiroku({"unseal", "-i", "key.txt", "-o", "opened", "sealed"}), "sealed");
  EXPECT_THAT(files_below(folder()), ElementsAre("key.txt", "plain", "sealed"));
}

TEST_F(Seal, KeepsTheBeginningOfATruncatedFileOnlyWhenAsked) {
  seal();
  std::filesystem::resize_file(folder() / "sealed", 200'000);
  EXPECT_REFUSED(kiroku({"unseal", "-i", "key.txt", "-o", "opened", "sealed"}), "");
  EXPECT_FALSE(std::filesystem::exists(folder() / "opened"));
  const ProcessResult kept =
      kiroku({"unseal", "--keep-truncated", "-i", "key.txt", "-o", "opened", "sealed"});
  EXPECT_EQ(kept.status, 1) << kept.err;
  EXPECT_THAT(kept.err, HasSubstr("ends early"));
  // Three whole chunks of 64 KiB.
  EXPECT_EQ(read_text(folder() / "opened"), plain_.substr(0, 3 * 65536));
}

TEST_F(Seal, RefusesAnIdentityThatIsNoRecipient) {
  seal();
  ASSERT_EQ(tool({"age-keygen", "-o", "other.txt"}).status, 0);
  EXPECT_REFUSED(kiroku({"unseal", "-i", "other.txt", "-o", "opened", "sealed"}), "");
  EXPECT_REFUSED(kiroku({"unseal", "-o", "opened", "sealed"}), "--identity");
  EXPECT_REFUSED(kiroku({"unseal", "-i", "plain", "-o", "opened", "sealed"}), "plain");
  EXPECT_REFUSED(kiroku({"unseal", "-i", "key.txt", "-o", "opened", "plain"}), "plain");
  EXPECT_FALSE(std::filesystem::exists(folder() / "opened"));
}

TEST_F(Seal, RefusesAZeroLengthFileWhenOpening) {
  write_text(folder() / "nothing", "");
  EXPECT_REFUSED(kiroku({"unseal", "-i", "key.txt", "-o", "opened", "nothing"}), "");
  EXPECT_FALSE(std::filesystem::exists(folder() / "opened"));
}

}  // namespace
}  // namespace kiroku::test
