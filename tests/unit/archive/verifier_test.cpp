#include "archive/verifier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

std::string listing(const VerificationReport& report) {
  std::string text = std::string(verdict_name(report.verdict)) + "\n";
  for (const Finding& finding : report.findings) {
    text += finding.code + " | " + finding.file + " | " +
            (finding.entry ? std::to_string(*finding.entry) : "-") + " | " +
            (finding.offset ? std::to_string(*finding.offset) : "-") + " | " + finding.text + "\n";
  }
  return text;
}

TEST(Verifier, FindsTheUntouchedCaseIntact) {
  test::SampleArchive archive;
  const auto folder = test::SampleCase::write(archive);
  const VerificationReport report = verify_case(folder, archive.options());
  EXPECT_EQ(listing(report), "intact\n");
}

}  // namespace
}  // namespace kiroku::archive
