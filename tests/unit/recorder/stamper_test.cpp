// Asking authorities while a case is recorded: networks and authorities that do not behave.
#include "recorder/stamper.h"

#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"
#include "tests/support/scripted_server.h"
#include "tests/support/switched_authority.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"
#include "timestamp/authority_server.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::http_answer;
using test::ScriptedServer;
using test::SwitchedAuthority;
using testing::AllOf;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Le;
using testing::SizeIs;

class StamperTest : public testing::Test {
 protected:
  StamperTest() { trust_.add_trusted(bytes_of(authority_.root_pem()), "the embedded authority"); }

  static archive::StoredCheckpoint checkpoint(std::uint64_t size) {
    return {size, {}, "note of " + std::to_string(size) + " entries\n", {}};
  }
  [[nodiscard]] Stamper::Context around() {
    return {&trust_, queue_.get(), "case", [this](const std::string& sentence) { said_ += sentence; },
            &clock_};
  }
  [[nodiscard]] std::unique_ptr<Stamper> stamper(BackOffPolicy pauses) {
    return std::make_unique<Stamper>(std::vector<NamedAuthority>{{"swiss", source_, pauses}}, around(),
                                     facts_);
  }
  /// The next answer; fails the test if none comes in time.
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
  /// What has come, without waiting for more.
  bool nothing_has_come() { return waiting_.empty() && facts_.take(0ns).empty(); }
  /// Until nothing is asked, and nothing is about to be.
  static void settle(const Stamper& stamper) {
    while (stamper.outstanding() > 0) std::this_thread::yield();
  }

  test::MovedClock clock_;
  test::TemporaryFolder folder_{test::quick_parent()};
  timestamp::Authority authority_ = timestamp::Authority::create(folder_ / "authority", "Test");
  timestamp::TrustStore trust_;
  std::shared_ptr<SwitchedAuthority> source_ =
      std::make_shared<SwitchedAuthority>(timestamp::embedded_stamp_source(authority_));
  std::unique_ptr<StampingQueue> queue_ = StampingQueue::open(folder_ / "stamping.sqlite");
  FactQueue facts_;
  std::vector<AuthorityAnswer> waiting_;
  std::string said_;
};

TEST_F(StamperTest, WhatIsWantedStandsInTheQueueUntilItsTokenIsEntered) {
  const auto stamper = this->stamper({});
  stamper->stamp(checkpoint(3));
  const AuthorityAnswer first = answer();
  EXPECT_TRUE(first.valid()) << first.cause;
  EXPECT_EQ(first.checkpoint.size, 3U);
  EXPECT_EQ(first.path, "over wwan0");
  EXPECT_LE(first.asked, first.answered);
  ASSERT_THAT(queue_->list(), SizeIs(1));
  EXPECT_EQ(queue_->list()[0].checkpoint, 3U);
  stamper->entered(first);
  EXPECT_THAT(queue_->list(), IsEmpty());
  EXPECT_EQ(said_, "");
}

TEST_F(StamperTest, AfterAnOutageOneTokenCatchesUp) {
  // Two hours, a checkpoint each minute; pauses of half a minute to ten.
  const auto stamper = this->stamper({});
  source_->up = false;
  for (std::uint64_t minute = 1; minute <= 120; ++minute) {
    stamper->stamp(checkpoint(minute));
    for (int looks = 0; looks < 12; ++looks) {
      clock_.await_waiting(1);
      clock_.move(5s);
    }
  }
  clock_.await_waiting(1);
  EXPECT_THAT(source_->requests.load(), AllOf(Ge(12), Le(24)));
  source_->up = true;
  clock_.move(750s);  // the longest pause and a quarter more; after its token the stamper waits for nothing
  int missed = 0;
  AuthorityAnswer latest = answer();
  while (!latest.valid()) {
    EXPECT_GT(latest.pause, 0ns);
    ++missed;
    latest = answer();
  }
  EXPECT_EQ(missed + 1, source_->requests.load());
  EXPECT_EQ(latest.checkpoint.size, 120U);
  settle(*stamper);
  clock_.move(1h);
  EXPECT_TRUE(nothing_has_come()) << "one token is enough";
  ASSERT_THAT(queue_->list(), SizeIs(1));
  EXPECT_EQ(queue_->list()[0].attempts, static_cast<std::uint64_t>(missed));
  stamper->entered(latest);
  EXPECT_THAT(queue_->list(), IsEmpty());
  EXPECT_EQ(stamper->status()[0].failures, 0U);
}

TEST_F(StamperTest, ANewStartDoesNotAskSoonerAndTakesUpWhatIsWanted) {
  source_->up = false;
  source_->leave_alone_for_s = 3600;
  {
    const auto stamper = this->stamper({});
    stamper->stamp(checkpoint(7));
    EXPECT_FALSE(answer().valid());
  }
  source_->up = true;
  const auto stamper = this->stamper({});
  stamper->stamp(checkpoint(9));
  clock_.await_waiting(1);
  clock_.move(1800s);
  clock_.await_waiting(1);
  EXPECT_TRUE(nothing_has_come());
  EXPECT_EQ(source_->requests, 1);
  const auto status = stamper->status();
  EXPECT_EQ(status[0].last_error, "the authority is not there");
  EXPECT_EQ(status[0].pause, 1800s);
  ASSERT_THAT(queue_->list(), SizeIs(1));
  EXPECT_EQ(queue_->list()[0].checkpoint, 9U);
  clock_.move(1800s);
  EXPECT_TRUE(answer().valid());
}

TEST_F(StamperTest, TheClosingCheckpointIsTriedOnceMoreInTheMiddleOfAPause) {
  const auto stamper = this->stamper({.first = 1h, .longest = 1h});
  source_->up = false;
  stamper->stamp(checkpoint(1));
  EXPECT_FALSE(answer().valid());
  stamper->stamp(checkpoint(2));
  settle(*stamper);
  clock_.move(30min);
  EXPECT_TRUE(nothing_has_come());
  source_->up = true;
  source_->held = true;
  stamper->stamp_closing(checkpoint(3));
  EXPECT_EQ(stamper->outstanding(), 1U);
  source_->release();
  const AuthorityAnswer closing = answer();
  EXPECT_TRUE(closing.valid()) << closing.cause;
  EXPECT_EQ(closing.checkpoint.size, 3U);
}

TEST_F(StamperTest, TheClosingCheckpointDoesNotWaitForALimitedAuthority) {
  const auto stamper = this->stamper({});
  source_->up = false;
  source_->leave_alone_for_s = 1200;
  stamper->stamp(checkpoint(1));
  EXPECT_FALSE(answer().valid());
  source_->up = true;
  stamper->stamp_closing(checkpoint(3));
  const AuthorityAnswer closing = answer();
  EXPECT_EQ(closing.cause, "not asked, since it is to be left alone: the authority is not there");
  EXPECT_EQ(closing.pause, 1200s);
  EXPECT_EQ(stamper->outstanding(), 0U);
  EXPECT_EQ(source_->requests, 1);
  ASSERT_THAT(queue_->list(), SizeIs(1));
  EXPECT_EQ(queue_->list()[0].checkpoint, 3U);
}

TEST_F(StamperTest, ALeastIntervalAloneIsNoFailure) {
  const auto stamper = this->stamper({.min_interval = 1h});
  stamper->stamp(checkpoint(1));
  const AuthorityAnswer first = answer();
  EXPECT_TRUE(first.valid());
  stamper->entered(first);
  stamper->stamp_closing(checkpoint(2));
  settle(*stamper);
  EXPECT_TRUE(nothing_has_come());
  EXPECT_EQ(source_->requests, 1);
  ASSERT_THAT(queue_->list(), SizeIs(1));
  EXPECT_EQ(queue_->list()[0].checkpoint, 2U);
}

TEST_F(StamperTest, GoesOnWithoutAQueueThatCannotBeUsed) {
  // The tables are gone under the running program.
  std::filesystem::remove(folder_ / "stamping.sqlite");
  std::filesystem::create_directory(folder_ / "stamping.sqlite-journal");
  const auto stamper = this->stamper({});
  stamper->stamp(checkpoint(3));
  EXPECT_TRUE(answer().valid());
  EXPECT_THAT(said_, HasSubstr("stamping.sqlite"));
}

// What real networks answer; each over HTTP.
struct Nuisance {
  std::string name, answer, cause;
  friend void PrintTo(const Nuisance& nuisance, std::ostream* out) { *out << nuisance.name; }
};
class StamperUnder : public StamperTest, public testing::WithParamInterface<Nuisance> {};

TEST_P(StamperUnder, SaysWhatWasTheMatterAndCatchesUp) {
  ScriptedServer server(GetParam().answer);
  const timestamp::AuthorityPath path{.url = server.url(), .total_timeout = 300ms};
  std::vector<NamedAuthority> authorities{
      {"swiss", timestamp::http_stamp_source(std::vector{path}), {.first = 20ms, .longest = 20ms}}};
  Stamper stamper(std::move(authorities), around(), facts_);
  stamper.stamp(checkpoint(5));
  const AuthorityAnswer bad = answer();
  EXPECT_THAT(bad.cause, HasSubstr(GetParam().cause));
  EXPECT_EQ(queue_->list()[0].last_error, bad.cause);
}

INSTANTIATE_TEST_SUITE_P(
    Nuisances, StamperUnder,
    testing::Values(
        Nuisance{"garbage", http_answer("200 OK", "application/timestamp-reply", std::string(400, '\x05')),
                 "neither a DER TimeStampResp nor a token"},
        Nuisance{"html", http_answer("200 OK", "text/html", "<html>log in</html>"), "captive portal"},
        Nuisance{"no_http", "\x15\x03\x01", "could not be asked"},
        Nuisance{"slow", "", "did not answer in time"},
        Nuisance{"rejection",
                 http_answer("200 OK", "application/timestamp-reply", "\x30\x05\x30\x03\x02\x01\x02"),
                 "rejected"},
        Nuisance{"server_error", http_answer("500 Internal Server Error", "text/plain", "x"), "status 500"}),
    [](const auto& tested) { return tested.param.name; });

TEST_F(StamperTest, HonoursRetryAfterOverHttp) {
  ScriptedServer server(
      "HTTP/1.1 429 Too Many Requests\r\nRetry-After: 1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
  const timestamp::AuthorityPath path{.url = server.url()};
  Stamper stamper(
      {{"swiss", timestamp::http_stamp_source(std::vector{path}), {.first = 1ms, .longest = 1ms}}}, around(),
      facts_);
  stamper.stamp(checkpoint(1));
  const AuthorityAnswer first = answer();
  EXPECT_THAT(first.cause, HasSubstr("429"));
  EXPECT_GE(first.pause, 1s);
  stamper.stamp(checkpoint(2));
  clock_.await_waiting(1);
  EXPECT_EQ(server.requests(), 1U);
  clock_.move(1s);
  const AuthorityAnswer second = answer();
  EXPECT_GE(second.asked - first.answered, 1s);
  EXPECT_EQ(second.checkpoint.size, 2U);
  EXPECT_EQ(server.requests(), 2U);
}

TEST_F(StamperTest, TellsARefusedConnection) {
  std::string url;
  {
    const ScriptedServer server("x");
    url = server.url();
  }
  const timestamp::AuthorityPath path{.url = url};
  Stamper stamper({{"swiss", timestamp::http_stamp_source(std::vector{path})}}, around(), facts_);
  stamper.stamp(checkpoint(1));
  EXPECT_THAT(answer().cause, HasSubstr("is unreachable"));
}

}  // namespace
}  // namespace kiroku::recorder
