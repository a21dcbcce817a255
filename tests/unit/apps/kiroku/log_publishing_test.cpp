#include "apps/kiroku/log_publishing.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::apps {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class LogPublishingTest : public testing::Test {
 protected:
  LogPublishingTest() {
    std::ofstream(home_.device_file()) << crypto::verifier_key_of("or-1", key_).to_string() << "\n";
    std::filesystem::create_directory(home_.archive());
    enter();
  }
  /// One entry more.
  void enter() {
    const auto log =
        archive::ApplianceLog::open(archive::real_file_system(), home_.log_folder(), key_, "or-1");
    log->access("20261126T091502Z-3f9c21ab", "watched", "somebody");
  }
  std::vector<std::string> brought() {
    std::vector<std::string> problems;
    publishing_.bring_up_to_date(problems);
    return problems;
  }
  /// What is published.
  [[nodiscard]] std::string checkpoint() const {
    std::ifstream stream(home_.published_log() / "checkpoint", std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  }
  /// A file in the place of the folder, and away again.
  void stand_in_the_way() const { std::ofstream(home_.published_log()) << "a file"; }
  void get_out_of_the_way() const { std::filesystem::remove(home_.published_log()); }

  test::TemporaryFolder folder_;
  Home home_{folder_.path()};
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  test::MovedClock clock_;
  LogPublishing publishing_{home_, true, clock_};
};

TEST_F(LogPublishingTest, IsDoneOnceAnHour) {
  EXPECT_THAT(brought(), IsEmpty());
  const std::string first = checkpoint();
  EXPECT_THAT(first, HasSubstr("kiroku/or-1/log"));
  enter();
  clock_.move(1h - 1s);
  EXPECT_THAT(brought(), IsEmpty());
  EXPECT_EQ(checkpoint(), first);
  clock_.move(1s);
  EXPECT_THAT(brought(), IsEmpty());
  EXPECT_NE(checkpoint(), first);
}

// Each try reads the log of years, and whoever follows looks every five seconds.
TEST_F(LogPublishingTest, ThatFailsIsTriedAgainAfterAMinuteAndToldEachTime) {
  stand_in_the_way();
  EXPECT_THAT(brought(), ElementsAre(HasSubstr("the log was not published: ")));
  get_out_of_the_way();
  for (int look = 0; look < 11; ++look) {
    clock_.move(5s);
    EXPECT_THAT(brought(), ElementsAre(HasSubstr("the log was not published: "))) << look;
    EXPECT_FALSE(std::filesystem::exists(home_.published_log())) << look;
  }
  clock_.move(5s);
  EXPECT_THAT(brought(), IsEmpty());
  EXPECT_NE(checkpoint(), "");
  // From there on an hour counts again.
  const std::string first = checkpoint();
  enter();
  clock_.move(1h - 1s);
  EXPECT_THAT(brought(), IsEmpty());
  EXPECT_EQ(checkpoint(), first);
}

TEST_F(LogPublishingTest, GoesOnThoughAnOldNoteLiesUnderALargeNumber) {
  const std::filesystem::path notes = home_.log_folder() / "checkpoints";
  std::filesystem::copy(notes / "00000002.note", notes / "99999999.note");
  enter();
  EXPECT_THAT(brought(), IsEmpty());
  EXPECT_THAT(checkpoint(), HasSubstr("\n3\n"));
}

TEST_F(LogPublishingTest, TellsThatTheLogGoesOnWithoutCheckpoints) {
  enter();
  enter();
  const std::filesystem::path notes = home_.log_folder() / "checkpoints";
  std::filesystem::remove(notes / "00000003.note");
  std::filesystem::remove(notes / "00000004.note");
  EXPECT_THAT(brought(), ElementsAre(HasSubstr("the log was not published to its end. The log goes on beyond "
                                               "that: 2 entries have no checkpoint yet")));
  EXPECT_THAT(checkpoint(), HasSubstr("\n2\n"));
}

TEST_F(LogPublishingTest, IsNotDoneWhereNobodyWantsIt) {
  LogPublishing unwanted(home_, false, clock_);
  std::vector<std::string> problems;
  unwanted.bring_up_to_date(problems);
  EXPECT_THAT(problems, IsEmpty());
  EXPECT_FALSE(std::filesystem::exists(home_.published_log()));
}

}  // namespace
}  // namespace kiroku::apps
