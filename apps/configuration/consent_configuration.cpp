#include "apps/configuration/consent_configuration.h"

#include <algorithm>

#include "apps/configuration/table_reader.h"
#include "archive/format/case_layout.h"
#include "archive/format/consent_layout.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/printable.h"

namespace kiroku::apps {

bool ConsentConfiguration::knows(const std::string& purpose) const {
  return std::ranges::find(purposes, purpose) != purposes.end();
}

std::string ConsentConfiguration::known() const { return joined(purposes); }

bool ConsentConfiguration::has_rules_of(const ConsentConfiguration& other) const {
  return purposes == other.purposes && demand_purpose == other.demand_purpose &&
         erase_when_withdrawn == other.erase_when_withdrawn;
}

ConsentConfiguration parse_consent_configuration(std::string_view text, const std::string& name_for_errors) {
  ConsentConfiguration consent;
  try {
    const toml::table root = toml::parse(text);
    TableReader top(root, "the file", name_for_errors);
    read_consent(top, consent);
  } catch (const toml::parse_error& error) {
    const auto& where = error.source().begin;
    throw UsageError(name_for_errors + ":" + std::to_string(where.line) + ":" + std::to_string(where.column) +
                     ": " + std::string(error.description()));
  }
  return consent;
}

void read_consent(TableReader& top, ConsentConfiguration& into) {
  const toml::table* table = top.table("consent");
  if (table == nullptr) return;
  into.is_stated = true;
  TableReader reader(*table, "[consent]", top.file());
  reader.texts("purposes", [&](const std::vector<std::string>& purposes) {
    if (purposes.empty() || purposes.size() > archive::kMaximumPurposes)
      throw UsageError("'purposes' must name 1 to 32 purposes");
    for (const std::string& each : purposes) {
      if (!archive::is_short_name(each)) {
        throw UsageError("'purposes' has '" + printable(each) +
                         "': a purpose is 1 to 32 of a-z, 0-9 and '-', for it stands in the appliance log in "
                         "the clear");
      }
      if (std::ranges::count(purposes, each) > 1) throw UsageError("'purposes' has '" + each + "' twice");
    }
    into.purposes = purposes;
  });
  reader.flag("demand_purpose", into.demand_purpose);
  reader.texts("erase_when_withdrawn", [&](const std::vector<std::string>& purposes) {
    for (const std::string& each : purposes) {
      if (!into.knows(each)) {
        throw UsageError("'erase_when_withdrawn' has '" + printable(each) +
                         "', which is none of the purposes: " + into.known());
      }
    }
    into.erase_when_withdrawn = purposes;
  });
  reader.refuse_unknown_keys();
}

}  // namespace kiroku::apps
