#include <algorithm>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/note_format.h"
#include "crypto/signed_note.h"
#include "viewer/report/document_parts.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/proof_files.h"
#include "viewer/report/qr_figure.h"
#include "viewer/report/report_document.h"
#include "viewer/report/texts.h"

namespace kiroku::report {
namespace {

/// What the code holds of a note: its text and the device's own lines. Anybody who writes to the folder can
/// add lines in other names, as many as no code holds. An ML-DSA signature alone has more bytes than that;
/// where there is one, Ed25519's is all.
std::string note_for_code(const std::string& note, const std::string& verifier_key) {
  const std::string device = verifier_key.substr(0, verifier_key.find('+'));
  const auto line_of = [&](const std::string& name) {
    const std::string beginning = "\n" + std::string(crypto::kSignaturePrefix) + name + ' ';
    const std::size_t at = note.rfind(beginning);
    return at == std::string::npos ? std::string() : note.substr(at + 1, note.find('\n', at + 1) - at);
  };
  const std::string text = note.substr(0, note.rfind("\n\n") + 2);
  const bool has_ml_dsa = !line_of(crypto::MlDsaVerifierKey::name_of(device)).empty();
  return text + line_of(device) + (has_ml_dsa ? "" : line_of(crypto::HardwareVerifierKey::name_of(device)));
}

}  // namespace

Document make_receipt(const ReportInput& input) {
  constexpr double kCodeSide = 106;
  const CaseFacts& facts = input.facts;
  if (facts.excerpt) {
    throw UsageError(
        "an excerpt has no receipt: its checkpoint covers more than it holds; make one of the whole case");
  }
  if (is_of_later_version(input.verification)) {
    throw UsageError(
        "cannot make a receipt: the case is of a later version of the format than this program knows; use a "
        "newer version of the program");
  }
  if (!facts.last_checkpoint) {
    throw UsageError(
        "cannot make a receipt: the case has no checkpoint that its device signed of the entries that are "
        "there; 'kiroku report' without --receipt tells what there is");
  }
  const StoredNote& note = *facts.last_checkpoint;
  const auto words = [&](TextKey key, std::initializer_list<std::string> values = {}) {
    return say(input.language, key, values);
  };
  Document document = empty_document(input, words("receipt.title"));
  const auto add = [&](Block block) { document.blocks.push_back(std::move(block)); };

  // One page: what else is to be known stands in the report.
  Statement statement = verdict_statement(input, Brackets::kUnsaid);
  statement.remarks.clear();
  const std::size_t limits =
      statement.tone == Tone::kGood ? archive::time_remarks(input.verification).size() : 0;
  if (statement.tone != Tone::kGood) {
    statement.remarks.push_back(words("receipt.not-intact"));
  } else if (input.verification.time != archive::TimeProof::kExternal || limits > 0) {
    // A verdict alone would say that its times hold.
    statement.remarks.push_back(time_sentence(input, Brackets::kUnsaid));
  }
  // Likewise that the recorder made all of it.
  const std::string late = statement.tone == Tone::kGood ? signed_late_sentence(input) : std::string();
  if (!late.empty()) statement.remarks.push_back(late);
  add(std::move(statement));
  // What the times are not worth, and what is to be known of this case, goes before what every receipt says.
  constexpr std::size_t kMostBesideTheLead = 1;
  const bool is_renewed = !evidence_sentence(input).empty();
  const std::size_t beside =
      limits + (is_renewed ? 1 : 0) + (late.empty() ? 0 : 2) + (facts.clock_set ? 1 : 0);
  if (beside <= kMostBesideTheLead) add(Paragraph{words("receipt.lead")});

  Table table = facts_table();
  add_fact(table, words("case.id"), identifier_words(input, document.identifier));
  if (facts.opened_at)
    add_fact(table, words("case.opened"), words("case.by-device", {utc_time(facts.opened_at->utc)}));
  add_fact(table, words("case.closed"), facts.closed_at ? closed_words(input) : words("case.not-closed"));
  add_fact(table, words("receipt.root"), crypto::to_base64(note.root, crypto::Base64Padding::kPadded),
           Face::kMono);
  if (beside <= kMostBesideTheLead)
    add_fact(table, words("receipt.root-hex"), crypto::to_hex(note.root), Face::kMono);
  add_fact(table, words("receipt.size"), grouped(note.size));
  if (std::string evidence = evidence_sentence(input); !evidence.empty()) {
    add_fact(table, words("receipt.evidence"), std::move(evidence));
  }
  if (std::string witnesses = witness_sentence(input); !witnesses.empty()) {
    add_fact(table, words("receipt.witnesses"), std::move(witnesses));
  }
  add_fact(table, words("device.key"), plain_text(input.verification.device), Face::kMono);
  add_fact(table, words("device.trusted"), device_trust_words(input));
  add_fact(table, words("device.signatures"), signature_words(input));
  add(std::move(table));

  const std::string code = note_for_code(note.text, input.verification.device);
  const bool whole = code == note.text;
  const auto same = static_cast<std::size_t>(std::ranges::mismatch(code, note.text).in1 - code.begin());
  add(Picture{
      qr_figure(code, kCodeSide, words("qr.description")),
      words(whole ? TextKey("receipt.qr.caption") : TextKey("receipt.qr.caption.ed25519"), {note.file})});
  add(Heading{2, words("receipt.check")});
  add(Paragraph{words("receipt.check.scan")});
  const std::string bytes = whole ? "" : "-n " + std::to_string(same) + " ";
  add(Listing{{"zbarimg --quiet --raw -Sbinary RECEIPT.png | cmp " + bytes + "- " + note.file}});
  add(Paragraph{words("receipt.check.verify")});
  add(Listing{
      {"kiroku verify " + document.identifier + " --device " + shell_word(input.verification.device)}});
  // One page has no room for more than a line or two about them.
  std::string last = words("receipt.keep");
  if (!input.attachments.empty()) {
    std::string names;
    for (const Attachment& file : input.attachments) names += (names.empty() ? "" : ", ") + file.name;
    last += " " + words("receipt.attached", {names});
    if (std::ranges::find(input.attachments, kLogProofFile, &Attachment::name) != input.attachments.end())
      last += " " + words("receipt.attached.log-proof", {std::string(kLogProofFile)});
    document.attachments = input.attachments;
  }
  add(Paragraph{std::move(last), ParagraphStyle::kSmall});
  return document;
}

}  // namespace kiroku::report
