#include "crypto/remote_identity.h"

#include <array>
#include <cerrno>
#include <cstdint>
#include <mutex>
#include <sys/socket.h>

#include "base/error.h"
#include "crypto/age_header.h"

namespace kiroku::crypto {
namespace {

constexpr std::byte kNone{0}, kFound{1};
constexpr unsigned kBitsPerByte = 8;
using Length = std::array<std::byte, 4>;

bool send_all(int socket, ByteView bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
  return true;
}

bool receive_all(int socket, std::span<std::byte> into) {
  while (!into.empty()) {
    const ssize_t got = ::recv(socket, into.data(), into.size(), 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    into = into.subspan(static_cast<std::size_t>(got));
  }
  return true;
}

class RemoteIdentity : public AgeIdentity {
 public:
  explicit RemoteIdentity(Descriptor socket) : socket_(std::move(socket)) {}

  [[nodiscard]] std::optional<Secret> unwrap(const std::vector<AgeStanza>& stanzas) const override {
    const Bytes header = write_age_header(stanzas, Secret(kFileKeySize));
    Length length{};
    for (std::size_t i = 0; i < length.size(); ++i)
      length[i] = static_cast<std::byte>(header.size() >> (kBitsPerByte * (length.size() - 1 - i)));
    const std::lock_guard guard(mutex_);
    std::array<std::byte, 1> answer{};
    Secret file_key(kFileKeySize);
    const bool answered = send_all(socket_.number(), length) && send_all(socket_.number(), header) &&
                          receive_all(socket_.number(), answer) &&
                          (answer[0] != kFound || receive_all(socket_.number(), file_key.bytes()));
    if (!answered) throw Error("who holds the identity does not answer any more; begin anew");
    if (answer[0] != kFound) return {};
    return file_key;
  }

 private:
  Descriptor socket_;
  mutable std::mutex mutex_;
};

/// As of one header: what the identities hold of it.
std::optional<Secret> file_key_of(const AgeIdentities& identities, const std::vector<AgeStanza>& stanzas) {
  for (const auto& identity : identities) {
    try {
      if (auto file_key = identity->unwrap(stanzas)) return file_key;
    } catch (const Error&) {
      continue;
    }
  }
  return {};
}

}  // namespace

std::shared_ptr<const AgeIdentity> remote_identity(Descriptor socket) {
  return std::make_shared<RemoteIdentity>(std::move(socket));
}

void answer_for(const AgeIdentities& identities, int socket) {
  Length length{};
  while (receive_all(socket, length)) {
    std::size_t size = 0;
    for (const std::byte byte : length) size = size << kBitsPerByte | std::to_integer<std::size_t>(byte);
    if (size > kMaximumAgeHeaderSize) return;
    Bytes header(size);
    if (!receive_all(socket, header)) return;
    std::optional<AgeHeader> asked;
    try {
      asked = parse_age_header(header);
    } catch (const AgeError&) {
      return;
    }
    if (!asked) return;
    const std::optional<Secret> file_key = file_key_of(identities, asked->stanzas);
    const std::array<std::byte, 1> answer{file_key ? kFound : kNone};
    if (!send_all(socket, answer) || (file_key && !send_all(socket, file_key->bytes()))) return;
  }
}

}  // namespace kiroku::crypto
