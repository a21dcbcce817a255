#include "viewer/rooms/room_company.h"

#include <mutex>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "viewer/rooms/point_rate.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;

class Heard final : public SocketOutput {
 public:
  bool send_text(std::string text) override {
    texts.push_back(std::move(text));
    return true;
  }
  bool send_bytes(std::shared_ptr<const Bytes> /*bytes*/) override { return true; }
  [[nodiscard]] std::size_t waiting() const override { return 0; }
  void when_taken(std::function<void()> action) override { action(); }
  void end(std::string /*sentence*/) override {}
  std::vector<std::string> texts;
};

class Company : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<RoomCompany::Seat> join(const std::string& room, const std::string& name,
                                                        const std::string& role,
                                                        const std::shared_ptr<Heard>& heard,
                                                        bool admitted = true) {
    return company.join(room, {name, role, heard, [admitted] { return admitted; }});
  }
  RoomCompany company;
  std::shared_ptr<Heard> anna = std::make_shared<Heard>(), sato = std::make_shared<Heard>();
};

TEST_F(Company, KnowsWhoIsThere) {
  const auto first = join("or-1", "anna", "surgeon", anna);
  auto second = join("or-1", "Dr. Sato", "guest", sato);
  const auto elsewhere = join("or-2", "berta", "operator", std::make_shared<Heard>());
  const auto again = join("or-1", "anna", "surgeon", std::make_shared<Heard>());
  second.reset();
  const std::string alone = R"({"watchers":[{"name":"anna","role":"surgeon"}]})";
  const std::string both =
      R"({"watchers":[{"name":"anna","role":"surgeon"},{"name":"Dr. Sato","role":"guest"}]})";
  EXPECT_THAT(anna->texts, ElementsAre(alone, both, both, alone)) << "each person once";
  EXPECT_THAT(sato->texts, ElementsAre(both, both)) << "nothing after leaving";
}

TEST_F(Company, TellsARoomAloneAndThoseWhoMaySeeIt) {
  const auto outsider = std::make_shared<Heard>(), early = std::make_shared<Heard>();
  const auto first = join("or-1", "anna", "surgeon", anna);
  const auto second = join("or-1", "Dr. Sato", "guest", sato);
  const auto third = join("or-1", "Dr. Mori", "guest", early, false);
  const auto other = join("or-2", "berta", "operator", outsider);
  second->tell("there");
  EXPECT_EQ(anna->texts.back(), "there");
  EXPECT_EQ(sato->texts.back(), "there");
  EXPECT_NE(early->texts.back(), "there");
  EXPECT_NE(outsider->texts.back(), "there");
}

TEST(PointRateOfOneBrowser, IsAsAPagePointsAndNoFaster) {
  Clock::Time now{};
  PointRate rate(now);
  for (int i = 0; i < 1000; ++i)
    EXPECT_TRUE(rate.take(now += 50ms)) << "20 a second, for as long as one likes";
  int taken = 0;
  for (int i = 0; i < 10'000; ++i) taken += rate.take(now += 1ms) ? 1 : 0;
  EXPECT_GE(taken, 300);
  EXPECT_LE(taken, 331) << "of a thousand a second for ten seconds";
}

TEST(PointRateOfOnePerson, IsOneForAllTheirBrowsers) {
  Clock::Time now{};
  PointRates rates;
  std::vector<std::shared_ptr<PointRates::Shared>> browsers;
  for (int i = 0; i < 60; ++i) browsers.push_back(rates.of("invitation 3f9c21ab", now));
  const auto other = rates.of("invitation 3f9c21ac", now);
  int taken = 0;
  for (int i = 0; i < 10'000; ++i) {
    now += 1ms;
    for (const auto& browser : browsers) taken += browser->take(now) ? 1 : 0;
  }
  EXPECT_LE(taken, 331) << "as of one browser";
  EXPECT_TRUE(other->take(now)) << "another person's";
}

}  // namespace
}  // namespace kiroku::viewer
