// Messages between a program and the decoder that it keeps in a box (child.h), over a pair of local stream
// sockets: a kind and a length, both 32 bits in this machine's order, then so many bytes. Either end takes
// what the other says for hostile: lengths are bounded before memory is asked for, and no wait is for ever.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string_view>

#include "base/bytes.h"
#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::media {

/// The other end is gone, or does not keep to the form.
class ChannelError : public Error {
 public:
  using Error::Error;
};

class Channel {
 public:
  struct Message {
    std::uint32_t kind = 0;
    Bytes body;
  };

  /// Takes one end of a connected pair.
  explicit Channel(Descriptor socket) : socket_(std::move(socket)) {}

  /// From any thread. Throws ChannelError where the other end is gone, or has taken nothing for `patience`.
  void send(std::uint32_t kind, ByteView body, std::chrono::milliseconds patience = std::chrono::seconds(30));
  void send(std::uint32_t kind, std::string_view body) { send(kind, bytes_of(body)); }
  /// The next message; nothing where none is whole within `limit`. One thread at a time. Throws ChannelError
  /// where the other end is gone, or announces more than `most_bytes`.
  std::optional<Message> receive(std::chrono::milliseconds limit, std::size_t most_bytes);
  /// Both directions end; a waiting call of either end returns. From any thread.
  void shut_down() const;

 private:
  std::optional<Message> next_whole(std::size_t most_bytes);

  Descriptor socket_;
  std::mutex sending_;
  Bytes received_;             // not yet given out
  std::size_t given_out_ = 0;  // of its bytes
};

/// Both ends, closed on exec. Throws kiroku::IoError.
struct SocketPair {
  Descriptor ours, theirs;
};
SocketPair make_channel_pair();

}  // namespace kiroku::media
