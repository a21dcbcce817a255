// Whoever has the hashes of many stamped together, as one of them sees it. Implementations are not
// thread-safe. What they give is not judged: evidence/shared_token.h reads it.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

#include "base/bytes.h"
#include "base/error.h"

namespace kiroku::evidence {

/// Whoever gives shared tokens does not answer now, and the same question may be answered later.
class SharedStampsAway : public Error {
 public:
  using Error::Error;
};

class SharedStamps {
 public:
  static constexpr std::size_t kNonceBytes = 32;

  SharedStamps() = default;
  virtual ~SharedStamps() = default;
  SharedStamps(const SharedStamps&) = delete;
  SharedStamps& operator=(const SharedStamps&) = delete;

  /// A hash in a round that is open.
  struct Place {
    std::string ticket;
    std::chrono::milliseconds ready_in{0};  // until the round ends, as the other side says; may be anything
  };
  /// Gives a SHA-256, and a nonce of kNonceBytes that was drawn for it, into the next round. Throws
  /// kiroku::Error.
  virtual Place enter(ByteView digest, ByteView nonce) = 0;
  /// The shared token; nothing while its round is not stamped. Throws SharedStampsAway where it is worth
  /// asking again, kiroku::Error where it will not be given.
  virtual std::optional<Bytes> fetch(const Place& place) = 0;
  /// The way in words, beside timestamp::path_name(): "shared, by https://fleet.hospital.example:8444".
  [[nodiscard]] virtual std::string path() const = 0;
};

}  // namespace kiroku::evidence
