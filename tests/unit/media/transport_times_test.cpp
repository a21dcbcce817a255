#include "media/transport_times.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "media/segment_input.h"
#include "media/stream_clock.h"
#include "tests/support/media_maker.h"

namespace kiroku::media {
namespace {

Bytes film() {
  Bytes joined;
  for (const Bytes& segment : test::make_transport_stream({.sound = true})) append(joined, segment);
  return joined;
}

std::vector<Ticks> move(Bytes& film, Ticks shift, Ticks around = 0) {
  std::vector<Ticks> pictures;
  TransportTimes times(shift, "a film", [&](Ticks time) { pictures.push_back(time); });
  times.expect_around(around);
  times.move(film);
  return pictures;
}

TEST(TransportTimes, ThereAndBackGivesTheSameBytes) {
  const Bytes original = film();
  Bytes moved = original;
  const auto later = move(moved, 90'000);
  EXPECT_NE(moved, original);
  const auto again = move(moved, -90'000);
  EXPECT_EQ(moved, original);
  ASSERT_EQ(later.size(), 75U);
  EXPECT_EQ(later.front(), 45'000 + 90'000);
  EXPECT_EQ(again.front(), 45'000);
  EXPECT_EQ(again[1] - again[0], 3'600);
}

TEST(TransportTimes, ChangeNothingButTimes) {
  const Bytes original = film();
  Bytes moved = original;
  move(moved, 12'345'678);
  ASSERT_EQ(moved.size(), original.size());
  std::size_t changed = 0;
  for (std::size_t i = 0; i < moved.size(); ++i) changed += moved[i] != original[i] ? 1U : 0U;
  EXPECT_LT(changed, moved.size() / TransportTimes::kPacketBytes * 6);
  EXPECT_GT(changed, 0U);
}

TEST(TransportTimes, CarryOnOverTheWrap) {
  Bytes moved = film();
  const Ticks before = kTransportWrap - 45'000 - 36'000;  // the eleventh picture stands at 2^33
  const auto pictures = move(moved, before, kTransportWrap);
  EXPECT_EQ(pictures[9], kTransportWrap - 3'600);
  EXPECT_EQ(pictures[10], kTransportWrap);
  EXPECT_EQ(pictures[11], kTransportWrap + 3'600);
}

TEST(TransportTimes, LeaveOutSoundBeforeZero) {
  const Bytes original = film();
  Bytes moved = original;
  const auto nulls = [](const Bytes& bytes) {
    std::size_t count = 0;
    for (std::size_t at = 0; at < bytes.size(); at += TransportTimes::kPacketBytes) {
      count += bytes[at + 1] == std::byte{0x1f} && bytes[at + 2] == std::byte{0xff} ? 1U : 0U;
    }
    return count;
  };
  const auto pictures = move(moved, -45'000 - 36'000, -36'000);
  EXPECT_EQ(pictures.front(), -36'000) << "pictures stay";
  EXPECT_GT(nulls(moved), nulls(original));
}

TEST(TransportTimes, RefuseWhatIsNoTransportStream) {
  Bytes cut = film();
  cut.resize(cut.size() - 1);
  EXPECT_THROW(move(cut, 1), MediaError);
  Bytes other(TransportTimes::kPacketBytes, std::byte{0x46});
  EXPECT_THROW(move(other, 1), MediaError);
  Bytes too_long(TransportTimes::kPacketBytes, std::byte{0xff});
  too_long[0] = std::byte{0x47};
  too_long[1] = std::byte{0x40};
  EXPECT_THROW(move(too_long, 1), MediaError);
}

}  // namespace
}  // namespace kiroku::media
