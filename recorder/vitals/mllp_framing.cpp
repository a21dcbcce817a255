#include "recorder/vitals/mllp_framing.h"

#include <algorithm>
#include <utility>

namespace kiroku::recorder {
namespace {

constexpr char kBegin = '\x0B';
constexpr char kEnd = '\x1C';
constexpr std::string_view kFraming("\x0B\x1C");
/// Of what is dropped so much is told.
constexpr std::size_t kTold = 200;

std::string beginning_of(std::string_view text) { return std::string(text.substr(0, kTold)); }

}  // namespace

std::string mllp_frame(std::string_view message) {
  std::string frame(1, kBegin);
  frame += message;
  frame += kEnd;
  frame += '\r';
  return frame;
}

std::optional<MllpDeframer::Event> MllpDeframer::feed(std::string_view& bytes) {
  while (!bytes.empty()) {
    const std::string_view plain = bytes.substr(0, bytes.find_first_of(kFraming));
    if (!plain.empty()) {
      bytes.remove_prefix(plain.size());
      if (state_ == State::kOutside) {
        if (plain.find_first_not_of("\r\n") != std::string_view::npos) {
          return Event{Event::Kind::kStray, beginning_of(plain)};
        }
      } else if (state_ == State::kInside) {
        message_ += plain.substr(0, longest_ + 1 - std::min(message_.size(), longest_));
        if (message_.size() > longest_) {
          state_ = State::kDropping;
          message_.resize(std::min(message_.size(), kTold));
          return Event{Event::Kind::kTooLong, message_};
        }
      }
      continue;
    }
    const char mark = bytes.front();
    bytes.remove_prefix(1);
    const State before = std::exchange(state_, mark == kBegin ? State::kInside : State::kOutside);
    std::string message = std::exchange(message_, {});
    if (before == State::kInside) {
      return Event{mark == kBegin ? Event::Kind::kCut : Event::Kind::kMessage,
                   mark == kBegin ? beginning_of(message) : std::move(message)};
    }
    if (before == State::kOutside && mark == kEnd) {
      return Event{Event::Kind::kStray, std::string(1, kEnd)};
    }
  }
  return std::nullopt;
}

}  // namespace kiroku::recorder
