// [consent] of kiroku.toml: for what a patient may consent to the use of a case, and what rests on that.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace kiroku::apps {

class TableReader;

struct ConsentConfiguration {
  /// Short names, [a-z0-9-]: they stand in the appliance log in the clear.
  std::vector<std::string> purposes{"treatment-record", "quality-assurance", "teaching", "research",
                                    "publication"};
  /// Exports and excerpts of the home's cases need a purpose, to which a consent must stand.
  bool demand_purpose = false;
  /// Purposes whose withdrawn consent makes a case due for erasure.
  std::vector<std::string> erase_when_withdrawn;
  bool is_stated = false;  // the file has the section

  [[nodiscard]] bool knows(const std::string& purpose) const;
  /// "teaching, research", for sentences.
  [[nodiscard]] std::string known() const;
  /// Nothing comes out otherwise by the other's rules.
  [[nodiscard]] bool has_rules_of(const ConsentConfiguration& other) const;
};

/// [consent] of the text of kiroku.toml, whose other sections are not looked at; the defaults where there is
/// none. Throws kiroku::UsageError with line and column.
ConsentConfiguration parse_consent_configuration(std::string_view toml, const std::string& name_for_errors);

/// [consent], out of the whole file. Throws kiroku::UsageError with line and column.
void read_consent(TableReader& top, ConsentConfiguration& into);

}  // namespace kiroku::apps
