#include "recorder/record_stamper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/moved_clock.h"
#include "tests/support/switched_authority.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/token_maker.h"
#include "timestamp/authority.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// An authority that is no recorder's own.
class OutsideAuthority final : public timestamp::StampSource {
 public:
  Bytes ask(ByteView query) override {
    const auto request = timestamp::parse_request(query).request;
    test::TokenRecipe recipe;
    recipe.imprint_algorithm = request->algorithm == crypto::HashAlgorithm::kSha512 ? NID_sha512 : NID_sha256;
    recipe.imprint = request->imprint;
    std::uint64_t nonce = 0;
    for (const std::byte byte : *request->nonce) nonce = nonce << 8U | std::to_integer<std::uint64_t>(byte);
    recipe.nonce = nonce;
    recipe.signer = &authority_.signer;
    recipe.enclosed = {authority_.signer.certificate.get(), authority_.ca.certificate.get()};
    return test::make_response(test::make_token(recipe));
  }
  [[nodiscard]] std::string root_pem() const { return authority_.root_pem(); }

 private:
  test::TestAuthority authority_ = test::make_test_authority();
};

/// Two authorities behind switches, both the recorder's own; and two that are one outside authority.
class RecordStamperTest : public testing::Test {
 protected:
  RecordStamperTest() {
    trust_.add_own_authority(bytes_of(own_authority_.root_pem()), "own");
    trust_.add_trusted(bytes_of(outside_->root_pem()), "outside");
  }
  [[nodiscard]] evidence::Stamp stamper(const timestamp::TrustStore& trust,
                                        std::vector<NamedAuthority> authorities) const {
    return record_stamper(authorities, &trust, nullptr, clock_);
  }
  static Bytes ask(const evidence::Stamp& stamp,
                   crypto::HashAlgorithm algorithm = crypto::HashAlgorithm::kSha512) {
    return stamp(algorithm, crypto::digest(algorithm, bytes_of("root")));
  }
  static std::string refusal(const evidence::Stamp& stamp) {
    try {
      ask(stamp);
      return "none";
    } catch (const Error& error) {
      return error.what();
    }
  }

  test::TemporaryFolder folder_;
  timestamp::Authority own_authority_ = timestamp::Authority::create(folder_ / "own", "Test");
  std::shared_ptr<test::SwitchedAuthority> first_ =
      std::make_shared<test::SwitchedAuthority>(timestamp::embedded_stamp_source(own_authority_));
  std::shared_ptr<test::SwitchedAuthority> second_ =
      std::make_shared<test::SwitchedAuthority>(timestamp::embedded_stamp_source(own_authority_));
  std::shared_ptr<OutsideAuthority> outside_ = std::make_shared<OutsideAuthority>();
  std::shared_ptr<test::SwitchedAuthority> outside_first_ =
      std::make_shared<test::SwitchedAuthority>(outside_);
  std::shared_ptr<test::SwitchedAuthority> outside_second_ =
      std::make_shared<test::SwitchedAuthority>(outside_);
  timestamp::TrustStore trust_;
  test::MovedClock clock_;
};

TEST_F(RecordStamperTest, GivesATokenOverTheHashThatIsAskedFor) {
  const Bytes token = ask(stamper(trust_, {{"own", first_}}));
  std::string why;
  const auto info = timestamp::parse_token_info(token, why);
  ASSERT_TRUE(info) << why;
  EXPECT_EQ(info->algorithm, crypto::HashAlgorithm::kSha512);
  EXPECT_EQ(info->imprint, crypto::digest(crypto::HashAlgorithm::kSha512, bytes_of("root")));
}

TEST_F(RecordStamperTest, TheNextAuthorityIsAskedWhereOneDoesNotAnswer) {
  first_->up = false;
  const auto stamp = stamper(trust_, {{"first", first_}, {"second", second_}});
  // The recorder's own: as long as another one is away, its token is not taken.
  EXPECT_THAT(refusal(stamp),
              HasSubstr("no outside authority answered, and the recorder's own is none; first: "
                        "the authority is not there"));
  EXPECT_EQ(second_->requests, 1);
  first_->up = true;
  EXPECT_FALSE(ask(stamper(trust_, {{"first", first_}, {"second", second_}})).empty());
}

TEST_F(RecordStamperTest, NobodyAnswersIsToldOfEach) {
  first_->up = second_->up = false;
  EXPECT_EQ(refusal(stamper(trust_, {{"first", first_}, {"second", second_}})),
            "first: the authority is not there; second: the authority is not there");
  const timestamp::TrustStore nobody;
  first_->up = true;
  EXPECT_THAT(refusal(stamper(nobody, {{"first", first_}})), HasSubstr("first: "));
}

TEST_F(RecordStamperTest, AnAuthorityThatAsksToBeLeftAloneForLongIsPassedOver) {
  outside_first_->up = false;
  outside_first_->leave_alone_for_s = 3600;
  const auto stamp = stamper(trust_, {{"first", outside_first_}, {"second", outside_second_}});
  EXPECT_FALSE(ask(stamp).empty()) << "the second one's";
  outside_first_->up = true;
  EXPECT_FALSE(ask(stamp).empty());
  EXPECT_EQ(outside_first_->requests, 1) << "it is left alone";
  outside_second_->up = false;
  EXPECT_THAT(refusal(stamp), HasSubstr("first: is to be left alone for another 3600 s; second: "));
}

TEST_F(RecordStamperTest, TheFirstOutsideAuthorityDoesWhereverTheRecordersOwnStands) {
  EXPECT_FALSE(ask(stamper(trust_, {{"own", first_}, {"first", outside_first_}, {"second", outside_second_}}))
                   .empty());
  EXPECT_EQ(first_->requests, 1);
  EXPECT_EQ(outside_first_->requests, 1);
  EXPECT_EQ(outside_second_->requests, 0);
  const Bytes token = ask(stamper(trust_, {{"own", first_}, {"first", outside_first_}}));
  EXPECT_EQ(timestamp::judge_token(token, {}, trust_).authority, timestamp::TimeAuthority::kOutside);
}

}  // namespace
}  // namespace kiroku::recorder
