#include "recorder/procedure/repeated_messages.h"

#include <algorithm>

#include "recorder/procedure/state_codec.h"

namespace kiroku::recorder {
namespace {

void read(StateReader& reader, crypto::Sha256Digest& digest) {
  Bytes bytes;
  reader.one(bytes);
  if (bytes.size() != digest.size()) StateReader::refuse();
  std::ranges::copy(bytes, digest.begin());
}

}  // namespace

bool RepeatedMessages::is_repeated(const Hl7Message& message, std::string_view bytes) {
  const auto earlier = memory_.see(message.sender(), message, bytes, 0);
  if (!earlier || !earlier->has_same_content) return false;
  const bool has_time = !message.header().field(7).empty();
  return earlier->tells_apart || (has_time && earlier->has_same_bytes);
}

Bytes RepeatedMessages::exported() const {
  const MessageMemory::All all = memory_.all();
  StateWriter writer;
  writer.one(static_cast<std::uint64_t>(all.seen.size()));
  for (const MessageMemory::Seen& each : all.seen)
    writer.all(to_bytes(each.key), to_bytes(each.whole), to_bytes(each.content));
  writer.one(static_cast<std::uint64_t>(all.senders.size()));
  for (const MessageMemory::Sender& each : all.senders)
    writer.all(to_bytes(each.name), to_bytes(each.first), each.several, each.reused);
  return writer.take();
}

RepeatedMessages RepeatedMessages::imported(ByteView bytes) {
  StateReader reader(bytes);
  MessageMemory::All all;
  for (std::size_t left = reader.length(); left > 0; --left) {
    MessageMemory::Seen& each = all.seen.emplace_back();
    read(reader, each.key);
    read(reader, each.whole);
    read(reader, each.content);
  }
  for (std::size_t left = reader.length(); left > 0; --left) {
    MessageMemory::Sender& each = all.senders.emplace_back();
    read(reader, each.name);
    read(reader, each.first);
    reader.all(each.several, each.reused);
  }
  reader.require_end();
  RepeatedMessages messages;
  messages.memory_ = MessageMemory(all);
  return messages;
}

}  // namespace kiroku::recorder
