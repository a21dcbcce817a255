// Every finding with its place.
#include <algorithm>
#include <functional>

#include "base/printable.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/report_maker.h"

namespace kiroku::report {

using archive::Finding;

std::string ReportMaker::place_of(const Finding& finding) const {
  std::vector<std::string> parts;
  if (!finding.file.empty()) parts.push_back(plain_text(finding.file));
  if (finding.entry) {
    std::string entry = words("finding.entry", {std::to_string(*finding.entry)});
    const auto written = in_.facts.written.find(*finding.entry);
    const bool of_case = !finding.of_log && written != in_.facts.written.end();
    // Behind the end the case clock stands, and days may lie in between.
    const bool is_later = in_.facts.closed_at && *finding.entry > in_.facts.closed_by;
    if (of_case && is_later) entry += ", " + words("finding.written", {utc_time(written->second.utc)});
    if (of_case && !is_later) entry += ", " + words("finding.at", {in_case(written->second.mono_ns)});
    parts.push_back(std::move(entry));
  }
  if (finding.offset) parts.push_back(words("finding.byte", {std::to_string(*finding.offset)}));
  if (parts.empty()) return words("finding.whole");
  std::string place = parts[0];
  for (std::size_t i = 1; i < parts.size(); ++i) place += "\n" + parts[i];
  return place;
}

std::string ReportMaker::meaning_and_text(const Finding& finding) const {
  const std::string meaning = meaning_of(in_.language, finding.code);
  const std::string english = meaning_of(Language::kEnglish, finding.code);
  const bool same =
      english.size() == finding.text.size() + 1 && english.substr(1).starts_with(finding.text.substr(1));
  return same ? meaning : meaning + "\n" + printable(finding.text);  // its length has a limit
}

void ReportMaker::add_findings() {
  heading("heading.findings");
  if (found_.findings.empty()) return paragraph(words("findings.none"));
  small(words("findings.lead"));
  std::vector<Finding> findings = found_.findings;
  std::ranges::stable_sort(findings, std::greater<>(), &Finding::severity);
  Table table{{{words("finding.number"), 0.55, Alignment::kRight},
               {words("finding.what"), 2},
               {words("finding.place"), 2.4},
               {words("finding.meaning"), 3.6}},
              {}};
  for (const Finding& finding : findings) {
    table.rows.push_back({{std::to_string(table.rows.size() + 1)},
                          {severity_words(in_.language, finding.severity) + "\n" + plain_text(finding.code),
                           tone_of(finding.severity)},
                          {place_of(finding)},
                          {meaning_and_text(finding)}});
  }
  add(std::move(table));
}

}  // namespace kiroku::report
