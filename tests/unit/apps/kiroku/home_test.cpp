#include "apps/kiroku/home.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"
#include "timestamp/request.h"

namespace kiroku::apps {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using timestamp::TimeAuthority;

class HomeRoots : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  /// Whose clock the token of the home's authority tells; it must hold.
  [[nodiscard]] TimeAuthority judged(const timestamp::TrustStore& trust) const {
    const auto judgement = timestamp::judge_token(token_, {}, trust);
    EXPECT_EQ(timestamp::code_name(judgement.code), "token-valid") << judgement.explanation;
    return judgement.authority;
  }

  test::TemporaryFolder folder_;
  Home home_{folder_.path()};
  timestamp::Authority authority_ = timestamp::Authority::create(folder_ / "authority", "or-3");
  Bytes token_ = authority_.respond(timestamp::encode_request(
      timestamp::make_request(crypto::HashAlgorithm::kSha256, Bytes(32, std::byte{1}))));
};

TEST_F(HomeRoots, KeepTheOwnAuthorityApart) {
  write("trust.pem", "# Roots of outside authorities\n\n  # none yet\n");
  write("own-authority.pem", authority_.root_pem());
  EXPECT_THAT(home_.outside_root_files(), IsEmpty());
  EXPECT_THAT(home_.own_root_files(),
              ElementsAre(folder_ / "own-authority.pem", folder_ / "authority/ca.pem"));
  EXPECT_EQ(judged(home_.trust()), TimeAuthority::kOwn);
  EXPECT_THAT(home_.trust().own_among_outside(), IsEmpty());
}

TEST_F(HomeRoots, OfAnOlderHomeThatHasTheOwnOneAmongTheOutsideOnesAreRecognised) {
  write("trust.pem", authority_.root_pem());
  EXPECT_THAT(home_.outside_root_files(), ElementsAre(folder_ / "trust.pem"));
  EXPECT_THAT(home_.trust().own_among_outside(), ElementsAre(HasSubstr("or-3")));
  EXPECT_EQ(judged(home_.trust()), TimeAuthority::kOwn);
}

TEST_F(HomeRoots, OfAnAuthorityThatWasMadeAnewStayTheOwnOnes) {
  write("own-authority.pem", authority_.root_pem());
  std::filesystem::remove_all(folder_ / "authority");
  EXPECT_EQ(judged(home_.trust()), TimeAuthority::kOwn) << "the former one, by own-authority.pem";
  const timestamp::Authority renewed = timestamp::Authority::create(folder_ / "authority", "or-3");
  EXPECT_EQ(judged(home_.trust()), TimeAuthority::kOwn) << "the former one, beside the new one";
}

TEST_F(HomeRoots, ThatCannotBeUsedAreToldAndLeftOutWhereRecordingGoesOn) {
  write("own-authority.pem", "-----BEGIN CERTIFICATE-----\ndamaged\n-----END CERTIFICATE-----\n");
  EXPECT_THROW(home_.trust(), Error);
  std::vector<std::string> told;
  const auto trust = home_.trust([&told](const std::string& sentence) { told.push_back(sentence); });
  EXPECT_THAT(told, ElementsAre(HasSubstr("own-authority.pem")));
  EXPECT_EQ(judged(trust), TimeAuthority::kOwn) << "by the certificate that is there";
}

TEST_F(HomeRoots, ThatAreNoCertificatesAreRefused) {
  write("trust.pem", "<html>502 Bad Gateway</html>");
  EXPECT_THROW(home_.trust(), Error);
  std::filesystem::remove(folder_ / "trust.pem");
  EXPECT_TRUE(home_.trust().has_trusted()) << "the own one is there";
  std::filesystem::remove_all(folder_ / "authority");
  EXPECT_FALSE(home_.trust().has_trusted());
}

}  // namespace
}  // namespace kiroku::apps
