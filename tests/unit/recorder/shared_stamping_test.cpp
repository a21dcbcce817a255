// Checkpoints that an aggregator has stamped together with others, and one that is away, late, or lies.
#include <algorithm>
#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evidence/shared_token.h"
#include "recorder/stamper.h"
#include "tests/support/moved_clock.h"
#include "tests/support/switched_authority.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"
#include "timestamp/token.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::Ge;
using testing::HasSubstr;

/// What an aggregator does. Its rounds are real, each of the checkpoint and two more.
enum class Conduct {
  kGood,
  kAway,         // enter() fails
  kLoses,        // fetch() fails
  kNever,        // no round is ever stamped
  kOtherNote,    // a good token over what another room gave
  kOtherNonce,   // over the checkpoint, with another question's nonce
  kNoNonce,      // over the checkpoint alone
  kReplays,      // what it gave for the same checkpoint before
  kForeign,      // by an authority that is not trusted
  kSpoiled,      // a byte of the path is another one
  kGarbage,      // no record
  kEndlessWait,  // a round that ends in a year
};

class PlayedAggregator final : public evidence::SharedStamps {
 public:
  PlayedAggregator(timestamp::Authority& authority, timestamp::Authority& foreign)
      : authority_(authority), foreign_(foreign) {}

  Place enter(ByteView digest, ByteView nonce) override {
    ++entered;
    if (conduct == Conduct::kAway) throw Error("the aggregator is not there");
    digest_ = to_bytes(digest);
    nonce_ = to_bytes(nonce);
    return {"ticket", conduct == Conduct::kEndlessWait ? std::chrono::hours(24 * 365) : 30s};
  }
  std::optional<Bytes> fetch(const Place& place) override {
    EXPECT_EQ(place.ticket, "ticket");
    if (away > 0) {
      --away;
      throw evidence::SharedStampsAway("cannot reach the aggregator");
    }
    if (conduct == Conduct::kLoses) throw Error("there is no such ticket");
    if (conduct == Conduct::kNever) return {};
    if (conduct == Conduct::kGarbage) return to_bytes(bytes_of("<html>log in</html>"));
    if (conduct == Conduct::kReplays && given_) return given_;
    Bytes record = round().file_of(conduct == Conduct::kOtherNote ? 1 : 0);
    if (conduct == Conduct::kSpoiled) {
      const Bytes digest = other("digest");
      const auto there = std::search(record.begin(), record.end(), digest.begin(), digest.end());
      *there ^= std::byte{1};
    }
    given_ = record;
    return record;
  }
  [[nodiscard]] std::string path() const override { return "shared, by the aggregator"; }

  std::atomic<Conduct> conduct = Conduct::kGood;
  std::atomic<int> entered = 0;
  std::atomic<int> away = 0;  // so many times fetch() reaches nobody

 private:
  static Bytes other(const std::string& text) {
    return crypto::digest(crypto::HashAlgorithm::kSha256, bytes_of(text));
  }
  evidence::StampedRound round() {
    std::vector<evidence::HashList> groups{{digest_, nonce_}, {other("digest")}};
    if (conduct == Conduct::kOtherNonce) groups[0][1] = other("nonce");
    if (conduct == Conduct::kNoNonce) groups[0].pop_back();
    if (conduct == Conduct::kOtherNote) groups[1].push_back(nonce_);
    timestamp::Authority& asked = conduct == Conduct::kForeign ? foreign_ : authority_;
    return {std::move(groups), [&](crypto::HashAlgorithm algorithm, ByteView imprint) {
              std::string ignored;
              const Bytes response =
                  asked.respond(timestamp::encode_request(timestamp::make_request(algorithm, imprint)));
              return timestamp::parse_response(response, ignored)->token;
            }};
  }

  timestamp::Authority& authority_;
  timestamp::Authority& foreign_;
  Bytes digest_, nonce_;
  std::optional<Bytes> given_;
};

class SharedStampingTest : public testing::Test {
 protected:
  SharedStampingTest() { trust_.add_trusted(bytes_of(authority_.root_pem()), "the authority"); }

  static archive::StoredCheckpoint checkpoint(std::uint64_t size) {
    return {size, {}, "note of " + std::to_string(size) + " entries\n", {}};
  }
  std::unique_ptr<Stamper> stamper(BackOffPolicy pauses = {}, StampingQueue* queue = nullptr) {
    NamedAuthority swiss{"swiss", source_, pauses};
    swiss.shared = aggregator_;
    return std::make_unique<Stamper>(std::vector{std::move(swiss)},
                                     Stamper::Context{&trust_, queue, "case", {}, &clock_}, facts_);
  }
  void expect_no_other_answer() {
    EXPECT_TRUE(waiting_.empty());
    EXPECT_TRUE(facts_.take(0ms).empty());
  }
  AuthorityAnswer answer() {
    for (int i = 0; i < 500 && waiting_.empty(); ++i) {
      for (Fact& fact : facts_.take(20ms)) waiting_.push_back(std::get<AuthorityAnswer>(std::move(fact)));
    }
    if (waiting_.empty()) {
      ADD_FAILURE() << "no answer";
      return {};
    }
    AuthorityAnswer first = std::move(waiting_.front());
    waiting_.erase(waiting_.begin());
    return first;
  }
  /// Once its round is over.
  AuthorityAnswer answer_of_round() {
    clock_.await_waiting(1);
    clock_.move(30s);
    return answer();
  }

  test::MovedClock clock_;
  test::TemporaryFolder folder_{test::quick_parent()};
  timestamp::Authority authority_ = timestamp::Authority::create(folder_ / "authority", "Test");
  timestamp::Authority foreign_ = timestamp::Authority::create(folder_ / "foreign", "Stranger");
  timestamp::TrustStore trust_;
  std::shared_ptr<test::SwitchedAuthority> source_ =
      std::make_shared<test::SwitchedAuthority>(timestamp::embedded_stamp_source(authority_));
  std::shared_ptr<PlayedAggregator> aggregator_ = std::make_shared<PlayedAggregator>(authority_, foreign_);
  FactQueue facts_;
  std::vector<AuthorityAnswer> waiting_;
};

TEST_F(SharedStampingTest, TheAuthorityIsNotAskedWhereARoundGivesAToken) {
  const auto stamper = this->stamper();
  stamper->stamp(checkpoint(3));
  const AuthorityAnswer shared = answer_of_round();
  EXPECT_TRUE(shared.valid()) << shared.cause;
  EXPECT_TRUE(evidence::begins_as_record(shared.response));
  EXPECT_EQ(shared.path, "shared, by the aggregator");
  EXPECT_EQ(shared.not_shared, "");
  EXPECT_FALSE(shared.judgement.chain.empty());
  EXPECT_THAT(shared.answered - shared.asked, Ge(30s)) << "the token may be of any moment of the round";
  EXPECT_EQ(source_->requests, 0);
  EXPECT_EQ(stamper->status()[0].path, "shared, by the aggregator");
  EXPECT_TRUE(stamper->status()[0].last_token);
}

TEST_F(SharedStampingTest, AnAggregatorThatIsAwayIsLeftAloneAndFoundAgain) {
  const auto stamper = this->stamper();
  aggregator_->conduct = Conduct::kAway;
  for (std::uint64_t size = 1; size <= 2; ++size) {
    stamper->stamp(checkpoint(size));
    const AuthorityAnswer own = answer();
    EXPECT_TRUE(own.valid()) << own.cause;
    EXPECT_FALSE(evidence::begins_as_record(own.response));
    EXPECT_EQ(own.path, "over wwan0");
    EXPECT_EQ(own.not_shared, "the aggregator is not there");
    EXPECT_FALSE(own.hurried);
  }
  EXPECT_EQ(aggregator_->entered, 1) << "the second checkpoint does not wait for it again";
  EXPECT_EQ(source_->requests, 2);
  EXPECT_EQ(stamper->status()[0].not_shared, "the aggregator is not there");
  EXPECT_EQ(stamper->status()[0].failures, 0U);
  aggregator_->conduct = Conduct::kGood;
  clock_.move(38s);  // the first pause and a quarter more
  stamper->stamp(checkpoint(3));
  EXPECT_EQ(answer_of_round().path, "shared, by the aggregator");
  EXPECT_EQ(stamper->status()[0].not_shared, "");
}

TEST_F(SharedStampingTest, AnAggregatorThatIsLateIsWaitedForNoLongerThanItMayBe) {
  const auto stamper = this->stamper();
  aggregator_->conduct = Conduct::kNever;
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  clock_.move(30s);
  for (int second = 0; second < 60; ++second) {
    clock_.await_waiting(1);
    EXPECT_EQ(source_->requests, 0) << second;
    clock_.move(1s);
  }
  const AuthorityAnswer own = answer();
  EXPECT_TRUE(own.valid()) << own.cause;
  EXPECT_EQ(own.not_shared, "its token does not come within 90 s");
  EXPECT_EQ(own.asked, own.answered) << "the wait is no part of what the authority took";
}

TEST_F(SharedStampingTest, AProofThatCannotBeFetchedIsAskedForAgainAfterLongerAndLonger) {
  const auto stamper = this->stamper();
  aggregator_->away = 3;
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  clock_.move(30s);
  for (const std::chrono::seconds pause : {2s, 4s, 8s}) {
    clock_.await_waiting(1);
    const int left = aggregator_->away;
    clock_.move(pause - 1ms);
    clock_.await_waiting(1);
    EXPECT_EQ(aggregator_->away, left) << "asked again before " << pause.count() << " s";
    clock_.move(1ms);
  }
  const AuthorityAnswer shared = answer();
  EXPECT_TRUE(shared.valid()) << shared.cause;
  EXPECT_EQ(shared.path, "shared, by the aggregator");
  EXPECT_EQ(aggregator_->entered, 1) << "the same place in the same round";
  EXPECT_EQ(source_->requests, 0);
  EXPECT_EQ(stamper->status()[0].not_shared, "");
}

TEST_F(SharedStampingTest, AnAggregatorThatStaysAwayIsAskedNoLongerThanItMayBeWaitedFor) {
  const auto stamper = this->stamper();
  aggregator_->away = 1000;
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  clock_.move(30s);
  // At 30 s, then after 2, 4, 8, 16 and 16 s; the last look is when the patience ends.
  for (const std::chrono::seconds pause : {2s, 4s, 8s, 16s, 16s, 14s}) {
    clock_.await_waiting(1);
    EXPECT_EQ(source_->requests, 0);
    clock_.move(pause);
  }
  const AuthorityAnswer own = answer();
  EXPECT_TRUE(own.valid()) << own.cause;
  EXPECT_EQ(own.not_shared, "its token does not come within 90 s: cannot reach the aggregator");
  EXPECT_EQ(aggregator_->away, 1000 - 7);
}

TEST_F(SharedStampingTest, AnAggregatorThatComesBackWithinThePatienceGivesItsToken) {
  const auto stamper = this->stamper();
  aggregator_->away = 6;  // at 30, 32, 36, 44, 60 and 76 s
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  clock_.move(30s);
  for (const std::chrono::seconds pause : {2s, 4s, 8s, 16s, 16s, 14s}) {
    clock_.await_waiting(1);
    clock_.move(pause);
  }
  const AuthorityAnswer shared = answer();
  EXPECT_TRUE(shared.valid()) << shared.cause;
  EXPECT_EQ(shared.path, "shared, by the aggregator");
  EXPECT_EQ(source_->requests, 0);
}

TEST_F(SharedStampingTest, ARoundThatEndsTooLateIsNotWaitedFor) {
  const auto stamper = this->stamper();
  aggregator_->conduct = Conduct::kEndlessWait;
  stamper->stamp(checkpoint(1));
  const AuthorityAnswer own = answer();
  EXPECT_TRUE(own.valid());
  EXPECT_EQ(own.not_shared, "its token does not come within 90 s");
}

TEST_F(SharedStampingTest, NobodyWaitsForARoundAtTheEndOfACase) {
  const auto stamper = this->stamper();
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  stamper->stamp_closing(checkpoint(2));
  const AuthorityAnswer own = answer();
  EXPECT_TRUE(own.valid()) << own.cause;
  EXPECT_EQ(own.checkpoint.size, 2U) << "it covers the one that waited for a round";
  EXPECT_TRUE(own.hurried);
  EXPECT_EQ(own.not_shared, "") << "this is no failure";
  EXPECT_EQ(stamper->outstanding(), 0U);
  expect_no_other_answer();
}

TEST_F(SharedStampingTest, AnAuthoritysIntervalDoesNotCostTheEndOfACaseItsToken) {
  BackOffPolicy pauses;
  pauses.min_interval = 75s;
  const auto stamper = this->stamper(pauses);
  stamper->stamp(checkpoint(1));
  EXPECT_TRUE(answer_of_round().valid());
  stamper->stamp(checkpoint(2));  // no request went to the authority: the interval has not begun
  clock_.await_waiting(1);
  stamper->stamp_closing(checkpoint(3));
  const AuthorityAnswer own = answer();
  EXPECT_TRUE(own.valid()) << own.cause;
  EXPECT_EQ(own.checkpoint.size, 3U);
  EXPECT_EQ(source_->requests, 1);
  EXPECT_EQ(stamper->outstanding(), 0U);
  expect_no_other_answer();
}

TEST_F(SharedStampingTest, WhatAnotherRoomLearntDuringTheWaitIsHeeded) {
  const auto queue = StampingQueue::open(folder_ / "stamping.db");
  const auto stamper = this->stamper({}, queue.get());
  aggregator_->conduct = Conduct::kLoses;
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  source_->up = false;
  source_->leave_alone_for_s = 3600;
  AuthorityContact other_room(NamedAuthority{"swiss", source_}, &trust_, queue.get(), clock_);
  EXPECT_FALSE(other_room.ask(checkpoint(9)).valid());
  clock_.move(30s);
  while (stamper->outstanding() > 0) std::this_thread::yield();
  EXPECT_EQ(stamper->status()[0].not_shared, "there is no such ticket");
  EXPECT_EQ(source_->requests, 1) << "the other room's";
}

TEST_F(SharedStampingTest, ASharedTokenLeavesWhatAnotherRoomLearntOfTheAuthority) {
  const auto queue = StampingQueue::open(folder_ / "stamping.db");
  const auto stamper = this->stamper({}, queue.get());
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  source_->up = false;
  source_->leave_alone_for_s = 3600;
  AuthorityContact other_room(NamedAuthority{"swiss", source_}, &trust_, queue.get(), clock_);
  EXPECT_FALSE(other_room.ask(checkpoint(9)).valid());
  clock_.move(30s);
  EXPECT_TRUE(answer().valid());
  EXPECT_THAT(other_room.limit() - clock_.now(), Ge(3500s));
}

TEST_F(SharedStampingTest, AnAuthorityThatIsLeftAloneKeepsNobodyFromARound) {
  const auto stamper = this->stamper();
  aggregator_->conduct = Conduct::kAway;
  source_->up = false;
  source_->leave_alone_for_s = 3600;
  stamper->stamp(checkpoint(1));
  EXPECT_FALSE(answer().valid());
  aggregator_->conduct = Conduct::kGood;
  while (stamper->outstanding() > 0) std::this_thread::yield();
  clock_.await_waiting(1);
  clock_.move(38s);  // the aggregator's first pause and a quarter more
  while (aggregator_->entered < 2) std::this_thread::yield();
  const AuthorityAnswer shared = answer_of_round();
  EXPECT_TRUE(shared.valid()) << shared.cause;
  EXPECT_EQ(shared.path, "shared, by the aggregator");
  EXPECT_EQ(stamper->status()[0].failures, 0U) << "tokens come";
  EXPECT_EQ(source_->requests, 1);
  // The authority itself is left alone as before, and the end of the case says why it has no token.
  stamper->stamp_closing(checkpoint(2));
  const AuthorityAnswer none = answer();
  EXPECT_EQ(none.cause, "not asked, since it is to be left alone: the authority is not there");
  EXPECT_GT(none.pause, 3000s);
  EXPECT_EQ(source_->requests, 1);
}

TEST_F(SharedStampingTest, TheSameCheckpointAtTheEndEndsTheWaitToo) {
  const auto stamper = this->stamper();
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  stamper->stamp_closing(checkpoint(1));
  EXPECT_TRUE(answer().hurried);
}

TEST_F(SharedStampingTest, WhoEndsTheStamperDoesNotWaitForARound) {
  auto stamper = this->stamper();
  stamper->stamp(checkpoint(1));
  clock_.await_waiting(1);
  stamper.reset();
  EXPECT_EQ(source_->requests, 0) << "nobody would read the answer";
}

TEST_F(SharedStampingTest, WhereBothAreAwayBothAreTold) {
  const auto stamper = this->stamper();
  aggregator_->conduct = Conduct::kAway;
  source_->up = false;
  stamper->stamp(checkpoint(1));
  const AuthorityAnswer none = answer();
  EXPECT_EQ(none.cause, "the authority is not there; nor was it shared: the aggregator is not there");
  EXPECT_GT(none.pause, 0ns);
  EXPECT_EQ(stamper->status()[0].failures, 1U);
}

TEST_F(SharedStampingTest, AnAuthorityThatNobodySharesIsAskedAsBefore) {
  aggregator_ = nullptr;
  const auto stamper = this->stamper();
  stamper->stamp(checkpoint(1));
  const AuthorityAnswer own = answer();
  EXPECT_TRUE(own.valid());
  EXPECT_FALSE(own.hurried);
  EXPECT_EQ(own.not_shared, "");
}

struct Lie {
  Conduct conduct;
  std::string name, why;
  friend void PrintTo(const Lie& lie, std::ostream* out) { *out << lie.name; }
};
class SharedStampingUnder : public SharedStampingTest, public testing::WithParamInterface<Lie> {};

TEST_P(SharedStampingUnder, NothingOfItIsTakenAndTheAuthorityIsAsked) {
  const auto stamper = this->stamper();
  constexpr std::uint64_t kSize = 7;
  if (GetParam().conduct == Conduct::kReplays) {
    // What it gives again is over the same note, which a stamper asks about once: another one asks anew.
    const auto before = this->stamper();
    before->stamp(checkpoint(kSize));
    EXPECT_TRUE(answer_of_round().valid());
  }
  aggregator_->conduct = GetParam().conduct;
  stamper->stamp(checkpoint(kSize));
  const AuthorityAnswer own = answer_of_round();
  EXPECT_TRUE(own.valid()) << own.cause;
  EXPECT_FALSE(evidence::begins_as_record(own.response));
  EXPECT_THAT(own.not_shared, HasSubstr(GetParam().why));
  EXPECT_EQ(source_->requests, 1);
}

INSTANTIATE_TEST_SUITE_P(Lies, SharedStampingUnder,
                         testing::Values(Lie{Conduct::kLoses, "loses", "no such ticket"},
                                         Lie{Conduct::kOtherNote, "other_note", "does not hold"},
                                         Lie{Conduct::kOtherNonce, "other_nonce", "the nonce is not in it"},
                                         Lie{Conduct::kNoNonce, "no_nonce", "the nonce is not in it"},
                                         Lie{Conduct::kReplays, "replays", "the nonce is not in it"},
                                         Lie{Conduct::kForeign, "foreign", "does not hold"},
                                         Lie{Conduct::kSpoiled, "spoiled", "does not hold"},
                                         Lie{Conduct::kGarbage, "garbage", "no shared token"}),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace kiroku::recorder
