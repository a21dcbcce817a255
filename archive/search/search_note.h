// One case's search note: hashes of what it can be found by, under a key of this note alone
// (docs/reference/format-recovery.md names its members). Values; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "archive/search/search_key.h"
#include "archive/search/search_words.h"

namespace kiroku::search {

inline constexpr std::size_t kMostNoteBytes = 1024;

/// By which step of which series, and for which case, something was hashed.
struct NoteKey {
  std::string case_id, series;
  std::uint64_t step = 0;
  bool operator==(const NoteKey&) const = default;
};

struct SearchNote {
  NoteKey of;          // the note's own: by it the MAC is made
  NoteKey words;       // by which its words are; of a case that carries on another one, the other's
  std::string hashes;  // hexadecimal: four words of 128 bits
  std::string mac;     // hexadecimal
  bool operator==(const SearchNote&) const = default;

  /// One line of JSON.
  [[nodiscard]] std::string text() const;
  /// Nothing for what is not written exactly as text() does.
  static std::optional<SearchNote> parse(std::string_view text);
};

/// Of a case whose subject says `words`.
SearchNote make_note(const ApplianceKey& key, const std::string& case_id, const SearchWords& words);
/// Of a case with the subject of the case of `earlier`, which is not at hand in the clear.
SearchNote carry_over(const ApplianceKey& key, const std::string& case_id, const SearchNote& earlier);

/// What the holder of the site's key sees in notes. Not thread-safe.
class NoteReader {
 public:
  explicit NoteReader(SiteKey key) : key_(std::move(key)) {}

  enum class Answer { kFits, kDiffers, kForeign };
  /// Whether the note of an appliance's case has all that is asked for; foreign: a key of this site did not
  /// make it for that case. Who asks for an authority or a system asks for the number or code, too.
  Answer read(const std::string& appliance, const std::string& case_id, const SearchNote& note,
              const SearchWords& asked);

 private:
  [[nodiscard]] std::optional<crypto::Sha256Digest> key_at(const std::string& appliance, const NoteKey& at);
  struct Series {
    Step next;
    std::vector<crypto::Sha256Digest> keys;  // of the steps before `next`
  };
  SiteKey key_;
  std::map<std::pair<std::string, std::string>, Series> series_;  // by appliance and name
};

}  // namespace kiroku::search
