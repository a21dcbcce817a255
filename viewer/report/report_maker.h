// Makes the report of a verification, part after part (report_document.h); the parts are defined in the files
// that are named after them. For report_*.cpp alone. Used once, by one thread.
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "viewer/report/document_parts.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/report_document.h"
#include "viewer/report/texts.h"

namespace kiroku::report {

class ReportMaker {
 public:
  explicit ReportMaker(const ReportInput& input)
      : in_(input),
        found_(input.verification),
        answers_(answer_checks(input.verification, input.given, input.facts.excerpt)),
        document_(empty_document(input, say(input.language, "report.title"))) {}

  Document make();

 private:
  void add(Block block) { document_.blocks.push_back(std::move(block)); }
  void heading(TextKey key, int level = 1) { add(Heading{level, words(key)}); }
  void paragraph(std::string text) { add(Paragraph{std::move(text)}); }
  void small(std::string text) { add(Paragraph{std::move(text), ParagraphStyle::kSmall}); }
  [[nodiscard]] std::string words(TextKey key, std::initializer_list<std::string> values = {}) const;
  [[nodiscard]] std::string count(std::uint64_t number, TextKey one, TextKey many) const;
  [[nodiscard]] const CheckAnswer& answer(Check check) const;
  [[nodiscard]] std::string entries() const { return count(found_.entries, "one.entry", "many.entry"); }
  [[nodiscard]] std::string device_name() const;

  void add_answers();

  [[nodiscard]] std::string question(Check check) const;

  [[nodiscard]] std::string explanation(const CheckAnswer& answered) const;

  /// Whether there are more findings than are kept, of which the rest is only counted.
  [[nodiscard]] bool only_counted() const;
  [[nodiscard]] std::string not_asked(Check check) const;

  [[nodiscard]] std::string rekeyed_words() const;
  [[nodiscard]] std::string yes_to(const CheckAnswer& answered) const;

  /// That nothing lacks between segments, and how far the streams reach.
  [[nodiscard]] std::string unbroken_words() const;
  [[nodiscard]] std::string log_words(Answer answer) const;
  /// Of an excerpt of whose entries the log states no root to the last.
  [[nodiscard]] std::string part_known_to_log() const;
  /// Who stamped, by certificate, with what the ledger calls them.
  [[nodiscard]] std::string authority_words() const;
  /// Whether anything of a stream is stated to be missing.
  [[nodiscard]] bool has_gaps() const;

  [[nodiscard]] std::string reason() const;

  /// "endoscope: 3 of 12 segments, …": what an excerpt holds of the streams that it selects.
  [[nodiscard]] std::string held_words() const;
  void add_part(Table& table, const archive::ExcerptReport& part) const;
  /// Of an excerpt: whether the gap is of what it is an excerpt of.
  [[nodiscard]] bool concerns(const archive::GapEntry& gap) const;

  void add_case();

  [[nodiscard]] Chain::Link link(TextKey title, const CheckAnswer& answered, std::string text,
                                 std::string bond) const;

  /// What a change would take, by the kind of the time stamps that hold.
  [[nodiscard]] std::string chain_lead() const;
  void add_chain();

  [[nodiscard]] std::string kind_words(const std::string& kind) const;

  /// On the case clock, counted from where the case begins.
  [[nodiscard]] std::string in_case(std::int64_t ns) const;

  void add_streams();

  [[nodiscard]] std::string cause_words(archive::GapCause cause) const;

  void add_gaps();

  [[nodiscard]] std::string place_of(const archive::Finding& finding) const;

  /// The code's meaning, and what the verifier says of this place where that is more.
  [[nodiscard]] std::string meaning_and_text(const archive::Finding& finding) const;

  void add_findings();

  /// Rows of a long list: all, or as many at each end; then what `further` says of the number left out.
  template <typename Row>
  void add_long_table(Table table, std::size_t size, const Row& row, TextKey further);

  /// What the times below are worth, by the kind of the time stamps that hold.
  [[nodiscard]] std::string time_lead() const;
  void add_time();

  /// Whether a token holds and proves time; nothing: no.
  [[nodiscard]] const archive::ProvingToken* proving(std::uint64_t entry) const;
  /// Those that the proof of time rests on: outside authorities' where there are any, else the recorder's
  /// own.
  [[nodiscard]] std::vector<const StatedToken*> relied_on() const;
  [[nodiscard]] std::string tokens_words() const;
  void add_tokens();

  void add_clocks();

  /// What an evidence record proves, by which chain, and what it does not prove. Nothing without a record.
  void add_evidence();

  /// By a policy of witnesses; nothing where none was given.
  void add_witnesses();

  /// Consents and withdrawals of the case; nothing where no log was given, or it states none.
  void add_consents();

  void add_device();

  void add_hashes();

  /// What the document carries along; nothing without attachments.
  void add_attached();

  void add_repeating();

  void add_about();

  [[nodiscard]] std::string given_words() const;

  void add_words();

  const ReportInput& in_;
  const archive::VerificationReport& found_;
  std::vector<CheckAnswer> answers_;
  Document document_;
};

}  // namespace kiroku::report
