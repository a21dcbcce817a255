#include "fleet/reports/stamp_rounds.h"

#include <atomic>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "evidence/shared_token.h"
#include "fleet/reports/stamp_messages.h"
#include "tests/support/evidence_kit.h"
#include "tests/support/moved_clock.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using enum StampRounds::Fetched::State;
using testing::ElementsAre;
using testing::HasSubstr;

Bytes hash_of(const std::string& text) {
  return crypto::digest(crypto::HashAlgorithm::kSha256, bytes_of(text));
}

class StampRoundsTest : public testing::Test {
 protected:
  StampRoundsTest() { trust_.add_trusted(bytes_of(authority_.root_pem()), "the authority"); }

  std::unique_ptr<StampRounds> rounds(RoundLimits limits = {}) {
    StampRounds::Options options;
    options.stamp = [this](crypto::HashAlgorithm algorithm, ByteView imprint) {
      ++asked_;
      held_.wait(true);
      if (away_) throw Error("the authority is not there");
      return authority_.at("2026-06-01")(algorithm, imprint);
    };
    options.limits = limits;
    options.tell = [this](const std::string& what) { told_.push_back(what); };
    options.clock = &clock_;
    return std::make_unique<StampRounds>(std::move(options));
  }
  /// The ticket.
  static std::string enter(StampRounds& rounds, const std::string& appliance, const std::string& note) {
    const StampRounds::Entered entered =
        rounds.enter(appliance, hash_of(note), hash_of("nonce of " + appliance + note));
    EXPECT_FALSE(entered.refused);
    return entered.place.ticket;
  }
  /// Ends the round, and returns once it was stamped or not.
  void end_round() {
    clock_.await_waiting(1);
    clock_.move(60s);
    clock_.await_waiting(1);
  }
  timestamp::TokenCode judge(const Bytes& record, const std::string& note) const {
    std::string why;
    const auto judging = evidence::judging_shared(record, bytes_of(note), why);
    if (!judging) return timestamp::TokenCode::kNotAToken;
    return timestamp::judge_token(judging->token, judging->expectation, trust_).code;
  }

  test::MovedClock clock_;
  test::PlayedAuthority authority_{"outside", "2026-01-01", "2030-01-01"};
  timestamp::TrustStore trust_;
  std::atomic<int> asked_ = 0;
  std::atomic<bool> away_ = false, held_ = false;
  std::vector<std::string> told_;
};

TEST_F(StampRoundsTest, TwoHundredRoomsCostOneRequestAMinute) {
  const auto rounds = this->rounds();
  for (int minute = 0; minute < 3; ++minute) {
    std::vector<std::string> tickets;
    for (int room = 0; room < 200; ++room) {
      const std::string name = std::to_string(room);
      tickets.push_back(enter(*rounds, "or-" + name, std::to_string(minute) + " of " + name));
    }
    end_round();
    EXPECT_EQ(asked_, minute + 1);
    for (int room = 0; room < 200; ++room) {
      const std::string name = std::to_string(room);
      const StampRounds::Fetched fetched = rounds->fetch("or-" + name, tickets[std::size_t(room)]);
      ASSERT_EQ(fetched.state, kReady);
      EXPECT_EQ(judge(fetched.record, std::to_string(minute) + " of " + name), timestamp::TokenCode::kValid);
      EXPECT_TRUE(
          evidence::parse_shared_token(fetched.record)
              .shared->begins_with(hash_of("nonce of or-" + name + std::to_string(minute) + " of " + name)));
      EXPECT_LE(fetched.record.size(), kLargestSharedToken);
    }
  }
}

TEST_F(StampRoundsTest, NobodyIsAskedWhereNothingWasCollected) {
  const auto rounds = this->rounds();
  for (int minute = 0; minute < 5; ++minute) end_round();
  EXPECT_EQ(asked_, 0);
  const StampRounds::Entered entered = rounds->enter("or-1", hash_of("note"), hash_of("nonce"));
  EXPECT_EQ(entered.place.ready_in, 60s) << "rounds end each minute, also where those before were empty";
}

TEST_F(StampRoundsTest, SaysHowLongARoundTakesAndThatItIsBeingStamped) {
  const auto rounds = this->rounds();
  clock_.await_waiting(1);
  clock_.move(20s);
  const StampRounds::Entered entered = rounds->enter("or-1", hash_of("note"), hash_of("nonce"));
  EXPECT_EQ(entered.place.ready_in, 40s);
  EXPECT_EQ(rounds->fetch("or-1", entered.place.ticket).ready_in, 40s);
  held_ = true;
  clock_.await_waiting(1);
  clock_.move(40s);
  while (asked_ == 0) std::this_thread::yield();
  EXPECT_EQ(rounds->fetch("or-1", entered.place.ticket).state, kWaiting);
  // What comes meanwhile is of the next round.
  const std::string next = enter(*rounds, "or-1", "later");
  held_ = false;
  held_.notify_all();
  clock_.await_waiting(1);
  EXPECT_EQ(rounds->fetch("or-1", entered.place.ticket).state, kReady);
  EXPECT_EQ(rounds->fetch("or-1", next).state, kWaiting);
  end_round();
  EXPECT_EQ(judge(rounds->fetch("or-1", next).record, "later"), timestamp::TokenCode::kValid);
}

TEST_F(StampRoundsTest, AnApplianceHasItsOwnPlacesAlone) {
  const auto rounds = this->rounds({.of_appliance = 3, .of_round = 5});
  for (int i = 0; i < 3; ++i) enter(*rounds, "hog", std::to_string(i));
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(rounds->enter("hog", hash_of("more"), hash_of("nonce")).refused,
              StampRounds::Refusal::kTooManyOfAppliance);
  const std::string ticket = enter(*rounds, "or-1", "note");
  enter(*rounds, "or-2", "note");
  EXPECT_EQ(rounds->enter("or-3", hash_of("note"), hash_of("nonce")).refused, StampRounds::Refusal::kFull);
  end_round();
  EXPECT_EQ(judge(rounds->fetch("or-1", ticket).record, "note"), timestamp::TokenCode::kValid);
  enter(*rounds, "hog", "a new round");
}

TEST_F(StampRoundsTest, AnApplianceHearsNothingOfAnother) {
  const auto rounds = this->rounds();
  const std::string ticket = enter(*rounds, "or-1", "note");
  EXPECT_EQ(rounds->fetch("or-2", ticket).state, kUnknown);
  end_round();
  EXPECT_EQ(rounds->fetch("or-2", ticket).state, kUnknown);
  EXPECT_EQ(rounds->fetch("or-1", std::string(32, '0')).state, kUnknown);
  EXPECT_EQ(rounds->fetch("or-1", ticket).state, kReady);
}

TEST_F(StampRoundsTest, RoundsThatAreOverAreForgottenAfterAWhile) {
  const auto rounds = this->rounds({.kept = 2});
  std::vector<std::string> tickets;
  for (int round = 0; round < 4; ++round) {
    tickets.push_back(enter(*rounds, "or-1", std::to_string(round)));
    end_round();
  }
  std::vector<StampRounds::Fetched::State> states;
  for (const std::string& ticket : tickets) states.push_back(rounds->fetch("or-1", ticket).state);
  EXPECT_THAT(states, ElementsAre(kUnknown, kUnknown, kReady, kReady));
}

TEST_F(StampRoundsTest, ARoundWithoutATokenFailsAloneAndIsToldOnce) {
  const auto rounds = this->rounds();
  away_ = true;
  std::string ticket;
  for (int round = 0; round < 3; ++round) {
    ticket = enter(*rounds, "or-1", "note");
    end_round();
  }
  const StampRounds::Fetched failed = rounds->fetch("or-1", ticket);
  EXPECT_EQ(failed.state, kFailed);
  EXPECT_EQ(failed.why, "the authority is not there");
  away_ = false;
  ticket = enter(*rounds, "or-1", "note");
  end_round();
  EXPECT_EQ(rounds->fetch("or-1", ticket).state, kReady);
  EXPECT_THAT(told_, ElementsAre("no time-stamp for a round of 1: the authority is not there",
                                 "rounds are stamped again"));
}

TEST_F(StampRoundsTest, ManyAtOnceGetTicketsOfTheirOwn) {
  const auto rounds = this->rounds();
  std::vector<std::vector<std::string>> tickets(4);
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < tickets.size(); ++i) {
      threads.emplace_back([&, i] {
        const std::string name = "or-" + std::to_string(i);
        for (int note = 0; note < 50; ++note)
          tickets[i].push_back(enter(*rounds, name, std::to_string(note)));
      });
    }
  }
  end_round();
  EXPECT_EQ(asked_, 1);
  std::set<std::string> different;
  for (std::size_t i = 0; i < tickets.size(); ++i) {
    for (int note = 0; note < 50; ++note) {
      const std::string& ticket = tickets[i][std::size_t(note)];
      different.insert(ticket);
      EXPECT_EQ(judge(rounds->fetch("or-" + std::to_string(i), ticket).record, std::to_string(note)),
                timestamp::TokenCode::kValid);
    }
  }
  EXPECT_EQ(different.size(), 200U);
}

TEST_F(StampRoundsTest, WhoEndsThemDoesNotWaitForARound) {
  const auto rounds = this->rounds();
  enter(*rounds, "or-1", "note");
  clock_.await_waiting(1);
}

}  // namespace
}  // namespace kiroku::fleet
