#include "media/transport_times.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

constexpr std::byte kSync{0x47};
constexpr unsigned kNullPid = 0x1fff;
constexpr std::size_t kHeaderBytes = 4;
constexpr std::size_t kStampBytes = 5, kClockReferenceBytes = 6;

unsigned octet(std::byte value) { return std::to_integer<unsigned>(value); }

Ticks modulo(Ticks time) { return (time % kTransportWrap + kTransportWrap) % kTransportWrap; }

/// A time stamp of 33 bits in five bytes, marker bits between its parts (2.4.3.7).
Ticks read_stamp(std::span<const std::byte> bytes) {
  return (Ticks{octet(bytes[0]) >> 1 & 7U} << 30) | (Ticks{octet(bytes[1])} << 22) |
         (Ticks{octet(bytes[2]) >> 1} << 15) | (Ticks{octet(bytes[3])} << 7) | Ticks{octet(bytes[4]) >> 1};
}

void write_stamp(std::span<std::byte> bytes, Ticks stamp) {
  const auto bits = static_cast<std::uint64_t>(stamp);
  const auto with = [](std::byte kept, unsigned mask, std::uint64_t value) {
    return static_cast<std::byte>((octet(kept) & ~mask) | (static_cast<unsigned>(value) & mask));
  };
  bytes[0] = with(bytes[0], 0x0eU, bits >> 30 << 1);
  bytes[1] = static_cast<std::byte>(bits >> 22 & 0xffU);
  bytes[2] = with(bytes[2], 0xfeU, bits >> 15 << 1);
  bytes[3] = static_cast<std::byte>(bits >> 7 & 0xffU);
  bytes[4] = with(bytes[4], 0xfeU, bits << 1);
}

/// The 33 bits of a clock reference's base; its extension of 9 bits stays.
void move_clock_reference(std::span<std::byte> bytes, Ticks shift) {
  const Ticks base = (Ticks{octet(bytes[0])} << 25) | (Ticks{octet(bytes[1])} << 17) |
                     (Ticks{octet(bytes[2])} << 9) | (Ticks{octet(bytes[3])} << 1) |
                     Ticks{octet(bytes[4]) >> 7};
  const auto bits = static_cast<std::uint64_t>(modulo(base + shift));
  for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::byte>(bits >> (25 - 8 * i) & 0xffU);
  bytes[4] = static_cast<std::byte>((octet(bytes[4]) & 0x7fU) | static_cast<unsigned>((bits & 1U) << 7));
}

bool is_picture_stream(unsigned id) { return id >= 0xe0 && id <= 0xef; }
/// MPEG audio, and what has a private form (AC-3, LPCM).
bool is_sound_stream(unsigned id) { return (id >= 0xc0 && id <= 0xdf) || id == 0xbd; }

void make_null(std::span<std::byte> packet) {
  packet[1] = std::byte{0x1f};
  packet[2] = std::byte{0xff};
  packet[3] = std::byte{0x10};
  std::fill(packet.begin() + kHeaderBytes, packet.end(), std::byte{0xff});
}

}  // namespace

TransportTimes::TransportTimes(Ticks shift, std::string name, OnPicture on_picture)
    : shift_(shift), name_(std::move(name)), on_picture_(std::move(on_picture)) {}

void TransportTimes::refuse(const std::string& what) const {
  throw MediaError("the media of " + name_ + " is no MPEG transport stream: packet " +
                   std::to_string(moved_) + " " + what);
}

void TransportTimes::move(std::span<std::byte> packets) {
  while (packets.size() >= kPacketBytes) {
    move_packet(packets.first(kPacketBytes));
    packets = packets.subspan(kPacketBytes);
    ++moved_;
  }
  if (!packets.empty()) refuse("is cut");
}

void TransportTimes::move_packet(std::span<std::byte> packet) {
  if (packet[0] != kSync) refuse("does not begin as one");
  const unsigned pid = (octet(packet[1]) & 0x1fU) << 8 | octet(packet[2]);
  if (pid == kNullPid) return;
  const bool begins = (octet(packet[1]) & 0x40U) != 0;
  const unsigned control = octet(packet[3]);
  std::size_t at = kHeaderBytes;
  if ((control & 0x20U) != 0) {
    const std::size_t length = octet(packet[at]);
    if (at + 1 + length > packet.size()) refuse("has an adaptation field that is longer than itself");
    move_clock_references(packet.subspan(at + 1, length));
    at += 1 + length;
  }
  if ((control & 0x10U) == 0) return;
  if (begins) {
    left_out_.erase(pid);
    if (!move_stamps(packet.subspan(at))) left_out_.insert(pid);
  }
  if (left_out_.contains(pid)) make_null(packet);
}

void TransportTimes::move_clock_references(std::span<std::byte> adaptation) const {
  if (adaptation.empty()) return;
  const unsigned flags = octet(adaptation[0]);
  std::size_t at = 1;
  for (const unsigned flag : {0x10U, 0x08U}) {
    if ((flags & flag) == 0) continue;
    if (at + kClockReferenceBytes > adaptation.size()) refuse("has a clock reference that is cut");
    move_clock_reference(adaptation.subspan(at, kClockReferenceBytes), shift_);
    at += kClockReferenceBytes;
  }
}

bool TransportTimes::move_stamps(std::span<std::byte> payload) {
  constexpr std::size_t kFlagsAt = 7, kStampsAt = 9;
  if (payload.size() < kStampsAt || octet(payload[0]) != 0 || octet(payload[1]) != 0 ||
      octet(payload[2]) != 1) {
    return true;  // a table
  }
  const unsigned id = octet(payload[3]);
  if (!is_picture_stream(id) && !is_sound_stream(id)) return true;
  const unsigned flags = octet(payload[kFlagsAt]) >> 6;
  if ((flags & 2U) == 0) return true;
  const std::size_t stamps = flags == 3 ? 2 : 1;
  if (kStampsAt + stamps * kStampBytes > payload.size()) refuse("has a time stamp that is cut");
  const Ticks time = around_ + unwrapped(read_stamp(payload.subspan(kStampsAt)) + shift_ - around_);
  if (is_picture_stream(id)) {
    if (on_picture_) on_picture_(time);
  } else if (time < 0) {
    return false;
  }
  for (std::size_t i = 0; i < stamps; ++i) {
    const auto stamp = payload.subspan(kStampsAt + i * kStampBytes, kStampBytes);
    write_stamp(stamp, modulo(read_stamp(stamp) + shift_));
  }
  return true;
}

}  // namespace kiroku::media
