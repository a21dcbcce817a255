#include "trainer/haptic_rate/fingers.h"

#include <algorithm>
#include <array>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

constexpr std::array<const char*, kMostFingers> kFingerNames{"thumb", "index", "middle", "third", "little"};

std::string joined(const std::vector<Finger>& fingers, const std::string& between) {
  std::string text;
  for (const Finger finger : fingers) text += (text.empty() ? "" : between) + name_of(finger);
  return text;
}

}  // namespace

std::string name_of(Finger finger) { return kFingerNames.at(static_cast<std::size_t>(finger)); }

Fingers::Fingers(std::size_t count) : count_(count) {
  if (count < 1 || count > kMostFingers)
    throw UsageError("a hand has 1 to 5 fingers, not " + std::to_string(count));
}

Fingers::Fingers(const std::vector<Finger>& named) : count_(named.size()) {
  for (const Finger finger : named) {
    const auto bit = static_cast<std::uint8_t>(1U << static_cast<unsigned>(finger));
    if ((mask_ & bit) != 0) throw UsageError("the " + name_of(finger) + " finger is named twice");
    mask_ = static_cast<std::uint8_t>(mask_ | bit);
  }
  if (named.empty()) throw UsageError("no finger is named");
}

Fingers Fingers::of(const std::string& text) {
  if (text.size() == 1 && text[0] >= '0' && text[0] <= '9') return static_cast<std::size_t>(text[0] - '0');
  std::vector<Finger> named;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('+', at), text.size());
    const std::string word = text.substr(at, end - at);
    const auto* const found = std::ranges::find(kFingerNames, word);
    if (found == kFingerNames.end()) {
      throw UsageError("'" + text +
                       "' names no fingers: give a number from 1 to 5, or thumb, index, middle, third and "
                       "little joined by +");
    }
    named.push_back(static_cast<Finger>(found - kFingerNames.begin()));
    at = end + 1;
  }
  return Fingers(named);
}

std::vector<Finger> Fingers::which() const {
  std::vector<Finger> found;
  if (!named() && count_ == 1) return {Finger::kIndex};
  for (std::size_t i = 0; i < kMostFingers; ++i) {
    if (named() ? ((mask_ >> i) & 1U) != 0 : i < count_) found.push_back(static_cast<Finger>(i));
  }
  return found;
}

std::string Fingers::text() const { return named() ? joined(which(), "+") : std::to_string(count_); }

std::string Fingers::in_words() const {
  if (named()) return joined(which(), " and ") + (count_ == 1 ? " finger" : " fingers");
  return std::to_string(count_) + (count_ == 1 ? " finger" : " fingers");
}

}  // namespace kiroku::trainer
