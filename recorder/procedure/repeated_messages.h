// Messages that a sender sends again, as it saw no acknowledgement or replays its queue: what they say was
// taken before. An object belongs to one thread at a time.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <string_view>

#include "crypto/hash.h"
#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

class RepeatedMessages {
 public:
  static constexpr std::size_t kRemembered = 4096;
  static constexpr std::size_t kMostSenders = 256;

  /// Whether the message was here before; it is remembered from now on. The same control ID (MSH-10) of the
  /// same sender says so where all else but MSH-7 is the same, and MSH-7, too, if this sender has used one
  /// control ID for several messages, or has used no other: some begin anew with 1, or always send the same.
  bool is_repeated(const Hl7Message& message, std::string_view bytes);

 private:
  struct Seen {
    crypto::Sha256Digest whole, content;  // content: without MSH-7
  };
  /// How a sender uses MSH-10.
  struct Identifiers {
    crypto::Sha256Digest first;
    bool several = false, reused = false;
  };
  std::map<crypto::Sha256Digest, Identifiers> identifiers_;  // by sender
  std::map<crypto::Sha256Digest, Seen> seen_;                // by sender and control ID
  std::deque<crypto::Sha256Digest> order_;                   // of seen_, the oldest first
};

}  // namespace kiroku::recorder
