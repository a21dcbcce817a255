#include "apps/kiroku/named_roots.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"
#include "timestamp/request.h"

namespace kiroku::apps {
namespace {

TEST(NamedRoots, StandInThePlaceOfTheHomesOwn) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "home");
  const Home home(folder / "home");
  timestamp::Authority of_home = timestamp::Authority::create(home.authority_folder(), "or-3");
  timestamp::Authority other = timestamp::Authority::create(folder / "other", "Other");
  std::ofstream(home.device_file()) << "what makes it a home\n";
  std::ofstream(folder / "other.pem") << other.root_pem();
  const Bytes request = timestamp::encode_request(
      timestamp::make_request(crypto::HashAlgorithm::kSha256, Bytes(32, std::byte{1})));
  const auto is_valid = [&](timestamp::Authority& by, const timestamp::TrustStore& trust) {
    return timestamp::judge_token(by.respond(request), {}, trust).code == timestamp::TokenCode::kValid;
  };
  const NamedRoots none, named{{}, {(folder / "other.pem").string()}};
  const std::string its_name = home.folder().string(), nowhere = (folder / "nowhere").string();
  EXPECT_TRUE(is_valid(of_home, required_trust(none, its_name)));
  EXPECT_FALSE(is_valid(of_home, required_trust(named, its_name)));
  EXPECT_TRUE(is_valid(other, required_trust(named, its_name)));
  EXPECT_TRUE(is_valid(other, required_trust(named, nowhere))) << "nobody asks for the home";
  EXPECT_TRUE(is_valid(of_home, trust_of(none, home)));
  EXPECT_FALSE(is_valid(of_home, trust_of(named, home)));
  EXPECT_FALSE(trust_of(none, std::nullopt).has_trusted());
  EXPECT_THROW((void)required_trust(none, nowhere), UsageError);
}

}  // namespace
}  // namespace kiroku::apps
