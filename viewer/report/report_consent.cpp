// To which uses of the case somebody consented, as the appliance log states it.
#include "base/joined.h"
#include "viewer/report/document_parts.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/report_maker.h"

namespace kiroku::report {
namespace {

TextKey key_of(const archive::Consent& consent) {
  if (consent.withdraws) {
    return consent.is_signed ? TextKey("consent.withdrawn") : TextKey("consent.withdrawn-unsigned");
  }
  return consent.is_signed ? TextKey("consent.given") : TextKey("consent.unsigned");
}

}  // namespace

void ReportMaker::add_consents() {
  if (!in_.consents || (in_.consents->entries.empty() && in_.consents->problem.empty())) return;
  heading("heading.consent");
  paragraph(words("consent.lead"));
  if (!in_.consents->problem.empty()) {
    return paragraph(words("consent.not-checked", {plain_text(in_.consents->problem)}));
  }
  constexpr std::size_t kMost = 60;
  Table table{{{words("consent.entered"), 2.6},
               {words("consent.kind"), 2.4},
               {words("consent.purposes"), 3.6},
               {words("consent.entry"), 1.2, Alignment::kRight}},
              {}};
  for (const archive::Consent& consent : in_.consents->entries) {
    if (table.rows.size() == kMost) break;
    table.rows.push_back({{utc_time(consent.at)},
                          {words(key_of(consent))},
                          {plain_text(joined(consent.says.purposes))},
                          {grouped(consent.entry)}});
  }
  const std::size_t all = in_.consents->entries.size();
  add(std::move(table));
  if (all > kMost) small(words("consent.further", {std::to_string(all - kMost)}));
}

}  // namespace kiroku::report
