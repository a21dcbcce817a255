// Compares what pictures of a stream show, or its sound carries, with what the ledger says a display showed.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "light/ledger_lights.h"
#include "light/picture_finder.h"

namespace kiroku::light {

/// What a second of pictures shows. kAgrees: the code of this second, or of one shortly before.
/// kOld: a code of this ledger, of another second. kForeign: a code that this ledger never had.
/// kUnread: none that could be read.
enum class SecondLight { kAgrees, kOld, kForeign, kUnread };

/// What is to be said of a stream. kAgrees: nearly every second agrees and none disagrees. kInPart: none
/// disagrees, and many could not be read. kDisagrees: some second shows an old or a foreign code. kNotSeen:
/// no code was read; whether there was a display, the ledger does not say. kNoPictures: there are none.
/// Of sound, one stretch that agrees is kNotSeen where it was not read nearly to the bit: so does noise.
enum class LightAnswer { kAgrees, kInPart, kDisagrees, kNotSeen, kNoPictures };
std::string_view answer_name(LightAnswer answer);       // "in-part"
std::string_view second_light_name(SecondLight light);  // "foreign"

/// Seconds one after the other that show the same.
struct LightStretch {
  SecondLight light = SecondLight::kUnread;
  std::int64_t start_ns = 0, end_ns = 0;  // case clock: its first and its last picture
  std::uint64_t seconds = 0;
  std::optional<std::int64_t> shown_second;  // kOld: Unix time of the code that its first second shows
};

/// Of sound, a stretch of kSoundPeriodSeconds stands where a second of pictures does.
struct LightReport {
  LightAnswer answer = LightAnswer::kNoPictures;
  std::uint64_t pictures = 0;
  std::uint64_t seconds = 0, agreeing = 0, old = 0, foreign = 0, unread = 0;  // seconds with pictures
  /// Seconds that agree and show a foreign code, too: of another recorder's display, say.
  std::uint64_t beside_foreign = 0;
  std::vector<std::int64_t>
      delays_ns;  // of each code's first picture, sorted: how long after its second began
  std::vector<LightStretch> stretches;  // that do not agree, at most kMostStretches
  std::uint64_t more_stretches = 0;     // left out
  /// Seconds among `unread` that were not compared: the ledger has so many codes then that noise would fit.
  std::uint64_t crowded = 0;
  /// Seconds that agree whose code was read nearly to the bit. A code that was corrected in six bits is one
  /// of 10^7: whoever chooses what stands in a ledger finds lines that fit a film from before.
  std::uint64_t exact = 0;
  /// Of the last such second: how many lines its code is made of, and the case clock of its first picture.
  /// The pictures were finished after those lines were.
  std::uint64_t exact_entries = 0;
  std::int64_t exact_shown_ns = 0;
};

/// What may be a code in sound, and when it began on the case clock.
struct TimedSighting {
  std::int64_t case_ns = 0;
  Sighting sighting;
};

class LightJudge {
 public:
  static constexpr std::size_t kMostStretches = 1'000;
  /// A code may be seen so late, or so early where the clocks are read one after the other.
  static constexpr std::int64_t kLateSeconds = 5, kEarlySeconds = 1;
  /// From this share of seconds on a stream agrees.
  static constexpr double kNearlyAll = 0.9;
  /// A second with more codes to compare with is not compared. A recorder with eight streams makes some 300.
  static constexpr std::size_t kMostNearby = 1'000;

  /// `ledger` must outlive the object. Only codes of seconds that `each_seconds` divides are shown: 1 of
  /// pictures, kSoundPeriodSeconds of sound.
  explicit LightJudge(const LedgerLights& ledger, std::int64_t each_seconds = 1)
      : ledger_(ledger), each_seconds_(each_seconds) {}
  /// One picture, in the order of their times on the case clock.
  void add(std::int64_t case_ns, std::span<const Sighting> sightings);
  /// One stretch of sound of kSoundPeriodSeconds, in their order, with what may be a code among those that
  /// begin in it. The caller of this does not call add().
  void hear(std::int64_t begin_ns, std::int64_t end_ns, std::span<const TimedSighting> heard);
  /// After the last picture, or stretch.
  [[nodiscard]] LightReport finish();

 private:
  /// Pictures of one second of UTC.
  struct Second {
    std::int64_t utc = 0;
    std::int64_t first_ns = 0, last_ns = 0;
    std::optional<std::int64_t> exact_ns;  // of sound: when the code began that was read to the bit
    std::uint64_t pictures = 0;
    std::map<std::int64_t, std::uint64_t> near;    // pictures by the second whose code they show
    std::map<std::uint64_t, std::uint64_t> exact;  // pictures by the entries of what they show to the bit
    bool is_crowded = false;
    std::map<std::uint64_t, std::uint64_t> strange;  // pictures by a word that is none of those
    std::map<std::uint64_t, std::uint64_t> clear;    // of them: so clear that they can be called foreign
  };
  /// Whether it is a code that fits, nearly to the bit.
  bool consider(const Sighting& sighting, std::int64_t utc_ns, Second& now);
  [[nodiscard]] std::span<const LedgerCode> around(std::int64_t utc) const {
    return ledger_.codes_of(utc - kLateSeconds, utc + kEarlySeconds);
  }
  void close();
  void note(SecondLight light, const Second& second, std::optional<std::int64_t> shown);
  struct Match {
    const LedgerCode* code = nullptr;
    bool is_exact = false;
  };
  [[nodiscard]] bool is_sound() const { return each_seconds_ > 1; }
  [[nodiscard]] bool is_shown(const LedgerCode& code) const { return code.second % each_seconds_ == 0; }
  [[nodiscard]] Match nearest(const Sighting& sighting, std::span<const LedgerCode> around) const;
  [[nodiscard]] const LedgerCode* anywhere(std::uint64_t word) const;
  /// The code of another time that the second shows.
  [[nodiscard]] const LedgerCode* old_in(const Second& second) const;

  const LedgerLights& ledger_;
  const std::int64_t each_seconds_;
  std::optional<Second> second_;
  LightReport report_;
  std::optional<std::int64_t> latest_shown_;  // of whose code the delay is known
};

}  // namespace kiroku::light
