#include "apps/kiroku/standing_consents.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::apps {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(EnterPurpose, ReadsNothingOfACaseWhereTheSiteDemandsNone) {
  const test::TemporaryFolder folder;
  const Home home(folder / "home");
  const std::filesystem::path own = home.archive() / "20261126T091502Z-3f9c21ab", other = folder / "other";
  std::filesystem::create_directories(own);
  std::filesystem::create_directories(other);
  std::ofstream(other / "ledger.jsonl") << "not to be read\n";
  const auto enter = [&](const std::filesystem::path& case_folder) {
    return enter_purpose(home, case_folder, {}, "exported endoscope");
  };
  EXPECT_FALSE(enter(own));
  EXPECT_FALSE(enter(other)) << "no kiroku.toml";
  std::ofstream(home.configuration_file()) << "[consent]\ndemand_purpose = false\n";
  EXPECT_FALSE(enter(own));
  EXPECT_FALSE(enter(other));
  // Where it does, whether the folder is a copy of an own case must be known.
  std::ofstream(home.configuration_file()) << "[consent]\ndemand_purpose = true\n";
  EXPECT_THAT([&] { (void)enter(own); },
              ThrowsMessage<UsageError>(HasSubstr("this site demands a purpose of every export")));
  EXPECT_THROW((void)enter(other), Error);
}

}  // namespace
}  // namespace kiroku::apps
