#include "media/box/channel.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <poll.h>
#include <sys/socket.h>

namespace kiroku::media {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct Head {
  std::uint32_t kind = 0, length = 0;
};

constexpr std::size_t kReadAtOnce = 64 * 1024;

int poll_for(int socket, short events, milliseconds limit) {
  pollfd waiting{socket, events, 0};
  const auto time = std::clamp<milliseconds::rep>(limit.count(), 0, 3'600'000);
  return ::poll(&waiting, 1, static_cast<int>(time));
}

[[noreturn]] void gone() { throw ChannelError("the other end of the channel is gone"); }

}  // namespace

void Channel::send(std::uint32_t kind, ByteView body, milliseconds patience) {
  Head head{kind, static_cast<std::uint32_t>(body.size())};
  if (head.length != body.size()) throw ChannelError("a message is too long for the channel");
  const std::lock_guard guard(sending_);
  for (ByteView rest : {std::as_bytes(std::span(&head, 1)), body}) {
    while (!rest.empty()) {
      const ssize_t sent = ::send(socket_.number(), rest.data(), rest.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (sent >= 0) {
        rest = rest.subspan(static_cast<std::size_t>(sent));
      } else if (errno == EAGAIN) {
        if (poll_for(socket_.number(), POLLOUT, patience) == 0)
          throw ChannelError("the other end of the channel takes nothing any more");
      } else if (errno != EINTR) {
        gone();
      }
    }
  }
}

std::optional<Channel::Message> Channel::next_whole(std::size_t most_bytes) {
  Head head;
  const std::size_t there = received_.size() - given_out_;
  if (there < sizeof head) return {};
  std::memcpy(&head, received_.data() + given_out_, sizeof head);
  if (head.length > most_bytes) throw ChannelError("a message is longer than it may be");
  if (there < sizeof head + head.length) return {};
  const auto body = received_.begin() + static_cast<std::ptrdiff_t>(given_out_ + sizeof head);
  Message message{head.kind, Bytes(body, body + head.length)};
  given_out_ += sizeof head + head.length;
  if (given_out_ == received_.size()) {
    received_.clear();
    given_out_ = 0;
  }
  return message;
}

std::optional<Channel::Message> Channel::receive(milliseconds limit, std::size_t most_bytes) {
  const steady_clock::time_point until = steady_clock::now() + limit;
  for (;;) {
    if (auto message = next_whole(most_bytes)) return message;
    const auto left = std::chrono::ceil<milliseconds>(until - steady_clock::now());
    // Who sends a byte at a time keeps nobody for as long as it goes on.
    if (left < milliseconds(0)) return {};
    const int ready = poll_for(socket_.number(), POLLIN, left);
    if (ready == 0) return {};
    if (ready < 0) {
      if (errno != EINTR) gone();
      continue;
    }
    std::array<std::byte, kReadAtOnce> block;
    const ssize_t got = ::recv(socket_.number(), block.data(), block.size(), MSG_DONTWAIT);
    if (got == 0) gone();
    if (got < 0) {
      if (errno != EINTR && errno != EAGAIN) gone();
      continue;
    }
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(given_out_));
    given_out_ = 0;
    append(received_, ByteView(block.data(), static_cast<std::size_t>(got)));
  }
}

void Channel::shut_down() const { (void)::shutdown(socket_.number(), SHUT_RDWR); }

SocketPair make_channel_pair() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw IoError("make", "a pair of sockets", errno);
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

}  // namespace kiroku::media
