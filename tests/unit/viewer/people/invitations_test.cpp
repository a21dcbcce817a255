#include "viewer/people/invitations.h"

#include <atomic>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;

class InvitationStore : public testing::Test {
 protected:
  Invitations::Made make(std::chrono::seconds lasts = 1h, const std::string& room = "or-1") {
    return store.make({"Dr. Sato", room, "anna", UtcTime(5us), lasts}, running_case);
  }
  std::optional<SessionStore::Opened> join(const std::string& token) {
    return store.join(token, "192.0.2.7", sessions, [](const Invitation& /*invitation*/) {});
  }
  void sweep(const std::string& running) {
    store.sweep([&](const std::string& /*room*/) { return running; },
                [this](const InvitationTerms& terms) { return terms.credential != credential; });
  }
  /// "time" once that has ended for lack of it.
  [[nodiscard]] static std::string end_of(const Invitation& invitation) {
    const auto end = invitation.view().end;
    return end ? std::string(invitation_end_name(*end)) : "";
  }

  test::MovedClock clock;
  std::string running_case;  // when an invitation is made
  std::vector<std::string> ended;
  Invitations store{[this](const Invitation& invitation, InvitationEnd why) {
                      ended.push_back(invitation.id() + " " + std::string(invitation_end_name(why)));
                    },
                    clock};
  SessionStore sessions{{}, clock};
  std::optional<UtcTime> credential = UtcTime(5us);
};

TEST_F(InvitationStore, OpensOneSessionOfAGuestForAToken) {
  const auto made = make();
  EXPECT_EQ(made.token.size(), 43U) << "256 bits";
  EXPECT_EQ(made.invitation->view().state, InvitationState::kOpen);
  const auto opened = join(made.token);
  ASSERT_TRUE(opened);
  EXPECT_EQ(opened->session->user(), "guest Dr. Sato");
  EXPECT_EQ(opened->session->role(), Role::kGuest);
  EXPECT_EQ(opened->session->invitation(), made.invitation);
  EXPECT_EQ(made.invitation->view().address, "192.0.2.7");
  EXPECT_FALSE(join(made.token)) << "works once";
  EXPECT_EQ(sessions.find(opened->token, true), opened->session) << "and the first stays";
}

TEST_F(InvitationStore, KnowsNoForgedToken) {
  const std::string token = make().token;
  std::string changed = token;
  changed[20] = changed[20] == 'A' ? 'B' : 'A';
  for (const std::string& forged :
       {std::string(), changed, token.substr(1), token + "A", token.substr(0, 8)}) {
    EXPECT_FALSE(join(forged)) << forged;
  }
  EXPECT_FALSE(join(make().invitation->id())) << "the identifier is no secret";
  EXPECT_TRUE(join(token));
}

TEST_F(InvitationStore, LetsOneOfManyInWhoComeAtOnce) {
  const std::string token = make().token;
  std::atomic<int> let_in = 0;
  std::vector<std::thread> guests;
  for (int i = 0; i < 8; ++i) guests.emplace_back([&] { let_in += join(token) ? 1 : 0; });
  for (std::thread& guest : guests) guest.join();
  EXPECT_EQ(let_in, 1);
}

TEST_F(InvitationStore, EndsWithItsTimeWhateverTheGuestDoes) {
  const auto made = make(0s);
  EXPECT_FALSE(join(made.token));
  sweep("");
  EXPECT_THAT(ended, testing::ElementsAre(made.invitation->id() + " time"));

  const auto short_one = make(20min);
  const auto opened = join(short_one.token);
  ASSERT_TRUE(opened);
  EXPECT_TRUE(short_one.invitation->admits("case-a"));
  clock.move(20min);
  EXPECT_TRUE(opened->session->has_ended()) << "without anybody's looking after it";
  EXPECT_FALSE(short_one.invitation->admits("case-a"));
  EXPECT_EQ(sessions.find(opened->token, true), nullptr);
}

TEST_F(InvitationStore, IsOfOneCaseAndEndsWithIt) {
  const auto made = make();
  const auto opened = join(made.token);
  ASSERT_TRUE(opened);
  EXPECT_FALSE(made.invitation->admits("")) << "nothing of what is recorded ahead";
  sweep("");
  EXPECT_EQ(end_of(*made.invitation), "") << "waits for the first case";
  EXPECT_TRUE(made.invitation->admits("case-a"));
  EXPECT_FALSE(made.invitation->admits("case-b")) << "before anybody has looked";
  EXPECT_FALSE(opened->session->has_ended());
  sweep("case-a");
  EXPECT_EQ(end_of(*made.invitation), "");
  sweep("");
  EXPECT_EQ(end_of(*made.invitation), "case");
  EXPECT_TRUE(opened->session->has_ended());
  EXPECT_FALSE(made.invitation->admits("case-a"));
}

TEST_F(InvitationStore, EndsAtOnceWhenItIsRevoked) {
  const auto made = make();
  const auto other = make();
  const auto opened = join(made.token);
  ASSERT_TRUE(opened);
  EXPECT_TRUE(store.revoke(made.invitation->id()));
  EXPECT_TRUE(opened->session->has_ended());
  EXPECT_FALSE(made.invitation->admits("case-a"));
  EXPECT_FALSE(store.revoke(made.invitation->id()));
  EXPECT_FALSE(store.revoke("00000000"));
  EXPECT_THAT(ended, testing::IsEmpty()) << "who revokes says so";
  EXPECT_TRUE(store.revoke(other.invitation->id()));
  EXPECT_FALSE(join(other.token)) << "also one that nobody has used";
}

TEST_F(InvitationStore, EndsWithTheUserWhoMadeIt) {
  const auto made = make();
  sweep("case-a");
  EXPECT_EQ(end_of(*made.invitation), "");
  credential = UtcTime(6us);
  sweep("case-a");
  EXPECT_EQ(end_of(*made.invitation), "inviter");
  EXPECT_FALSE(join(made.token));
}

TEST_F(InvitationStore, LetsNobodyInWhomTheLogDoesNotName) {
  const auto made = make();
  EXPECT_THROW(store.join(made.token, "192.0.2.7", sessions,
                          [](const Invitation& /*invitation*/) { throw Refusal(500, "the disk is full"); }),
               Refusal);
  EXPECT_EQ(made.invitation->view().state, InvitationState::kOpen);
  EXPECT_TRUE(join(made.token)) << "once it does";
}

TEST_F(InvitationStore, KnowsWhetherTheGuestIsThere) {
  const auto made = make();
  ASSERT_TRUE(join(made.token));
  Invitation& invitation = *made.invitation;
  EXPECT_FALSE(invitation.arrive());
  EXPECT_FALSE(invitation.arrive());
  EXPECT_TRUE(invitation.view().is_present);
  invitation.depart();
  clock.move(30min);
  EXPECT_FALSE(invitation.has_gone()) << "one connection is left";
  invitation.depart();
  EXPECT_FALSE(invitation.view().is_present);
  clock.move(9s);
  EXPECT_FALSE(invitation.has_gone()) << "a page that is loaded anew";
  clock.move(1s);
  EXPECT_TRUE(invitation.has_gone());
  clock.move(10s);
  EXPECT_FALSE(invitation.has_gone()) << "said once";
  EXPECT_TRUE(invitation.arrive()) << "is back";
  EXPECT_FALSE(invitation.arrive());
}

TEST_F(InvitationStore, HoldsAFewAtOnceAndForgetsTheOldest) {
  std::vector<std::string> ids;
  for (std::size_t i = 0; i < Invitations::kMostAtOnce; ++i) ids.push_back(make().invitation->id());
  EXPECT_THROW(make(), Refusal);
  EXPECT_EQ(store.list().size(), Invitations::kMostAtOnce);
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(store.revoke(store.list().front()->id()));
    make();
  }
  EXPECT_LE(store.list().size(), Invitations::kMostAtOnce + 21);
  EXPECT_NE(store.find(ids.front()), nullptr) << "what lasts is never forgotten";
  store.end_all(InvitationEnd::kStopped);
  for (const auto& each : store.list()) EXPECT_EQ(each->view().state, InvitationState::kEnded);
}

TEST_F(InvitationStore, IsOfTheCaseThatRanWhenItWasMade) {
  running_case = "case-a";
  const Invitations::Made made = make();
  EXPECT_EQ(made.invitation->view().case_id, "case-a");
  ASSERT_TRUE(join(made.token));
  // That case ended and another began before anybody swept.
  EXPECT_FALSE(made.invitation->admits("case-b"));
  EXPECT_TRUE(made.invitation->admits("case-a"));
  sweep("case-b");
  EXPECT_EQ(end_of(*made.invitation), "case");
}

}  // namespace
}  // namespace kiroku::viewer
