// The Minimal Lower Layer Protocol (HL7 v2 appendix C): 0x0B, a message, 0x1C 0x0D. An object belongs to one
// thread.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace kiroku::recorder {

std::string mllp_frame(std::string_view message);

/// Cuts a connection's bytes into messages, whatever pieces they come in. A message ends with 0x1C, also
/// where 0x0D is left out behind it (it occurs in none); CR and LF between frames are passed over. Memory is
/// bounded by the longest message.
class MllpDeframer {
 public:
  explicit MllpDeframer(std::size_t longest) : longest_(longest) {}

  struct Event {
    enum class Kind {
      kMessage,
      kStray,    // bytes outside of any frame: `text` is their beginning
      kCut,      // a frame began within another, which `text` is the beginning of
      kTooLong,  // a message longer than allowed was dropped: `text` is its beginning
    };
    Kind kind;
    std::string text;
  };
  /// Takes what it can of `bytes`, which is shortened by it, up to one event; nothing once all are taken.
  std::optional<Event> feed(std::string_view& bytes);
  [[nodiscard]] bool within_frame() const { return state_ != State::kOutside; }
  /// What of a frame has come so far.
  [[nodiscard]] const std::string& partial() const { return message_; }

 private:
  enum class State { kOutside, kInside, kDropping };
  std::size_t longest_;
  State state_ = State::kOutside;
  std::string message_;
};

}  // namespace kiroku::recorder
