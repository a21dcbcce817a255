// Messages between a program and its decoder, whose other end is hostile, slow or gone.
#include "media/box/channel.h"

#include <array>
#include <atomic>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::media {
namespace {

using namespace std::chrono_literals;

constexpr std::chrono::seconds kLong{60};
constexpr std::size_t kMost = 1 << 20;

class ChannelTest : public testing::Test {
 protected:
  /// The other end writes these bytes as they are.
  void write(const Bytes& bytes) const {
    ASSERT_EQ(::write(pair_.theirs.number(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  static Bytes head(std::uint32_t kind, std::uint32_t length) {
    const std::array<std::uint32_t, 2> numbers{kind, length};
    return to_bytes(std::as_bytes(std::span(numbers)));
  }
  SocketPair pair_ = make_channel_pair();
};

TEST_F(ChannelTest, CarriesMessagesInOrderBothWays) {
  Channel ours(std::move(pair_.ours)), theirs(std::move(pair_.theirs));
  const std::string large(300'000, 'x');  // more than one reading takes
  std::thread writer([&] {
    for (const std::string& text : {std::string("one"), std::string(), large}) ours.send(7, text);
  });
  for (const std::string& text : {std::string("one"), std::string(), large}) {
    const auto message = theirs.receive(kLong, kMost);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->kind, 7U);
    EXPECT_EQ(text_of(message->body), text);
  }
  writer.join();
  theirs.send(8, "back");
  EXPECT_EQ(text_of(ours.receive(kLong, kMost)->body), "back");
}

TEST_F(ChannelTest, WaitsNoLongerForOneThatNeverStopsSending) {
  constexpr std::uint32_t kLength = 64U << 20;
  Channel ours(std::move(pair_.ours));
  std::atomic<bool> whole = false;
  std::thread writer([&] {
    write(head(3, kLength));
    const Bytes piece(4096, std::byte{'x'});
    for (std::size_t sent = 0; sent < kLength; sent += piece.size()) write(piece);
    whole = true;
  });
  EXPECT_FALSE(ours.receive(1ms, kLength));
  EXPECT_FALSE(whole) << "it was waited for the end of the message";
  while (!ours.receive(kLong, kLength)) {
  }
  writer.join();
}

TEST_F(ChannelTest, PutsPiecesTogether) {
  Channel ours(std::move(pair_.ours));
  Bytes whole = head(3, 4);
  append(whole, bytes_of("abcd"));
  for (std::size_t i = 0; i + 1 < whole.size(); ++i) {
    write({whole[i]});
    EXPECT_FALSE(ours.receive(0ms, kMost)) << i;
  }
  Bytes rest{whole.back()};
  append(rest, head(4, 0));
  write(rest);
  EXPECT_EQ(text_of(ours.receive(kLong, kMost)->body), "abcd");
  EXPECT_EQ(ours.receive(kLong, kMost)->kind, 4U);
}

TEST_F(ChannelTest, BelievesNoLengthBeforeItIsBounded) {
  Channel ours(std::move(pair_.ours));
  write(head(1, 0xffff'ffff));
  EXPECT_THROW((void)ours.receive(kLong, kMost), ChannelError);
}

TEST_F(ChannelTest, AMessageThatNeverBecomesWholeIsNotWaitedFor) {
  Channel ours(std::move(pair_.ours));
  write(head(1, 10));
  EXPECT_FALSE(ours.receive(10ms, kMost));
}

TEST_F(ChannelTest, SaysThatTheOtherEndIsGone) {
  Channel ours(std::move(pair_.ours));
  pair_.theirs = Descriptor();
  EXPECT_THROW((void)ours.receive(kLong, kMost), ChannelError);
  EXPECT_THROW(ours.send(1, "text"), ChannelError);  // and no SIGPIPE
}

TEST_F(ChannelTest, WhoTakesNothingIsGivenUp) {
  Channel ours(std::move(pair_.ours));
  const std::string much(8 << 20, 'x');  // more than any socket holds
  EXPECT_THROW(ours.send(1, bytes_of(much), 50ms), ChannelError);
}

TEST_F(ChannelTest, ShuttingDownEndsWhoWaits) {
  Channel ours(std::move(pair_.ours));
  std::thread ending([&] { ours.shut_down(); });
  EXPECT_THROW((void)ours.receive(kLong, kMost), ChannelError);
  ending.join();
}

}  // namespace
}  // namespace kiroku::media
