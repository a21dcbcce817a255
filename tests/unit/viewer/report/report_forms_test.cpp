#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/signing_key.h"
#include "tests/unit/viewer/report/report_case.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/proof_files.h"

namespace kiroku::report {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST_F(ReportDocument, ReceiptHoldsTheLastCheckpointInItsCode) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  for (const Language language : {Language::kEnglish, Language::kJapanese}) {
    const ReportInput asked = input(archive_.options(), language);
    write("receipt.pdf", write_pdf(make_receipt(asked)));
    EXPECT_THAT(tool({"pdfinfo", "receipt.pdf"}), HasSubstr("Pages:           1\n"));
    tool({"pdftoppm", "-r", "150", "-png", "receipt.pdf", "page"});
    const std::string scanned = tool({"zbarimg", "--quiet", "--raw", "-Sbinary", "page-1.png"});
    ASSERT_TRUE(asked.facts.last_checkpoint);
    EXPECT_EQ(scanned, asked.facts.last_checkpoint->text);
    // What was scanned is a note that the device signed, over the whole ledger.
    const crypto::OpenedNote note = crypto::open_note(scanned, {archive_.device()});
    EXPECT_FALSE(note.failure) << note.explanation;
    EXPECT_EQ(crypto::Checkpoint::parse(note.text)->root, asked.facts.root);
    EXPECT_EQ(crypto::Checkpoint::parse(note.text)->size, asked.facts.entries);
  }
}

/// What the log says of the case's end, as a receipt carries it along, without that log.
archive::VerificationReport judged_without_log(const fs::path& folder, archive::VerifyOptions options,
                                               const std::string& proof) {
  options.log.reset();
  options.log_proof = archive::OutsideNote{"case.tlog-proof", proof};
  return archive::verify_case(folder, options);
}

TEST_F(ReportDocument, ReceiptCarriesItsCheckpointAndTheLogsProofAlong) {
  for (const Language language : {Language::kEnglish, Language::kJapanese}) {
    ReportInput in = input(archive_.options(), language);
    const ComparedLog log{archive_.log_folder(), archive_.device(), {}};
    const std::optional<Attachment> proof = log_proof_file(folder_, in, std::nullopt, log);
    ASSERT_TRUE(proof);
    EXPECT_EQ(proof->name, "case.tlog-proof");
    EXPECT_GT(
        judged_without_log(folder_, archive_.options(), std::string(text_of(proof->bytes))).proved_entries,
        0U);

    in.attachments = receipt_files(in, proof);
    ASSERT_EQ(in.attachments.size(), 2U);
    EXPECT_EQ(in.attachments[0].bytes, to_bytes(in.facts.last_checkpoint->text));
    const Document receipt = make_receipt(in);
    EXPECT_EQ(receipt.attachments.size(), 2U);
    EXPECT_THAT(test::text_of(receipt),
                AllOf(HasSubstr("--proof case.tlog-proof"), HasSubstr("pdfdetach -saveall")));
    if (!has_tools()) continue;
    write("receipt.pdf", write_pdf(receipt));
    EXPECT_THAT(tool({"pdfinfo", "receipt.pdf"}), HasSubstr("Pages:           1\n"));
    tool({"pdfdetach", "-saveall", "receipt.pdf"});
    std::ifstream saved(temporary_ / "case.tlog-proof", std::ios::binary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(saved), {}), text_of(proof->bytes));
  }
  // Nobody is sent to a file that is not there.
  EXPECT_THAT(test::text_of(make_receipt(input())),
              AllOf(Not(HasSubstr("--proof")), Not(HasSubstr("pdfdetach"))));
}

TEST_F(ReportDocument, CarriesNoProofAlongThatDoesNotHold) {
  const ComparedLog log{archive_.log_folder(), archive_.device(), {}};
  const archive::OutsideNote sound{
      "sound", std::string(text_of(log_proof_file(folder_, input(), std::nullopt, log)->bytes))};
  archive::VerifyOptions options = archive_.options();
  options.log_proof = sound;
  const std::optional<Attachment> given = log_proof_file(folder_, input(options), sound, log);
  ASSERT_TRUE(given);
  EXPECT_EQ(text_of(given->bytes), sound.text) << "as it was given, and judged";

  // One that was changed, or is another case's, stays behind; no other one takes its place.
  archive::OutsideNote changed = sound;
  changed.text[changed.text.find("index ") + 6] = '9';
  options.log_proof = changed;
  EXPECT_FALSE(log_proof_file(folder_, input(options), changed, log));
  const fs::path second = test::SampleCase::write(archive_);
  options.log_proof = sound;
  ReportInput of_second = input(options);
  of_second.verification = archive::verify_case(second, options);
  EXPECT_FALSE(log_proof_file(second, of_second, sound, log));

  // None is made of a log that was not compared, does not know the case's end, or is not there.
  archive::VerifyOptions without = archive_.options();
  without.log.reset();
  EXPECT_FALSE(log_proof_file(folder_, input(without), std::nullopt, log));
  EXPECT_FALSE(log_proof_file(folder_, input(), std::nullopt, std::nullopt));
  EXPECT_FALSE(log_proof_file(folder_, input(), std::nullopt,
                              ComparedLog{temporary_ / "nowhere", archive_.device(), {}}));
  const crypto::SigningKey stranger = crypto::SigningKey::generate();
  EXPECT_FALSE(log_proof_file(
      folder_, input(), std::nullopt,
      ComparedLog{archive_.log_folder(), crypto::VerifierKey{"or3", stranger.public_key()}, {}}));
}

// Anybody who writes to the folder can: no token is over the newest checkpoint of a case.
TEST_F(ReportDocument, ReceiptOfACheckpointWithForeignSignaturesHoldsTheDevicesAlone) {
  const ReportInput before = input();
  const StoredNote& note = *before.facts.last_checkpoint;
  const std::string foreign = "\u2014 witness.example/w " +
                              crypto::to_base64(Bytes(3000, std::byte{7}), crypto::Base64Padding::kPadded) +
                              "\n";
  const std::size_t signatures = note.text.rfind("\n\n") + 2;
  for (const std::string& changed :
       {note.text + foreign, note.text.substr(0, signatures) + foreign + note.text.substr(signatures)}) {
    std::ofstream(folder_ / note.file, std::ios::binary) << changed;
    const ReportInput in = input();
    ASSERT_EQ(in.verification.verdict, before.verification.verdict);
    ASSERT_EQ(in.facts.last_checkpoint->text, changed);
    const Document receipt = make_receipt(in);
    const std::string text = test::text_of(receipt);
    // As many bytes are compared as code and file have in common.
    const std::size_t same = changed.starts_with(note.text) ? note.text.size() : signatures + 4;
    EXPECT_THAT(text, HasSubstr("cmp -n " + std::to_string(same) + " - " + note.file));
    if (!has_tools()) continue;
    write("receipt.pdf", write_pdf(receipt));
    tool({"pdftoppm", "-r", "150", "-png", "receipt.pdf", "page"});
    EXPECT_EQ(tool({"zbarimg", "--quiet", "--raw", "-Sbinary", "page-1.png"}), note.text);
  }
}

TEST_F(ReportDocument, CertificateHoldsWhatWasFoundAndLeavesBlankWhatAPersonMustSay) {
  const ReportInput in = input();
  const std::string text = test::text_of(make_certificate(in));
  EXPECT_THAT(text, HasSubstr("✓ INTACT\n"));
  EXPECT_THAT(text, HasSubstr(crypto::to_hex(*in.facts.root)));
  EXPECT_THAT(text, HasSubstr(archive_.device().to_string()));
  EXPECT_THAT(text, HasSubstr("Signature | ____"));
  EXPECT_THAT(text, HasSubstr("I declare under penalty of perjury"));
  EXPECT_THAT(text, HasSubstr("That an outside clock confirms"));
  EXPECT_THAT(text, HasSubstr("No key was given that opens them"));
  EXPECT_THAT(text, Not(HasSubstr("That everything was recorded")));
}

// Whoever signs it does so under penalty of perjury.
TEST_F(ReportDocument, CertificateSaysWhoseTimeStampsThereAre) {
  ReportInput in = input();
  const auto text = [&] { return test::text_of(make_certificate(in)); };
  const char* const outside = "Time-stamping authorities outside the recorder signed";
  ASSERT_EQ(in.verification.time, archive::TimeProof::kSelfIssued);
  EXPECT_THAT(text(), AllOf(HasSubstr("part of the recorder signed, by the recorder's own clock"),
                            HasSubstr("That an outside clock confirms any of the times"),
                            Not(HasSubstr(outside)), Not(HasSubstr("Time-stamping authorities sign"))));
  in.verification.time = archive::TimeProof::kNone;
  EXPECT_THAT(text(), AllOf(HasSubstr("No time stamp of an authority could be relied on"),
                            HasSubstr("That an outside clock confirms any of the times"),
                            Not(HasSubstr(outside)), Not(HasSubstr("Time-stamping authorities sign"))));
  in.verification.time = archive::TimeProof::kExternalInPart;
  in.verification.outside_entries = 3;
  EXPECT_THAT(text(), AllOf(HasSubstr(outside), HasSubstr("as far as entry 2 of the ledger. Of what follows"),
                            HasSubstr("That an outside clock confirms all of the times")));
  in.verification.time = archive::TimeProof::kExternal;
  EXPECT_THAT(text(), AllOf(HasSubstr(outside), Not(HasSubstr("That an outside clock confirms"))));
}

TEST_F(ReportDocument, CertificateSaysWhatNoLogShowed) {
  const std::string missing = "which was not compared, or knows it only in part";
  EXPECT_THAT(test::text_of(make_certificate(input())), Not(HasSubstr(missing)));
  archive::VerifyOptions options = archive_.options();
  options.log.reset();
  EXPECT_THAT(test::text_of(make_certificate(input(options))), HasSubstr(missing));
}

TEST_F(ReportDocument, CertificateOfARecordWithGapsSaysThatNotEverythingIsThere) {
  ReportInput in = input();
  in.verification.verdict = archive::Verdict::kIntactWithGaps;
  in.verification.time = archive::TimeProof::kExternal;
  const std::string text = test::text_of(make_certificate(in));
  EXPECT_THAT(text, HasSubstr("That everything was recorded"));
  EXPECT_THAT(text, Not(HasSubstr("That an outside clock confirms")));
}

// sha256sum of such a file gives another hash than its entry: nobody could swear that each was compared.
TEST_F(ReportDocument, CertificateOfARekeyedExcerptSaysWhatHasTheEntrysHash) {
  take_rekeyed_excerpt();
  const ReportInput in = input_of_reader();
  ASSERT_EQ(in.verification.verdict, archive::Verdict::kIntactExcerpt);
  const std::uint64_t named = archive::named_files(in.verification);
  const std::string text = test::text_of(make_certificate(in));
  EXPECT_THAT(text,
              Not(HasSubstr("of the " + std::to_string(named) + " files of the copy that entries name")));
  EXPECT_THAT(text,
              AllOf(HasSubstr("of the " + std::to_string(named - 1)),
                    HasSubstr("of the copy that entries name and that are as they were recorded"),
                    HasSubstr("1 segment of the copy were sealed anew for another reader: the file of such a "
                              "segment has another hash than its entry states."),
                    HasSubstr("The new header of each yields the same key as the original one.")));
}

// The lines around its stretch are not all of the case's: nobody computed the root from those that are here
// alone.
TEST_F(ReportDocument, CertificateOfAnExcerptSaysWhatItsRootWasComputedFrom) {
  EXPECT_THAT(test::text_of(make_certificate(input())),
              AllOf(HasSubstr("It computed the root of the entries, and"), HasSubstr("\nLedger entries | ")));
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  EXPECT_THAT(test::text_of(make_certificate(input())),
              AllOf(HasSubstr("from those of the excerpt and the hashes that stand for the others"),
                    HasSubstr("Ledger entries in the excerpt | "), Not(HasSubstr("\nLedger entries | "))));
}

// What nobody had signed when a recorder found its case cut off, others may have made.
TEST_F(ReportDocument, FormsSayWhatWasSignedOnlyWhenRecordingWasFoundCutOff) {
  ReportInput in = input();
  const std::string made = "That all of it was made by the recorder. ";
  const std::string late = "Nobody had signed the entries 7 to 9 until recording was found cut off.";
  for (const Document& document : {make_report(in), make_receipt(in), make_certificate(in)}) {
    EXPECT_THAT(test::text_of(document), AllOf(Not(HasSubstr("until recording was")), Not(HasSubstr(made))));
  }
  in.verification.signed_late = {{7, 9}};
  in.verification.found_segments = 2;
  for (const Document& document : {make_report(in), make_receipt(in), make_certificate(in)}) {
    EXPECT_THAT(test::text_of(document),
                AllOf(HasSubstr(late), HasSubstr("Until then no entry named 2 sealed files."),
                      HasSubstr("Whoever could write to the disk meanwhile could have made them")));
  }
  EXPECT_THAT(test::text_of(make_certificate(in)), HasSubstr(made + late));
  if (has_tools()) {
    for (const Language language : {Language::kEnglish, Language::kJapanese}) {
      in.language = language;
      in.verification.signed_late = {{7, 9}, {12, 20}, {30, 40}, {50, 60}, {70, 80}};
      write("receipt.pdf", write_pdf(make_receipt(in)));
      EXPECT_THAT(tool({"pdfinfo", "receipt.pdf"}), HasSubstr("Pages:           1\n"));
    }
  }
  in.language = Language::kEnglish;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("The same holds of 2 more stretches of entries."));
  in.verification.excerpt.emplace();
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("The excerpt shows no signature over the entries 7 to 9"));
}

// A key of the monitor's alone opens no picture.
TEST_F(ReportDocument, CertificateSaysOfWhichPicturesNothingWasSeen) {
  ReportInput in = input();
  in.given.identities.push_back({"identity.txt", {}});
  const std::string all = "That all of it can be played. Of the 4 files that should hold its streams, ";
  const auto text = [&] { return test::text_of(make_certificate(in)); };
  in.verification.contents = archive::OpenedContents{4, 4, 4, {{"endoscope", 3}, {"vitals", 1}}};
  EXPECT_THAT(text(), AllOf(Not(HasSubstr("can be played")), Not(HasSubstr("were not opened"))));
  in.verification.contents = archive::OpenedContents{4, 1, 1, {{"vitals", 1}}};
  EXPECT_THAT(text(), AllOf(HasSubstr(all + "1 were opened, and 1 of these decoded"),
                            HasSubstr("No picture of these streams was looked at: endoscope."),
                            HasSubstr("The pictures of endoscope were not opened")));
  in.verification.contents = archive::OpenedContents{4, 3, 3, {{"endoscope", 2}, {"vitals", 1}}};
  EXPECT_THAT(text(), AllOf(HasSubstr(all + "3 were opened"), Not(HasSubstr("No picture of these"))));
  in.verification.contents = archive::OpenedContents{4, 4, 4, {{"endoscope", 3}, {"vitals", 1}}};
  in.verification.findings.push_back({"events-not-compared", archive::Severity::kNote, {}, {}, {}, "why"});
  EXPECT_THAT(text(), HasSubstr("Not all marks were compared with the events that were opened."));
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("Events and mark entries that were not compared"));
}

TEST_F(ReportDocument, CertificateOfAShortStreamSaysThatNotAllWasRecorded) {
  ReportInput in = input();
  const char* const shorter = "That all of its streams were recorded throughout";
  EXPECT_THAT(test::text_of(make_certificate(in)), Not(HasSubstr(shorter)));
  archive::Finding found;
  found.code = "stream-shorter";
  found.severity = archive::Severity::kNote;
  in.verification.findings.push_back(found);
  EXPECT_THAT(test::text_of(make_certificate(in)), HasSubstr(shorter));
}

archive::Finding doubt(const std::string& code, bool of_log) {
  archive::Finding found;
  found.code = code;
  found.severity = archive::Severity::kUnproven;
  found.of_log = of_log;
  return found;
}

TEST_F(ReportDocument, SaysOfTheCasesOwnDeviceWhetherItsKeyIsTrusted) {
  const auto said = [](const ReportInput& in) {
    const std::string text = test::text_of(make_receipt(in));
    const std::string label = "Key trusted | ";
    const std::size_t at = text.find(label);
    return at == std::string::npos ? text
                                   : text.substr(at + label.size(), text.find('\n', at) - at - label.size());
  };
  const std::string yes = "yes: among the keys that were given for this check";
  EXPECT_EQ(said(input()), yes);
  ReportInput other_log = input();
  other_log.verification.findings.push_back(doubt("device-not-trusted", true));
  EXPECT_EQ(said(other_log), yes) << "it is the log's device that is not trusted";
  ReportInput other_device = input();
  other_device.verification.findings.push_back(doubt("device-not-trusted", false));
  EXPECT_EQ(said(other_device), "no: not among the keys that were given for this check");
  ReportInput roots_alone = input();
  roots_alone.given.devices.clear();
  roots_alone.verification.findings.push_back(doubt("no-trusted-device", false));
  EXPECT_EQ(said(roots_alone), "not judged: no key was given for this check");
  // Of authorities' roots it says nothing.
  archive::VerifyOptions no_roots = archive_.options();
  no_roots.trust = nullptr;
  EXPECT_EQ(said(input(no_roots)), yes);
}

TEST_F(ReportDocument, OfAClockThatWasSetSaysByHowMuchTheTimesAreApart) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  sample.writer().append({archive::ClockEntry{true, 0, 0, 10'000'000'000}}, archive_.now());
  sample.close();
  folder_ = sample.folder();
  const ReportInput in = input();
  ASSERT_EQ(in.verification.verdict, archive::Verdict::kIntact);
  const char* const set = "by the device's clock, which was set since the opening, by +10.000 s in all";
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(set));
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr(set));
  EXPECT_THAT(test::text_of(make_certificate(in)),
              AllOf(HasSubstr("that clock was set since the opening, by +10.000 s in all"),
                    HasSubstr("That the times above by the recorder's clock tell how long")));
}

/// Its own time-stamps count no more; the record that was begun in time does.
ReportInput of_renewed(ReportInput in) {
  in.verification.time = archive::TimeProof::kNone;
  archive::EvidenceReport& evidence = in.verification.evidence.emplace();
  evidence.holds = evidence.outside = true;
  evidence.time_stamps = 1;
  evidence.entries = evidence.later_entries = in.verification.entries;
  evidence.since = evidence.newest = parse_utc("2027-01-01T00:00:00Z");
  return in;
}

TEST_F(ReportDocument, OfARenewedCaseDoesNotSayThatNothingProvesWhenItExisted) {
  const ReportInput in = of_renewed(input());
  for (const Document& document : {make_report(in), make_receipt(in), make_certificate(in)}) {
    const std::string text = test::text_of(document);
    EXPECT_THAT(text, Not(HasSubstr("when it existed is not proved")));
    EXPECT_THAT(text, Not(HasSubstr("No time stamp of an authority")));
    EXPECT_THAT(text, HasSubstr("ledger entries are proved since 2027-01-01 00:00:00 UTC by one time stamp"));
  }
  EXPECT_THAT(test::text_of(make_certificate(in)), HasSubstr("An evidence record (RFC 4998) carries"));
}

TEST_F(ReportDocument, AReceiptOfARenewedCaseWhoseClockWasSetHasOnePage) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  for (const Language language : {Language::kEnglish, Language::kJapanese}) {
    ReportInput in = of_renewed(input(archive_.options(), language));
    in.verification.verdict = archive::Verdict::kIntactWithGaps;
    in.facts.clock_set = true;
    in.facts.clock_set_ns = -3'600'000'000'000;
    write("receipt.pdf", write_pdf(make_receipt(in)));
    EXPECT_THAT(tool({"pdfinfo", "receipt.pdf"}), HasSubstr("Pages:           1\n"));
  }
}

TEST_F(ReportDocument, AReceiptSendsNobodyToAListThatItDoesNotHave) {
  ReportInput in = input();
  in.verification.verdict = archive::Verdict::kIntactWithGaps;
  for (const Document& document : {make_receipt(in), make_certificate(in)}) {
    EXPECT_THAT(test::text_of(document),
                AllOf(HasSubstr("the verification report lists it"), Not(HasSubstr("this report lists"))));
  }
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("this report lists it"));
}

TEST_F(ReportDocument, CertificateIsRefusedWhereNobodyCouldSignIt) {
  using archive::Verdict;
  for (const Verdict verdict : {Verdict::kUnproven, Verdict::kIncomplete, Verdict::kTampered}) {
    ReportInput in = input();
    in.verification.verdict = verdict;
    EXPECT_THROW(make_certificate(in), UsageError);
  }
  EXPECT_THROW(make_certificate(input(archive_.options(), Language::kJapanese)), UsageError);
}

TEST_F(ReportDocument, ReceiptOfACaseWithoutOutsideTimeSaysSo) {
  ReportInput in = input();
  ASSERT_EQ(in.verification.time, archive::TimeProof::kSelfIssued);
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("no clock outside stands behind them"));
  in.verification.time = archive::TimeProof::kExternalInPart;
  in.verification.outside_entries = 3;
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("as far as entry 2 of its ledger"));
  in.verification.time = archive::TimeProof::kExternal;
  EXPECT_THAT(test::text_of(make_receipt(in)), Not(HasSubstr("\n- ")));
}

TEST_F(ReportDocument, ReceiptOfATamperedCaseSaysSoOnOnePage) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  change_byte("segments/endoscope/00000001.ts.age", 500);
  write("receipt.pdf", write_pdf(make_receipt(input())));
  EXPECT_THAT(tool({"pdfinfo", "receipt.pdf"}), HasSubstr("Pages:           1\n"));
  EXPECT_THAT(tool({"pdftotext", "receipt.pdf", "-"}), HasSubstr("DOES NOT HOLD (TAMPERED)"));
}

TEST_F(ReportDocument, ReceiptWithoutACheckpointIsRefused) {
  fs::remove_all(folder_ / "checkpoints");
  EXPECT_THROW(make_receipt(input()), UsageError);
}

TEST_F(ReportDocument, ReceiptWithoutACheckpointOfTheEntriesThatAreThereIsRefused) {
  change_byte("ledger.jsonl", 2);
  const ReportInput in = input();
  EXPECT_THROW(make_receipt(in), UsageError);
  EXPECT_THAT(test::text_of(make_report(in)),
              AllOf(HasSubstr("There is no checkpoint that the device signed of these entries."),
                    Not(HasSubstr("Root that it signs"))));
}

// It would state a root that the device never signed.
TEST_F(ReportDocument, NothingStatesACheckpointThatDoesNotHold) {
  const std::string forged =
      "kiroku/or3/" + name_in(folder_.string()) + "\n9999\n" +
      crypto::to_base64(Bytes(32, std::byte{7}), crypto::Base64Padding::kPadded) + "\n\n\u2014 or3 " +
      crypto::to_base64(Bytes(68, std::byte{7}), crypto::Base64Padding::kPadded) + "\n";
  const ReportInput before = input();
  write_in_case("checkpoints/00009999.note", forged);
  ReportInput in = input();
  ASSERT_EQ(in.verification.verdict, archive::Verdict::kTampered);
  in.attachments = receipt_files(in, std::nullopt);
  EXPECT_EQ(in.attachments[0].bytes, to_bytes(before.facts.last_checkpoint->text));
  const std::string root = crypto::to_hex(*before.facts.root);
  EXPECT_THAT(test::text_of(make_receipt(in)), AllOf(HasSubstr(root), Not(HasSubstr("9999.note"))));
  EXPECT_THAT(test::text_of(make_report(in)),
              AllOf(HasSubstr("Last checkpoint that holds | " + before.facts.last_checkpoint->file + " ("),
                    HasSubstr("Root that it signs | " + root)));
}

}  // namespace
}  // namespace kiroku::report
