#include "archive/reading/excerpt.h"

#include <algorithm>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/reading/case_reader.h"
#include "archive/reading/replica.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/verify/verifier.h"
#include "crypto/age_file.h"
#include "tests/support/forger.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/observed_file_system.h"
#include "tests/support/report_text.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::details;
using test::summary;

std::string read(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void write(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
}

class Excerpt : public ::testing::Test {
 protected:
  ExcerptResult make(const ExcerptOptions& options) { return make_excerpt(folder_, options, excerpt()); }
  [[nodiscard]] fs::path excerpt() const { return archive_.folder() / "excerpt"; }
  [[nodiscard]] VerificationReport verify() const { return verify_case(excerpt(), archive_.options()); }
  /// The middle of the endoscope's film: segment 1 of 3.
  static ExcerptOptions middle() {
    ExcerptOptions options;
    options.from_ns = 2 * kSecond + 1;
    options.to_ns = 4 * kSecond;
    options.streams = {"endoscope"};
    return options;
  }

  test::SampleArchive archive_;
  fs::path folder_ = test::SampleCase::write(archive_);
};

TEST_F(Excerpt, VerifiesByItself) {
  const ExcerptResult result = make(middle());
  EXPECT_EQ(result.segments, 1U);
  EXPECT_EQ(result.first_entry, 1U);
  const VerificationReport report = verify();
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
  EXPECT_EQ(report.time, TimeProof::kSelfIssued);
  EXPECT_TRUE(fs::exists(excerpt() / "segments/endoscope/00000001.ts.age"));
  EXPECT_FALSE(fs::exists(excerpt() / "segments/endoscope/00000000.ts.age"));
  EXPECT_FALSE(fs::exists(excerpt() / "subject.json.age"));
}

TEST_F(Excerpt, CopiesNoHoleOfTebibytes) {
  fs::resize_file(folder_ / "segments/endoscope/00000001.ts.age", std::uintmax_t{8} << 40U);
  try {
    make(middle());
    FAIL() << "an excerpt was made";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("00000001.ts.age has 8796093022208 bytes, not "));
  }
  EXPECT_FALSE(fs::exists(excerpt()));
}

TEST_F(Excerpt, OfEverythingVerifies) {
  ExcerptOptions options;
  options.to_ns = 3600 * kSecond;
  EXPECT_EQ(make(options).segments, 4U);
  const VerificationReport report = verify();
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
}

TEST_F(Excerpt, TellsWhatItHoldsAndNotWhatItsLinesName) {
  make(middle());
  const VerificationReport report = verify();
  ASSERT_TRUE(report.excerpt);
  const ExcerptReport& part = *report.excerpt;
  EXPECT_EQ(part.from_ns, 2 * kSecond + 1);
  EXPECT_EQ(part.to_ns, 4 * kSecond);
  EXPECT_FALSE(part.with_gaps);
  ASSERT_EQ(part.streams.size(), 2U);
  EXPECT_EQ(part.streams[0].name, "endoscope");
  EXPECT_TRUE(part.streams[0].selected);
  EXPECT_EQ(part.streams[0].held_segments, 1U);
  EXPECT_EQ(part.streams[0].held_frames, 50U);
  EXPECT_EQ(part.streams[0].case_segments, 3U);
  EXPECT_EQ(part.streams[0].known_segments, 3U);
  EXPECT_FALSE(part.streams[1].selected);
  EXPECT_EQ(part.streams[1].held_segments, 0U);
  ASSERT_EQ(report.streams.size(), 1U);
  EXPECT_EQ(report.streams[0].segments, 1U);
  EXPECT_EQ(report.streams[0].span.start_ns, 2 * kSecond);
  EXPECT_EQ(report.streams[0].span.end_ns, 4 * kSecond);
  EXPECT_EQ(exit_status(report.verdict), 4);
  EXPECT_EQ(exit_status(report.verdict, true), 0);
  EXPECT_EQ(exit_status(Verdict::kTampered, true), 1);
  EXPECT_EQ(exit_status(Verdict::kUnproven, true), 3);
  EXPECT_EQ(exit_status(Verdict::kIntact, true), 0);
}

TEST_F(Excerpt, WithoutTheEndOfItsCaseKnowsOnlyHowMuchThatHasAtLeast) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.stamp();
  archive_.now_ns = 3 * kSecond;
  sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond})}, archive_.now());
  sample.stamp();
  sample.stamp();
  archive_.now_ns = 6 * kSecond;
  sample.writer().append({sample.segment(0, 1, {3 * kSecond, 6 * kSecond})}, archive_.now());
  sample.close();
  folder_ = sample.folder();
  ExcerptOptions options;
  options.to_ns = 2 * kSecond;
  options.streams = {"endoscope"};
  make(options);
  const VerificationReport report = verify();
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
  EXPECT_EQ(report.excerpt->streams[0].case_segments, std::nullopt);
  EXPECT_EQ(report.excerpt->streams[0].known_segments, 1U);
}

// A log states few roots of a case, and what it was compared with reads as what it confirms.
TEST_F(Excerpt, TellsHowManyOfItsEntriesTheLogKnows) {
  const auto known = [&](const ExcerptOptions& options, bool with_log = true) {
    fs::remove_all(excerpt());
    make(options);
    VerifyOptions verifying = archive_.options();
    if (!with_log) verifying.log.reset();
    const VerificationReport report = verify_case(excerpt(), verifying);
    EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt) << details(report);
    const std::optional<std::uint64_t> entries =
        report.in_log ? std::optional(report.in_log->entries) : std::nullopt;
    return std::pair(entries, report.excerpt->size);
  };
  EXPECT_EQ(known(middle(), false).first, std::nullopt);
  const auto [all, size] = known(middle());
  EXPECT_EQ(all, size);

  // As a recorder does that asks for time-stamps more often than its log takes a checkpoint.
  archive_.clear();
  test::SampleCase sample(archive_);
  const auto stamp_beside_the_log = [&] {
    const StoredCheckpoint checkpoint = sample.writer().checkpoint(archive_.now(), false);
    const Bytes response = archive_.stamp(checkpoint.note);
    sample.writer().add_token(checkpoint, test::SampleArchive::kAuthorityName, response,
                              test::SampleArchive::facts_of(response), archive_.now());
  };
  const auto record_a_second = [&](std::uint64_t index) {
    archive_.now_ns += kSecond;
    const auto begin_ns = static_cast<std::int64_t>(index) * kSecond;
    sample.writer().append({sample.segment(0, index, {begin_ns, begin_ns + kSecond})}, archive_.now());
  };
  sample.stamp();  // entry 1 is its token
  record_a_second(0);
  stamp_beside_the_log();
  record_a_second(1);
  stamp_beside_the_log();
  record_a_second(2);
  stamp_beside_the_log();
  record_a_second(3);
  sample.close();
  folder_ = sample.folder();
  ExcerptOptions inside;
  inside.from_ns = kSecond;
  inside.to_ns = 2 * kSecond;
  inside.streams = {"endoscope"};
  EXPECT_EQ(known(inside).first, 0U) << "the log states roots from before it and behind it";
}

TEST_F(Excerpt, StatesItsStreamsAndItsMakingWhichNothingProves) {
  ExcerptOptions options;
  options.to_ns = 3600 * kSecond;
  options.made_at = parse_utc("2026-08-06T09:00:00Z");
  options.made_by = "Dr. Mori";
  make(options);
  const ExcerptParse parse = parse_excerpt(read(excerpt() / "excerpt.json"));
  ASSERT_TRUE(parse.document) << parse.problem;
  EXPECT_THAT(parse.document->streams, ::testing::ElementsAre("endoscope", "vitals"));
  EXPECT_EQ(parse.document->to_ns, 7'100'000'000) << "the end of the case";
  VerificationReport report = verify();
  EXPECT_EQ(summary(report), "intact-excerpt");
  EXPECT_EQ(report.excerpt->stated_made_by, "Dr. Mori");
  EXPECT_EQ(report.excerpt->stated_made_at, options.made_at);
  EXPECT_EQ(report.excerpt->streams[0].case_segments, 3U);
  EXPECT_EQ(report.excerpt->streams[0].case_frames, 150U);

  // Anybody can write there what they like, or nothing, as older programs did.
  std::string document = read(excerpt() / "excerpt.json");
  document.replace(document.find("Mori"), 4, "Abe");
  write(excerpt() / "excerpt.json", document);
  report = verify();
  EXPECT_EQ(summary(report), "intact-excerpt");
  EXPECT_EQ(report.excerpt->stated_made_by, "Dr. Abe");
  document = document.substr(0, document.find(",\"made_utc\"")) + "}\n";
  write(excerpt() / "excerpt.json", document);
  report = verify();
  EXPECT_EQ(summary(report), "intact-excerpt");
  EXPECT_EQ(report.excerpt->stated_made_at, std::nullopt);
}

TEST_F(Excerpt, WithStatedGapsIsAnIntactExcerptThatSaysSo) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  sample.writer().append({GapEntry{"endoscope", {6 * kSecond, 6'500'000'000}, GapCause::kSignalLost}},
                         archive_.now());
  sample.close();
  folder_ = sample.folder();
  ExcerptOptions options = middle();
  options.to_ns = 7 * kSecond;
  make(options);
  const VerificationReport report = verify();
  EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt) << details(report);
  EXPECT_TRUE(report.excerpt->with_gaps);
  EXPECT_EQ(report.streams[0].gap_ns, 500'000'000);
}

// A silence is entered up to a minute after it was.
TEST_F(Excerpt, WithoutItsSoundHasTheEntryThatSaysSoHoweverLateThatIs) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.stamp();
  archive_.now_ns = 3 * kSecond;
  sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond})}, archive_.now());
  sample.stamp();
  sample.stamp();
  archive_.now_ns = 6 * kSecond;
  sample.writer().append({sample.segment(0, 1, {3 * kSecond, 6 * kSecond})}, archive_.now());
  sample.writer().append({GapEntry{"endoscope", {kSecond, 5 * kSecond}, GapCause::kSignalLost, true}},
                         archive_.now());
  sample.close();
  folder_ = sample.folder();
  ExcerptOptions options;
  options.to_ns = 2 * kSecond;
  options.streams = {"endoscope"};
  make(options);
  const VerificationReport report = verify();
  EXPECT_THAT(summary(report), testing::HasSubstr("intact-excerpt\nsound-gap ")) << details(report);
  EXPECT_TRUE(report.excerpt->with_gaps);
}

// Else the case clock seems to go on by another time than the authorities' clocks.
TEST_F(Excerpt, OfTimeWithASlewHasTheEntryThatStatesIt) {
  for (const std::int64_t rate_ppb : {83'333'000, 0}) {
    archive_.clear();
    fs::remove_all(excerpt());
    test::SampleCase sample(archive_);
    sample.writer().append({ClockEntry{true, 0, 0, 0, 83'333'000}}, archive_.now());
    sample.writer().append({ClockEntry{true, 0, 0, 0, rate_ppb}}, archive_.now());
    for (std::uint64_t i = 0; i < 3; ++i) {
      const auto begin_ns = static_cast<std::int64_t>(i) * 2 * kSecond;
      archive_.now_ns = begin_ns + 2 * kSecond;
      sample.writer().append({sample.segment(0, i, {begin_ns, archive_.now_ns})}, archive_.now());
      sample.stamp();
    }
    sample.close();
    folder_ = sample.folder();
    ExcerptOptions options = middle();
    options.from_ns = 4 * kSecond + 1;
    options.to_ns = 5 * kSecond;
    make(options);
    EXPECT_EQ(verify().verdict, Verdict::kIntactExcerpt) << details(verify());
    const std::string lines = read(excerpt() / "ledger-part.jsonl");
    EXPECT_EQ(lines.find("rate_ppb") != std::string::npos, rate_ppb != 0) << lines;
  }
}

TEST_F(Excerpt, OfAStreamThatHasNothingShowsThatItHasNothing) {
  for (const bool is_stated : {false, true}) {
    archive_.clear();
    fs::remove_all(excerpt());
    test::SampleCase sample(archive_);
    sample.stamp();
    archive_.now_ns = 3 * kSecond;
    sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond})}, archive_.now());
    if (is_stated) {
      sample.writer().append({GapEntry{"vitals", {0, 3 * kSecond}, GapCause::kSignalLost}}, archive_.now());
    }
    sample.stamp();
    archive_.now_ns = 6 * kSecond;
    sample.writer().append({sample.segment(0, 1, {3 * kSecond, 6 * kSecond})}, archive_.now());
    if (is_stated) {
      sample.writer().append({GapEntry{"vitals", {3 * kSecond, 6 * kSecond}, GapCause::kSignalLost}},
                             archive_.now());
    }
    sample.close();
    folder_ = sample.folder();
    ExcerptOptions options;
    options.from_ns = 4 * kSecond;
    options.to_ns = 5 * kSecond;
    make(options);
    const VerificationReport report = verify();
    if (is_stated) {
      EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt) << details(report);
    } else {
      EXPECT_EQ(summary(report), "unproven\nstream-empty ledger-part.jsonl -") << details(report);
    }
    ASSERT_EQ(report.streams.size(), 2U);
    EXPECT_EQ(report.streams[1].segments, 0U);
    // Of the stream that is there nothing is missing.
    fs::remove_all(excerpt());
    options.streams = {"endoscope"};
    make(options);
    EXPECT_EQ(verify().verdict, Verdict::kIntactExcerpt) << details(verify());
  }
}

TEST_F(Excerpt, IsNoCaseForWhoReadsOne) {
  make(middle());
  EXPECT_TRUE(is_excerpt(excerpt()));
  EXPECT_FALSE(is_excerpt(folder_));
  EXPECT_FALSE(is_excerpt(archive_.folder() / "nothing"));
  EXPECT_THROW(CaseReader::open(excerpt()), UsageError);
  EXPECT_EQ(why_not_replicated(folder_, "endoscope", excerpt()),
            "it is an excerpt, which is no copy of the case");
}

// Who reads an excerpt must not believe more of it than of its case.
TEST_F(Excerpt, SaysWhichEntriesNobodyHadSignedWhenItsCaseWasFoundCutOff) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  const std::uint64_t unsigned_entry = sample.writer().size();
  sample.writer().append({MarkEntry{}}, archive_.now());
  const std::uint64_t recovered = sample.writer().size();
  sample.writer().append({RecoveredEntry{"6f1b1a52-4c9a-4d8c-9a3e-0f0e2f6f7a10", "crash", ""}},
                         archive_.now());
  sample.close();
  folder_ = sample.folder();
  const VerificationReport whole = verify_case(folder_, archive_.options());
  ASSERT_EQ(whole.signed_late.size(), 1U) << details(whole);
  ExcerptOptions options;
  options.to_ns = 3600 * kSecond;
  make(options);
  const VerificationReport part = verify();
  EXPECT_EQ(part.verdict, Verdict::kIntactExcerpt) << details(part);
  ASSERT_EQ(part.signed_late.size(), 1U);
  EXPECT_EQ(part.signed_late[0].first, whole.signed_late[0].first) << "an honest excerpt is not doubted";
  EXPECT_LE(part.signed_late[0].first, unsigned_entry);
  EXPECT_EQ(part.signed_late[0].last, recovered - 1);
  EXPECT_THAT(details(part), testing::HasSubstr("this excerpt shows no signature over the entries from " +
                                                std::to_string(part.signed_late[0].first) + " to " +
                                                std::to_string(recovered - 1) + " from before that"));

  fs::remove(excerpt() / note_path(whole.signed_late[0].first));
  EXPECT_LT(verify().signed_late[0].first, whole.signed_late[0].first) << "without that note it shows less";
}

TEST_F(Excerpt, WithASegmentLeftOutNamesIt) {
  make(middle());
  fs::remove(excerpt() / "segments/endoscope/00000001.ts.age");
  EXPECT_EQ(summary(verify()), "tampered\nfile-missing segments/endoscope/00000001.ts.age 4");
}

TEST_F(Excerpt, WithALineRemovedIsTampered) {
  make(middle());
  const fs::path lines = excerpt() / "ledger-part.jsonl";
  const std::string text = read(lines);
  const std::size_t second = text.find('\n') + 1;
  write(lines, text.substr(0, second) + text.substr(text.find('\n', second) + 1));
  const VerificationReport report = verify();
  EXPECT_EQ(report.verdict, Verdict::kTampered);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("excerpt-malformed ledger-part.jsonl"));
}

TEST_F(Excerpt, WithAnotherOpenIsTampered) {
  make(middle());
  std::string open = read(excerpt() / "ledger-open.jsonl");
  open.replace(open.find("monitor"), 7, "patient");
  write(excerpt() / "ledger-open.jsonl", open);
  EXPECT_THAT(summary(verify()), ::testing::HasSubstr("excerpt-proof-invalid ledger-open.jsonl 0"));
}

TEST_F(Excerpt, WithAForeignEarlierCheckpointIsTampered) {
  make(middle());
  std::string document = read(excerpt() / "excerpt.json");
  const std::size_t proof = document.find("\"proof\":[\"") + 10;
  document[proof] = document[proof] == '0' ? '1' : '0';
  const std::size_t proving = verify().proving_tokens.size();
  write(excerpt() / "excerpt.json", document);
  const VerificationReport report = verify();
  EXPECT_THAT(summary(report), ::testing::HasSubstr("excerpt-proof-invalid checkpoints/00000001.note"));
  EXPECT_THAT(summary(report), ::testing::Not(::testing::HasSubstr("ledger-changed"))) << "said once";
  EXPECT_LT(report.proving_tokens.size(), proving) << "a token over it proves no time of these lines";
}

TEST_F(Excerpt, ThatStatesMoreTimeThanItsLinesShowIsUnproven) {
  ExcerptOptions options = middle();
  options.from_ns = 5 * kSecond;
  options.to_ns = 6 * kSecond;
  make(options);
  std::string document = read(excerpt() / "excerpt.json");
  document.replace(document.find("\"from_ns\":5"), 11, "\"from_ns\":1");
  write(excerpt() / "excerpt.json", document);
  const VerificationReport report = verify();
  EXPECT_EQ(report.verdict, Verdict::kUnproven) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("excerpt-range-short ledger-part.jsonl"));
}

TEST_F(Excerpt, HoldsNothingThatItDoesNotName) {
  make(middle());
  write(excerpt() / "segments/endoscope/00000007.ts.age", "x");
  EXPECT_EQ(summary(verify()), "tampered\nfile-unnamed segments/endoscope/00000007.ts.age -");
}

TEST_F(Excerpt, HoldsNoHeaderOfASegmentThatIsElsewhere) {
  make(middle());
  write(excerpt() / "segments/endoscope/00000000.ts.age.header", "a film, for instance");
  EXPECT_EQ(summary(verify()), "tampered\nfile-unnamed segments/endoscope/00000000.ts.age.header -");
}

TEST_F(Excerpt, CarriesCertificatesOfTheAuthoritiesAndNothingElse) {
  write(folder_ / "authorities/film.mp4", "x");
  write(folder_ / "authorities/swiss.pem", "no certificate");
  fs::copy_file(folder_ / "authorities/embedded.pem", folder_ / "authorities/free.pem");
  make(middle());
  EXPECT_FALSE(fs::exists(excerpt() / "authorities/film.mp4"));
  EXPECT_FALSE(fs::exists(excerpt() / "authorities/swiss.pem"));
  EXPECT_EQ(read(excerpt() / "authorities/embedded.pem"), read(folder_ / "authorities/embedded.pem"));
  // Other lines of the case may name that authority.
  EXPECT_EQ(summary(verify()), "intact-excerpt\nauthority-not-named authorities/free.pem -");
  write(excerpt() / "authorities/film.mp4", "x");
  EXPECT_EQ(verify().verdict, Verdict::kTampered);
}

TEST_F(Excerpt, IsComparedWithANoteThatWasKeptAsFarAsItsLinesReach) {
  make(middle());
  VerifyOptions options = archive_.options();
  const auto kept = [&](const std::string& file) {
    return std::vector<OutsideNote>{{"kept.note", read(folder_ / "checkpoints" / file)}};
  };
  std::uint64_t largest = 0;
  for (const auto& each : fs::directory_iterator(excerpt() / "checkpoints")) {
    largest = std::max<std::uint64_t>(largest, std::stoull(each.path().stem().string()));
  }
  options.against = kept(format_index(largest) + ".note");
  EXPECT_EQ(summary(verify_case(excerpt(), options)), "intact-excerpt\noutside-note-holds - -");
  // Of what came later the excerpt shows nothing: that is no cut.
  options.against = kept("00000011.note");
  EXPECT_EQ(summary(verify_case(excerpt(), options)), "unproven\noutside-note-unchecked - -");
}

TEST_F(Excerpt, ReKeyedOpensForTheNewReaderAndProvesTheFilm) {
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  ExcerptOptions options = middle();
  options.identities = &archive_.identities();
  options.recipients = {crypto::parse_recipient(pair.recipient)};
  make(options);

  VerificationReport report = verify();
  EXPECT_EQ(summary(report), "unproven\nrekeyed-not-opened segments/endoscope/00000001.ts.age 4")
      << details(report);
  EXPECT_EQ(report.rekeyed_segments, 1U);
  EXPECT_EQ(report.rekeyed_opened, 0U);

  const crypto::AgeIdentities reader{crypto::parse_identity(pair.identity_text.text())};
  VerifyOptions with_identity = archive_.options();
  with_identity.identities = &reader;
  report = verify_case(excerpt(), with_identity);
  EXPECT_EQ(summary(report), "intact-excerpt") << details(report);
  EXPECT_EQ(report.rekeyed_segments, 1U);
  EXPECT_EQ(report.rekeyed_opened, 1U);

  const auto source = crypto::open_file_source(excerpt() / "segments/endoscope/00000001.ts.age");
  EXPECT_EQ(crypto::AgeFile::open(*source, reader).plaintext_size(), 70'000U);
}

TEST_F(Excerpt, WithAHeaderThatOpensAnotherFilmIsTampered) {
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  ExcerptOptions options = middle();
  options.identities = &archive_.identities();
  options.recipients = {crypto::parse_recipient(pair.recipient)};
  make(options);
  // A header of the reader's for another file key, before the same payload.
  const fs::path segment = excerpt() / "segments/endoscope/00000001.ts.age";
  const Bytes other = crypto::seal_bytes({}, options.recipients);
  const std::string other_text(text_of(other));
  const std::string film = read(segment);
  const auto header_end = [](const std::string& text) {
    return text.find('\n', text.find("\n--- ") + 1) + 1;
  };
  write(segment, other_text.substr(0, header_end(other_text)) + film.substr(header_end(film)));
  const crypto::AgeIdentities reader{crypto::parse_identity(pair.identity_text.text())};
  VerifyOptions with_identity = archive_.options();
  with_identity.identities = &reader;
  const VerificationReport report = verify_case(excerpt(), with_identity);
  EXPECT_EQ(summary(report), "tampered\nrekeyed-key-differs segments/endoscope/00000001.ts.age 4")
      << details(report);
}

TEST_F(Excerpt, ReKeysTheHeaderThatItHashes) {
  // A forger's film stands there when the header is opened, and the recorded one when the rest is copied.
  const fs::path segment = folder_ / "segments/endoscope/00000001.ts.age";
  const std::string honest = read(segment);
  const std::string forged = test::sealed_anew(Bytes(70'000), archive_.recipients());
  ASSERT_EQ(forged.size(), honest.size());
  const crypto::AgeIdentities forging =
      test::observed(archive_.identities(), [&] { test::write_into(segment, honest); });
  write(segment, forged);
  ExcerptOptions options = middle();
  options.identities = &forging;
  options.recipients = {crypto::parse_recipient(crypto::generate_age_key().recipient)};
  EXPECT_THROW(make(options), Error);
  EXPECT_FALSE(fs::exists(excerpt()));
}

TEST_F(Excerpt, IsRefusedWhereTheLedgerChangesMeanwhile) {
  const fs::path ledger = folder_ / "ledger.jsonl";
  const std::string honest = read(ledger);
  std::string changed = honest;
  changed[changed.find("utc", changed.find('\n')) + 8] = '9';
  for (const std::string& other : {changed, honest.substr(0, honest.find('\n') + 1)}) {
    write(ledger, honest);
    test::ObservedFileSystem files([&](const fs::path& file) {
      if (file.filename() == "ledger-part.jsonl") test::write_into(ledger, other);
    });
    EXPECT_THAT(
        [&] { make_excerpt(folder_, middle(), excerpt(), files); },
        ::testing::ThrowsMessage<Error>(::testing::HasSubstr("its ledger changed while it was read")));
    EXPECT_FALSE(fs::exists(excerpt()));
  }
}

TEST_F(Excerpt, TakesNoFileAlongThatALineCallsAToken) {
  const fs::path ledger = folder_ / "ledger.jsonl";
  std::string changed = read(ledger);
  const std::string names = "\"file\":\"tokens/";
  std::size_t lines = 0;
  for (std::size_t at = 0; (at = changed.find(names, at)) != std::string::npos; ++lines) {
    const std::size_t begin = at + names.size() - std::string_view("tokens/").size();
    changed.replace(begin, changed.find('"', begin) - begin, "ledger.jsonl");
  }
  ASSERT_GT(lines, 0U);
  write(ledger, changed);
  EXPECT_THAT([&] { make_excerpt(folder_, middle(), excerpt()); },
              ::testing::ThrowsMessage<Error>(::testing::HasSubstr("names 'ledger.jsonl' as a token")));
  EXPECT_FALSE(fs::exists(excerpt()));
}

TEST_F(Excerpt, ASegmentThatChangesMeanwhileIsRefused) {
  const fs::path segment = folder_ / "segments/endoscope/00000001.ts.age";
  test::ObservedFileSystem files([&](const fs::path& file) {
    if (file.filename() == segment.filename()) {
      test::write_into(segment, test::sealed_anew(Bytes(70'000), archive_.recipients()));
    }
  });
  EXPECT_THAT([&] { make_excerpt(folder_, middle(), excerpt(), files); },
              ::testing::ThrowsMessage<Error>(::testing::HasSubstr("is not the file whose hash")));
  EXPECT_FALSE(fs::exists(excerpt()));
}

TEST_F(Excerpt, IsRefusedWithNothingLeftBehind) {
  fs::create_directory(excerpt());
  EXPECT_THROW(make(middle()), UsageError);
  fs::remove(excerpt());
  ExcerptOptions options = middle();
  options.streams = {"cardiology"};
  EXPECT_THROW(make(options), UsageError);
  options = middle();
  options.from_ns = 100 * kSecond;
  options.to_ns = 101 * kSecond;
  EXPECT_THROW(make(options), UsageError);
  write(folder_ / "segments/endoscope/00000001.ts.age", "damaged");
  EXPECT_THROW(make(middle()), Error);
  std::vector<std::string> names;
  for (const auto& each : fs::directory_iterator(archive_.folder())) {
    names.push_back(each.path().filename());
  }
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("log", ".reserve", folder_.filename()));
}

}  // namespace
}  // namespace kiroku::archive
