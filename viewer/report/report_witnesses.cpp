// Who cosigned the log's checkpoint that holds the case's end.
#include <chrono>

#include "viewer/report/document_parts.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/report_maker.h"

namespace kiroku::report {

void ReportMaker::add_witnesses() {
  using State = crypto::CosignatureCheck::State;
  if (!found_.witnesses) return;
  const archive::WitnessReport& witnesses = *found_.witnesses;
  heading("heading.witnesses");
  paragraph(words("witness.lead"));
  paragraph(witness_sentence(in_));
  if (!witnesses.witnessed.cosigners.empty()) {
    Table table{{{words("witness.name"), 3}, {words("witness.answer"), 3}, {words("witness.time"), 2.2}}, {}};
    for (const crypto::WitnessedNote::Cosigner& cosigner : witnesses.witnessed.cosigners) {
      const State state = cosigner.check.state;
      const auto since_epoch = std::chrono::seconds(static_cast<std::int64_t>(cosigner.check.time_s));
      table.rows.push_back({{plain_text(cosigner.name)},
                            {words(state == State::kValid     ? TextKey("witness.cosigned")
                                   : state == State::kInvalid ? TextKey("witness.invalid")
                                                              : TextKey("witness.absent"))},
                            {state == State::kValid ? utc_time(UtcTime(since_epoch)) : std::string()}});
    }
    add(std::move(table));
  }
  for (const std::string& why : witnesses.unused) small(words("witness.note", {plain_text(why)}));
}

}  // namespace kiroku::report
