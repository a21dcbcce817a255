#include "recorder/procedure/repeated_messages.h"

#include <utility>

#include "base/bytes.h"
#include "recorder/vitals/hl7_vitals.h"

namespace kiroku::recorder {

bool RepeatedMessages::is_repeated(const Hl7Message& message, std::string_view bytes) {
  const Seen now{crypto::sha256(bytes_of(bytes)), content_hash(message)};
  // As digests: names and identifiers are as long as whoever sends likes.
  const crypto::Sha256Digest sender = crypto::sha256(bytes_of(message.sender()));
  const crypto::Sha256Digest key = crypto::sha256(bytes_of(message.sender() + "\n" + message.control_id()));
  if (identifiers_.size() >= kMostSenders) identifiers_.clear();  // somebody makes up senders
  Identifiers& identifiers = identifiers_.try_emplace(sender, Identifiers{key}).first->second;
  identifiers.several = identifiers.several || identifiers.first != key;
  const auto [known, added] = seen_.try_emplace(key, now);
  if (!added) {
    const Seen before = std::exchange(known->second, now);
    if (before.content != now.content) {
      identifiers.reused = true;
      return false;
    }
    const bool tells_apart = identifiers.several && !identifiers.reused;
    const bool has_time = !message.header().field(7).empty();
    return tells_apart || (has_time && before.whole == now.whole);
  }
  order_.push_back(key);
  if (order_.size() > kRemembered) {
    seen_.erase(order_.front());
    order_.pop_front();
  }
  return false;
}

}  // namespace kiroku::recorder
