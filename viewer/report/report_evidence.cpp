// What an evidence record adds: proof that outlives the time-stamps of the case itself.
#include "viewer/report/report_maker.h"

namespace kiroku::report {

void ReportMaker::add_evidence() {
  if (!found_.evidence) return;
  const archive::EvidenceReport& evidence = *found_.evidence;
  heading("heading.evidence");
  paragraph(words("evidence.lead"));
  paragraph(evidence_sentence(in_));
  if (!evidence.links.empty()) {
    Table table{{{words("evidence.time"), 2.2},
                 {words("evidence.authority"), 3},
                 {words("evidence.hash"), 1},
                 {words("evidence.covers"), 2.2}},
                {}};
    for (const archive::EvidenceLink& link : evidence.links) {
      std::string authority =
          link.authority.empty() ? words("evidence.authority.unknown") : plain_text(link.authority);
      if (!link.authority.empty() && !link.outside) authority = words("evidence.authority.own", {authority});
      table.rows.push_back(
          {{link.time ? utc_time(*link.time) : words("case.unknown")},
           {std::move(authority)},
           {plain_text(link.hash)},
           {words(link.covers_data ? TextKey("evidence.covers.data") : TextKey("evidence.covers.link"))}});
    }
    add(std::move(table));
  }
  if (!evidence.holds) return;
  paragraph(words("evidence.covered", {grouped(evidence.entries), grouped(evidence.files)}));
  const std::uint64_t covered = evidence.later_since ? evidence.later_entries : evidence.entries;
  if (!found_.excerpt && evidence.later_since) {
    paragraph(
        words("evidence.taken-in", {grouped(covered - evidence.entries), utc_time(*evidence.later_since)}));
  }
  if (!found_.excerpt && covered < found_.entries) {
    paragraph(words("evidence.later", {grouped(found_.entries - covered)}));
  }
  if (found_.excerpt) paragraph(words("evidence.excerpt"));
  if (evidence.resealed > 0) paragraph(words("evidence.resealed", {grouped(evidence.resealed)}));
  paragraph(words("evidence.not-proved"));
  paragraph(evidence.ends ? words("evidence.ends", {utc_time(*evidence.ends)}) : words("evidence.endless"));
}

}  // namespace kiroku::report
