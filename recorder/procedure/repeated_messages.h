// Messages that a sender sends again, as it saw no acknowledgement or replays its queue: what they say was
// taken before. An object belongs to one thread at a time.
#pragma once

#include <cstddef>
#include <string_view>

#include "base/bytes.h"
#include "recorder/vitals/message_memory.h"

namespace kiroku::recorder {

class RepeatedMessages {
 public:
  static constexpr std::size_t kRemembered = MessageMemory::kRemembered;

  /// Whether the message was here before; it is remembered from now on. The same control ID (MSH-10) of the
  /// same sender says so where all else but MSH-7 is the same, and MSH-7, too, if this sender has used one
  /// control ID for several messages, or has used no other: some begin anew with 1, or always send the same.
  bool is_repeated(const Hl7Message& message, std::string_view bytes);

  /// All of it, as digests, for a recorder that starts anew on the running machine.
  [[nodiscard]] Bytes exported() const;
  /// What exported() gave. Throws kiroku::Error for anything else.
  static RepeatedMessages imported(ByteView bytes);

 private:
  MessageMemory memory_;
};

}  // namespace kiroku::recorder
