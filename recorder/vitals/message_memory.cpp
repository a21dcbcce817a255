#include "recorder/vitals/message_memory.h"

#include <string>
#include <utility>

#include "base/bytes.h"

namespace kiroku::recorder {

crypto::Sha256Digest content_hash(const Hl7Message& message) {
  constexpr std::size_t kSentAt = 7;
  crypto::Sha256 hash;
  for (const Hl7Segment& segment : message.segments()) {
    const bool is_header = &segment == &message.header();
    hash.update(bytes_of(segment.name()));
    for (std::size_t number = 1; number <= segment.size(); ++number) {
      // The separator keeps fields apart: none holds it.
      hash.update(bytes_of("|"));
      if (!is_header || number != kSentAt) {
        hash.update(bytes_of(segment.field(number).raw()));
      }
    }
    hash.update(bytes_of("\r"));
  }
  return hash.finish();
}

std::optional<MessageMemory::Earlier> MessageMemory::see(std::string_view sender, const Hl7Message& message,
                                                         std::string_view bytes, std::int64_t arrival_ns) {
  const crypto::Sha256Digest name = crypto::sha256(bytes_of(sender));
  const std::string named = std::string(sender) + "\n" + message.control_id();
  const Seen now{crypto::sha256(bytes_of(named)), crypto::sha256(bytes_of(bytes)), content_hash(message),
                 arrival_ns};
  if (senders_.size() >= kMostSenders) senders_.clear();  // somebody makes up senders
  Sender& uses = senders_.try_emplace(name, Sender{name, now.key}).first->second;
  uses.several = uses.several || uses.first != now.key;
  const auto known = seen_.find(now.key);
  if (known == seen_.end()) {
    remember(now);
    return {};
  }
  const Seen before = std::exchange(known->second, now);
  uses.reused = uses.reused || before.content != now.content;
  return Earlier{before.whole == now.whole, before.content == now.content, uses.several && !uses.reused,
                 before.arrival_ns};
}

void MessageMemory::remember(const Seen& seen) {
  if (!seen_.try_emplace(seen.key, seen).second) return;
  order_.push_back(seen.key);
  if (order_.size() <= kRemembered) return;
  seen_.erase(order_.front());
  order_.pop_front();
}

MessageMemory::All MessageMemory::all() const {
  All all;
  all.seen.reserve(order_.size());
  for (const crypto::Sha256Digest& key : order_) all.seen.push_back(seen_.at(key));
  all.senders.reserve(senders_.size());
  for (const auto& [name, sender] : senders_) all.senders.push_back(sender);
  return all;
}

MessageMemory::MessageMemory(const All& all) {
  for (const Seen& seen : all.seen) remember(seen);
  for (const Sender& sender : all.senders) {
    if (senders_.size() < kMostSenders) senders_.try_emplace(sender.name, sender);
  }
}

}  // namespace kiroku::recorder
