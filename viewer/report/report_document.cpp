#include "viewer/report/report_document.h"

#include "viewer/report/report_maker.h"

namespace kiroku::report {

Document ReportMaker::make() {
  add(verdict_statement(in_));
  // What its lines say is not known: only what they are, and how to ask a newer program.
  if (is_of_later_version(found_)) {
    add_answers();
    add_chain();
    add_findings();
    add_hashes();
    add_repeating();
    add_about();
    add_words();
    return std::move(document_);
  }
  add_answers();
  add_case();
  add(PageBreak{});
  add_chain();
  add_streams();
  add_gaps();
  add_findings();
  add_time();
  add_evidence();
  add_witnesses();
  add_consents();
  add_device();
  add_hashes();
  add_attached();
  add_repeating();
  add_about();
  add_words();
  return std::move(document_);
}

std::string ReportMaker::words(TextKey key, std::initializer_list<std::string> values) const {
  return say(in_.language, key, values);
}

std::string ReportMaker::count(std::uint64_t number, TextKey one, TextKey many) const {
  return say_count(in_.language, number, one, many);
}

const CheckAnswer& ReportMaker::answer(Check check) const {
  return *std::ranges::find(answers_, check, &CheckAnswer::check);
}

std::string ReportMaker::device_name() const {
  return plain_text(std::string_view(found_.device).substr(0, found_.device.find('+')), kMostBytesOfName);
}

Document make_report(const ReportInput& input) { return ReportMaker(input).make(); }

}  // namespace kiroku::report
