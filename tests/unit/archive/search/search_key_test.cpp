#include "archive/search/search_key.h"

#include <fstream>
#include <set>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::search {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class SearchKeyTest : public testing::Test {
 protected:
  std::filesystem::path put(const std::string& name, std::string_view text, mode_t mode = 0600) const {
    std::filesystem::path file = folder_ / name;
    std::ofstream(file, std::ios::binary) << text;
    EXPECT_EQ(::chmod(file.c_str(), mode), 0);
    return file;
  }
  static std::string read(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  const test::TemporaryFolder folder_;
  const SiteKey site_ = SiteKey::make();
};

TEST_F(SearchKeyTest, TheSiteKeyLeadsToEachStepOfAnAppliance) {
  const std::filesystem::path file = put("or-1.key", site_.key_for("or-1").text().text());
  const ApplianceKey first = take_step(file), second = take_step(file), third = take_step(file);
  EXPECT_EQ(first.step, 0U);
  EXPECT_EQ(third.step, 2U);
  EXPECT_TRUE(site_.has_given("or-1", first.series));
  Step step = site_.first_of("or-1", first.series);
  EXPECT_EQ(step.note_key(), first.now.note_key());
  step = step.next();
  EXPECT_EQ(step.note_key(), second.now.note_key());
  EXPECT_EQ(step.next().note_key(), third.now.note_key());
}

TEST_F(SearchKeyTest, TheFileHoldsNothingOfBefore) {
  const std::filesystem::path file = put("or-1.key", site_.key_for("or-1").text().text());
  const std::string before = read(file);
  const ApplianceKey taken = take_step(file);
  const std::string after = read(file);
  EXPECT_EQ(before.size(), after.size());
  EXPECT_THAT(before, HasSubstr(taken.text().text()));
  const std::string chain = before.substr(before.rfind(' ') + 1);
  EXPECT_EQ(after.find(chain), std::string::npos);
  EXPECT_EQ(ApplianceKey::read(file).step, 1U);
  struct stat status {};
  ASSERT_EQ(::stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST_F(SearchKeyTest, SeriesAreOfOneSiteAndOneAppliance) {
  const std::string series = site_.key_for("or-1").series;
  EXPECT_TRUE(is_series(series));
  EXPECT_NE(site_.key_for("or-1").series, series) << "each key has its own";
  EXPECT_FALSE(site_.has_given("or-2", series));
  EXPECT_FALSE(SiteKey::make().has_given("or-1", series));
  EXPECT_FALSE(site_.has_given("or-1", std::string(32, '0')));
  EXPECT_FALSE(site_.has_given("or-1", ""));
  EXPECT_NE(site_.first_of("or-1", series).note_key(), site_.first_of("or-2", series).note_key());
  EXPECT_THROW((void)site_.key_for("Room 1"), UsageError);
}

TEST_F(SearchKeyTest, IsReadAsItWasWritten) {
  const SiteKey again = SiteKey::read(put("site.key", site_.text().text()));
  EXPECT_EQ(again.text().text(), site_.text().text());
  const ApplianceKey key = site_.key_for("or-1");
  const ApplianceKey same = ApplianceKey::parse(key.text().text(), "a file");
  EXPECT_EQ(same.text().text(), key.text().text());
  EXPECT_EQ(same.appliance, "or-1");
}

TEST_F(SearchKeyTest, WhatOthersMayReadIsRefused) {
  for (const mode_t mode : {0640U, 0604U, 0620U}) {
    const std::filesystem::path file = put("open.key", site_.text().text(), mode);
    EXPECT_THAT([&] { (void)SiteKey::read(file); }, ThrowsMessage<UsageError>(HasSubstr("chmod 600")));
  }
  EXPECT_THAT([&] { (void)SiteKey::read(folder_ / "nowhere"); },
              ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet search-key")));
}

TEST_F(SearchKeyTest, WhatIsNoKeyIsRefused) {
  const std::string good(site_.key_for("or-1").text().text());
  const std::string chain = good.substr(good.rfind(' '));
  for (const std::string& bad :
       {std::string(), std::string("\n"), good.substr(0, good.size() - 1), good + "\n", " " + good,
        "kiroku-appliance-search-key-1 Or-1 " + std::string(32, 'a') + " 00000000" + chain,
        "kiroku-appliance-search-key-1 or-1 " + std::string(31, 'a') + " 00000000" + chain,
        "kiroku-appliance-search-key-1 or-1 " + std::string(32, 'a') + " 0000000x" + chain,
        "kiroku-appliance-search-key-1 or-1 " + std::string(32, 'a') + " 0" + chain,
        std::string(site_.text().text()), std::string(513, 'a')}) {
    const std::filesystem::path file = put("bad.key", bad);
    EXPECT_THROW((void)ApplianceKey::read(file), UsageError) << bad;
    EXPECT_THROW((void)take_step(file), UsageError) << bad;
    EXPECT_EQ(read(file), bad) << "it is not written over";
  }
  EXPECT_THAT([&] { (void)SiteKey::read(put("or-1.key", good)); },
              ThrowsMessage<UsageError>(HasSubstr("of an appliance")));
}

TEST_F(SearchKeyTest, ASpentKeyMakesNoMore) {
  ApplianceKey key = site_.key_for("or-1");
  key.step = kMostSteps - 1;
  const std::filesystem::path file = put("or-1.key", key.text().text());
  EXPECT_EQ(take_step(file).step, kMostSteps - 1);
  EXPECT_THAT([&] { (void)take_step(file); }, ThrowsMessage<Error>(HasSubstr("have another one made")));
}

}  // namespace
}  // namespace kiroku::search
