// Which fingers press: so many of them, or named ones. A value; thread-safe.
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

namespace kiroku::trainer {

inline constexpr std::size_t kMostFingers = 5;

/// Of a right hand; the third finger is the one beside the little one, as the exclusion study counts.
enum class Finger : std::uint8_t { kThumb, kIndex, kMiddle, kThird, kLittle };
/// "thumb", "index", "middle", "third", "little".
std::string name_of(Finger finger);

/// One condition of the experiment. The haptic-rate study tells numbers of fingers apart, the exclusion study
/// names them (its Table 1): "2" and "index+middle" are two conditions. Ordered: numbers before names.
class Fingers {
 public:
  /// So many, which of them does not matter. Implicit: a number is what most ask for. kiroku::UsageError for
  /// other than 1 to kMostFingers.
  Fingers(std::size_t count);  // NOLINT(google-explicit-constructor)
  /// These, each once; kiroku::UsageError for none, and for one that is named twice.
  explicit Fingers(const std::vector<Finger>& named);
  /// "2", "little", "index+middle"; kiroku::UsageError for other texts.
  static Fingers of(const std::string& text);

  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] bool named() const { return mask_ != 0; }
  /// From the thumb on. Of a number: one is the index finger, more are the first ones from the thumb on.
  [[nodiscard]] std::vector<Finger> which() const;
  /// What of() reads.
  [[nodiscard]] std::string text() const;
  /// "2 fingers", "index and middle finger".
  [[nodiscard]] std::string in_words() const;
  auto operator<=>(const Fingers&) const = default;

 private:
  std::uint8_t mask_ = 0;  // of named ones; 0: a number
  std::size_t count_;
};

}  // namespace kiroku::trainer
