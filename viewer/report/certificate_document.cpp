// The form of a declaration under the Federal Rules of Evidence of the United States. Its texts stand here
// and not in the dictionary (text_table.h): it is for courts of one language.
#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"
#include "crypto/encoding.h"
#include "viewer/report/document_parts.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/report_document.h"

namespace kiroku::report {
namespace {

using archive::Verdict;

constexpr std::string_view kBlank = "______________________________________________";

bool can_be_declared(Verdict verdict) {
  return verdict == Verdict::kIntact || verdict == Verdict::kIntactWithGaps ||
         verdict == Verdict::kIntactExcerpt;
}

std::string files(std::uint64_t number) { return grouped(number) + (number == 1 ? " file" : " files"); }

class CertificateMaker {
 public:
  explicit CertificateMaker(const ReportInput& input)
      : in_(input),
        found_(input.verification),
        document_(empty_document(input, "Certificate of an electronic record")) {}

  Document make() {
    document_.subtitle += ". Federal Rules of Evidence 902(13) and 902(14); 28 U.S.C. § 1746";
    body(
        "This is a form. The program filled in what it found by verifying the record, under the headings "
        "that say "
        "so. The person who signs fills in the blank lines, strikes out what they cannot say of their own "
        "knowledge, and declares the rest. The program knows nothing of that person.");
    add_person();
    add_record();
    add_system();
    add_copy();
    add_limits();
    add_declaration();
    return std::move(document_);
  }

 private:
  void add(Block block) { document_.blocks.push_back(std::move(block)); }
  void heading(std::string text) { add(Heading{1, std::move(text)}); }
  void body(std::string text) { add(Paragraph{std::move(text)}); }
  void item(const std::string& text) { add(Paragraph{"• " + text}); }
  void small(std::string text) { add(Paragraph{std::move(text), ParagraphStyle::kSmall}); }
  static void blank(Table& table, std::string name) { add_fact(table, std::move(name), std::string(kBlank)); }

  void add_person() {
    heading("1. The person (stated by the person who signs)");
    Table table = facts_table();
    blank(table, "Name");
    blank(table, "Position, employer");
    blank(table, "What qualifies me to speak of this system");
    add(std::move(table));
  }

  void add_record() {
    heading("2. The record (found by the program)");
    const CaseFacts& facts = in_.facts;
    Table table = facts_table();
    add_fact(table, found_.excerpt ? "Excerpt of case" : "Case", identifier_words(in_, document_.identifier));
    if (facts.opened_at) add_fact(table, "Opened, by the recorder's clock", utc_time(facts.opened_at->utc));
    if (facts.closed_at) {
      const std::string closed = utc_time(facts.closed_at->utc);
      add_fact(table, "Closed, by the recorder's clock",
               facts.clock_set ? closed + "; that clock was set since the opening, by " +
                                     signed_seconds(facts.clock_set_ns) + " in all"
                               : closed);
    }
    if (found_.excerpt) {
      const std::int64_t begins = found_.excerpt->begins_ns;
      add_fact(
          table, "Stretch of the case",
          case_time(found_.excerpt->from_ns - begins) + " to " + case_time(found_.excerpt->to_ns - begins));
    }
    add_fact(table, "Streams", streams());
    add_fact(table, "Device key", plain_text(found_.device), Face::kMono);
    add_fact(table, found_.excerpt ? "Ledger entries in the excerpt" : "Ledger entries",
             grouped(facts.entries));
    add_fact(table, "SHA-256 of " + facts.ledger.name, crypto::to_hex(facts.ledger.sha256), Face::kMono);
    if (facts.root) add_fact(table, "Merkle root (RFC 6962)", crypto::to_hex(*facts.root), Face::kMono);
    add(std::move(table));
  }

  [[nodiscard]] std::string streams() const {
    std::string out;
    for (const archive::StreamReport& stream : found_.streams)
      out += (out.empty() ? "" : ", ") + plain_text(stream.info.name, kMostBytesOfName);
    return out.empty() ? "none" : out;
  }

  /// What an evidence record adds to that.
  [[nodiscard]] std::string renewed_evidence() const {
    return is_proved_by_record(found_)
               ? " An evidence record (RFC 4998) carries proof of its existence on. " + evidence_sentence(in_)
               : "";
  }

  /// Who vouches for the times of this record: what is signed under penalty of perjury claims no other.
  [[nodiscard]] std::string time_stamping() const {
    switch (found_.time) {
      case archive::TimeProof::kExternal:
        return "Time-stamping authorities outside the recorder signed when they were shown these roots.";
      case archive::TimeProof::kExternalInPart:
        return "Time-stamping authorities outside the recorder signed when they were shown these roots, as "
               "far as entry " +
               std::to_string(found_.outside_entries - 1) +
               " of the ledger. Of what follows the recorder alone says when it was written.";
      case archive::TimeProof::kSelfIssued:
        return "A time-stamping authority that is part of the recorder signed, by the recorder's own clock, "
               "when it was shown these roots. " +
               std::string(is_proved_by_record(found_)
                               ? "No other time stamp of the record's own could be relied on."
                               : "No time stamp of an authority outside the recorder could be relied on.");
      case archive::TimeProof::kNone:
        break;
    }
    return is_proved_by_record(found_)
               ? "No time stamp of the record's own could be relied on: the recorder alone says when it was "
                 "written."
               : "No time stamp of an authority could be relied on: the recorder alone says when the record "
                 "was written.";
  }

  void add_system() {
    heading("3. The process that made the record: Rule 902(13)");
    body(
        "The record was made by a recorder that runs Kiroku. While an operation goes on, the recorder writes "
        "each "
        "stream in segments of a few seconds. It encrypts each segment, and enters its SHA-256 hash in a "
        "ledger. It "
        "signs the root of all entries with a key of its own. What the recorder could not record it enters "
        "as a gap. " +
        time_stamping() + renewed_evidence());
    small("Stated by the person who signs:");
    Table table = facts_table();
    blank(table, "How I know that the recorder worked as set up");
    blank(table, "Who set it up, and by which instructions");
    blank(table, "Place of the operation; its cameras");
    add(std::move(table));
  }

  void add_copy() {
    heading("4. The copy, and how it was identified: Rule 902(14) (found by the program)");
    body("On " + utc_time(in_.made) + " the program " + in_.program +
         " verified the copy to which this certificate "
         "belongs. " +
         hashed_files() +
         (found_.excerpt ? " It computed the root of the case's entries from those of the excerpt and the "
                           "hashes that stand for the others, and checked the device's "
                         : " It computed the root of the entries, and checked the device's ") +
         signatures() + " over that root. The copy has " + grouped(found_.bytes) + " bytes in all.");
    add(verdict_statement(in_, Brackets::kInTheReport));
    small("Stated by the person who signs:");
    Table table = facts_table();
    blank(table, "Who ran the program, and saw this result");
    blank(table, "Who made the copy, when, from which storage");
    add(std::move(table));
  }

  /// Of a segment that was sealed anew the file has another hash than its entry states.
  [[nodiscard]] std::string hashed_files() const {
    const std::uint64_t named = archive::named_files(found_), anew = found_.rekeyed_segments;
    const std::string hash = "It computed the SHA-256 hash (FIPS 180-4) of the ";
    if (anew == 0)
      return hash + files(named) + " of the copy that entries name, and compared each with its entry.";
    std::string out;
    if (named > anew) {
      out = hash + files(named - anew) +
            " of the copy that entries name and that are as they were recorded, and compared each with its "
            "entry. ";
    }
    out += grouped(anew) + (anew == 1 ? " segment" : " segments") +
           " of the copy were sealed anew for another reader: the file of such a segment has another hash "
           "than its entry states. Of each of these the program computed the SHA-256 hash of the original "
           "header, which is kept beside the file, and the payload behind the new header, and compared it "
           "with the entry.";
    if (found_.rekeyed_opened == anew)
      out += " The new header of each yields the same key as the original one.";
    return out;
  }

  [[nodiscard]] std::string signatures() const {
    switch (found_.signatures) {
      case archive::SignaturesChecked::kBoth:
        return "signatures by Ed25519 (RFC 8032) and ML-DSA-65 (FIPS 204)";
      case archive::SignaturesChecked::kHardware:
        return "signatures by Ed25519 (RFC 8032) and by a key in the recorder's hardware (ECDSA on P-256, "
               "FIPS "
               "186-5)";
      case archive::SignaturesChecked::kAll:
        return "signatures by Ed25519 (RFC 8032), ML-DSA-65 (FIPS 204) and a key in the recorder's hardware "
               "(ECDSA "
               "on P-256, FIPS 186-5)";
      case archive::SignaturesChecked::kEd25519:
      case archive::SignaturesChecked::kNone:
        break;
    }
    return "Ed25519 signature (RFC 8032)";
  }

  [[nodiscard]] std::string what_no_clock_says(archive::TimeRemark remark) const {
    using archive::TimeRemark;
    switch (remark) {
      case TimeRemark::kThereByThen:
        return "That an outside clock confirms any of the times above: the time stamps show by when the "
               "record was there. When it was made, and how long that took, the recorder alone says.";
      case TimeRemark::kFirstStampedLate:
        return "That an outside clock confirms when recording began. By the case clock it began " +
               case_time(found_.age_at_first_stamp_ns.value_or(0), false) +
               " before the first time stamp; that it began no earlier, the recorder alone says.";
      case TimeRemark::kEnteredLate:
        return "That an outside clock confirms when all of it was recorded. By the case clock some of it "
               "ended " +
               case_time(found_.entered_late_ns.value_or(0), false) +
               " before the time stamp behind which it is entered; that it is no older, the recorder alone "
               "says.";
      case TimeRemark::kEndStampedLate:
        return "That recording ended when the record says: the time stamp over its end came later than that "
               "explains.";
      case TimeRemark::kClockDiffers:
        return "That the times above by the recorder's clock are right: by the time stamps that clock was "
               "wrong.";
      case TimeRemark::kLengthDiffers:
        break;
    }
    return "That the record lasted from the opening to the closing that stand above: by its case clock it "
           "lasted another time.";
  }

  [[nodiscard]] std::string made_by_the_recorder() const {
    return "That all of it was made by the recorder. " + signed_late_sentence(in_);
  }

  /// `are_all`: everything was opened, and shows what the ledger states.
  void add_what_was_not_opened(bool are_all) {
    if (!found_.contents || found_.contents->opened == 0) {
      item(
          "That the pictures can be played. No key was given that opens them, so their contents were not "
          "looked at.");
      return;
    }
    if (are_all) return;
    const archive::OpenedContents& contents = *found_.contents;
    const std::string names = unopened_pictures(found_);
    item("That all of it can be played. Of the " + std::string(files(archive::listed_segments(found_))) +
         " that should hold its streams, " + grouped(contents.opened) + " were opened, and " +
         grouped(contents.decoded) + " of these decoded to what the ledger states." +
         (names.empty() ? "" : " No picture of these streams was looked at: " + names + ".") +
         (has_uncompared_events() ? " Not all marks were compared with the events that were opened." : ""));
  }

  [[nodiscard]] bool has_uncompared_events() const {
    return std::ranges::find(found_.findings, "events-not-compared", &archive::Finding::code) !=
           found_.findings.end();
  }

  void add_limits() {
    heading("5. What this does not say");
    item("Who and what is in the pictures. The verification shows that the files are as they were recorded.");
    item(
        "That the pictures came from a camera in the room. Whoever controls a camera's cable can feed the "
        "recorder "
        "other pictures while it records.");
    if (found_.time == archive::TimeProof::kExternalInPart)
      item("That an outside clock confirms all of the times above: see the result in part 4.");
    if (found_.time == archive::TimeProof::kSelfIssued || found_.time == archive::TimeProof::kNone)
      item("That an outside clock confirms any of the times above: see the result in part 4.");
    for (const archive::TimeRemark remark : archive::time_remarks(found_)) item(what_no_clock_says(remark));
    const std::vector<CheckAnswer> answers = answer_checks(found_, in_.given, in_.facts.excerpt);
    const bool states_gaps =
        found_.verdict == Verdict::kIntactWithGaps || (found_.excerpt && found_.excerpt->with_gaps);
    if (states_gaps)
      item(
          "That everything was recorded, or is there still. The record itself states what is missing; the "
          "verification report lists it.");
    const bool is_sparse =
        std::ranges::find(answers, Check::kStreams, &CheckAnswer::check)->answer == Answer::kInPart;
    if (is_sparse)
      item(
          "That all of its streams were recorded throughout. One is shorter than the record, or holds far "
          "less "
          "in places than elsewhere; the verification report says which, and where.");
    if (!found_.signed_late.empty() || found_.found_segments > 0) item(made_by_the_recorder());
    if (in_.facts.clock_set)
      item(
          "That the times above by the recorder's clock tell how long anything lasted. That clock was set "
          "while the record was made.");
    if (std::ranges::find(answers, Check::kLog, &CheckAnswer::check)->answer != Answer::kYes)
      item(
          "That nobody who holds the recorder's key removed the end of the record or signed another one in "
          "its "
          "place. That shows beside the recorder's own log, which was not compared, or knows it only in "
          "part.");
    if (found_.excerpt) item("Anything of the parts of the case that this excerpt leaves out.");
    add_what_was_not_opened(std::ranges::find(answers, Check::kContents, &CheckAnswer::check)->answer ==
                            Answer::kYes);
    item(
        "That the record is admissible. Authenticity is one question of several; relevance and hearsay are "
        "others.");
  }

  void add_declaration() {
    heading("6. Declaration");
    body(
        "I declare under penalty of perjury under the laws of the United States of America that the "
        "foregoing is "
        "true and correct.");
    Table table = facts_table();
    blank(table, "Executed on (date)");
    blank(table, "Signature");
    add(std::move(table));
    small(
        "Before the trial or hearing the party that offers the record must give the other party reasonable "
        "written "
        "notice, and make the record and this certificate available for inspection (Rule 902(11)). Whether "
        "this "
        "form suffices in a given case is for counsel and the court.");
  }

  const ReportInput& in_;
  const archive::VerificationReport& found_;
  Document document_;
};

}  // namespace

Document make_certificate(const ReportInput& input) {
  if (input.language != Language::kEnglish) {
    throw UsageError(
        "the certificate is a form of United States law, and there is no other than the English one: leave "
        "--language "
        "out");
  }
  if (!can_be_declared(input.verification.verdict)) {
    throw UsageError(
        "cannot make a certificate of a record that reads as " +
        std::string(archive::verdict_name(input.verification.verdict)) +
        ": nobody could sign that it is as it was recorded; make a report without --certificate, which "
        "says what was found");
  }
  return CertificateMaker(input).make();
}

}  // namespace kiroku::report
