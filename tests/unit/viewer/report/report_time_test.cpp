#include <algorithm>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "archive/verify/report_json.h"
#include "crypto/encoding.h"
#include "tests/unit/viewer/report/report_case.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/proof_files.h"

namespace kiroku::report {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST_F(ReportDocument, SaysHowFarOutsideAuthoritiesProveTheTime) {
  ReportInput in = input();
  in.verification.time = archive::TimeProof::kExternalInPart;
  in.verification.outside_entries = 3;
  in.verification.clocks = {{"embedded", false, 1, {}, {}}};
  in.given.own_roots.push_back({"own-authority.pem", crypto::sha256({})});
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr("! In part | As far as entry 2 of the ledger"));
  EXPECT_THAT(text, HasSubstr("time-stamped it as far as entry 2 of its ledger"));
  EXPECT_THAT(text, HasSubstr("roots of the recorder's own authority: own-authority.pem"));
  EXPECT_THAT(text, HasSubstr("embedded (self-issued)"))
      << "the clock that is compared is the recorder's own";
  in.language = Language::kJapanese;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("台帳の項目 2 まで"));
}

TEST_F(ReportDocument, SaysSinceWhenAnEvidenceRecordProvesTheCaseAndWhatItDoesNot) {
  ReportInput in = input();
  EXPECT_THAT(test::text_of(make_report(in)), Not(HasSubstr("Evidence record")));
  archive::EvidenceReport evidence;
  evidence.file = "case.ers";
  evidence.holds = evidence.outside = true;
  evidence.since = *parse_utc("2026-11-01T00:00:00Z");
  evidence.newest = *parse_utc("2044-03-01T00:00:00Z");
  evidence.ends = *parse_utc("2051-01-01T00:00:00Z");
  evidence.time_stamps = 3;
  evidence.links = {{evidence.since, "CN=First root", true, "sha256", true},
                    {*parse_utc("2033-10-01T00:00:00Z"), "CN=Second root", true, "sha256", false},
                    {evidence.newest, "CN=Third root", true, "sha512", true}};
  evidence.entries = in.verification.entries - 2;
  evidence.files = 12;
  in.verification.evidence = evidence;
  const std::string text = test::text_of(make_report(in));
  const std::string all = std::to_string(in.verification.entries), part = std::to_string(evidence.entries);
  const std::string since =
      " ledger entries are proved since 2026-11-01 00:00:00 UTC by a chain of 3 time stamps, the newest of "
      "2044-03-01 00:00:00 UTC.";
  const std::string proved = "The first " + part + " of " + all + since;
  EXPECT_THAT(text, HasSubstr("- " + proved + "\n")) << "on the first page";
  EXPECT_THAT(text, HasSubstr("# Evidence record\n"));
  EXPECT_THAT(text, HasSubstr("2033-10-01 00:00:00 UTC | CN=Second root | sha256 | the time stamp before\n"));
  EXPECT_THAT(text, HasSubstr("12 files that they name"));
  EXPECT_THAT(
      text,
      HasSubstr(
          "2 entries came later. The record says nothing of them. On the recorder 'kiroku renew --take-in'"));
  {
    ReportInput taken_in = in;
    taken_in.verification.evidence->later_entries = in.verification.entries - 1;
    taken_in.verification.evidence->later_since = *parse_utc("2044-03-01T00:00:00Z");
    const std::string some = test::text_of(make_report(taken_in));
    EXPECT_THAT(some, HasSubstr("1 entries came later. A later time stamp of the record covers them, since "
                                "2044-03-01 00:00:00 UTC."));
    EXPECT_THAT(some, HasSubstr("1 entries came later. The record says nothing of them."));
    taken_in.verification.evidence->later_entries = in.verification.entries;
    EXPECT_THAT(test::text_of(make_report(taken_in)), Not(HasSubstr("says nothing of them")));
  }
  EXPECT_THAT(text, HasSubstr("It does not prove when before that it was recorded"));
  EXPECT_THAT(text, HasSubstr("It must be renewed before 2051-01-01 00:00:00 UTC."));
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("Evidence record | " + proved));
  in.language = Language::kJapanese;
  const std::string japanese = test::text_of(make_report(in));
  EXPECT_THAT(
      japanese,
      HasSubstr("- 台帳の全 " + all + " 項目のうち最初の " + part +
                " 項目が 2026-11-01 00:00:00 UTC から存在したことが、3個のタイムスタンプの連鎖（最新は "
                "2044-03-01 00:00:00 UTC）により証明されています。\n"));
  EXPECT_THAT(japanese, HasSubstr("2 件の項目は、証拠記録の対象ではありません"));
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("証拠記録 | 台帳の全"));

  in.verification.evidence->entries = in.verification.entries;
  EXPECT_THAT(test::text_of(make_receipt(in)),
              HasSubstr("証拠記録 | 台帳の全 " + all + " 項目が 2026-11-01"));

  in.language = Language::kEnglish;
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("Evidence record | All " + all + since));
  in.verification.evidence->outside = false;
  // What no outside clock stands behind is said, and proved to nobody.
  for (const std::string& page : {test::text_of(make_report(in)), test::text_of(make_receipt(in))}) {
    EXPECT_THAT(page,
                HasSubstr("By the recorder's own word all " + all + " ledger entries existed at 2026-11-01"));
    EXPECT_THAT(page, HasSubstr("no outside clock stands behind these times"));
    EXPECT_THAT(page, Not(HasSubstr("proved since")));
  }
  in.verification.evidence->entries = in.verification.entries - 2;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("By the recorder's own word the first " + part +
                                                        " of " + all + " ledger entries existed"));
  in.language = Language::kJapanese;
  EXPECT_THAT(test::text_of(make_receipt(in)), HasSubstr("記録装置自身の申告では、台帳の全 " + all));
  EXPECT_THAT(test::text_of(make_receipt(in)), Not(HasSubstr("証明されています")));
  in.language = Language::kEnglish;
  in.verification.evidence->holds = false;
  in.verification.evidence->refusal = "it is another's";
  const std::string refused = test::text_of(make_report(in));
  EXPECT_THAT(refused,
              HasSubstr("The evidence record proves nothing here. The verifier says: it is another's"));
  EXPECT_THAT(refused, Not(HasSubstr("proved since")));
  in.verification.evidence->could_not_check = true;
  EXPECT_THAT(test::text_of(make_receipt(in)),
              HasSubstr("could not be checked. The verifier says: it is another's"));
}

TEST_F(ReportDocument, TellsNoTimeAndNoLogByWhatEnded) {
  ReportInput in = input();
  in.verification.verdict = archive::Verdict::kUnproven;
  in.verification.time = archive::TimeProof::kNone;
  in.verification.brackets.clear();
  in.verification.findings.push_back(
      {"algorithm-ended", archive::Severity::kUnproven, {}, {}, {}, "ecdsa ended"});
  const std::string ended = test::text_of(make_report(in));
  EXPECT_THAT(ended,
              HasSubstr("an algorithm of its time stamps counts no more: when it existed is not proved"));
  EXPECT_THAT(ended, Not(HasSubstr("Authorities outside the recorder time-stamped it")));
  in.language = Language::kJapanese;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("タイムスタンプのアルゴリズムがもう有効でないため"));

  ReportInput beside = input();
  beside.given.log = {{"log", {}}};
  EXPECT_THAT(test::text_of(make_report(beside)),
              HasSubstr("The appliance log that was given knows its beginning"));
  beside.verification.findings.push_back(
      {"log-algorithm-ended", archive::Severity::kNote, "log/ledger.jsonl", {}, {}, "ed25519 ended", true});
  EXPECT_THAT(test::text_of(make_report(beside)),
              Not(HasSubstr("The appliance log that was given knows its beginning")));
}

TEST_F(ReportDocument, CountsOnlyTheTimeStampsThatHold) {
  ReportInput in = input();
  EXPECT_EQ(in.verification.own_tokens, 3U);
  EXPECT_EQ(in.verification.outside_tokens, 0U);
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("3 time stamps of the recorder's own authority hold"));
  in.verification.time = archive::TimeProof::kExternal;
  in.verification.tokens = 9;
  in.verification.outside_tokens = 2;
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("2 time stamps by authorities under trusted roots hold."));
}

// Whoever reads a report must not take the recorder's word for an outside authority's.
TEST_F(ReportDocument, SaysWhoseTimeStampsAChangeWouldHaveToOvercome) {
  ReportInput in = input();
  const auto text_in = [&](Language language) {
    in.language = language;
    return test::text_of(make_report(in));
  };
  const char* const others = "time stamps that others issued";
  const char* const others_ja = "第三者が発行したタイムスタンプ";
  const char* const outside_times = "between two outside times";
  const char* const outside_times_ja = "二つの外部時刻の間";

  ASSERT_EQ(in.verification.time, archive::TimeProof::kSelfIssued);
  std::string text = text_in(Language::kEnglish), japanese = text_in(Language::kJapanese);
  EXPECT_THAT(text, AllOf(HasSubstr("time stamps that the recorder's own authority issued. Whoever holds the "
                                    "recorder's keys can make all of them anew."),
                          HasSubstr("are those of an authority inside the recorder"),
                          HasSubstr(" | embedded (self-issued)\n"), Not(HasSubstr(others)),
                          Not(HasSubstr(outside_times)), Not(HasSubstr("proves that what it covers"))));
  EXPECT_THAT(japanese, AllOf(HasSubstr("記録装置自身の認証局が発行したタイムスタンプ"),
                              HasSubstr("embedded（自己発行）\n"), Not(HasSubstr(others_ja)),
                              Not(HasSubstr(outside_times_ja))));

  in.verification.time = archive::TimeProof::kExternal;
  in.verification.outside_tokens = 2;
  for (archive::Bracket& bracket : in.verification.brackets) bracket.time = archive::TimeProof::kExternal;
  text = text_in(Language::kEnglish);
  EXPECT_THAT(text,
              AllOf(HasSubstr(others), HasSubstr(outside_times),
                    HasSubstr("The recorder's own authority issued 3 time stamps, too. No bracket rests on "
                              "what they say."),
                    HasSubstr(" | embedded\n")));
  EXPECT_THAT(text_in(Language::kJapanese), AllOf(HasSubstr(others_ja), HasSubstr(outside_times_ja),
                                                  HasSubstr("時刻の範囲には用いていません")));

  in.verification.time = archive::TimeProof::kExternalInPart;
  in.verification.outside_entries = 3;
  in.verification.own_tokens = 0;
  EXPECT_THAT(
      text_in(Language::kEnglish),
      AllOf(HasSubstr("As far as entry 2 of the ledger they would also have to change time stamps that "
                      "others issued. Whoever holds the recorder's keys can make what follows anew."),
            HasSubstr("as far as entry 2 lies in a bracket between two outside times"),
            HasSubstr("No outside clock says by when the rest was written."),
            Not(HasSubstr("authority issued"))));
  EXPECT_THAT(text_in(Language::kJapanese),
              AllOf(HasSubstr("台帳の項目 2 までは、第三者が発行した"), HasSubstr("項目 2 までの各部分は")));
}

TEST_F(ReportDocument, WithoutATimeStampThatHoldsTellsOfNone) {
  // None was ever there: what the authority would have signed was not asked for.
  archive_.clear();
  test::SampleCase sample(archive_);
  archive_.now_ns = 7'000'000'000;
  sample.record_at_once();
  sample.writer().close("operator", archive_.now());
  sample.writer().finish(archive_.now());
  folder_ = sample.folder();
  const auto expect_none = [](const ReportInput& asked) {
    ReportInput in = asked;
    ASSERT_EQ(in.verification.time, archive::TimeProof::kNone);
    const std::string text = test::text_of(make_report(in));
    EXPECT_THAT(text, AllOf(HasSubstr("No time stamp could be checked: when it existed is not proved."),
                            HasSubstr("can make both anew. No time stamp could be relied on."),
                            HasSubstr("There is no bracket"), Not(HasSubstr("others issued")),
                            Not(HasSubstr("outside times")), Not(HasSubstr("proves that what it covers"))));
    in.language = Language::kJapanese;
    EXPECT_THAT(test::text_of(make_report(in)),
                AllOf(HasSubstr("依拠できるタイムスタンプはありません"), Not(HasSubstr("第三者が発行した")),
                      Not(HasSubstr("二つの外部時刻"))));
  };
  expect_none(input());
  // Those of a case are there, and nobody was trusted to have made them.
  folder_ = test::SampleCase::write(archive_);
  archive::VerifyOptions trusting_nobody = archive_.options();
  trusting_nobody.trust = nullptr;
  expect_none(input(trusting_nobody));
}

// Whoever sets a recorder up chooses what its own authority is called.
TEST_F(ReportDocument, ANameMakesNoOutsideAuthorityOfTheRecordersOwn) {
  archive_.clear();
  test::SampleCase sample(archive_);
  archive_.now_ns = 7'000'000'000;
  sample.record_at_once();
  sample.writer().close("operator", archive_.now());
  const archive::StoredCheckpoint checkpoint = sample.writer().checkpoint(archive_.now(), true);
  const Bytes response = archive_.stamp(checkpoint.note);
  sample.writer().add_token(checkpoint, "national-metrology-institute", response,
                            test::SampleArchive::facts_of(response), archive_.now());
  sample.writer().finish(archive_.now());
  folder_ = sample.folder();
  ReportInput in = input();
  ASSERT_EQ(in.verification.time, archive::TimeProof::kSelfIssued);
  std::size_t named = 0;
  const nlohmann::ordered_json as_json = archive::report_json(in.verification);
  for (const auto& bracket : as_json.at("brackets")) {
    if (bracket.at("authority_after").is_null() && bracket.at("authority_before").is_null()) {
      EXPECT_EQ(bracket.at("time"), "none");
      continue;
    }
    ++named;
    EXPECT_EQ(bracket.at("time"), "self-issued") << bracket;
  }
  EXPECT_GT(named, 0U);
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr(" | national-metrology-institute (self-issued)\n"));
  EXPECT_THAT(text, Not(HasSubstr(" | national-metrology-institute\n")));
  EXPECT_THAT(text, HasSubstr(" (national-metrology-institute) (self-issued)")) << "in the chain";
  in.language = Language::kJapanese;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr(" | national-metrology-institute（自己発行）\n"));
}

// Whoever holds the device's key can enter a token of an authority of their own, of any time, beside a true
// one.
TEST_F(ReportDocument, TellsNoTimeOfATokenThatDoesNotHold) {
  ReportInput in = input();
  ASSERT_EQ(in.verification.proving_tokens.size(), in.facts.tokens.size());
  StatedToken forged = in.facts.tokens.front();
  forged.entry += 1'000;
  forged.token.authority = "stranger";
  forged.token.gen_time = *parse_utc("2019-11-26T11:39:51Z");
  in.facts.tokens.push_back(forged);
  std::string text = test::text_of(make_report(in));
  const std::string chain =
      text.substr(text.find("[Time stamps"), text.find("[Authorities") - text.find("[Time stamps"));
  EXPECT_THAT(chain, HasSubstr("3 time stamps (RFC 3161) that hold, the earliest of "));
  EXPECT_THAT(chain, HasSubstr("Of 1 more the times prove nothing here"));
  EXPECT_THAT(chain, Not(HasSubstr("2019")));
  EXPECT_THAT(text, HasSubstr("stranger | 2019-11-26 11:39:51.000000 UTC | "));
  EXPECT_THAT(text, HasSubstr(" | ! no | "));
  EXPECT_THAT(text, HasSubstr(" | order alone: the recorder's own | "));

  // An outside authority's tokens are what the proof of time rests on, and not the recorder's own beside
  // them.
  in.verification.proving_tokens[1].outside = true;
  text = test::text_of(make_report(in));
  EXPECT_THAT(text, HasSubstr("1 time stamp (RFC 3161) that hold"));
  EXPECT_THAT(text, HasSubstr("Of 3 more the times prove nothing here"));

  in.verification.proving_tokens.clear();
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("4 time stamps (RFC 3161), of which none holds under the roots that were given."));
}

TEST_F(ReportDocument, OfACaseThatWasStampedAfterItsEndAloneSaysNoBeginning) {
  ReportInput in = input();
  in.verification.time = archive::TimeProof::kExternal;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("time-stamped it, from "));
  in.verification.findings.push_back(
      {"stamped-after-close", archive::Severity::kNote, {}, {}, {}, "a year after it"});
  const std::string text = test::text_of(make_report(in));
  EXPECT_THAT(text, testing::Not(HasSubstr("time-stamped it, from ")));
  EXPECT_THAT(text, HasSubstr("no later than "));
  EXPECT_THAT(text, HasSubstr("When it was recorded, and for how long, rests on the recorder's word."));
  EXPECT_THAT(text, HasSubstr("So none of them is an earlier limit of any part of the record"));
  EXPECT_THAT(text, testing::Not(HasSubstr("lies in a bracket between two outside times")));
}

// Who holds a receipt or a certificate alone reads no findings.
TEST_F(ReportDocument, EveryDocumentSaysWhatItsTimeIsNotWorth) {
  struct Limit {
    std::string code, english, japanese, certificate;
  };
  const std::vector<Limit> limits = {
      {"stamped-after-close", "When it was recorded, and for how long, rests on the recorder's word.",
       "いつ、どれだけの時間記録されたかは", "That an outside clock confirms any of the times above:"},
      {"first-stamped-late", "By the case clock recording began 0:03:20 before the first time stamp:",
       "記録は最初のタイムスタンプの 0:03:20 前に始まりました",
       "That an outside clock confirms when recording began. By the case clock it began 0:03:20 before"},
      {"segments-entered-late", "By the case clock some of it ended 0:03:20 before the time stamp in front",
       "タイムスタンプの後に記入された記録の一部は、その 0:03:20 前に終わっています",
       "That an outside clock confirms when all of it was recorded. By the case clock some of it ended "
       "0:03:20"},
      {"end-stamped-late", "That recording ended when it says rests on the recorder's word",
       "そこで終わったことは記録装置のみに依拠します", "That recording ended when the record says"},
      {"clock-differs", "By the time stamps the recorder's clock was wrong, and so",
       "タイムスタンプによれば記録装置の時計は誤っており",
       "That the times above by the recorder's clock are right"},
      {"close-utc-differs", "How long it lasted, the case clock alone says", "長さを示すのは症例時計のみです",
       "That the record lasted from the opening to the closing"}};
  for (const Limit& stated : limits) {
    ReportInput in = input();
    in.verification.time = archive::TimeProof::kExternal;
    in.verification.age_at_first_stamp_ns = in.verification.entered_late_ns = 200'000'000'000;
    in.verification.findings.push_back({stated.code, archive::Severity::kNote, {}, {}, {}, "why"});
    for (const Limit& each : limits) {
      const auto says = [&](const std::string& words) {
        return each.code == stated.code ? testing::Matcher<std::string>(HasSubstr(words))
                                        : testing::Matcher<std::string>(Not(HasSubstr(words)));
      };
      in.language = Language::kEnglish;
      EXPECT_THAT(test::text_of(make_report(in)), says(each.english)) << stated.code;
      EXPECT_THAT(test::text_of(make_receipt(in)), says(each.english)) << stated.code;
      EXPECT_THAT(test::text_of(make_certificate(in)), AllOf(says(each.english), says(each.certificate)))
          << stated.code;
      in.language = Language::kJapanese;
      EXPECT_THAT(test::text_of(make_report(in)), says(each.japanese)) << stated.code;
      EXPECT_THAT(test::text_of(make_receipt(in)), says(each.japanese)) << stated.code;
    }
  }
}

// That the rest has no outside time at all is the graver of the two.
TEST_F(ReportDocument, OfTimeThatIsExternalInPartTheRestIsSpokenOfFirst) {
  ReportInput in = input();
  in.verification.findings.push_back({"stamped-after-close", archive::Severity::kNote, {}, {}, {}, "why"});
  in.verification.time = archive::TimeProof::kExternal;
  EXPECT_THAT(test::text_of(make_report(in)),
              HasSubstr("Here every time stamp of an outside authority was entered behind"));
  in.verification.time = archive::TimeProof::kExternalInPart;
  in.verification.outside_entries = 1;
  EXPECT_THAT(test::text_of(make_report(in)),
              AllOf(HasSubstr("No outside clock says by when the rest was written"),
                    Not(HasSubstr("Here every time stamp"))));
}

TEST_F(ReportDocument, AReceiptWithAllThatItsTimeIsNotWorthHasOnePage) {
  if (!has_tools()) GTEST_SKIP() << "poppler-utils or zbar-tools is not installed";
  const std::vector<std::vector<std::string>> cases = {
      {"first-stamped-late"},
      {"first-stamped-late", "segments-entered-late", "end-stamped-late", "clock-differs",
       "close-utc-differs"},
      {"stamped-after-close", "clock-differs", "close-utc-differs"}};
  for (const Language language : {Language::kEnglish, Language::kJapanese}) {
    for (const std::vector<std::string>& codes : cases) {
      ReportInput in = input(archive_.options(), language);
      in.verification.time = archive::TimeProof::kExternal;
      for (const std::string& code : codes)
        in.verification.findings.push_back({code, archive::Severity::kNote, {}, {}, {}, "why"});
      write("receipt.pdf", write_pdf(make_receipt(in)));
      EXPECT_THAT(tool({"pdfinfo", "receipt.pdf"}), HasSubstr("Pages:           1\n"))
          << codes.size() << codes.front();
    }
  }
}

TEST_F(ReportDocument, SpeaksOfTheBracketsWhereTheyStand) {
  ReportInput in = input();
  in.verification.time = archive::TimeProof::kExternal;
  EXPECT_THAT(test::text_of(make_report(in)), HasSubstr("the brackets below say."));
  EXPECT_THAT(test::text_of(make_certificate(in)),
              AllOf(HasSubstr("the verification report says."), Not(HasSubstr("brackets below"))));
  in.verification.findings.push_back({"clock-differs", archive::Severity::kNote, {}, {}, {}, "why"});
  EXPECT_THAT(test::text_of(make_receipt(in)),
              AllOf(HasSubstr("time-stamped it, from "), Not(HasSubstr("Between which times"))));
}

// Whoever makes a case chooses its identifier.
TEST_F(ReportDocument, CertificateSaysThatTheIdentifiersTimeIsAnother) {
  ReportInput in = input();
  in.verification.case_id = "20150805T091502Z-3f9c21ab";
  EXPECT_THAT(test::text_of(make_certificate(in)), HasSubstr("Case | 20150805T091502Z-3f9c21ab, "));
}

TEST_F(ReportDocument, CarriesTheFilesAlongThatItsProofOfTimeRestsOn) {
  ReportInput in = input();
  EXPECT_THAT(test::text_of(make_report(in)), Not(HasSubstr("Attached files")));
  in.attachments = read_proof_files(folder_, in, std::nullopt);
  std::map<std::string, Bytes> files;
  for (const Attachment& file : in.attachments) EXPECT_TRUE(files.emplace(file.name, file.bytes).second);
  ASSERT_TRUE(in.facts.last_checkpoint);
  EXPECT_EQ(files.at(name_in(in.facts.last_checkpoint->file)), to_bytes(in.facts.last_checkpoint->text));
  ASSERT_FALSE(in.facts.tokens.empty());
  for (const StatedToken& stated : in.facts.tokens) {
    EXPECT_EQ(crypto::sha256(files.at(name_in(stated.token.file))), stated.token.sha256);
    EXPECT_TRUE(files.contains(name_in(archive::note_path(stated.token.checkpoint))));
  }
  EXPECT_TRUE(text_of(files.at("receipt.pdf")).starts_with("%PDF-1.7"));
  const Document document = make_report(in);
  EXPECT_EQ(document.attachments.size(), in.attachments.size());
  const std::string text = test::text_of(document);
  EXPECT_THAT(text, HasSubstr("Attached files"));
  for (const auto& [name, bytes] : files)
    EXPECT_THAT(text, HasSubstr(crypto::to_hex(crypto::sha256(bytes)))) << name;
  if (!has_tools()) GTEST_SKIP() << "poppler-utils is not installed";
  write("report.pdf", write_pdf(document));
  tool({"pdfdetach", "-saveall", "report.pdf"});
  EXPECT_TRUE(fs::exists(temporary_ / "receipt.pdf"));
}

// Between the verification and the report somebody may change a file: what leaves is what was verified.
TEST_F(ReportDocument, CarriesNoTokenAlongThatIsNotTheOneThatWasVerified) {
  const ReportInput in = input();
  ASSERT_FALSE(in.facts.tokens.empty());
  const archive::TokenEntry& changed = in.facts.tokens.front().token;
  change_byte(changed.file, 40);
  const std::vector<Attachment> files = read_proof_files(folder_, in, std::nullopt);
  EXPECT_FALSE(
      std::ranges::any_of(files, [&](const Attachment& file) { return file.name == name_in(changed.file); }));
}

TEST_F(ReportDocument, CarriesNoEvidenceRecordAlongThatIsNotTheOneThatWasJudged) {
  ReportInput in = input();
  const fs::path record = temporary_ / "case.ers";
  write("case.ers", bytes_of("the record that was judged"));
  in.verification.evidence.emplace();
  in.verification.evidence->holds = true;
  in.verification.evidence->sha256 = crypto::sha256(bytes_of("the record that was judged"));
  const auto carried = [&] {
    return std::ranges::any_of(read_proof_files(folder_, in, record),
                               [](const Attachment& each) { return each.name == "evidence-record.ers"; });
  };
  EXPECT_TRUE(carried());
  write("case.ers", bytes_of("another one"));
  EXPECT_FALSE(carried());
  // What cannot be read any more costs the attachment, not the report.
  fs::remove(record);
  fs::create_directory(record);
  EXPECT_FALSE(carried());
}

// Nor one that proves nothing to the person who asked: without roots no time-stamp holds.
TEST_F(ReportDocument, CarriesNoTokenAlongThatDoesNotHold) {
  archive::VerifyOptions options = archive_.options();
  const timestamp::TrustStore nobody;
  options.trust = &nobody;
  for (const Attachment& file : read_proof_files(folder_, input(options), std::nullopt))
    EXPECT_FALSE(file.name.ends_with(".tsr")) << file.name;
}

// Nobody signs what lies in `authorities`.
TEST_F(ReportDocument, CarriesNoTextAlongThatStandsBesideCertificates) {
  const fs::path chain = folder_ / "authorities" / (input().facts.tokens.front().token.authority + ".pem");
  std::ifstream file(chain);
  const std::string pem(std::istreambuf_iterator<char>(file), {});
  ASSERT_TRUE(pem.starts_with("-----BEGIN CERTIFICATE-----"));
  const auto carried = [&] {
    return std::ranges::any_of(read_proof_files(folder_, input(), std::nullopt),
                               [](const Attachment& each) { return each.name.ends_with(".pem"); });
  };
  EXPECT_TRUE(carried());
  std::ofstream(chain, std::ios::binary) << "The court found this recording sound.\n" << pem;
  EXPECT_FALSE(carried());
}

}  // namespace
}  // namespace kiroku::report
