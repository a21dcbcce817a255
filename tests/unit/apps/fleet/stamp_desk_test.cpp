// What appliances hear of rounds, whatever the authority does.
#include "apps/fleet/stamp_desk.h"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/fleet/desk_refusal.h"
#include "crypto/hash.h"
#include "evidence/shared_token.h"
#include "tests/support/moved_clock.h"
#include "tests/support/switched_authority.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"

namespace kiroku::apps {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

Bytes hash_of(const std::string& text) {
  return crypto::digest(crypto::HashAlgorithm::kSha256, bytes_of(text));
}

class StampDeskTest : public testing::Test {
 protected:
  StampDeskTest() { trust_.add_trusted(bytes_of(authority_.root_pem()), "the authority"); }

  std::unique_ptr<StampDesk> desk() {
    StampDesk::Options options;
    AuthorityConfiguration swiss;
    swiss.name = "swiss";
    options.authorities = {swiss};
    options.trust = &trust_;
    options.clock = &clock_;
    options.reach = [this](const AuthorityConfiguration&) { return source_; };
    return std::make_unique<StampDesk>(std::move(options));
  }
  static std::string enter(StampDesk& desk, const std::string& appliance, const std::string& note) {
    const StampDesk::Answer answer = desk.enter(appliance, {"swiss", hash_of(note), hash_of("nonce")});
    EXPECT_EQ(answer.status, 202);
    return fleet::parse_place(answer.json).ticket;
  }
  template <typename Step>
  static DeskRefusal refusal_of(const Step& step) {
    try {
      step();
    } catch (const DeskRefusal& refusal) {
      return refusal;
    }
    return {0, "taken"};
  }
  void end_round() {
    clock_.await_waiting(1);
    clock_.move(60s);
    clock_.await_waiting(1);
  }

  test::MovedClock clock_;
  test::TemporaryFolder folder_{test::quick_parent()};
  timestamp::Authority authority_ = timestamp::Authority::create(folder_ / "authority", "Test");
  timestamp::TrustStore trust_;
  std::shared_ptr<test::SwitchedAuthority> source_ =
      std::make_shared<test::SwitchedAuthority>(timestamp::embedded_stamp_source(authority_));
};

TEST_F(StampDeskTest, GivesATokenThatIsOverTheNoteAndJudged) {
  const auto desk = this->desk();
  const std::string ticket = enter(*desk, "or-1", "note");
  EXPECT_EQ(desk->fetch("or-1", {"swiss", ticket}).status, 202);
  end_round();
  const StampDesk::Answer answer = desk->fetch("or-1", {"swiss", ticket});
  EXPECT_EQ(answer.status, 200);
  std::string why;
  const auto judging =
      evidence::judging_shared(fleet::parse_record_answer(answer.json), bytes_of("note"), why);
  ASSERT_TRUE(judging) << why;
  EXPECT_EQ(timestamp::judge_token(judging->token, judging->expectation, trust_).code,
            timestamp::TokenCode::kValid);
  EXPECT_EQ(refusal_of([&] { static_cast<void>(desk->fetch("or-2", {"swiss", ticket})); }).status, 404);
}

TEST_F(StampDeskTest, AnAuthorityThatFailedIsNotWaitedForAgain) {
  const auto desk = this->desk();
  source_->up = false;
  const std::string ticket = enter(*desk, "or-1", "note");
  end_round();
  const DeskRefusal failed = refusal_of([&] { static_cast<void>(desk->fetch("or-1", {"swiss", ticket})); });
  EXPECT_EQ(failed.status, 502);
  EXPECT_THAT(failed.why, HasSubstr("swiss gave no time-stamp: the authority is not there"));
  const DeskRefusal refused = refusal_of([&] { enter(*desk, "or-2", "note"); });
  EXPECT_EQ(refused.status, 503);
  EXPECT_THAT(refused.why, HasSubstr("swiss is left alone for another"));
  source_->up = true;
  clock_.move(38s);  // the first pause and a quarter more
  const std::string again = enter(*desk, "or-2", "note");
  end_round();
  EXPECT_EQ(desk->fetch("or-2", {"swiss", again}).status, 200);
  EXPECT_EQ(source_->requests, 2);
}

TEST_F(StampDeskTest, ARoundThatIsOpenWhenAnAuthorityWantsToBeLeftAloneDoesNotAskIt) {
  const auto desk = this->desk();
  source_->up = false;
  source_->leave_alone_for_s = 3600;
  source_->held = true;
  enter(*desk, "or-1", "note");
  clock_.await_waiting(1);
  clock_.move(60s);
  while (source_->requests < 1) std::this_thread::yield();
  // It is asked for the first round meanwhile, and has not failed yet.
  const std::string ticket = enter(*desk, "or-2", "note");
  source_->release();
  end_round();
  const DeskRefusal failed = refusal_of([&] { static_cast<void>(desk->fetch("or-2", {"swiss", ticket})); });
  EXPECT_EQ(failed.status, 502);
  EXPECT_THAT(failed.why, HasSubstr("not asked, since it is to be left alone for another 3540 s"));
  EXPECT_EQ(source_->requests, 1);
}

TEST_F(StampDeskTest, HandsOutNothingThatItDoesNotTrust) {
  trust_ = timestamp::TrustStore();
  const auto desk = this->desk();
  const std::string ticket = enter(*desk, "or-1", "note");
  end_round();
  EXPECT_EQ(refusal_of([&] { static_cast<void>(desk->fetch("or-1", {"swiss", ticket})); }).status, 502);
}

TEST_F(StampDeskTest, NamesTheAuthoritiesThatItHas) {
  const auto desk = this->desk();
  const DeskRefusal refused = refusal_of([&] {
    desk->enter("or-1", {"french", hash_of("note"), hash_of("nonce")});
  });
  EXPECT_EQ(refused.status, 404);
  EXPECT_EQ(refused.why, "no authority named french is shared here; there are: swiss");
}

TEST_F(StampDeskTest, AnApplianceThatAsksWithoutEndIsRefusedAndNoOtherIs) {
  const auto desk = this->desk();
  for (int i = 0; i < 64; ++i) enter(*desk, "hog", std::to_string(i));
  EXPECT_EQ(refusal_of([&] { enter(*desk, "hog", "more"); }).status, 429);
  for (int i = 0; i < 1024; ++i) desk->count("fingerprint of hog");
  EXPECT_EQ(refusal_of([&] { desk->count("fingerprint of hog"); }).status, 429);
  desk->count("fingerprint of or-1");
  enter(*desk, "or-1", "note");
}

}  // namespace
}  // namespace kiroku::apps
