// A sound case that its recorder writes to while somebody verifies it: between the moment when the folder is
// listed and the moment when the ledger is read.
#include <fstream>
#include <functional>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/upkeep/consents.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/report_text.h"
#include "tests/support/sample_case.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;

/// Lets a recorder go on once, before the ledger is opened to be walked.
class WhileTheLedgerIsOpened : public archive::FileReading {
 public:
  explicit WhileTheLedgerIsOpened(std::function<void()> go_on) : go_on_(std::move(go_on)) {}
  int open_at(int folder, const std::string& name, int flags, const fs::path& path) const override {
    const bool now = name == archive::kLedgerFile && ++openings_ == 2;
    if (now) go_on_();
    return FileReading::open_at(folder, name, flags, path);
  }

 private:
  std::function<void()> go_on_;
  mutable int openings_ = 0;
};

class GrowingCase : public ::testing::Test {
 protected:
  archive::VerificationReport verify_while(const std::function<void()>& go_on) {
    const WhileTheLedgerIsOpened files(go_on);
    archive::VerifyOptions options = archive_.options();
    options.files = &files;
    return archive::verify_case(sample_.folder(), options);
  }

  SampleArchive archive_;
  SampleCase sample_{archive_};
};

TEST_F(GrowingCase, ThatIsStampedMeanwhileIsStillBeingRecorded) {
  sample_.record();
  const archive::VerificationReport report = verify_while([&] { sample_.stamp(); });
  EXPECT_EQ(report.verdict, archive::Verdict::kIncomplete) << details(report);
}

TEST_F(GrowingCase, ThatIsClosedMeanwhileIsIntact) {
  sample_.record();
  const fs::path part = sample_.folder() / "segments/endoscope/00000003.ts.age.part";
  std::ofstream(part) << "a film that is being written";
  const archive::VerificationReport report = verify_while([&] {
    fs::remove(part);
    archive_.now_ns = 7 * kSecond;
    sample_.writer().append({sample_.segment(0, 3, {6 * kSecond, 7 * kSecond})}, archive_.now());
    sample_.close();
  });
  EXPECT_EQ(summary(report), "intact") << details(report);
}

TEST_F(GrowingCase, FromWhichIsErasedMeanwhileHasAStatedGap) {
  AttackedCase closed;
  const WhileTheLedgerIsOpened files([&] {
    closed.append(archive::ErasedEntry{"endoscope", 0, 1, "room: 30 days"});
    const std::uint64_t size = closed.lines().size();
    closed.write_note(size, closed.origin(), size, closed.root(size), SoundCases::get().archive.key(),
                      SampleArchive::kDeviceName);
    for (const char* name : {"00000000", "00000001"}) {
      fs::remove(closed / ("segments/endoscope/" + std::string(name) + ".ts.age"));
    }
  });
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.files = &files;
  options.log = closed.log();
  const archive::VerificationReport report = archive::verify_case(closed.folder(), options);
  EXPECT_EQ(report.verdict, archive::Verdict::kIntactWithGaps) << details(report);
}

// A statement is sealed beside the log before its entry.
TEST_F(GrowingCase, WhoseConsentIsEnteredWhileTheLogIsVerifiedLeavesNothingUnentered) {
  sample_.record();
  sample_.close();
  const auto verdict = [&](const std::function<void()>& go_on) {
    // The second time is after all lines were read, to see what came meanwhile.
    const WhileTheLedgerIsOpened files(go_on);
    archive::VerifyOptions options = archive_.options();
    options.files = &files;
    return details(archive::verify_log(archive_.log_folder(), options));
  };
  archive::ConsentStatement says;
  says.case_id = sample_.folder().filename().string();
  says.purposes = {"teaching"};
  says.who = "anna";
  says.statement = archive::keep_sealed(archive::real_file_system(), archive_.log_folder(),
                                        bytes_of("a statement"), archive_.recipients());
  EXPECT_THAT(verdict([] {}), ::testing::HasSubstr("consent-not-entered"));
  EXPECT_THAT(verdict([&] { sample_.log()->consent_given(says); }),
              ::testing::Not(::testing::HasSubstr("consent-not-entered")));
}

// What does not hold is told, however often somebody writes to the ledger.
TEST_F(GrowingCase, OfWhichAFilmIsMissingIsTampered) {
  sample_.record();
  fs::remove(sample_.folder() / "segments/endoscope/00000001.ts.age");
  const archive::VerificationReport report = verify_while([&] { sample_.close(); });
  EXPECT_EQ(report.verdict, archive::Verdict::kTampered) << details(report);
}

}  // namespace
}  // namespace kiroku::test
