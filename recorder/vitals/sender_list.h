// Which senders' HL7 messages are taken: their names in MSH-3 and MSH-4. Whoever may connect can write any
// name there, so this keeps out a monitor that was pointed here by mistake, and no attacker. Immutable;
// thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace kiroku::recorder {

class Hl7Message;

/// What a sender that is not taken is told.
inline constexpr std::string_view kStrangersMessage =
    "this sender's messages (MSH-3, MSH-4) are not taken here";

class SenderList {
 public:
  /// Takes every sender.
  SenderList() = default;
  /// "APPLICATION" or "APPLICATION/FACILITY", several separated by commas. Each part is that of
  /// Hl7Message::sender(), with or without the identifier behind '^'. Throws kiroku::UsageError, naming
  /// `source`, for a list with an empty name.
  static SenderList parse(std::string_view text, const std::string& source);
  [[nodiscard]] bool takes(const Hl7Message& message) const;

 private:
  struct Entry {
    std::string application, facility;  // "": any
  };
  std::vector<Entry> entries_;
};

}  // namespace kiroku::recorder
