#include "apps/fleet/fleet_configuration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::apps {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const std::string kFleet =
    "[store]\nendpoint = \"https://store.example\"\nbucket = \"recordings\"\n"
    "[catalogue]\nconnection = \"dbname=kiroku\"\n";
const std::string kTrust = "[verification]\ntrust = [\"swiss.pem\"]\n";
const std::string kSwiss = "[[authority]]\nname = \"swiss\"\nurl = \"https://tsa.example/tsr\"\n";

std::string refusal(const std::string& toml) {
  try {
    FleetConfiguration::parse(toml, "fleet.toml");
  } catch (const UsageError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(FleetConfiguration, ReadsWhoStampsForAllAppliances) {
  const FleetConfiguration read = FleetConfiguration::parse(
      kFleet + kTrust + "[sharing]\nevery = \"30s\"\n" + kSwiss + "min_interval = \"20s\"\n", "fleet.toml");
  ASSERT_EQ(read.authorities.size(), 1U);
  EXPECT_EQ(read.authorities[0].name, "swiss");
  EXPECT_EQ(read.authorities[0].paths.at(0).url, "https://tsa.example/tsr");
  EXPECT_EQ(read.round, 30s);
  EXPECT_TRUE(FleetConfiguration::parse(kFleet, "fleet.toml").authorities.empty());
  EXPECT_EQ(FleetConfiguration::parse(kFleet, "fleet.toml").round, 60s);
}

TEST(FleetConfiguration, RefusesRoundsThatCannotBeStamped) {
  EXPECT_THAT(refusal(kFleet + kSwiss), HasSubstr("name its root in 'trust' of [verification]"));
  EXPECT_THAT(refusal(kFleet + kTrust + "[sharing]\nevery = \"30s\"\n"), HasSubstr("needs an [[authority]]"));
  for (const char* every : {"0s", "999ms", "6m", "x", "20"})
    EXPECT_THAT(refusal(kFleet + kTrust + "[sharing]\nevery = \"" + every + "\"\n" + kSwiss),
                HasSubstr("'every'"));
  EXPECT_THAT(refusal(kFleet + kTrust + kSwiss + "min_interval = \"75s\"\n"),
              HasSubstr("rounds are stamped each 60 s, more often than 'min_interval' of swiss allows"));
  EXPECT_THAT(refusal(kFleet + kTrust + "[[authority]]\nname = \"own\"\nurl = \"embedded\"\n"),
              HasSubstr("others cannot share it"));
  EXPECT_THAT(refusal(kFleet + kTrust + kSwiss + "shared = true\n"), HasSubstr("shared"));
  EXPECT_THAT(refusal(kFleet + kTrust + kSwiss + kSwiss), HasSubstr("two authorities named 'swiss'"));
}

const std::string kMending = "[mending]\nhome = \"mending\"\n";

TEST(FleetConfiguration, ReadsWhereCopiesLie) {
  const FleetConfiguration read = FleetConfiguration::parse(
      kFleet + kMending + "credentials = \"mending-credentials\"\n" +
          "[[copy]]\nname = \"second\"\nendpoint = \"https://other.example\"\nbucket = \"copies\"\n"
          "[[copy]]\nname = \"replica\"\nfolder = \"/mnt/replica\"\n",
      "fleet.toml");
  ASSERT_TRUE(read.mending);
  EXPECT_EQ(read.mending->home, "mending");
  EXPECT_EQ(read.mending->credentials, "mending-credentials");
  ASSERT_EQ(read.copies.size(), 2U);
  EXPECT_EQ(read.copies[0].store.endpoint, "https://other.example");
  EXPECT_EQ(read.copies[0].store.credentials, "store-credentials");
  EXPECT_EQ(read.copies[1].name, "replica");
  EXPECT_EQ(read.copies[1].folder, "/mnt/replica");
  EXPECT_FALSE(FleetConfiguration::parse(kFleet, "fleet.toml").mending);
  EXPECT_TRUE(FleetConfiguration::parse(kFleet + kMending, "fleet.toml").copies.empty());
}

TEST(FleetConfiguration, RefusesCopiesThatAreNone) {
  const std::string replica = "[[copy]]\nname = \"replica\"\nfolder = \"/mnt/replica\"\n";
  EXPECT_THAT(refusal(kFleet + replica), HasSubstr("nothing uses the copy 'replica' without [mending]"));
  EXPECT_THAT(refusal(kFleet + "[mending]\n"), HasSubstr("[mending] needs 'home'"));
  EXPECT_THAT(refusal(kFleet + kMending + replica + replica), HasSubstr("two copies named 'replica'"));
  EXPECT_THAT(refusal(kFleet + kMending + "[[copy]]\nname = \"a\"\n"), HasSubstr("either 'folder', or"));
  EXPECT_THAT(refusal(kFleet + kMending + "[[copy]]\nfolder = \"/mnt\"\n"), HasSubstr("needs 'name'"));
  EXPECT_THAT(refusal(kFleet + kMending + "[[copy]]\nname = \"A/b\"\nfolder = \"/mnt\"\n"),
              HasSubstr("'name'"));
  EXPECT_THAT(refusal(kFleet + kMending + replica + "endpoint = \"https://other.example\"\n"),
              HasSubstr("unknown key 'endpoint'"));
}

TEST(FleetConfiguration, ReadsHowEvidenceRecordsAreRenewed) {
  const FleetConfiguration read = FleetConfiguration::parse(
      kFleet + "[evidence]\npolicy = \"algorithms.toml\"\ncredentials = \"put\"\nevery = \"30d\"\n",
      "/etc/kiroku/fleet.toml");
  EXPECT_EQ(read.policy_file(), "/etc/kiroku/algorithms.toml");
  EXPECT_EQ(read.evidence.credentials, "put");
  EXPECT_EQ(read.evidence.look_every, std::chrono::hours(24 * 30));
  const FleetConfiguration without = FleetConfiguration::parse(kFleet, "fleet.toml");
  EXPECT_FALSE(without.policy_file());
  EXPECT_EQ(without.evidence.look_every, std::chrono::hours(24 * 91));
  EXPECT_THAT(refusal(kFleet + "[evidence]\nevery = \"1s\"\n"), HasSubstr("an hour at least"));
  EXPECT_THAT(refusal(kFleet + "[evidence]\npolicies = \"a\"\n"), HasSubstr("unknown key 'policies'"));
}

}  // namespace
}  // namespace kiroku::apps
