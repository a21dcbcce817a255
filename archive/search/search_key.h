// The keys by which a site finds cases by patient or procedure although what they are about is sealed
// (docs/explanation/fleet.md, "Search by patient or procedure"). The site's key stays with who searches; each
// appliance has one of its own, which goes one step further with every note, so that it tells nothing of the
// notes before. Values; functions are thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "crypto/hash.h"
#include "crypto/secret.h"

namespace kiroku::search {

/// So many notes are made by one key of an appliance.
inline constexpr std::uint64_t kMostSteps = 262'144;

/// "0123…", 32 hexadecimal digits: which of the keys that an appliance was given. It has 64 random bits and
/// as many of an HMAC under the site's key.
bool is_series(std::string_view text);

/// What one step is for: its note's words and MAC, and the step after it.
struct Step {
  crypto::Secret chain;
  [[nodiscard]] crypto::Sha256Digest note_key() const;
  [[nodiscard]] Step next() const;
};

/// An appliance's key as it is now.
struct ApplianceKey {
  std::string appliance, series;
  std::uint64_t step = 0;
  Step now;

  /// One line. Its length stays the same from step to step.
  [[nodiscard]] crypto::Secret text() const;
  /// Throws kiroku::UsageError naming `file`.
  static ApplianceKey parse(std::string_view text, const std::filesystem::path& file);
  /// Throws kiroku::UsageError also where others than the owner may read or write the file.
  static ApplianceKey read(const std::filesystem::path& file);
};

/// Takes the key's step for one note: when it returns, the file holds the next one, in the place of this one
/// and flushed. Waits for other callers and processes. Throws kiroku::Error, also where all steps were taken.
ApplianceKey take_step(const std::filesystem::path& file);

/// The site's key.
class SiteKey {
 public:
  static SiteKey make();
  [[nodiscard]] SiteKey clone() const { return SiteKey(secret_.clone()); }
  /// As ApplianceKey::read().
  static SiteKey read(const std::filesystem::path& file);
  [[nodiscard]] crypto::Secret text() const;

  /// A new key for an appliance, in a series of its own.
  [[nodiscard]] ApplianceKey key_for(const std::string& appliance) const;
  /// Whether this key gave the appliance that series.
  [[nodiscard]] bool has_given(std::string_view appliance, std::string_view series) const;
  /// The first step of a series.
  [[nodiscard]] Step first_of(std::string_view appliance, std::string_view series) const;

 private:
  explicit SiteKey(crypto::Secret secret) : secret_(std::move(secret)) {}
  crypto::Secret secret_;
};

}  // namespace kiroku::search
