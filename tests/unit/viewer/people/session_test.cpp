#include "viewer/people/session.h"

#include <atomic>
#include <latch>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/attempt_guard.h"
#include "tests/support/moved_clock.h"
#include "viewer/people/invitations.h"
#include "viewer/people/sign_in_link.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;

Session::Identities an_identity() {
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  return std::make_shared<const crypto::AgeIdentities>(
      crypto::AgeIdentities{crypto::parse_identity(pair.identity_text.text())});
}

TEST(Sessions, AreFoundByTheirTokenAlone) {
  SessionStore store;
  const auto opened = store.open("anna", Role::kSurgeon, {});
  EXPECT_EQ(opened.token.size(), 43U);
  EXPECT_EQ(
      opened.token.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"),
      std::string::npos);
  EXPECT_EQ(store.find(opened.token, true), opened.session);
  EXPECT_EQ(store.find(opened.token.substr(1), true), nullptr);
  EXPECT_EQ(store.find("", true), nullptr);
  EXPECT_NE(store.open("anna", Role::kSurgeon, {}).token, opened.token);
}

TEST(Sessions, EndAtSigningOutWithTheirIdentity) {
  SessionStore store;
  const auto opened = store.open("anna", Role::kSurgeon, {});
  const auto identities = an_identity();
  opened.session->unlock(identities);
  EXPECT_EQ(identities.use_count(), 3) << "the session, and what it reads subjects by";
  store.close(opened.token);
  EXPECT_EQ(identities.use_count(), 1);
  EXPECT_TRUE(opened.session->has_ended());
  EXPECT_EQ(store.find(opened.token, true), nullptr);
  opened.session->unlock(identities);
  EXPECT_EQ(opened.session->identities(), nullptr);
}

TEST(Sessions, EndWhenNothingIsDone) {
  test::MovedClock clock;
  SessionStore store({.idle = 30min, .longest = 12h}, clock);
  const auto opened = store.open("anna", Role::kSurgeon, {});
  clock.move(30min - 1ns);
  EXPECT_EQ(store.find(opened.token, false), opened.session);
  clock.move(1ns);
  EXPECT_EQ(store.find(opened.token, true), nullptr);
  EXPECT_TRUE(opened.session->has_ended());
}

TEST(Sessions, EndAtTheirLongestWhateverIsDone) {
  test::MovedClock clock;
  SessionStore store({.idle = 30min, .longest = 12h}, clock);
  const auto opened = store.open("anna", Role::kSurgeon, {});
  for (int quarter = 1; quarter < 48; ++quarter) {
    clock.move(15min);
    ASSERT_EQ(store.find(opened.token, true), opened.session) << quarter;
  }
  clock.move(15min);
  EXPECT_TRUE(opened.session->has_ended()) << "whether anybody asks or not";
  EXPECT_EQ(store.find(opened.token, true), nullptr);
}

TEST(Sessions, LiveLongerOnlyByWhatIsADeed) {
  test::MovedClock clock;
  SessionStore store({.idle = 30min, .longest = 12h}, clock);
  const auto opened = store.open("anna", Role::kSurgeon, {});
  clock.move(20min);
  ASSERT_NE(store.find(opened.token, false), nullptr);
  EXPECT_EQ(store.left(*opened.session), 10min);
  ASSERT_NE(store.find(opened.token, true), nullptr);
  EXPECT_EQ(store.left(*opened.session), 30min);
}

TEST(Sessions, OfOneUserAreLimited) {
  SessionStore store({.most_of_person = 2});
  const auto first = store.open("anna", Role::kSurgeon, {});
  const auto second = store.open("anna", Role::kSurgeon, {});
  const auto other = store.open("bert", Role::kSurgeon, {});
  store.open("anna", Role::kSurgeon, {});
  EXPECT_TRUE(first.session->has_ended());
  EXPECT_FALSE(second.session->has_ended());
  EXPECT_FALSE(other.session->has_ended());
}

TEST(Sessions, OfGuestsWhoAreCalledAlikeDoNotEndEachOther) {
  test::MovedClock clock;
  SessionStore store({.most_of_person = 1}, clock);
  std::vector<SessionStore::Opened> opened;
  for (const char* id : {"3f9c21ab", "3f9c21ac", "3f9c21ad"}) {
    const auto invitation = std::make_shared<Invitation>(
        id, InvitationTerms{"Dr. Mori", "or-1", "anna", {}, std::chrono::hours(1)}, clock);
    opened.push_back(store.open_for_guest("guest Dr. Mori", invitation, invitation->deadline()));
  }
  for (const SessionStore::Opened& each : opened) EXPECT_FALSE(each.session->has_ended());
  EXPECT_NE(opened[0].session->person(), opened[1].session->person());
  EXPECT_NE(store.open("guest Dr. Mori", Role::kSurgeon, {}).session->person(), opened[0].session->person());
}

TEST(Sessions, OfAUserWhoChangedAreSwept) {
  SessionStore store;
  const auto anna = store.open("anna", Role::kSurgeon, {});
  const auto bert = store.open("bert", Role::kSurgeon, {});
  store.sweep([](const Session& session) { return session.user() == "anna"; });
  EXPECT_TRUE(anna.session->has_ended());
  EXPECT_FALSE(bert.session->has_ended());
  store.close_all_of("bert");
  EXPECT_TRUE(bert.session->has_ended());
}

TEST(Sessions, DoADeedOnceAndTheOthersWaitForIt) {
  Session session("anna", Role::kSurgeon, {}, Clock::system().now() + 1h);
  std::atomic<bool> is_entered{false};
  std::atomic<int> calls{0};
  std::latch all_ask(8);
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      all_ask.count_down();
      session.once("watched", [&] {
        ++calls;
        all_ask.wait();
        is_entered = true;
      });
      EXPECT_TRUE(is_entered);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(calls, 1);
}

TEST(Sessions, TryADeedAgainThatFailed) {
  Session session("anna", Role::kSurgeon, {}, Clock::system().now() + 1h);
  EXPECT_THROW(session.once("watched", [] { throw std::runtime_error("disk full"); }), std::runtime_error);
  bool is_called = false;
  session.once("watched", [&] { is_called = true; });
  EXPECT_TRUE(is_called);
}

TEST(AttemptGuard, LetsOneWaitLongerAfterEachFailure) {
  AttemptGuard guard({.free_failures = 3, .first_wait = 2s, .longest_wait = 30s});
  const auto now = AttemptGuard::Clock::now();
  const auto wait = [&] { return guard.wait("user:anna", now); };
  guard.failed("user:anna", now);
  guard.failed("user:anna", now);
  EXPECT_EQ(wait(), 0s);
  for (const auto expected : {2s, 4s, 8s, 16s, 30s, 30s}) {
    guard.failed("user:anna", now);
    EXPECT_EQ(wait(), expected);
  }
  EXPECT_EQ(guard.wait("user:bert", now), 0s);
  EXPECT_EQ(guard.wait("user:anna", now + 30s), 0s);
  guard.succeeded("user:anna");
  EXPECT_EQ(wait(), 0s);
}

TEST(AttemptGuard, NeverOverflowsHoweverManyFail) {
  AttemptGuard guard({.free_failures = 1, .first_wait = 2s, .longest_wait = 300s});
  const auto now = AttemptGuard::Clock::now();
  for (int i = 0; i < 200; ++i) guard.failed("address:192.0.2.7", now);
  EXPECT_EQ(guard.wait("address:192.0.2.7", now), 300s);
}

TEST(AttemptGuard, RemembersALimitedNumber) {
  AttemptGuard guard({.free_failures = 1, .most_remembered = 10});
  const auto now = AttemptGuard::Clock::now();
  for (int i = 0; i < 50; ++i) guard.failed("user:" + std::to_string(i), now + std::chrono::seconds(i));
  EXPECT_EQ(guard.wait("user:0", now + 49s), 0s);
  EXPECT_GT(guard.wait("user:49", now + 49s), 0s);
}

TEST(AttemptGuard, ForgetsAfterAWhile) {
  AttemptGuard guard({.free_failures = 2, .memory = 60s});
  const auto now = AttemptGuard::Clock::now();
  guard.failed("user:anna", now);
  guard.failed("user:anna", now + 61s);
  EXPECT_EQ(guard.wait("user:anna", now + 61s), 0s);
}

TEST(SignInLink, WorksOnce) {
  SignInLink link;
  const std::string token = link.make("demo", Role::kAdministrator);
  EXPECT_FALSE(link.use(""));
  EXPECT_FALSE(link.use(token + "x"));
  const auto holder = link.use(token);
  ASSERT_TRUE(holder);
  EXPECT_EQ(holder->user, "demo");
  EXPECT_FALSE(link.use(token));
  EXPECT_FALSE(link.use(""));
}

}  // namespace
}  // namespace kiroku::viewer
