#include "archive/verify/brackets.h"

#include <string_view>
#include <vector>

#include <gtest/gtest.h>

namespace kiroku::archive {
namespace {

UtcTime at(int seconds) { return UtcTime(std::chrono::seconds(seconds)); }

TEST(Brackets, WithoutTokensAreOneWithoutBounds) {
  const std::vector<Bracket> brackets = brackets_of({}, 0, 5);
  ASSERT_EQ(brackets.size(), 1U);
  EXPECT_EQ(brackets[0].first_entry, 0U);
  EXPECT_EQ(brackets[0].last_entry, 4U);
  EXPECT_EQ(brackets[0].not_before, std::nullopt);
  EXPECT_EQ(brackets[0].not_after, std::nullopt);
}

// Entries between token i's entry and the checkpoint of token i+1 lie between their times.
TEST(Brackets, LieBetweenOneTokensEntryAndTheNextCheckpoint) {
  const std::vector<Bracket> brackets =
      brackets_of({{1, 1, at(10), 0, "a"}, {6, 5, at(70), 1'000'000'000, "a"}}, 0, 8);
  ASSERT_EQ(brackets.size(), 4U);
  EXPECT_EQ(brackets[0].last_entry, 0U);
  EXPECT_EQ(brackets[0].not_before, std::nullopt);
  EXPECT_EQ(brackets[0].not_after, at(11)) << "whole seconds, whose fraction may have been cut off";
  EXPECT_EQ(brackets[1].first_entry, 1U);
  EXPECT_EQ(brackets[1].last_entry, 4U);
  EXPECT_EQ(brackets[1].not_before, at(10));
  EXPECT_EQ(brackets[1].not_after, at(71));
  // Written while the second token was asked for: no token covers it.
  EXPECT_EQ(brackets[2].first_entry, 5U);
  EXPECT_EQ(brackets[2].last_entry, 5U);
  EXPECT_EQ(brackets[2].not_before, at(10));
  EXPECT_EQ(brackets[2].not_after, std::nullopt);
  EXPECT_EQ(brackets[3].first_entry, 6U);
  EXPECT_EQ(brackets[3].not_before, at(69));
}

TEST(Brackets, TakeTheNarrowestBoundsOfSeveralAuthorities) {
  const std::vector<Bracket> brackets = brackets_of(
      {{1, 1, at(10), 0, "a"}, {2, 1, at(12), 0, "b"}, {6, 6, at(80), 0, "b"}, {7, 6, at(70), 0, "a"}}, 3, 6);
  ASSERT_EQ(brackets.size(), 1U);
  EXPECT_EQ(brackets[0].not_before, at(12));
  EXPECT_EQ(brackets[0].authority_before, "b");
  EXPECT_EQ(brackets[0].not_after, at(71)) << "whole seconds, whose fraction may have been cut off";
  EXPECT_EQ(brackets[0].authority_after, "a");
}

TEST(Brackets, OfClocksThatDifferSpanWhatBothSay) {
  const auto brackets =
      brackets_of({{1, 1, at(12) + std::chrono::milliseconds(700), 0, "a"}, {6, 6, at(10), 0, "b"}}, 3, 6);
  ASSERT_EQ(brackets.size(), 1U);
  EXPECT_EQ(brackets[0].not_before, at(11));
  EXPECT_EQ(brackets[0].authority_before, "b");
  EXPECT_EQ(brackets[0].not_after, at(12) + std::chrono::milliseconds(700));
  EXPECT_EQ(brackets[0].authority_after, "a");
}

// A name says nothing of whose clock it is.
TEST(Brackets, SayWhoseClockTheirTimesAre) {
  const auto token = [](std::uint64_t entry, int seconds, bool outside) {
    return StampedToken{entry, entry, at(seconds), 0, "national-metrology-institute", {}, {}, outside};
  };
  const auto times = [](const std::vector<StampedToken>& tokens) {
    std::vector<std::string_view> names;
    for (const Bracket& bracket : brackets_of(tokens, 0, 8)) names.push_back(time_proof_name(bracket.time));
    return names;
  };
  using Names = std::vector<std::string_view>;
  EXPECT_EQ(times({}), Names({"none"}));
  EXPECT_EQ(times({token(3, 10, false)}), Names({"self-issued", "self-issued"}));
  EXPECT_EQ(times({token(3, 10, true)}), Names({"external", "external"}));
  EXPECT_EQ(times({token(3, 10, true), token(6, 20, false)}),
            Names({"external", "self-issued", "self-issued"}))
      << "what the recorder's own authority bounds on one side is its word";
}

}  // namespace
}  // namespace kiroku::archive
