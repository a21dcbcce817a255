// Work on archived segments in a box: what it asks for, what ends it, and what the asker is told.
#include "media/box/boxed_jobs.h"

#include <csignal>
#include <fcntl.h>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/age_error.h"
#include "media/inspection/frame_count_job.h"
#include "media/segment_input.h"
#include "tests/support/child_processes.h"
#include "tests/support/media_maker.h"
#include "tests/support/moved_clock.h"

namespace kiroku::media {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::child_processes;
using test::line_of_process;
using testing::HasSubstr;
using testing::IsEmpty;

/// Bytes in memory, which may be told to fail.
class Plaintext : public crypto::ByteSource {
 public:
  explicit Plaintext(const Bytes& bytes, std::function<void()> before = {})
      : bytes_(bytes), before_(std::move(before)) {}
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    if (before_) before_();
    const std::size_t count =
        std::min(into.size(), bytes_.size() - std::min<std::size_t>(offset, bytes_.size()));
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), count, into.begin());
    return count;
  }

 private:
  const Bytes& bytes_;
  const std::function<void()> before_;
};

/// Of the film of one second that the tests have counted.
const json kCounted{{"frames", 25}, {"first", 45000}, {"last", 131400}};

class BoxedJobsTest : public testing::Test {
 protected:
  json count(BoxedJobs& box, const Bytes& film, std::function<void()> before = {}) const {
    return box.ask(
        kCountFrames, {{"media", "video/mp2t"}, {"name", "a film"}, {"complete", true}},
        [&](std::uint64_t) { return std::make_unique<Plaintext>(film, before); }, "a film");
  }
  const Bytes film_ = test::make_transport_stream({}).front();
};

TEST_F(BoxedJobsTest, DoesOneJobAfterTheOther) {
  BoxedJobs box;
  for (int i = 0; i < 3; ++i) EXPECT_EQ(count(box, film_), kCounted);
  EXPECT_FALSE(box.is_spent());
  EXPECT_EQ(line_of_process(box.process(), "status", "Seccomp:"), "2");
  EXPECT_EQ(line_of_process(box.process(), "status", "NoNewPrivs:"), "1");
}

TEST_F(BoxedJobsTest, DamageIsNoReasonForAnotherBox) {
  BoxedJobs box;
  EXPECT_THROW(count(box, Bytes(4096, std::byte{0})), MediaError);
  EXPECT_FALSE(box.is_spent());
  EXPECT_EQ(count(box, film_), kCounted);
}

TEST_F(BoxedJobsTest, WhatTheDoorThrowsReachesTheAskerAsItIs) {
  BoxedJobs box;
  EXPECT_THROW(
      count(box, film_, [] { throw crypto::AgeError(crypto::AgeFailure::kPayloadDamaged, "damaged"); }),
      crypto::AgeError);
  try {
    count(box, film_, [] { throw IoError("read", "segments/a.ts.age", EIO); });
    ADD_FAILURE();
  } catch (const IoError& error) {
    EXPECT_EQ(error.error_number(), EIO);
  }
  EXPECT_EQ(count(box, film_), kCounted);
}

TEST_F(BoxedJobsTest, AJobThatNobodyKnowsIsRefused) {
  BoxedJobs box;
  EXPECT_THROW(box.ask("open the door", json::object(), {}, "a film"), Error);
  EXPECT_EQ(count(box, film_), kCounted);
}

TEST_F(BoxedJobsTest, ADecoderThatCrashesIsSaidOfTheMedia) {
  BoxedJobs box;
  try {
    count(box, film_, [&] { ::kill(box.process(), SIGABRT); });
    ADD_FAILURE();
  } catch (const MediaError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("the media of a film cannot be decoded: the decoder was killed by SIGABRT"));
  }
  EXPECT_TRUE(box.is_spent());
}

TEST_F(BoxedJobsTest, ADecoderThatSomebodyKilledIsNotSaidOfTheMedia) {
  BoxedJobs box;
  EXPECT_THROW(count(box, film_, [&] { ::kill(box.process(), SIGKILL); }), IoError);
  EXPECT_TRUE(box.is_spent());
}

TEST_F(BoxedJobsTest, ADecoderThatHangsIsKilled) {
  BoxedJobs box(300ms);
  EXPECT_EQ(count(box, film_), kCounted);
  EXPECT_THROW(count(box, film_, [&] { ::kill(box.process(), SIGSTOP); }), MediaError);
  EXPECT_THAT(child_processes(), IsEmpty());
}

// One that was taken over gives signs of life without end.
TEST_F(BoxedJobsTest, ADecoderThatTakesTooLongInAllIsKilled) {
  test::MovedClock clock;
  const auto count_within = [&](std::chrono::minutes whole) {
    BoxedJobs box;
    return box.ask(
        kCountFrames, {{"media", "video/mp2t"}, {"name", "a film"}, {"complete", true}},
        [&](std::uint64_t) { return std::make_unique<Plaintext>(film_, [&] { clock.move(1min); }); },
        "a film", nullptr, {.whole = whole, .clock = &clock});
  };
  EXPECT_EQ(count_within(1000min), kCounted);
  try {
    count_within(1min);
    ADD_FAILURE();
  } catch (const MediaError& error) {
    EXPECT_THAT(error.what(), HasSubstr("takes too long"));
  }
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST_F(BoxedJobsTest, MakesNoMoreThanItMay) {
  for (const std::size_t most : {std::size_t{1} << 20, std::size_t{100}}) {
    BoxedJobs box(60s, "remuxing");
    Bytes made;
    const auto remux = [&] {
      // As an export asks (media/export/remux_job.h).
      return box.ask("remux",
                     {{"matroska", true},
                      {"media", "video/mp2t"},
                      {"stream", "a film"},
                      {"output", "film.mkv"},
                      {"inputs", json::array({{{"name", "a film"}, {"complete", true}}})},
                      {"run", false},
                      {"shift", nullptr},
                      {"first_at", 0}},
                     [&](std::uint64_t) { return std::make_unique<Plaintext>(film_); }, "a film", &made,
                     {.bytes = most});
    };
    if (most > 100) {
      EXPECT_EQ(remux().at("frames"), 25);
      EXPECT_GT(made.size(), 100U);
    } else {
      EXPECT_THROW(remux(), MediaError);
      EXPECT_TRUE(box.is_spent());
    }
  }
}

TEST_F(BoxedJobsTest, APoolReplacesWhatEndedAndLendsEachBoxOnce) {
  int prepared = 0;
  BoxPool pool([&](BoxedJobs&) { ++prepared; });
  pid_t first = 0;
  pool.with([&](BoxedJobs& box) {
    first = box.process();
    pool.with([&](BoxedJobs& other) { EXPECT_NE(other.process(), first); });
    return 0;
  });
  EXPECT_EQ(prepared, 2);
  EXPECT_THROW(
      pool.with([&](BoxedJobs& box) { return count(box, film_, [&] { ::kill(box.process(), SIGSEGV); }); }),
      MediaError);
  EXPECT_EQ(pool.with([&](BoxedJobs& box) { return count(box, film_); }), kCounted);
  EXPECT_EQ(prepared, 2) << "the other one was there";
}

TEST(WhyNoBox, ThereIsOneHere) {
  int waited = 0;
  EXPECT_EQ(why_no_box([&] { ++waited; }), "");
  EXPECT_THAT(child_processes(), IsEmpty());
}

TEST(BoxedChild, ARoleThatNobodyKnowsEnds) {
  const Descriptor memory = make_shared_memory(4096);
  BoxedChild child("cook", memory);
  EXPECT_EQ(child.how_it_ended(60s), "ended with status 2");
}

}  // namespace
}  // namespace kiroku::media
