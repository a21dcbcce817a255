#include "viewer/api/finding_meanings.h"

#include <string>

#include "viewer/report/checks.h"

namespace kiroku::viewer {

void add_meanings(nlohmann::ordered_json& report) {
  for (nlohmann::ordered_json& finding : report["findings"]) {
    const std::string code = finding["code"].get<std::string>();
    finding["meaning"] = {{"en", report::meaning_of(report::Language::kEnglish, code)},
                          {"ja", report::meaning_of(report::Language::kJapanese, code)}};
  }
}

}  // namespace kiroku::viewer
