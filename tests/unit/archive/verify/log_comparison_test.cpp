#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/verify/log_rules.h"

namespace kiroku::archive {
namespace {

constexpr const char* kLoggedCase = "20260805T091502Z-3f9c21ab";

crypto::Sha256Digest digest(std::uint8_t fill) {
  crypto::Sha256Digest value;
  value.fill(static_cast<std::byte>(fill));
  return value;
}

std::optional<OpenEntry> case_opening() {
  OpenEntry open;
  open.case_id = kLoggedCase;
  return open;
}

/// A log that knows the case and these roots of it.
LogContents log_of(std::vector<KnownRoot> roots) {
  LogContents log;
  log.root_at_head = crypto::Sha256Digest{};
  log.cases[kLoggedCase].opened = 1;
  log.cases[kLoggedCase].roots = std::move(roots);
  return log;
}

TEST(LogComparison, AsksForTheSizesThatTheLogStatesInWhateverOrder) {
  const LogContents log =
      log_of({{9, digest(9), 3}, {2, digest(2), 4}, {5, digest(5), 5}, {2, digest(7), 6}});
  FindingList findings;
  LogComparison comparison(&log, case_opening(), findings);
  std::vector<std::uint64_t> asked;
  for (std::uint64_t size = 0; size < 12; ++size) {
    if (comparison.asks_for(size)) {
      asked.push_back(size);
    }
  }
  EXPECT_THAT(asked, testing::ElementsAre(2, 5, 9));
  EXPECT_TRUE(comparison.knows_beyond(8));
  EXPECT_FALSE(comparison.knows_beyond(9));
  // Both roots of size 2 are compared, in the order of the log.
  std::vector<crypto::Sha256Digest> compared;
  comparison.reached(2, [&](const crypto::Sha256Digest& root) {
    compared.push_back(root);
    return root == digest(2);
  });
  EXPECT_THAT(compared, testing::ElementsAre(digest(2), digest(7)));
  const std::vector<Finding> told = findings.take();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].code, "log-checkpoint-differs");
  EXPECT_EQ(told[0].entry, 6U);
}

// A walk over all roots for each line would take a million million steps.
TEST(LogComparison, AnswersForAMillionLinesAgainstAMillionRoots) {
  constexpr std::uint64_t kRoots = 1'000'000;
  std::vector<KnownRoot> roots;
  for (std::uint64_t i = 0; i < kRoots; ++i) {
    roots.push_back({2 * (kRoots - i), digest(1), i});
  }
  const LogContents log = log_of(std::move(roots));
  FindingList findings;
  LogComparison comparison(&log, case_opening(), findings);
  std::uint64_t asked = 0;
  for (std::uint64_t size = 1; size <= 2 * kRoots; ++size) {
    if (comparison.asks_for(size)) {
      comparison.reached(size, [&](const crypto::Sha256Digest&) { return ++asked > 0; });
    }
  }
  EXPECT_EQ(asked, kRoots);
  EXPECT_TRUE(findings.take().empty());
}

}  // namespace
}  // namespace kiroku::archive
