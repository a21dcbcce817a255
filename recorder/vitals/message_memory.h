// Which messages senders of HL7 have sent before, and what their control IDs (MSH-10) tell. An object belongs
// to one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "crypto/hash.h"
#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

/// Of all that a message says but when it was sent (MSH-7), which a retry may state anew.
crypto::Sha256Digest content_hash(const Hl7Message& message);

class MessageMemory {
 public:
  static constexpr std::size_t kRemembered = 4096;
  static constexpr std::size_t kMostSenders = 256;

  /// The last message with the same sender and control ID.
  struct Earlier {
    bool has_same_bytes = false, has_same_content = false;  // content: without MSH-7
    /// The sender has used several control IDs, and none for two contents: some begin anew with 1, or always
    /// send the same.
    bool tells_apart = false;
    std::int64_t arrival_ns = 0;
  };
  /// Nothing where there is none. The message is remembered from now on.
  std::optional<Earlier> see(std::string_view sender, const Hl7Message& message, std::string_view bytes,
                             std::int64_t arrival_ns);

  /// Digests alone: names and identifiers are as long as whoever sends likes.
  struct Seen {
    crypto::Sha256Digest key, whole, content;  // key: of sender and control ID
    std::int64_t arrival_ns = 0;
  };
  /// How a sender uses MSH-10.
  struct Sender {
    crypto::Sha256Digest name, first;
    bool several = false, reused = false;
  };
  /// All of it; `seen` in the order in which the control IDs came first.
  struct All {
    std::vector<Seen> seen;
    std::vector<Sender> senders;
  };
  [[nodiscard]] All all() const;
  MessageMemory() = default;
  /// Of more than it remembers it takes the last ones.
  explicit MessageMemory(const All& all);

 private:
  void remember(const Seen& seen);

  std::map<crypto::Sha256Digest, Sender> senders_;
  std::map<crypto::Sha256Digest, Seen> seen_;
  std::deque<crypto::Sha256Digest> order_;  // of seen_, the oldest first
};

}  // namespace kiroku::recorder
