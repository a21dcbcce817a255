// Moves the time stamps of an MPEG-TS stream (ISO 13818-1) and leaves everything else of it, byte for byte.
// An object belongs to one thread.
#pragma once

#include <functional>
#include <set>
#include <span>
#include <string>

#include "base/bytes.h"
#include "media/media_ticks.h"

namespace kiroku::media {

/// Clock references (PCR, OPCR: 2.4.3.4) and time stamps of packetised streams (PTS, DTS: 2.4.3.6) are moved
/// by a constant, modulo 2^33; a clock reference that goes below zero wraps, as the standard has it. Sound
/// that would begin before zero becomes null packets, since players take a wrapped time stamp for a late one.
class TransportTimes {
 public:
  /// Hears where each picture stands after the move, in the order of the stream.
  using OnPicture = std::function<void(Ticks time)>;
  /// `name` stands in errors.
  TransportTimes(Ticks shift, std::string name, OnPicture on_picture);

  /// What follows stands around this time after the move: by it wraps are told apart.
  void expect_around(Ticks time) { around_ = time; }
  /// Changes whole transport packets in place. Throws MediaError where they are none, or state a time stamp
  /// that does not fit into its packet.
  void move(std::span<std::byte> packets);

  static constexpr std::size_t kPacketBytes = 188;

 private:
  void move_packet(std::span<std::byte> packet);
  void move_clock_references(std::span<std::byte> adaptation) const;
  /// Of a packetised stream that begins in this payload; whether it goes on to stand there.
  [[nodiscard]] bool move_stamps(std::span<std::byte> payload);
  [[noreturn]] void refuse(const std::string& what) const;

  Ticks shift_;
  std::string name_;
  OnPicture on_picture_;
  Ticks around_ = 0;
  std::uint64_t moved_ = 0;      // packets
  std::set<unsigned> left_out_;  // streams whose packet that runs is left out
};

}  // namespace kiroku::media
