#include "viewer/people/known_devices.h"

#include <fstream>
#include <iterator>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace kiroku::viewer {
namespace {

using Standing = KnownDevices::Standing;

class KnownDevicesTest : public testing::Test {
 protected:
  static KnownDevices::Caller caller(const std::string& user, const std::string& device,
                                     const std::string& holder = "192.0.2.7") {
    return {user, *parse_utc("2026-08-05T09:15:02Z"), device, holder};
  }
  test::TemporaryFolder folder;
  std::unique_ptr<KnownDevices> devices = KnownDevices::open(folder / "devices.sqlite");
};

TEST_F(KnownDevicesTest, AreThoseBySomebodySignedInBefore) {
  EXPECT_EQ(devices->standing(caller("anna", "")), Standing::kStranger);
  const std::string cookie = devices->remember(caller("anna", ""));
  EXPECT_EQ(cookie.size(), 43U);
  EXPECT_EQ(devices->standing(caller("anna", cookie, "198.51.100.1")), Standing::kKnownDevice);
  EXPECT_EQ(devices->standing(caller("anna", "")), Standing::kKnownAddress);
  EXPECT_EQ(devices->standing(caller("anna", "forged")), Standing::kKnownAddress);
  EXPECT_EQ(devices->standing(caller("anna", "forged", "198.51.100.1")), Standing::kStranger);
  EXPECT_EQ(devices->standing(caller("bert", cookie)), Standing::kStranger) << "of another user";
}

TEST_F(KnownDevicesTest, AreRememberedOverAStartByHashesAlone) {
  const std::string cookie = devices->remember(caller("anna", ""));
  devices.reset();
  std::ifstream file(folder / "devices.sqlite", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(bytes.find(cookie), std::string::npos);
  struct stat status {};
  ASSERT_EQ(::stat((folder / "devices.sqlite").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  devices = KnownDevices::open(folder / "devices.sqlite");
  EXPECT_EQ(devices->standing(caller("anna", cookie, "198.51.100.1")), Standing::kKnownDevice);
}

TEST_F(KnownDevicesTest, OfSeveralPeopleKeepOneCookieWhichEachSignInReplaces) {
  const std::string first = devices->remember(caller("anna", ""));
  const std::string second = devices->remember(caller("bert", first));
  EXPECT_NE(first, second);
  for (const char* user : {"anna", "bert"}) {
    EXPECT_EQ(devices->standing(caller(user, second, "198.51.100.1")), Standing::kKnownDevice) << user;
    EXPECT_EQ(devices->standing(caller(user, first, "198.51.100.1")), Standing::kStranger)
        << "who noted the old cookie has nothing of it";
  }
}

TEST_F(KnownDevicesTest, AreStrangersOnceThePasswordIsAnother) {
  const std::string cookie = devices->remember(caller("anna", ""));
  KnownDevices::Caller later = caller("anna", cookie);
  later.credential += std::chrono::seconds(1);
  EXPECT_EQ(devices->standing(later), Standing::kStranger);
}

TEST_F(KnownDevicesTest, LoseTheirStandingByFailuresOfTheirOwnAlone) {
  const std::string cookie = devices->remember(caller("anna", ""));
  for (int i = 0; i < 1000; ++i) devices->note_failure(caller("anna", "", "203.0.113.9"));
  EXPECT_EQ(devices->standing(caller("anna", cookie)), Standing::kKnownDevice);
  for (int i = 0; i < KnownDevices::kOwnFailures; ++i) devices->note_failure(caller("anna", "", "192.0.2.7"));
  EXPECT_EQ(devices->standing(caller("anna", "")), Standing::kStranger) << "the address";
  EXPECT_EQ(devices->standing(caller("anna", cookie)), Standing::kKnownDevice) << "not the browser at it";
  for (int i = 0; i < KnownDevices::kOwnFailures - 1; ++i) devices->note_failure(caller("anna", cookie));
  const std::string next = devices->remember(caller("anna", cookie));
  for (int i = 0; i < KnownDevices::kOwnFailures; ++i) {
    EXPECT_EQ(devices->standing(caller("anna", next, "203.0.113.9")), Standing::kKnownDevice) << "in a row";
    devices->note_failure(caller("anna", next, "203.0.113.9"));
  }
  EXPECT_EQ(devices->standing(caller("anna", next, "203.0.113.9")), Standing::kStranger);
}

TEST_F(KnownDevicesTest, AreTheLatestOfEachUser) {
  const std::string of_bert = devices->remember(caller("bert", "", "198.51.100.1"));
  std::vector<std::string> cookies;
  for (int i = 0; i <= KnownDevices::kMostOfUser; ++i) {
    cookies.push_back(devices->remember(caller("anna", "", "192.0.2." + std::to_string(i))));
  }
  EXPECT_EQ(devices->standing(caller("anna", cookies[0], "192.0.2.0")), Standing::kStranger);
  EXPECT_EQ(devices->standing(caller("anna", cookies[1], "203.0.113.9")), Standing::kKnownDevice);
  EXPECT_EQ(devices->standing(caller("anna", "", "192.0.2.1")), Standing::kKnownAddress);
  EXPECT_EQ(devices->standing(caller("bert", of_bert)), Standing::kKnownDevice);
}

}  // namespace
}  // namespace kiroku::viewer
