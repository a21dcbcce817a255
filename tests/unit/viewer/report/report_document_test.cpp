#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "tests/support/nanoseconds.h"
#include "tests/unit/viewer/report/report_case.h"
#include "viewer/report/document_parts.h"
#include "viewer/report/html_writer.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/time_figure.h"

namespace kiroku::report {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST_F(ReportDocument, NamesConsentsAndWithdrawalsOfThisCaseAlone) {
  const std::string id = folder_.filename().string();
  const auto consents = [&] {
    return read_stated_consents(archive_.log_folder(), archive_.options().devices, id);
  };
  ReportInput made = input();
  made.consents = consents();
  EXPECT_THAT(test::text_of(make_report(made)), Not(HasSubstr("Consent to the use of the case")));
  const auto log = archive::ApplianceLog::open(archive::real_file_system(), archive_.log_folder(),
                                               archive_.key(), archive_.device().name());
  const auto statement = [](const std::string& case_id, std::vector<std::string> purposes) {
    archive::ConsentStatement says;
    says.case_id = case_id;
    says.purposes = std::move(purposes);
    says.who = "anna";
    return says;
  };
  log->consent_given(statement(id, {"teaching", "research"}));
  log->consent_given(statement("20200101T000000Z-00000000", {"publication"}));
  log->consent_withdrawn(statement(id, {"teaching"}));
  made.consents = consents();
  const std::string text = test::text_of(make_report(made));
  EXPECT_THAT(text, HasSubstr("Consent to the use of the case"));
  EXPECT_THAT(text, HasSubstr(" | consent | teaching, research | "));
  EXPECT_THAT(text, HasSubstr(" | withdrawn | teaching | "));
  EXPECT_THAT(text, Not(HasSubstr("publication")));
  made.language = Language::kJapanese;
  EXPECT_THAT(test::text_of(make_report(made)), HasSubstr(" | 撤回 | teaching | "));
}

TEST_F(ReportDocument, SaysWhereNobodyCanTellWhatWasConsentedTo) {
  fs::remove_all(archive_.log_folder() / "checkpoints");
  fs::create_directory(archive_.log_folder() / "checkpoints");
  ReportInput made = input();
  made.consents =
      read_stated_consents(archive_.log_folder(), archive_.options().devices, folder_.filename().string());
  const std::string text = test::text_of(make_report(made));
  EXPECT_THAT(text, HasSubstr("Could not check: nobody can tell what was consented to"));
}

// Whoever cuts the newest entries off the log, with their checkpoint, cuts a withdrawal off.
TEST_F(ReportDocument, SaysWhereTheLogEndsBeforeWhatWitnessesSaw) {
  const crypto::Checkpoint seen{"kiroku/or3/log", 1000, crypto::sha256({})};
  ReportInput made = input();
  made.consents = read_stated_consents(archive_.log_folder(), archive_.options().devices,
                                       folder_.filename().string(), seen);
  EXPECT_THAT(test::text_of(make_report(made)),
              HasSubstr("Could not check: nobody can tell what was consented to"));
}

TEST_F(ReportDocument, OfAnIntactCaseSaysSoAndWhatItRestsOn) {
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("✓ INTACT\n"));
  EXPECT_THAT(text, HasSubstr("nothing was changed, nothing was removed"));
  EXPECT_THAT(text, HasSubstr("Is every file there, and exactly as it was when it was listed? | ✓ Yes | "));
  EXPECT_THAT(text, HasSubstr("the recorder dropped no frame that reached it. What it recorded as it came "
                              "begins at most 0.0 s after the case and ends at most 1.0 s before the case "
                              "was closed."));
  EXPECT_THAT(text, HasSubstr("| Not checked | No key was given"));
  EXPECT_THAT(text, HasSubstr("! Only from inside"));
  EXPECT_THAT(text, HasSubstr("There is nothing to report."));
  EXPECT_THAT(text, HasSubstr(archive_.device().to_string()));
  EXPECT_THAT(text, HasSubstr("yes: among the keys"));
  EXPECT_THAT(text, HasSubstr("openssl ts -verify -data checkpoints/"));
  EXPECT_THAT(text, Not(HasSubstr("✗")));
}

TEST_F(ReportDocument, OfALedgerThatNobodySignedTellsOfNoDeviceThatSignedIt) {
  ReportInput in = input();
  in.verification.signed_entries = 0;
  EXPECT_THAT(test::text_of(make_report(in)), Not(HasSubstr("checkpoints that a device signed")));
}

TEST_F(ReportDocument, OfALaterVersionSaysThatItsEntriesWereNotCheckedAndNothingElse) {
  ReportInput in = input();
  in.verification = {};
  in.verification.verdict = archive::Verdict::kUnproven;
  in.verification.findings.push_back(
      {"format-newer", archive::Severity::kUnproven, "ledger.jsonl", {}, {}, "it is later", false});
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text,
              AllOf(HasSubstr("of a later version of the format"), HasSubstr("its files, was not checked"),
                    Not(HasSubstr("contradicts itself")), Not(HasSubstr("Nobody signed")),
                    Not(HasSubstr("no time stamp")), Not(HasSubstr("No time stamp"))));
  EXPECT_THROW(make_receipt(in), UsageError);
  in.language = Language::kJapanese;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("より新しい形式"));
}

// An expert types what stands under "Repeating this check".
TEST_F(ReportDocument, ItsCommandsAreNotThoseOfWhoeverMadeTheCase) {
  ReportInput in = input();
  in.facts.tokens.back().token.file = "tokens/1.x.tsr; touch OWNED #";
  const std::string report = test::text_of(make_report(in));
  const std::string commands = report.substr(report.find("openssl ts -verify"));
  EXPECT_THAT(commands, Not(HasSubstr("OWNED")));
  EXPECT_THAT(commands, HasSubstr(" -in tokens/"));

  in.verification.device = "or3';touch${IFS}OWNED;'+07d449ab+AQOhB7";
  const std::string receipt = test::text_of(make_receipt(in));
  write("command",
        to_bytes("kiroku() { printf '%s' \"$4\"; }\n" + receipt.substr(receipt.find("kiroku verify "))));
  EXPECT_EQ(tool({"sh", "-c", "head -n 2 command > two; sh two"}), in.verification.device);
  EXPECT_FALSE(fs::exists(temporary_ / "OWNED"));
}

TEST_F(ReportDocument, AGapMakesNoCaseLonger) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  sample.writer().append(
      {archive::GapEntry{"endoscope", {6'000'000'000, 36'000'000'000'000}, archive::GapCause::kPaused}},
      archive_.now());
  sample.close();
  folder_ = sample.folder();
  EXPECT_THAT(report(archive_.options()), HasSubstr("Length | 0:00:07\n"));
}

// Setting one text of 1 MiB took minutes, and pushed the answers off the first page.
TEST_F(ReportDocument, LongTextsOfACaseAreCutOff) {
  const std::string longest(1U << 20U, 'x');
  ReportInput in = input();
  in.facts.close_reason = "error: " + longest;
  in.verification.device = longest + "+07d449ab+AQOhB7/zzhC+HXDdGOdLwJln5NYwm6UNXx3chmQSVTG4";
  for (int i = 0; i < 1'000; ++i) {
    in.facts.tokens.push_back(in.facts.tokens.back());
    in.facts.tokens.back().entry += 1'000;
    in.facts.tokens.back().token.authority = "authority-" + std::to_string(i);
  }
  in.verification.authorities.clear();  // nobody vouches for any of them
  const Document document = make_report(in);
  const std::string text = test::text_of(document);
  EXPECT_LT(text.size(), 60'000U);
  EXPECT_THAT(text, HasSubstr(std::string(kMostBytesOfName, 'x') +
                              "…+07d449ab+AQOhB7/zzhC+HXDdGOdLwJln5NYwm6UNXx3chmQSVTG4\n"));
  EXPECT_THAT(text, HasSubstr("authority-6, …"));
  EXPECT_FALSE(write_pdf(document).empty());
  // Not within a character, and what misleads is told as such.
  EXPECT_EQ(plain_text(std::string(kMostBytesOfText - 1, 'x') + "手術"),
            std::string(kMostBytesOfText - 1, 'x') + "…");
  EXPECT_EQ(plain_text("\u202E" + std::string(kMostBytesOfText - 3, 'x')),
            "\\u{202E}" + std::string(kMostBytesOfText - 3, 'x'));
}

TEST_F(ReportDocument, SaysYesToNoFileThatWasNotLookedFor) {
  const std::string asked = "Is every file there, and exactly as it was when it was listed? | ";
  for (const char* code :
       {"entry-malformed", "entry-too-long", "ledger-unreadable", "stream-unknown", "segment-name-differs",
        "token-name-differs", "token-repeated", "token-covers-later"}) {
    ReportInput in = input();
    in.verification.findings.push_back({code, archive::Severity::kTampered, {}, 3, {}, "it is wrong"});
    EXPECT_THAT(
        test::text_of(make_report(in)),
        HasSubstr(asked + "! Could not be checked | Every file that could be looked for is there. But"))
        << code;
  }
}

// Whoever changes a line can take away a gap, or a segment with its file.
TEST_F(ReportDocument, OfALedgerThatWasChangedSaysYesToNothingThatItsLinesSay) {
  ReportInput in = input();
  in.verification.findings.push_back(
      {"ledger-changed", archive::Severity::kTampered, "ledger.jsonl", 3, {}, "it was changed"});
  const std::string text = test::text_of(make_report(in));
  for (const char* asked :
       {"Is every file there, and exactly as it was when it was listed? | ",
        "Was it recorded without a break from beginning to end? | ",
        "Was the recording brought to its end? | ", "Does somebody outside prove when it existed? | ",
        "Does the device's own log know this case, and the same of it? | "}) {
    EXPECT_THAT(text, HasSubstr(std::string(asked) +
                                "! Could not be checked | The lines of the ledger do not hold, so nothing is "
                                "said about this."));
  }
}

TEST_F(ReportDocument, CountsNoFindingsThatItDoesNotHave) {
  ReportInput in = input();
  in.verification.findings.push_back({"gap", archive::Severity::kGap, {}, 3, {}, "it is silent"});
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("(1 finding, see Findings.)"));
  in.verification.findings.push_back(
      {"more-findings", archive::Severity::kNote, {}, {}, {}, "59000 more of gap"});
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("(at least 1 finding, see Findings.)"));
}

// A figure that is higher than a page is cut off at its foot.
TEST_F(ReportDocument, ItsFigureStaysOnThePageAndHasFewLines) {
  ReportInput in = input();
  const archive::StreamReport one = in.verification.streams.front();
  while (in.verification.streams.size() < 256) {
    in.verification.streams.push_back(one);
    in.verification.streams.back().info.name = "s" + std::to_string(in.verification.streams.size());
  }
  for (std::int64_t i = 0; i < 100'000; ++i) {
    in.facts.gaps.push_back({"endoscope", {i * 10'000, i * 10'000 + 1}, archive::GapCause::kOverload});
    in.facts.tokens.push_back(in.facts.tokens.back());
    in.facts.tokens.back().token.exchange = {i * 10'000, i * 10'000};
  }
  const Figure figure = time_figure(in.verification, in.facts, Language::kEnglish, kTextWidth);
  EXPECT_LT(figure.height, 650);
  EXPECT_LT(figure.shapes.size(), 5'000U);
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr("224 further streams are not drawn"));
  EXPECT_THAT(text, HasSubstr("s256 | video"));
}

// Whoever can sign in the device's name, or find another text with the same hash, can make all of it anew.
TEST_F(ReportDocument, SaysYesToNothingThatRestsOnAnAlgorithmThatEnded) {
  const evidence::Policy ended = evidence::Policy::parse(
      "[[algorithm]]\nname=\"sha256\"\n[[algorithm]]\nname=\"ecdsa\"\n[[algorithm]]\nname=\"rsa\"\n"
      "[[algorithm]]\nname=\"ed25519\"\nuntil=2029-12-31\n",
      "policy.toml");
  archive::VerifyOptions options = archive_.options();
  options.policy = &ended;
  options.now = *parse_utc("2029-01-01T00:00:00Z");
  EXPECT_THAT(report(options), HasSubstr("signed by the device it names? | ✓ Yes"));
  options.now = *parse_utc("2046-01-01T00:00:00Z");
  ReportInput in = input(options);
  in.given.policy.push_back({"policy.toml", crypto::sha256({})});
  in.given.evidence.push_back({"case.ers", crypto::sha256({})});
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr("COULD NOT BE PROVED"));
  EXPECT_THAT(text, Not(HasSubstr("| ✓ Yes")));
  EXPECT_THAT(text, Not(HasSubstr(": ✓ Yes]")));
  EXPECT_THAT(text, HasSubstr("By the policy given, an algorithm on which the case rests counts no more"));
  // Whoever repeats the check without them is told otherwise.
  EXPECT_THAT(text, HasSubstr(".pem --log LOG --evidence RECORD.ers --policy POLICY.toml"));
  EXPECT_THAT(text, HasSubstr("until when algorithms count: policy.toml (SHA-256 "));
  EXPECT_THAT(text, HasSubstr("evidence record that had to hold: case.ers (SHA-256 "));
}

TEST_F(ReportDocument, SaysWhatTheLogAndCheckpointsKeptElsewhereWereOfWhichItSpeaks) {
  ReportInput in = input();
  in.given.log.clear();
  EXPECT_THAT(test::text_of(make_report(in)), Not(AnyOf(HasSubstr("--log"), HasSubstr("--against"))));
  in.given.log = {{"log", {}}};
  in.given.against = given_notes({{"kept.note", "a"}, {"other.note", "b"}});
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr(".pem --log LOG --against NOTE --against NOTE"));
  EXPECT_THAT(text,
              HasSubstr("checkpoints kept elsewhere: kept.note (SHA-256 ca978112ca1bbdcafac231b39a23dc4d"));
  EXPECT_THAT(text, HasSubstr("other.note (SHA-256 3e23e8160039594a33894f6564e1b134"));
}

TEST_F(ReportDocument, OfATamperedCaseNamesPlaceAndMeaning) {
  change_byte("segments/endoscope/00000001.ts.age", 500);
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("✗ DOES NOT HOLD (TAMPERED)\n"));
  EXPECT_THAT(text,
              HasSubstr("| ✗ No | A file has not the hash the ledger states. (1 finding, see Findings.)"));
  EXPECT_THAT(text, AllOf(HasSubstr("file-hash-differs"), HasSubstr("segments/endoscope/00000001.ts.age")));
  EXPECT_THAT(text, HasSubstr("[Segments: ✗ No]"));
  EXPECT_THAT(text, HasSubstr("[Ledger: ✓ Yes]"));
}

TEST_F(ReportDocument, OfAnExcerptSaysWhatPartItIsAndNothingOfTheRest) {
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("✓ INTACT EXCERPT\n"));
  EXPECT_THAT(text, HasSubstr("This is a part of a recording, not the recording."));
  EXPECT_THAT(text,
              HasSubstr("Is every file of the excerpt there, and exactly as it was when it was listed? | "
                        "✓ Yes | "));
  EXPECT_THAT(text, HasSubstr("endoscope: 1 of 3 sealed files"));
  EXPECT_THAT(text, HasSubstr("Part of the case | from 0:00:02.000 to 0:00:04.000 on the case clock"));
  EXPECT_THAT(text, HasSubstr("Leaves out | the streams vitals; everything before and after"));
  EXPECT_THAT(
      text, HasSubstr("2026-08-06 09:00:00 UTC by Dr. Mori (the excerpt says so itself; nothing proves it)"));
  EXPECT_THAT(text, HasSubstr("endoscope | video | 0:00:02.000 | 0:00:04.000 | 1 | 50 | 0 | none | "));
  EXPECT_THAT(text, HasSubstr("Whether the whole case still exists cannot be told from an excerpt."));
  EXPECT_THAT(text, Not(HasSubstr("Is every file there, and")));
  EXPECT_THAT(text, Not(HasSubstr("from beginning to end")));
  EXPECT_THAT(text, Not(HasSubstr("vitals | vital signs")));
  EXPECT_THAT(text, Not(HasSubstr("Patient data")));
}

TEST_F(ReportDocument, OfARekeyedExcerptSaysWhatHasTheHashOfTheEntry) {
  take_rekeyed_excerpt();
  const ReportInput in = input_of_reader();
  ASSERT_EQ(in.verification.verdict, archive::Verdict::kIntactExcerpt);
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, Not(HasSubstr("that are here, and each has the hash that they state")));
  EXPECT_THAT(text,
              HasSubstr("1 were sealed anew for another reader, and have other hashes: of each of these "
                        "the original header, kept beside, and the payload together have the hash"));
  EXPECT_THAT(text, HasSubstr("The new header of each yields the same key as the original one."));
  EXPECT_THAT(text, HasSubstr("1 of these were sealed anew since, and are hashed with the original header"));
  const std::string japanese = test::text_of(make_report(input_of_reader(Language::kJapanese)));
  EXPECT_THAT(japanese, AllOf(HasSubstr("1 個は別の読み手のために封緘し直されており"),
                              HasSubstr("新しいヘッダーの鍵は、いずれも元のヘッダーの鍵と同じです。"),
                              Not(HasSubstr("ここにある5 ファイルは、すべて記載どおりのハッシュ値です"))));
  // Without the key nobody gets the same answer.
  EXPECT_THAT(text.substr(text.find("kiroku verify EXCERPT")), HasSubstr(" -i IDENTITY.txt"));

  const std::string unopened = report(archive_.options());
  EXPECT_THAT(unopened, HasSubstr("Whether the new headers yield the same keys"));
  EXPECT_THAT(unopened, Not(HasSubstr(" -i IDENTITY")));
}

// Anybody can write a ledger that names a device.
TEST_F(ReportDocument, OfALedgerThatNobodySignedSaysYesToNothing) {
  archive_.clear();
  test::SampleCase sample(archive_);
  archive_.now_ns = 3 * kSecond;
  sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond})}, archive_.now());
  folder_ = sample.folder();
  fs::remove_all(folder_ / "checkpoints");
  fs::create_directory(folder_ / "checkpoints");
  const ReportInput input = this->input();
  ASSERT_EQ(input.verification.signatures, archive::SignaturesChecked::kNone);
  EXPECT_EQ(input.verification.verdict, archive::Verdict::kIncomplete);
  const std::string text = test::text_of(make_report(input));
  EXPECT_THAT(text, Not(HasSubstr("| ✓ Yes | ")));
  EXPECT_THAT(text, Not(HasSubstr("yes: among the keys")));
  EXPECT_THAT(
      text, HasSubstr("signed by the device it names? | ! Could not be checked | Nobody signed the ledger"));
}

TEST_F(ReportDocument, OfAnUnfinishedCaseSaysHowMuchOfItIsSigned) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.stamp();
  archive_.now_ns = 3 * kSecond;
  sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond})}, archive_.now());
  folder_ = sample.folder();
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("! In part | 3 ledger entries and 1 checkpoint agree"));
  EXPECT_THAT(text, HasSubstr("Nobody signed what follows entry 0: anybody can have written it."));
  EXPECT_THAT(text, HasSubstr("from beginning to end? | ! In part | The case was not closed, or"));
  EXPECT_THAT(
      text,
      HasSubstr("! In part | The appliance log that was given knows the case as it is here up to entry 0."));
}

// The log as it was after the opening, and a line of an end that anybody who can write to the disk can add.
TEST_F(ReportDocument, AnEndInTheLogThatNobodySignedIsNoEnd) {
  const std::string question = "Does the device's own log know this case, and the same of it? | ";
  const archive::VerifyOptions options = archive_.options();
  EXPECT_THAT(report(options), HasSubstr(question + "✓ Yes | "));
  std::vector<fs::path> notes;
  for (const auto& note : fs::directory_iterator(*options.log / "checkpoints")) notes.push_back(note.path());
  std::ranges::sort(notes);
  fs::remove(notes.back());
  EXPECT_THAT(report(options),
              AllOf(Not(HasSubstr(question + "✓ Yes | ")), HasSubstr(question + "! In part | ")));
}

TEST_F(ReportDocument, OfWhatIsMissingNobodySawTheContents) {
  ReportInput input = this->input();
  input.given.identities.push_back({"identity.txt", {}});
  fs::remove(folder_ / "segments/endoscope/00000001.ts.age");
  input.verification = archive::verify_case(folder_, archive_.options());
  input.verification.contents = archive::OpenedContents{3, 3, 3};
  EXPECT_THAT(
      test::text_of(make_report(input)),
      HasSubstr("! In part | Of 4 sealed files that the ledger lists, 3 sealed files are here as listed"));
}

// Somebody counts the files of the folder, and a certificate is signed under penalty of perjury.
TEST_F(ReportDocument, CountsTheFilesThatTheLedgerNamesAndSaysWhatElseIsThere) {
  const auto named_in = [](const fs::path& folder) {
    std::uint64_t named = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      const std::string path = entry.path().lexically_relative(folder).string();
      const bool is_named = path.starts_with("segments/") || path.starts_with("tokens/") ||
                            path == std::string(archive::kSubjectFile);
      if (entry.is_regular_file() && is_named) ++named;
    }
    return std::to_string(named);
  };
  ReportInput whole = input();
  EXPECT_THAT(test::text_of(make_report(whole)),
              HasSubstr("The ledger names " + named_in(folder_) +
                        " files, and each has the hash that it states. Beside these are the ledger, its "
                        "checkpoints, the device's public key and certificates of authorities, "));
  EXPECT_THAT(test::text_of(make_certificate(whole)),
              HasSubstr("the SHA-256 hash (FIPS 180-4) of the " + named_in(folder_) +
                        " files of the copy that entries name, and compared each with its entry."));
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  EXPECT_THAT(test::text_of(make_report(input())),
              HasSubstr("Its lines name " + named_in(folder_) +
                        " files that are here, and each has the hash that they state"));
}

// Whoever repeats the check would else take what a policy removed for files that are missing.
TEST_F(ReportDocument, SaysOfErasedFilesThatRepeatingTheCheckNamesThem) {
  ReportInput in = input();
  const std::string usual = "Every file is as the ledger lists it (no output means yes):";
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(usual));
  in.verification.streams.front().erased_segments = 2;
  EXPECT_THAT(
      test::text_of(make_report(in)),
      AllOf(Not(HasSubstr(usual)), HasSubstr("Every file is as the ledger lists it (2 sealed files that "
                                             "were erased are named as missing, and nothing else is):")));
}

TEST_F(ReportDocument, OfAnExcerptWhatIsMissingCountsAmongWhatItShouldHold) {
  archive::ExcerptOptions both = second_segment();
  both.from_ns = 0;
  archive::make_excerpt(folder_, both, temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  const std::uint64_t all = archive::listed_segments(input().verification);
  ASSERT_EQ(all, 2U);
  fs::remove(folder_ / "segments/endoscope/00000001.ts.age");
  ReportInput input = this->input();
  EXPECT_EQ(archive::listed_segments(input.verification), all);
  input.given.identities.push_back({"identity.txt", {}});
  input.verification.contents = archive::OpenedContents{1, 1, 1};
  EXPECT_THAT(
      test::text_of(make_report(input)),
      HasSubstr("! In part | Of 2 sealed files that the ledger lists, 1 sealed file are here as listed"));
}

TEST_F(ReportDocument, OfAnExcerptSaysHowMuchOfItTheLogKnows) {
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  ReportInput input = this->input();
  ASSERT_EQ(input.verification.in_log->entries, input.verification.excerpt->size);
  const std::string question = "Does the device's own log know this case, and the same of it? | ";
  EXPECT_THAT(test::text_of(make_report(input)), HasSubstr(question + "✓ Yes | "));
  // Entries 1 to 9 are here.
  ASSERT_EQ(input.verification.excerpt->first_entry, 1U);
  ASSERT_EQ(input.verification.excerpt->size, 10U);
  const std::string whole = " Whether the whole case still exists cannot be told from an excerpt.";
  input.verification.in_log->entries = 4;
  EXPECT_THAT(
      test::text_of(make_report(input)),
      AllOf(Not(HasSubstr(question + "✓ Yes | ")),
            HasSubstr("knows the case, and the part of its ledger that is here up to entry 3. It says "
                      "nothing of entries 4 to 9: a proof of the case's end, made on the recorder, does." +
                      whole)));
  input.verification.in_log->entries = 0;
  EXPECT_THAT(
      test::text_of(make_report(input)),
      AllOf(Not(HasSubstr(question + "✓ Yes | ")),
            HasSubstr("knows that the case was opened. It says nothing of the part of its ledger that is "
                      "here, entries 1 to 9: a proof of the case's end, made on the recorder, does." +
                      whole)));
}

// A time stamp at the edge of the figure would be one of a time at which there was none.
TEST_F(ReportDocument, TheFigureOfAnExcerptHasTheTimesOfTheCaseAndNothingFromOutsideOfIt) {
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  ReportInput in = input();
  constexpr std::int64_t kNs = 1'000'000'000;
  in.facts.gaps = {{"endoscope", {0, kNs}, archive::GapCause::kSignalLost},
                   {"endoscope", {5 * kNs, 6 * kNs}, archive::GapCause::kSignalLost}};
  ASSERT_FALSE(in.facts.tokens.empty());
  in.facts.tokens.resize(1, in.facts.tokens.front());
  in.facts.tokens.front().token.exchange = {kNs / 10, kNs / 10};
  const auto told = [&] {
    std::pair<std::vector<std::string>, std::size_t> words_and_lines{};
    for (const auto& shape : time_figure(in.verification, in.facts, Language::kEnglish, kTextWidth).shapes) {
      if (const auto* words = std::get_if<Lettering>(&shape)) words_and_lines.first.push_back(words->text);
      if (std::holds_alternative<Stroke>(shape)) ++words_and_lines.second;
    }
    return words_and_lines;
  };
  const auto [words, lines] = told();
  EXPECT_THAT(words, testing::ElementsAre("endoscope", testing::_, "0:00:02", "0:00:03", "0:00:04"));
  EXPECT_EQ(lines, 4U) << "the axis and its ticks";
  in.facts.tokens.front().token.exchange = {3 * kNs, 3 * kNs};
  in.facts.gaps.push_back({"endoscope", {2 * kNs, 3 * kNs}, archive::GapCause::kSignalLost});
  EXPECT_EQ(told().second, 4U + 1U + 6U) << "what is of its time";
  // Anybody can make a token of any time.
  in.facts.tokens.push_back(in.facts.tokens.front());
  in.facts.tokens.back().entry += 1'000;
  in.facts.tokens.back().token.exchange = {2 * kNs, 2 * kNs};
  EXPECT_EQ(told().second, 4U + 1U + 6U) << "what does not hold";
}

TEST_F(ReportDocument, OfAnExcerptThatReachesTheEndDoesNotSayThatTheEndIsNotPartOfIt) {
  archive::ExcerptOptions options = second_segment();
  archive::make_excerpt(folder_, options, temporary_ / "excerpt");
  options.to_ns = 60'000'000'000;
  archive::make_excerpt(folder_, options, temporary_ / "to-the-end");
  folder_ = temporary_ / "excerpt";
  const std::string closed = "Its lines show that the case was closed";
  const std::string early = report(archive_.options());
  folder_ = temporary_ / "to-the-end";
  const std::string late = report(archive_.options());
  EXPECT_THAT(late, HasSubstr(closed));
  EXPECT_THAT(late, Not(HasSubstr("the end of the case is not part of it")));
  EXPECT_NE(early.find(closed) == std::string::npos, early.find("Ended by") != std::string::npos);
}

TEST_F(ReportDocument, OfAnExcerptOfNothingSaysYesToNothingThatWasNotLookedAt) {
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  std::fstream document(folder_ / "excerpt.json", std::ios::in | std::ios::out);
  std::string json;
  std::getline(document, json);
  json.replace(json.find("[\"endoscope\"]"), 13, "[]");
  write("excerpt/excerpt.json", to_bytes(json + "\n"));
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("✗ DOES NOT HOLD (TAMPERED)\n"));
  EXPECT_THAT(text, HasSubstr("as it was when it was listed? | ! Could not be checked | "));
  EXPECT_THAT(text, HasSubstr("in its stretch of time? | ! Could not be checked | "));
  EXPECT_THAT(text, Not(HasSubstr("✓ Yes")));
}

TEST_F(ReportDocument, OfADamagedLedgerIsWrittenAllTheSame) {
  change_byte("ledger.jsonl", 2);
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("✗ DOES NOT HOLD (TAMPERED)\n"));
  EXPECT_THAT(text, HasSubstr("entry-malformed"));
  EXPECT_THAT(text, HasSubstr("Opened | not known"));
  EXPECT_FALSE(write_pdf(make_report(input())).empty());
}

TEST_F(ReportDocument, WithoutTrustCouldNotCheckWhichIsNeitherYesNorNo) {
  archive::VerifyOptions options = archive_.options();
  options.devices.clear();
  options.trust = nullptr;
  options.log.reset();
  const std::string text = report(options);
  EXPECT_THAT(text, HasSubstr("! COULD NOT BE PROVED\n"));
  EXPECT_THAT(text, HasSubstr("| ! Could not be checked | No trusted device key was given."));
  EXPECT_THAT(text, HasSubstr("not judged: no key was given"));
  EXPECT_THAT(text, HasSubstr("nothing: neither keys nor roots"));
  EXPECT_THAT(text, HasSubstr("| Not checked | No appliance log was given."));
  EXPECT_THAT(text, Not(HasSubstr("✗")));
}

TEST_F(ReportDocument, OfACaseThatIsNotClosedSaysNotFinished) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  folder_ = sample.folder();
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("! NOT FINISHED\n"));
  EXPECT_THAT(text, HasSubstr("Was the recording brought to its end? | ! Not finished"));
  EXPECT_THAT(text, HasSubstr("Closed | not closed"));
}

std::optional<archive::InspectionProblem> finds_nothing(const archive::StreamInfo&,
                                                        const archive::SegmentEntry&,
                                                        const crypto::ByteSource&,
                                                        const crypto::AgeIdentities&) {
  return std::nullopt;
}

TEST_F(ReportDocument, SaysThatTheContentsWereLookedIntoOnlyAsFarAsTheyWere) {
  const std::string asked = "Do the sealed pictures and vital signs open, and show what the list says? | ";
  const auto answered = [&](const crypto::AgeIdentities& identities) {
    archive::VerifyOptions options = archive_.options();
    options.identities = &identities;
    options.inspect = finds_nothing;
    ReportInput in = input(options);
    in.given.identities = {{"identity.txt", {}}};
    return test::text_of(make_report(in));
  };
  const crypto::AgeIdentities stranger{
      crypto::parse_identity(crypto::generate_age_key().identity_text.text())};
  std::string text = answered(stranger);
  EXPECT_THAT(text, HasSubstr(asked + "Not checked | The keys that were given opened nothing."));
  EXPECT_THAT(text, HasSubstr("The pictures themselves were not opened"));

  text = answered(archive_.identities());
  EXPECT_THAT(text, HasSubstr(asked + "✓ Yes | 4 sealed files: each was decrypted and decoded"));
  EXPECT_THAT(text, Not(HasSubstr("The pictures themselves were not opened")));

  ReportInput in = input();
  in.given.identities = {{"identity.txt", {}}};
  in.verification.contents = archive::OpenedContents{4, 3, 2};
  text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr(asked + "! In part | Of 4 sealed files that are here 3 were decrypted, and 2"));
}

TEST_F(ReportDocument, OfAStreamThatIsShorterThanTheCaseDoesNotSayYes) {
  const std::string asked = "Was it recorded without a break from beginning to end? | ! In part | ";
  for (const char* code : {"stream-shorter", "segments-sparse", "monitor-silent"}) {
    ReportInput in = input();
    in.verification.findings.push_back({code, archive::Severity::kNote, {}, {}, {}, "something lacks"});
    EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(asked + "No hole")) << code;
    // A gap that somebody states explains itself, and nothing else.
    in.verification.findings.push_back({"gap", archive::Severity::kGap, {}, {}, {}, "signal lost"});
    EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(asked + "Every hole")) << code;
  }
}

// Who reads that it is sealed does not look whether everybody can read it.
TEST_F(ReportDocument, OfPatientDataInTheClearDoesNotSayThatTheyAreSealed) {
  ReportInput in = input();
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("Patient data | sealed in the case"));
  in.verification.findings.push_back(
      {"subject-not-sealed", archive::Severity::kUnproven, "subject.json.age", {}, {}, "in the clear"});
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("Patient data | said to be sealed in the case, and its file is no sealed one"));
}

TEST_F(ReportDocument, OfFilmThatIsNotThereDoesNotSayThatItHasNoBreak) {
  ReportInput in = input();
  in.verification.findings.push_back(
      {"segments-empty", archive::Severity::kUnproven, {}, {}, {}, "a minute without a frame"});
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("Was it recorded without a break from beginning to end? | ! Could not be checked"));
}

// "Yes, with stated gaps" would be the answer where the gaps are all there is.
TEST_F(ReportDocument, OfACaseInWhichNothingWasRecordedDoesNotSayYes) {
  const std::string asked = "Was it recorded without a break from beginning to end? | ";
  ReportInput in = input();
  for (archive::StreamReport& stream : in.verification.streams) {
    if (stream.info.kind != "events") stream.segments = 0;
  }
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(asked + "✗ No | Nothing was recorded"));
  in.verification.findings.push_back({"gap", archive::Severity::kGap, {}, {}, {}, "signal lost"});
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(asked + "✗ No | Nothing was recorded"));
  in.verification.findings.push_back({"stream-empty", archive::Severity::kUnproven, {}, {}, {}, "empty"});
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(asked + "! Could not be checked"));
}

TEST_F(ReportDocument, BesideWhichFilesOfASystemLieDoesNotSayThatNothingWasAdded) {
  ReportInput in = input();
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("nothing was added"));
  for (const std::uint64_t files : {1U, 2U}) {
    in.verification.left_by_systems = files;
    in.verification.findings = {
        {"file-of-a-system", archive::Severity::kNote, "segments/@eaDir/big", {}, {}, "nobody recorded it"}};
    const std::string beside = files == 1 ? "Beside it lies 1 file that nobody recorded"
                                          : "Beside it lie 2 files that nobody recorded";
    for (const std::string& text : {test::text_of(make_report(in)), test::text_of(make_certificate(in))}) {
      EXPECT_THAT(text, Not(HasSubstr("nothing was added")));
      EXPECT_THAT(text, HasSubstr(beside));
    }
  }
}

TEST_F(ReportDocument, OfACaseWithoutStreamsSaysThatNothingWasRecorded) {
  ReportInput in = input();
  in.verification.streams.clear();
  in.verification.verdict = archive::Verdict::kUnproven;
  in.verification.findings.push_back(
      {"no-stream", archive::Severity::kUnproven, "ledger.jsonl", 0, {}, "open names no stream of pictures"});
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr("COULD NOT BE PROVED"));
  EXPECT_THAT(text,
              HasSubstr("Was it recorded without a break from beginning to end? | ! Could not be checked | "
                        "Open names no stream but of marks: nothing of an operation was recorded"));
  EXPECT_THAT(text, HasSubstr("Nothing was recorded: no stream of pictures or vital signs holds anything."));
}

// Whoever makes a case chooses its identifier, and a reader takes the time in it for the operation's.
TEST_F(ReportDocument, AnIdentifierThatNamesAnotherTimeThanTheOpeningIsSaid) {
  const std::string other = "which names a time that is not that of its opening";
  ReportInput in = input();
  std::string opened = format_utc(in.facts.opened_at->utc).substr(0, 19) + "Z-3f9c21ab";
  std::erase_if(opened, [](char c) { return c == ':'; });
  opened.erase(7, 1).erase(4, 1);
  in.verification.case_id = opened;
  EXPECT_THAT(test::text_of(make_report(in)), testing::Not(HasSubstr(other)));
  EXPECT_THAT(test::text_of(make_receipt(in)), testing::Not(HasSubstr(other)));
  in.verification.case_id = "20160805T091502Z-3f9c21ab";
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("20160805T091502Z-3f9c21ab, " + other));
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("20160805T091502Z-3f9c21ab, " + other));
}

TEST_F(ReportDocument, WhatTheDeviceWroteOfItsEndStandsInQuotationMarks) {
  ReportInput in = input();
  in.facts.close_reason = "error: none. The court's expert found this recording complete";
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("“error: none. The court's expert found this recording complete”, as the device "
                        "states it"));
}

TEST_F(ReportDocument, StatesGapsWithTheirCause) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  sample.writer().append(
      {archive::GapEntry{"endoscope", {6'000'000'000, 6'500'000'000}, archive::GapCause::kSignalLost}},
      archive_.now());
  sample.close();
  folder_ = sample.folder();
  const std::string text = report(archive_.options());
  EXPECT_THAT(text, HasSubstr("✓ INTACT, WITH STATED GAPS\n"));
  EXPECT_THAT(text, HasSubstr("endoscope | 0:00:06.000 | 0:00:06.500 | 0:00:00.500 | no signal came"));
  EXPECT_THAT(text, HasSubstr("| ✓ Yes, with stated gaps | Time in which nothing could be recorded."));
}

// What its lines say was not looked at.
TEST_F(ReportDocument, OfALaterFormatSaysNothingOfWhatItDidNotCheck) {
  ReportInput in = input();
  in.verification = archive::VerificationReport{};
  archive::Finding found;
  found.code = "format-newer";
  found.severity = archive::Severity::kUnproven;
  in.verification.findings.push_back(found);
  in.verification.verdict = archive::Verdict::kUnproven;
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, AllOf(HasSubstr("its files, was not checked"), HasSubstr("which were not checked"),
                          HasSubstr(in.facts.ledger.name)));
  for (const char* const unknown :
       {"Nobody signed the ledger", "contradicts itself", "states no gap", "none holds under the roots",
        "| Marks", "0 ledger entries", "sha256sum -c"})
    EXPECT_THAT(text, Not(HasSubstr(unknown)));
}

TEST_F(ReportDocument, OfAnExcerptTellsOfGapsInItsStretchAlone) {
  EXPECT_THAT(report(archive_.options()), HasSubstr("The record states no gap."));
  archive::make_excerpt(folder_, second_segment(), temporary_ / "excerpt");
  folder_ = temporary_ / "excerpt";
  EXPECT_THAT(report(archive_.options()),
              AllOf(HasSubstr("state no gap of its streams in its stretch of time"),
                    Not(HasSubstr("The record states no gap."))));
  ReportInput in = input();
  in.verification.excerpt->with_gaps = true;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("Some of its stretch of time is not in it"));
}

// Some are signed later: when a stream is erased.
TEST_F(ReportDocument, DoesNotSayWhenCheckpointsWereSigned) {
  EXPECT_THAT(report(archive_.options()), AllOf(HasSubstr("signed by or3; the last that holds covers"),
                                                Not(HasSubstr("while it recorded"))));
}

TEST_F(ReportDocument, InJapaneseSaysTheSame) {
  const std::string text = test::text_of(make_report(input(archive_.options(), Language::kJapanese)));
  EXPECT_THAT(text, HasSubstr("✓ 改変なし\n"));
  EXPECT_THAT(text, HasSubstr("| 未検査 |"));
  EXPECT_THAT(text, HasSubstr(archive_.device().to_string()));
}

TEST_F(ReportDocument, IsTheSameBytesForTheSameInput) {
  const ReportInput same = input();
  const Bytes pdf = write_pdf(make_report(same));
  EXPECT_EQ(pdf, write_pdf(make_report(same)));
  EXPECT_EQ(write_html(make_report(same)), write_html(make_report(same)));
  ReportInput later = input();
  later.made += std::chrono::seconds(1);
  EXPECT_NE(pdf, write_pdf(make_report(later)));
}

TEST_F(ReportDocument, AsPdfHasPagesThatCanBeSearched) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  write("report.pdf", write_pdf(make_report(input())));
  const std::string text = tool({"pdftotext", "-layout", "report.pdf", "-"});
  EXPECT_THAT(text, HasSubstr("Verification report"));
  EXPECT_THAT(text, HasSubstr("1 of "));
  EXPECT_THAT(text, HasSubstr("How the proof holds together"));
  EXPECT_THAT(text, HasSubstr("Dr. Sato"));
  // Hashes that need two lines are broken without a hyphen.
  EXPECT_THAT(text, Not(testing::ContainsRegex("[0-9a-f]{20}-\n")));
  const std::string info = tool({"pdfinfo", "report.pdf"});
  EXPECT_THAT(info, HasSubstr("A4"));
  EXPECT_THAT(info, HasSubstr("Author:          Dr. Sato"));
  EXPECT_THAT(info, HasSubstr("Creator:         kiroku 0.1.0"));
}

// The first part of an excerpt's report is longer than a page by a line or two.
TEST_F(ReportDocument, AsPdfLeavesNoPageToALineThatRanOver) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  Document document = make_report(input());
  const auto second_page = [&](std::size_t more) {
    Document longer = document;
    const auto at = std::ranges::find_if(
        longer.blocks, [](const Block& block) { return std::holds_alternative<PageBreak>(block); });
    longer.blocks.insert(at, more, Paragraph{"One line more."});
    write("report.pdf", write_pdf(longer));
    return tool({"pdftotext", "-f", "2", "-l", "2", "-layout", "report.pdf", "-"});
  };
  std::size_t more = 0;
  while (more < 60 && second_page(more).find("One line more.") == std::string::npos) ++more;
  const std::string text = second_page(more);
  EXPECT_THAT(text, HasSubstr("One line more."));
  EXPECT_THAT(text, HasSubstr("How the proof holds together"));
  EXPECT_THAT(second_page(more + 20), Not(HasSubstr("How the proof holds together")));
}

TEST_F(ReportDocument, AsHtmlNeedsNothingElseAndEscapesWhatItShows) {
  ReportInput hostile = input();
  hostile.author = "<script>alert(1)</script>";
  const std::string page = write_html(make_report(hostile));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(testing::ContainsRegex("(src|href)=")));
  EXPECT_THAT(page, HasSubstr("<html lang=\"en\">"));
}

TEST_F(ReportDocument, AsHtmlGivesEachColumnItsShareSoThatNoAnswerIsBroken) {
  EXPECT_THAT(write_html(make_report(input())),
              HasSubstr("<table><colgroup><col style=\"width:35%\"><col style=\"width:20%\"><col "
                        "style=\"width:45%\"></colgroup><tbody>"));
}

TEST_F(ReportDocument, OfManyFindingsRunsOverPagesWithoutLosingOne) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  ReportInput many = input();
  for (int i = 0; i < 300; ++i) {
    many.verification.findings.push_back({"file-missing", archive::Severity::kTampered,
                                          "segments/room/" + std::to_string(10'000'000 + i) + ".ts.age",
                                          std::nullopt, std::nullopt, "the file is not there"});
  }
  // Longer than a page.
  many.verification.findings.push_back({"file-missing", archive::Severity::kTampered, "x", std::nullopt,
                                        std::nullopt, std::string(12'000, 'w')});
  write("report.pdf", write_pdf(make_report(many)));
  const std::string text = tool({"pdftotext", "report.pdf", "-"});
  for (int i = 0; i < 300; ++i) EXPECT_THAT(text, HasSubstr(std::to_string(10'000'000 + i))) << i;
  EXPECT_EQ(std::ranges::count(text, 'w') > 12'000, true);
}

}  // namespace
}  // namespace kiroku::report
