// A haptic device on the network, or another program that stands for one: poses come as datagrams, forces go
// back to who sent them.
//
// Numbers are little-endian, lengths m, forces N, in the mesh's frame; f64 is an IEEE 754 double.
//
//   poses   offset 0   "KHP1"                       forces   offset 0   "KHF1"
//           4          u32 sequence number                   4          u32 of the poses it answers
//           8          u16 number of tools                   8          u16 number of tools
//           10         u16 zero                              10         u16 zero
//           12 + 56 i  f64 x, y, z, then w, x, y, z          12 + 24 i  f64 x, y, z
//                      of the unit quaternion
//
// Hands with a wrist send "KHP2": behind the tools' poses comes the wrist's, laid out as these. They are
// answered with "KHF2": behind the tools' forces come the wrist's, f64 x, y, z of its force and then of its
// torque about the wrist, N m.
//
// A datagram is exactly as long as its tools ask for. Nothing proves who sent it: the device listens on the
// loopback address unless told otherwise, and belongs to a network of its own if it is.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "base/clock.h"
#include "base/descriptor.h"
#include "sim/haptics/haptic_device.h"

namespace kiroku::sim {

/// Not thread-safe. Never waits; never throws once made: what is wrong with a datagram is counted.
class UdpDevice : public HapticDevice {
 public:
  /// `address` in numbers, IPv4; port 0 takes a free one. kiroku::UsageError for an address that is none or
  /// more than kMostTools, kiroku::Error where the address cannot be had. `time` must outlive it.
  explicit UdpDevice(std::size_t tools, const std::string& address = "127.0.0.1", std::uint16_t port = 0,
                     const Clock& time = Clock::system());

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::size_t tools() const override { return tools_; }
  /// Of what came, the newest; at most kMostDatagrams are looked at, so that a flood holds up nobody.
  bool read(std::span<Pose> poses) override;
  void write(std::span<const Vector3> forces_n) override;
  [[nodiscard]] bool has_wrist() const override { return has_wrist_; }
  [[nodiscard]] Pose wrist() const override { return wrist_; }
  void write_wrist(const WristForce& wrist) override { wrist_force_ = wrist; }

  struct Counts {
    std::uint64_t accepted = 0;
    std::uint64_t malformed = 0;     // length, first letters, number of tools, numbers that are no pose; of
                                     // the other version than its sender began with
    std::uint64_t out_of_order = 0;  // not newer than one that was accepted
    std::uint64_t foreign = 0;       // from another sender, while the first was heard within kSilence
    std::uint64_t not_sent = 0;      // forces that the network did not take
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

  static constexpr std::size_t kMostTools = 16;
  static constexpr int kMostDatagrams = 64;
  /// Who was not heard for so long may be followed by another sender, or by itself counting anew.
  static constexpr std::chrono::milliseconds kSilence{500};
  /// Positions further from the origin than this, m, are no poses of a tool at an organ.
  static constexpr double kFurthestMetres = 10;

 private:
  struct Peer {
    std::uint32_t address = 0;  // in network order, as the port is
    std::uint16_t port = 0;
    bool operator==(const Peer&) const = default;
  };

  std::size_t tools_;
  Descriptor socket_;
  std::uint16_t port_ = 0;
  Peer peer_;
  bool has_peer_ = false;
  const Clock& time_;
  Clock::Time heard_;
  std::uint32_t sequence_ = 0;
  bool has_wrist_ = false;
  Pose wrist_;
  WristForce wrist_force_;
  Counts counts_;
};

}  // namespace kiroku::sim
