#include "sim/haptics/udp_device.h"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <netinet/in.h>
#include <sys/socket.h>
#include <system_error>

#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kHeader = 12, kPoseBytes = 56, kForceBytes = 24;
using Letters = std::array<char, 4>;
constexpr Letters kPoses{'K', 'H', 'P', '1'}, kForces{'K', 'H', 'F', '1'};
constexpr Letters kPosesWithWrist{'K', 'H', 'P', '2'}, kForcesWithWrist{'K', 'H', 'F', '2'};

template <typename Number>
Number number_at(const std::byte* at) {
  Number number = 0;
  for (std::size_t i = sizeof(Number); i-- > 0;)
    number = static_cast<Number>((number << 8U) | std::to_integer<Number>(at[i]));
  return number;
}
double real_at(const std::byte* at) { return std::bit_cast<double>(number_at<std::uint64_t>(at)); }

template <typename Number>
void put(std::byte* at, Number number) {
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    at[i] = static_cast<std::byte>(number & 0xFFU);
    number = static_cast<Number>(number >> 8U);
  }
}

void put(std::byte* at, const Vector3& vector) {
  for (std::size_t i = 0; i < 3; ++i)
    put(at + 8 * i, std::bit_cast<std::uint64_t>(vector[static_cast<Eigen::Index>(i)]));
}

/// Where the numbers are those of a pose.
bool take_pose(const std::byte* at, Pose& pose) {
  pose.position_m = {real_at(at), real_at(at + 8), real_at(at + 16)};
  pose.orientation = {real_at(at + 24), real_at(at + 32), real_at(at + 40), real_at(at + 48)};
  const double length = pose.orientation.norm();
  // Senders round; what is further off than that is another kind of number.
  if (!pose.position_m.allFinite() || pose.position_m.norm() > UdpDevice::kFurthestMetres ||
      !(std::abs(length - 1) <= 1e-3))
    return false;
  pose.orientation.normalize();
  return true;
}

sockaddr_in socket_address(std::uint32_t address, std::uint16_t port) {
  sockaddr_in made{};
  made.sin_family = AF_INET;
  made.sin_addr.s_addr = address;
  made.sin_port = port;
  return made;
}

}  // namespace

UdpDevice::UdpDevice(std::size_t tools, const std::string& address, std::uint16_t port, const Clock& time)
    : tools_(tools), time_(time) {
  if (tools == 0 || tools > kMostTools) {
    throw UsageError("a UDP device has 1 to " + std::to_string(kMostTools) + " tools, not " +
                     std::to_string(tools));
  }
  in_addr parsed{};
  if (::inet_pton(AF_INET, address.c_str(), &parsed) != 1)
    throw UsageError("'" + address + "' is no IPv4 address: write it in numbers, such as 127.0.0.1");
  const auto fail = [&](int error_number) {
    throw Error("cannot listen for haptic datagrams on " + address + " port " + std::to_string(port) + ": " +
                std::generic_category().message(error_number));
  };
  socket_ = Descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket_) fail(errno);
  sockaddr_in own = socket_address(parsed.s_addr, htons(port));
  socklen_t length = sizeof own;
  if (::bind(socket_.number(), reinterpret_cast<const sockaddr*>(&own), length) != 0 ||
      ::getsockname(socket_.number(), reinterpret_cast<sockaddr*>(&own), &length) != 0)
    fail(errno);
  port_ = ntohs(own.sin_port);
}

bool UdpDevice::read(std::span<Pose> poses) {
  // One byte more than the longest, so that longer ones do not pass for it.
  std::array<std::byte, kHeader + kPoseBytes*(kMostTools + 1) + 1> datagram;
  std::array<Pose, kMostTools + 1> taken;  // the wrist's behind the tools'
  bool any = false;
  for (int looked_at = 0; looked_at < kMostDatagrams; ++looked_at) {
    sockaddr_in sender{};
    socklen_t sender_length = sizeof sender;
    const ssize_t received = ::recvfrom(socket_.number(), datagram.data(), datagram.size(), 0,
                                        reinterpret_cast<sockaddr*>(&sender), &sender_length);
    if (received < 0) {
      if (errno == EINTR) continue;
      break;  // nothing more; an error that a datagram of ours came back with is no reason to stop either
    }
    const bool with_wrist = std::memcmp(datagram.data(), kPosesWithWrist.data(), kPosesWithWrist.size()) == 0;
    const auto sound = [&] {
      const std::size_t poses_there = tools_ + (with_wrist ? 1 : 0);
      if (static_cast<std::size_t>(received) != kHeader + kPoseBytes * poses_there ||
          (!with_wrist && std::memcmp(datagram.data(), kPoses.data(), kPoses.size()) != 0) ||
          number_at<std::uint16_t>(&datagram[8]) != tools_ || number_at<std::uint16_t>(&datagram[10]) != 0)
        return false;
      for (std::size_t i = 0; i < poses_there; ++i)
        if (!take_pose(&datagram[kHeader + kPoseBytes * i], taken[i])) return false;
      return true;
    };
    if (!sound()) {
      ++counts_.malformed;
      continue;
    }
    const Clock::Time now = time_.now();
    const Peer from{sender.sin_addr.s_addr, sender.sin_port};
    const auto sequence = number_at<std::uint32_t>(&datagram[4]);
    if (has_peer_ && now - heard_ < kSilence) {
      if (from != peer_) {
        ++counts_.foreign;
        continue;
      }
      // Numbers go round; the half of them before the last one are older.
      if (static_cast<std::int32_t>(sequence - sequence_) <= 0) {
        ++counts_.out_of_order;
        continue;
      }
      // A wrist neither comes nor goes while a hand is moved.
      if (with_wrist != has_wrist_) {
        ++counts_.malformed;
        continue;
      }
    }
    has_peer_ = true;
    peer_ = from;
    heard_ = now;
    sequence_ = sequence;
    ++counts_.accepted;
    has_wrist_ = with_wrist;
    wrist_ = with_wrist ? taken[tools_] : Pose();
    std::copy_n(taken.begin(), tools_, poses.begin());
    any = true;
  }
  return any;
}

void UdpDevice::write(std::span<const Vector3> forces_n) {
  if (!has_peer_) return;
  std::array<std::byte, kHeader + kForceBytes*(kMostTools + 2)> datagram;
  const Letters& letters = has_wrist_ ? kForcesWithWrist : kForces;
  std::memcpy(datagram.data(), letters.data(), letters.size());
  put(&datagram[4], sequence_);
  put(&datagram[8], static_cast<std::uint16_t>(tools_));
  put(&datagram[10], std::uint16_t{0});
  std::size_t length = kHeader;
  const auto append = [&](const Vector3& vector) {
    put(&datagram[length], vector);
    length += kForceBytes;
  };
  for (std::size_t tool = 0; tool < tools_; ++tool) append(forces_n[tool]);
  if (has_wrist_) {
    append(wrist_force_.force_n);
    append(wrist_force_.torque_nm);
  }
  const sockaddr_in to = socket_address(peer_.address, peer_.port);
  if (::sendto(socket_.number(), datagram.data(), length, 0, reinterpret_cast<const sockaddr*>(&to),
               sizeof to) != static_cast<ssize_t>(length)) {
    ++counts_.not_sent;
  }
}

}  // namespace kiroku::sim
