// Datagrams over the real loopback address.
#include "sim/haptics/udp_device.h"

#include <arpa/inet.h>
#include <bit>
#include <cstring>
#include <limits>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/bytes.h"
#include "base/error.h"
#include "tests/support/moved_clock.h"

namespace kiroku::sim {
namespace {

/// The other end: a device, or a program that stands for one.
class Sender {
 public:
  explicit Sender(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  }
  ~Sender() { ::close(socket_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  void send(const std::string& datagram) const {
    EXPECT_EQ(::send(socket_, datagram.data(), datagram.size(), 0), static_cast<ssize_t>(datagram.size()));
  }
  /// Waits for it; empty after 5 s.
  [[nodiscard]] std::string receive() const {
    const timeval patience{5, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    std::string datagram(2000, '\0');
    const ssize_t length = ::recv(socket_, datagram.data(), datagram.size(), 0);
    datagram.resize(length > 0 ? static_cast<std::size_t>(length) : 0);
    return datagram;
  }

 private:
  int socket_;
};

template <typename Number>
void append(std::string& to, Number number) {
  char bytes[sizeof(Number)];
  std::memcpy(bytes, &number, sizeof bytes);  // little-endian, as is every machine this is tested on
  to.append(bytes, sizeof bytes);
}

std::string poses_of(std::uint32_t sequence, const std::vector<std::array<double, 7>>& poses) {
  std::string datagram = "KHP1";
  append(datagram, sequence);
  append(datagram, static_cast<std::uint16_t>(poses.size()));
  append(datagram, std::uint16_t{0});
  for (const auto& pose : poses)
    for (const double number : pose) append(datagram, number);
  return datagram;
}

/// Of a hand whose wrist is there.
std::string with_wrist(std::string datagram, const std::array<double, 7>& wrist) {
  datagram[3] = '2';
  for (const double number : wrist) append(datagram, number);
  return datagram;
}

const std::array<double, 7> kFirst{0.1, -0.2, 0.3, 1, 0, 0, 0}, kSecond{0, 0, 0.05, 0, 0, 0, -1};

/// Datagrams on the loopback address are there when send() returns.
class UdpDeviceTest : public testing::Test {
 protected:
  static_assert(std::endian::native == std::endian::little);
  test::MovedClock time_;
  UdpDevice device_{2, "127.0.0.1", 0, time_};
  Sender sender_{device_.port()};
  std::vector<Pose> poses_ = std::vector<Pose>(2);
};

TEST_F(UdpDeviceTest, TakesPosesAndAnswersWithForces) {
  EXPECT_FALSE(device_.read(poses_));
  device_.write(std::vector<Vector3>(2, Vector3::Zero()));  // nobody to send to
  sender_.send(poses_of(7, {kFirst, kSecond}));
  ASSERT_TRUE(device_.read(poses_));
  EXPECT_EQ(poses_[0].position_m, Vector3(0.1, -0.2, 0.3));
  EXPECT_EQ(poses_[1].orientation.z(), -1);
  EXPECT_FALSE(device_.read(poses_));
  device_.write(std::vector<Vector3>{{1.5, 0, -2}, {0, 0.25, 0}});
  std::string expected = "KHF1";
  append(expected, std::uint32_t{7});
  append(expected, std::uint16_t{2});
  append(expected, std::uint16_t{0});
  for (const double number : {1.5, 0.0, -2.0, 0.0, 0.25, 0.0}) append(expected, number);
  EXPECT_EQ(sender_.receive(), expected);
  EXPECT_EQ(device_.counts().accepted, 1U);
  EXPECT_EQ(device_.counts().not_sent, 0U);
}

TEST_F(UdpDeviceTest, AHandWithAWristIsAnsweredWithWhatTheWristBears) {
  const std::array<double, 7> wrist{0.5, 0.25, -0.125, 0, 1, 0, 0};
  EXPECT_FALSE(device_.has_wrist());
  sender_.send(with_wrist(poses_of(9, {kFirst, kSecond}), wrist));
  ASSERT_TRUE(device_.read(poses_));
  ASSERT_TRUE(device_.has_wrist());
  EXPECT_EQ(poses_[1].orientation.z(), -1);
  EXPECT_EQ(device_.wrist().position_m, Vector3(0.5, 0.25, -0.125));
  EXPECT_EQ(device_.wrist().orientation.x(), 1);
  device_.write_wrist({{1, 2, 3}, {4, 5, 6}});
  device_.write(std::vector<Vector3>{{1.5, 0, -2}, {0, 0.25, 0}});
  std::string expected = "KHF2";
  append(expected, std::uint32_t{9});
  append(expected, std::uint16_t{2});
  append(expected, std::uint16_t{0});
  for (const double number : {1.5, 0.0, -2.0, 0.0, 0.25, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0})
    append(expected, number);
  EXPECT_EQ(sender_.receive(), expected);
}

TEST_F(UdpDeviceTest, AWristNeitherComesNorGoesWhileAHandIsMoved) {
  const std::array<double, 7> wrist = kFirst;
  sender_.send(with_wrist(poses_of(1, {kFirst, kSecond}), wrist));
  ASSERT_TRUE(device_.read(poses_));
  std::uint64_t sent = 0;
  std::array<double, 7> none = kFirst;
  none[4] = std::nan("");
  const std::string good = with_wrist(poses_of(2, {kFirst, kSecond}), wrist);
  for (const std::string& datagram :
       {poses_of(2, {kFirst, kSecond}), with_wrist(poses_of(2, {kFirst, kSecond}), none),
        good.substr(0, good.size() - 56), good + std::string(56, '\0'), "KHP3" + good.substr(4)}) {
    sender_.send(datagram);
    EXPECT_FALSE(device_.read(poses_));
    EXPECT_EQ(device_.counts().malformed, ++sent);
  }
  EXPECT_TRUE(device_.has_wrist());
  time_.move(UdpDevice::kSilence);
  sender_.send(poses_of(1, {kFirst, kSecond}));
  EXPECT_TRUE(device_.read(poses_));
  EXPECT_FALSE(device_.has_wrist());
  device_.write(std::vector<Vector3>(2, Vector3::Zero()));
  EXPECT_EQ(sender_.receive().size(), 12 + 2 * 24U);
}

TEST_F(UdpDeviceTest, OfManyTheNewestCounts) {
  for (std::uint32_t sequence = 1; sequence <= 5; ++sequence) {
    std::array<double, 7> pose = kFirst;
    pose[0] = 0.01 * sequence;
    sender_.send(poses_of(sequence, {pose, kSecond}));
  }
  std::array<double, 7> late = kFirst;
  late[0] = 9;
  sender_.send(poses_of(3, {late, kSecond}));
  ASSERT_TRUE(device_.read(poses_));
  EXPECT_DOUBLE_EQ(poses_[0].position_m.x(), 0.05);
  EXPECT_EQ(device_.counts().accepted, 5U);
  EXPECT_EQ(device_.counts().out_of_order, 1U);
}

TEST_F(UdpDeviceTest, SequenceNumbersGoRound) {
  sender_.send(poses_of(0xFFFFFFFF, {kFirst, kSecond}));
  sender_.send(poses_of(0, {kFirst, kSecond}));
  sender_.send(poses_of(0xFFFFFFFE, {kFirst, kSecond}));
  EXPECT_TRUE(device_.read(poses_));
  EXPECT_EQ(device_.counts().accepted, 2U);
  EXPECT_EQ(device_.counts().out_of_order, 1U);
}

TEST_F(UdpDeviceTest, CountsBadDatagramsAndKeepsThePoses) {
  sender_.send(poses_of(1, {kFirst, kSecond}));
  ASSERT_TRUE(device_.read(poses_));
  const std::string good = poses_of(2, {kFirst, kSecond});
  std::vector<std::string> bad{"",
                               "KHP1",
                               good.substr(0, good.size() - 1),
                               good + "x",
                               good + std::string(2000, 'x'),
                               poses_of(2, {kFirst}),
                               "XHP1" + good.substr(4)};
  std::string count = good, reserved = good;
  count[8] = 3;
  reserved[10] = 1;
  bad.push_back(count);
  bad.push_back(reserved);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 7; ++i) {
    for (const double number : {std::nan(""), kInfinity, -kInfinity, 1e200}) {
      std::array<double, 7> pose = kSecond;
      pose[i] = number;
      bad.push_back(poses_of(2, {kFirst, pose}));
    }
  }
  bad.push_back(poses_of(2, {kFirst, {0, 0, 0, 0, 0, 0, 0}}));   // no direction
  bad.push_back(poses_of(2, {kFirst, {11, 0, 0, 1, 0, 0, 0}}));  // 11 m away
  std::uint64_t sent = 0;
  for (const std::string& datagram : bad) {
    sender_.send(datagram);
    EXPECT_FALSE(device_.read(poses_));
    EXPECT_EQ(device_.counts().malformed, ++sent);
  }
  EXPECT_EQ(poses_[0].position_m, Vector3(0.1, -0.2, 0.3));
  sender_.send(good);
  EXPECT_TRUE(device_.read(poses_));
}

TEST_F(UdpDeviceTest, AnotherSenderIsNotHeardWhileTheFirstIs) {
  sender_.send(poses_of(100, {kFirst, kSecond}));
  ASSERT_TRUE(device_.read(poses_));
  const Sender other(device_.port());
  other.send(poses_of(200, {kSecond, kFirst}));
  EXPECT_FALSE(device_.read(poses_));
  EXPECT_EQ(device_.counts().foreign, 1U);
  time_.move(UdpDevice::kSilence);
  other.send(poses_of(1, {kSecond, kFirst}));
  EXPECT_TRUE(device_.read(poses_));
  device_.write(std::vector<Vector3>(2, Vector3::Zero()));
  EXPECT_EQ(other.receive().size(), 12 + 2 * 24U);
}

TEST_F(UdpDeviceTest, AFloodDoesNotHoldItUp) {
  for (std::uint32_t i = 0; i < 100; ++i) sender_.send("flood");
  sender_.send(poses_of(1, {kFirst, kSecond}));
  EXPECT_FALSE(device_.read(poses_));
  EXPECT_EQ(device_.counts().malformed, static_cast<std::uint64_t>(UdpDevice::kMostDatagrams));
  EXPECT_TRUE(device_.read(poses_));
}

TEST(UdpDevice, RefusesWhatItCannotListenOn) {
  EXPECT_THROW(UdpDevice(0), UsageError);
  EXPECT_THROW(UdpDevice(UdpDevice::kMostTools + 1), UsageError);
  EXPECT_THROW(UdpDevice(1, "localhost"), UsageError);
  EXPECT_THROW(UdpDevice(1, "192.0.2.1"), Error);  // an address for documentation, nobody's
  const UdpDevice first(1);
  EXPECT_THROW(UdpDevice(1, "127.0.0.1", first.port()), Error);
}

}  // namespace
}  // namespace kiroku::sim
