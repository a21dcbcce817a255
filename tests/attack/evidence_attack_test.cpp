// Attacks on a case's evidence record. It lies beside the case, so anybody may remove, swap or change it:
// that never makes a verdict better, and a record that proves nothing of the case is told.
#include <algorithm>
#include <fcntl.h>
#include <map>

#include <gmock/gmock.h>

#include "archive/format/case_layout.h"
#include "archive/reading/excerpt.h"
#include "archive/upkeep/evidence_renewal.h"
#include "archive/verify/case_evidence.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attack_table.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/evidence_kit.h"
#include "tests/support/report_text.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::Verdict;
using archive::VerificationReport;

class EvidenceAttack : public ::testing::Test {
 protected:
  EvidenceAttack() {
    trust_.add_own_authority(bytes_of(archive_.authority().root_pem()), "own");
    trust_.add_trusted(bytes_of(outside_.root_pem()), "outside");
    trust_.add_trusted(bytes_of(middle_.root_pem()), "middle");
    renew("2027-01-01", outside_);
    renew("2033-10-01", middle_);
  }
  void renew(const std::string& today, const PlayedAuthority& authority) const {
    archive::EvidenceRenewalOptions options;
    options.trust = &trust_;
    options.now = [today] { return day(today); };
    options.stamp = authority.at(today);
    archive::renew_evidence(archive::real_file_system(), {first_, second_}, options);
  }
  [[nodiscard]] fs::path record(const fs::path& folder) const {
    return archive::evidence_file(folder, folder.filename().string());
  }
  /// A policy by which the device's signatures count no more.
  static const evidence::Policy& ended() {
    static const evidence::Policy policy = evidence::Policy::parse(
        "[[algorithm]]\nname=\"sha256\"\n[[algorithm]]\nname=\"ecdsa\"\n[[algorithm]]\nname=\"ed25519\"\n"
        "until=2029-12-31\n",
        "policy.toml");
    return policy;
  }
  [[nodiscard]] VerificationReport verify(const evidence::Policy* policy = nullptr,
                                          const std::optional<fs::path>& given = std::nullopt) const {
    archive::VerifyOptions options = archive_.options();
    options.trust = &trust_;
    options.now = day("2035-01-01");
    options.policy = policy;
    options.evidence = given;
    return archive::verify_case(first_, options);
  }
  static bool has(const VerificationReport& report, const std::string& code) {
    return std::ranges::find(report.findings, code, &archive::Finding::code) != report.findings.end();
  }
  /// The record is `bytes` now: it is told, and is worth no more than no record.
  void expect_worthless(const std::string& bytes, const std::string& what) {
    write_file(record(first_), bytes);
    EXPECT_EQ(verify().verdict, Verdict::kIntact) << what;
    EXPECT_TRUE(has(verify(), "evidence-refused") || has(verify(), "evidence-not-checked")) << what;
    EXPECT_FALSE(has(verify(), "evidence-holds")) << what;
    EXPECT_FALSE(verify().evidence->since) << "whoever made it chose its times";
    EXPECT_EQ(verify(&ended()).verdict, Verdict::kUnproven) << what;
    EXPECT_EQ(verify(nullptr, record(first_)).verdict, Verdict::kUnproven) << what;
    EXPECT_TRUE(has(verify(nullptr, record(first_)), "evidence-asked-for")) << what;
  }

  SampleArchive archive_;
  fs::path first_ = SampleCase::write(archive_);
  fs::path second_ = SampleCase::write(archive_);
  PlayedAuthority outside_{"Outside", "2026-01-01", "2034-01-01"};
  PlayedAuthority middle_{"Middle", "2026-01-01", "2034-03-01"};
  timestamp::TrustStore trust_;
};

TEST_F(EvidenceAttack, TheSoundRecordHolds) {
  // Its authority ends in 2034, and nothing renewed it since: in 2035 it has lapsed.
  EXPECT_TRUE(has(verify(), "evidence-not-checked"));
  PlayedAuthority later("Later", "2030-01-01", "2050-01-01");
  trust_.add_trusted(bytes_of(later.root_pem()), "later");
  renew("2033-12-01", later);
  EXPECT_TRUE(has(verify(), "evidence-holds"));
  EXPECT_EQ(verify().verdict, Verdict::kIntact);
  EXPECT_EQ(verify(&ended()).verdict, Verdict::kIntact);
  EXPECT_EQ(verify(nullptr, record(first_)).verdict, Verdict::kIntact);

  // -- removed
  const std::string sound = read_file(record(first_));
  EXPECT_EQ(verify().evidence->sha256, crypto::sha256(bytes_of(sound)));
  fs::remove(record(first_));
  EXPECT_EQ(verify().verdict, Verdict::kIntact);
  EXPECT_EQ(verify(&ended()).verdict, Verdict::kUnproven);
  EXPECT_THROW(static_cast<void>(verify(nullptr, record(first_))), UsageError);

  // -- swapped, cut, changed
  expect_worthless(read_file(record(second_)), "another case's");
  expect_worthless("", "empty");
  expect_worthless("<EvidenceRecord/>", "something else");
  expect_worthless(sound.substr(0, sound.size() / 2), "cut off");
  const evidence::EvidenceRecord record = *evidence::parse_record(bytes_of(sound)).record;
  const auto text = [](const evidence::EvidenceRecord& changed) {
    return std::string(text_of(evidence::encode_record(changed)));
  };
  evidence::EvidenceRecord changed = record;
  changed.chains[0].erase(changed.chains[0].begin() + 1);
  expect_worthless(text(changed), "a link cut out");
  changed = record;
  std::swap(changed.chains[0][1], changed.chains[0][2]);
  expect_worthless(text(changed), "links in another order");
  changed = record;
  changed.chains[0][0].reduced_tree[0].pop_back();
  expect_worthless(text(changed), "a value less");
  changed = record;
  changed.chains[0].pop_back();
  expect_worthless(text(changed), "the newest link gone, and what is left has lapsed");

  // Bytes that somebody flips anywhere.
  for (std::size_t at = 0; at < sound.size(); at += 97) {
    std::string flipped = sound;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x04);
    write_file(archive::evidence_file(first_, first_.filename().string()), flipped);
    const VerificationReport report = verify(&ended());
    // Of a token's certificates some bits count for nothing; all else does.
    if (report.verdict == Verdict::kIntact) {
      EXPECT_TRUE(has(report, "evidence-holds")) << at;
    }
  }
}

// Whoever makes a record of a part of the case gets no answer about the whole.
TEST_F(EvidenceAttack, ARecordOfAPartIsNoRecordOfTheCase) {
  using crypto::HashAlgorithm;
  PlayedAuthority later("Later", "2026-01-01", "2050-01-01");
  trust_.add_trusted(bytes_of(later.root_pem()), "later");
  const archive::CaseFolder folder = archive::CaseFolder::open(first_);
  const archive::CaseData data = archive::read_case_data(folder);
  const auto record_over = [&](std::uint64_t lines, const std::string& left_out) {
    evidence::HashList group{archive::hash_ledger_at(folder, {lines}, HashAlgorithm::kSha256).at(lines)};
    for (const archive::NamedFile& named : data.files) {
      if (named.entry >= lines || named.file == left_out) continue;
      group.push_back(archive::hash_named_file(folder, named, HashAlgorithm::kSha256));
    }
    return std::string(text_of(evidence::encode_record(
        evidence::begin_records(HashAlgorithm::kSha256, {group}, later.at("2027-01-01"))[0])));
  };
  expect_worthless(record_over(data.note_sizes.front(), ""), "the beginning alone");
  expect_worthless(record_over(data.note_sizes.back(), "segments/endoscope/00000001.ts.age"),
                   "a segment less");
  expect_worthless(record_over(data.note_sizes.back(), archive::note_path(data.note_sizes.front())),
                   "a note less");
  write_file(record(first_), record_over(data.note_sizes.back(), ""));
  EXPECT_EQ(verify(&ended()).verdict, Verdict::kIntact);

  // Time by the recorder's own authority does not stand for what ended.
  timestamp::TrustStore own;
  own.add_own_authority(bytes_of(archive_.authority().root_pem()), "own");
  own.add_own_authority(bytes_of(later.root_pem()), "later");
  std::swap(trust_, own);
  EXPECT_TRUE(has(verify(&ended()), "evidence-holds"));
  EXPECT_EQ(verify(&ended()).verdict, Verdict::kUnproven);
}

// In 2030 the device's signatures count no more, so whoever wants may sign in the device's name. What stands
// behind the record's lines is no older than they say.
TEST_F(EvidenceAttack, WhatIsAddedBehindTheRecordsLinesRestsOnWhatEnded) {
  AttackedCase attacked(first_);
  fs::create_directory(attacked.outside("evidence"));
  fs::copy_file(record(first_), record(attacked.folder()));
  attacked.append(archive::ErasedEntry{"endoscope", 0, 0, "thirty days"});
  const std::size_t size = attacked.lines().size();
  attacked.write_note(size, attacked.origin(), size, attacked.root(size), archive_.key(),
                      SampleArchive::kDeviceName);
  fs::remove(attacked / "segments/endoscope/00000000.ts.age");
  archive::VerifyOptions options;
  options.devices = {archive_.device()};
  options.trust = &trust_;
  options.now = day("2033-11-01");
  const VerificationReport without = archive::verify_case(attacked.folder(), options);
  EXPECT_EQ(without.verdict, Verdict::kIntactWithGaps);
  ASSERT_TRUE(has(without, "evidence-holds"));
  EXPECT_EQ(without.evidence->entries, size - 1);
  EXPECT_THAT(details(without), testing::HasSubstr("the first " + std::to_string(size - 1) + " of " +
                                                   std::to_string(size) + " entries"));
  options.policy = &ended();
  const VerificationReport report = archive::verify_case(attacked.folder(), options);
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  EXPECT_TRUE(has(report, "evidence-holds"));
  EXPECT_THAT(details(report),
              testing::HasSubstr("on which its entries from " + std::to_string(size - 1) + " on rest"));

  // A later chain that takes the erasure in makes up for it if it began in time, and not if it came later.
  const auto covered_at = [&](const std::string& today) {
    const archive::CaseFolder folder = archive::CaseFolder::open(attacked.folder());
    const archive::CaseData data = archive::read_case_data(folder);
    evidence::HashList group;
    for (const auto& [lines, hash] :
         archive::hash_ledger_at(folder, {size - 1, size}, crypto::HashAlgorithm::kSha256))
      group.push_back(hash);
    for (const archive::NamedFile& named : data.files)
      group.push_back(archive::hash_named_file(folder, named, crypto::HashAlgorithm::kSha256));
    evidence::EvidenceRecord beginning = *evidence::parse_record(bytes_of(read_file(record(first_)))).record;
    beginning.chains.front().resize(1);
    write_file(record(attacked.folder()),
               std::string(text_of(evidence::encode_record(evidence::renew_hash_trees(
                   {beginning}, crypto::HashAlgorithm::kSha256, {group}, outside_.at(today))[0]))));
    return archive::verify_case(attacked.folder(), options);
  };
  EXPECT_EQ(covered_at("2029-06-01").verdict, Verdict::kIntactWithGaps);
  EXPECT_EQ(covered_at("2030-01-01").verdict, Verdict::kUnproven);
}

// An authority that states a time before that of the tokens which the record covers has a wrong clock, or is
// the recorder's own.
TEST_F(EvidenceAttack, ARecordIsNotOlderThanTheTokensThatItCovers) {
  PlayedAuthority back_dated("Back-dated", "2020-01-01", "2050-01-01");
  const TestAuthority of_case = make_test_authority();
  archive_.authority_answer = [&](const std::string& note, UtcTime time) {
    const crypto::Sha256Digest imprint = crypto::sha256(bytes_of(note));
    TokenRecipe recipe;
    recipe.imprint = to_bytes(ByteView(imprint));
    recipe.gen_time = format_utc_compact(time).erase(8, 1);  // without the T
    recipe.signer = &of_case.signer;
    recipe.enclosed = {of_case.signer.certificate.get(), of_case.ca.certificate.get()};
    return make_response(make_token(recipe));
  };
  const fs::path stamped = SampleCase::write(archive_);
  fs::path asked = stamped;
  const auto judged = [&](bool case_outside, bool record_outside, const std::string& today) {
    timestamp::TrustStore trust;
    const auto add = [&](const std::string& pem, bool outside, const char* name) {
      if (outside) {
        trust.add_trusted(bytes_of(pem), name);
      } else {
        trust.add_own_authority(bytes_of(pem), name);
      }
    };
    add(of_case.root_pem(), case_outside, "of the case");
    add(back_dated.root_pem(), record_outside, "of the record");
    fs::remove(record(stamped));
    archive::renew_evidence(
        archive::real_file_system(), {stamped},
        {.trust = &trust, .now = [] { return day("2035-01-01"); }, .stamp = back_dated.at(today)});
    archive::VerifyOptions options = archive_.options();
    options.trust = &trust;
    options.now = day("2035-01-01");
    if (asked != stamped) options.evidence = record(stamped);
    return archive::verify_case(asked, options);
  };
  for (const bool record_outside : {true, false}) {
    const VerificationReport report = judged(true, record_outside, "2021-01-01");
    EXPECT_EQ(report.verdict, Verdict::kIntact) << details(report);
    ASSERT_TRUE(has(report, "evidence-refused")) << details(report);
    EXPECT_THAT(details(report), testing::HasSubstr("one of the two authorities states a wrong time"));
    EXPECT_FALSE(report.evidence->since) << "a time that nothing proves is told nowhere";
    EXPECT_TRUE(report.evidence->links.empty()) << "nor in the table of time-stamps";
    EXPECT_TRUE(has(judged(true, record_outside, "2027-01-01"), "evidence-holds"));
  }
  EXPECT_TRUE(has(judged(false, false, "2021-01-01"), "evidence-refused"));
  EXPECT_TRUE(has(judged(false, true, "2021-01-01"), "evidence-holds"))
      << "the recorder's clock may be ahead";

  // An excerpt holds the record against the time-stamps that it shows.
  asked = stamped.parent_path().parent_path() / "excerpt-of-stamped";
  archive::ExcerptOptions part;
  part.from_ns = 0;
  part.to_ns = 3'000'000'000;
  part.streams = {"endoscope"};
  archive::make_excerpt(stamped, part, asked);
  EXPECT_TRUE(has(judged(true, true, "2027-01-01"), "evidence-holds"));
  const VerificationReport of_excerpt = judged(true, true, "2021-01-01");
  EXPECT_EQ(of_excerpt.verdict, Verdict::kUnproven) << details(of_excerpt);
  EXPECT_TRUE(has(of_excerpt, "evidence-refused")) << details(of_excerpt);
}

// What has no record of its own is not proved by anything once its algorithms have ended.
TEST_F(EvidenceAttack, AnExcerptAndALogThatRestOnWhatEndedAreUnproven) {
  const fs::path excerpt = first_.parent_path().parent_path() / "excerpt";
  archive::ExcerptOptions part;
  part.from_ns = 0;
  part.to_ns = 3'000'000'000;
  part.streams = {"endoscope"};
  archive::make_excerpt(first_, part, excerpt);
  archive::VerifyOptions options = archive_.options();
  options.trust = &trust_;
  options.now = day("2028-01-01");
  options.policy = &ended();
  const fs::path log = *options.log;
  const auto verdicts = [&] {
    return std::vector<Verdict>{archive::verify_case(excerpt, options).verdict,
                                archive::verify_log(log, options).verdict};
  };
  EXPECT_THAT(verdicts(), testing::ElementsAre(Verdict::kIntactExcerpt, Verdict::kIntact));
  options.now = day("2031-01-01");
  EXPECT_THAT(verdicts(), testing::Each(Verdict::kUnproven));
  EXPECT_TRUE(has(archive::verify_case(excerpt, options), "algorithm-ended"));

  // A record that was given is judged with an excerpt, which holds by it though an algorithm ended. With a
  // log nothing looks at it, and that is told.
  options.now = day("2034-01-01");
  options.evidence = record(first_);
  EXPECT_THAT(verdicts(), testing::ElementsAre(Verdict::kIntactExcerpt, Verdict::kUnproven));
  const VerificationReport with_record = archive::verify_case(excerpt, options);
  EXPECT_TRUE(has(with_record, "evidence-holds")) << details(with_record);
  EXPECT_TRUE(has(archive::verify_log(log, options), "evidence-asked-for"));
}

/// Shows another ledger when the case has been verified.
class SwappedLedger : public archive::FileReading {
 public:
  explicit SwappedLedger(fs::path instead) : instead_(std::move(instead)) {}
  int open_at(int folder, const std::string& name, int flags, const fs::path& path) const override {
    if (name != "ledger.jsonl" || opened_++ < kOpenedToVerify)
      return FileReading::open_at(folder, name, flags, path);
    return FileReading::open_at(AT_FDCWD, instead_.native(), flags, instead_);
  }

 private:
  static constexpr int kOpenedToVerify = 2;
  fs::path instead_;
  mutable int opened_ = 0;
};

// Whoever serves the files shows verification one ledger, and the record the one that it covers.
TEST_F(EvidenceAttack, ARecordIsOfTheLedgerThatWasVerified) {
  AttackedCase attacked(first_);
  const fs::path genuine = attacked.outside("genuine");
  fs::copy_file(attacked / "ledger.jsonl", genuine);
  fs::create_directory(attacked.outside("evidence"));
  fs::copy_file(record(first_), record(attacked.folder()));
  attacked.append(archive::ErasedEntry{"endoscope", 0, 0, "thirty days"});
  const std::size_t size = attacked.lines().size();
  attacked.write_note(size, attacked.origin(), size, attacked.root(size), archive_.key(),
                      SampleArchive::kDeviceName);
  const SwappedLedger swapped(genuine);
  archive::VerifyOptions options;
  options.devices = {archive_.device()};
  options.trust = &trust_;
  options.now = day("2033-11-01");
  options.files = &swapped;
  const VerificationReport report = archive::verify_case(attacked.folder(), options);
  EXPECT_FALSE(has(report, "evidence-holds"));
  EXPECT_TRUE(has(report, "evidence-not-checked"));
  EXPECT_THAT(details(report), testing::HasSubstr("the ledger changed while the case was verified"));
}

/// Counts how often each file is opened.
class CountedReading : public archive::FileReading {
 public:
  int open_at(int folder, const std::string& name, int flags, const fs::path& path) const override {
    ++opened[name];
    return FileReading::open_at(folder, name, flags, path);
  }
  mutable std::map<std::string, int> opened;
};

// Whoever makes a record chooses how many chains it has, and how much of the ledger it names: neither makes
// the case be read more than once under a hash.
TEST_F(EvidenceAttack, ManyChainsAndManyBeginningsReadTheCaseOnce) {
  const auto opened_by = [&](std::size_t chains) {
    const CountedReading counted;
    const archive::CaseFolder folder = archive::CaseFolder::open(first_, counted);
    const archive::CaseData data = archive::read_case_data(folder);
    evidence::HashList group;
    for (const auto& [size, hash] :
         archive::hash_ledger_at(folder, data.note_sizes, crypto::HashAlgorithm::kSha512))
      group.push_back(hash);
    EXPECT_GT(group.size(), 2U);
    evidence::EvidenceRecord record =
        evidence::begin_records(crypto::HashAlgorithm::kSha512, {group}, outside_.at("2027-01-01"))[0];
    record.chains.resize(chains, record.chains.front());
    counted.opened.clear();
    const archive::CaseEvidence judged =
        archive::judge_case_evidence(folder, data, record, {.trust = &trust_, .now = day("2028-01-01")});
    EXPECT_EQ(judged.covered_lines.size(), data.note_sizes.size());
    EXPECT_FALSE(judged.refusal.empty());
    return counted.opened;
  };
  const std::map<std::string, int> once = opened_by(1);
  EXPECT_EQ(once.at("ledger.jsonl"), 1);
  for (const auto& [name, times] : once) EXPECT_EQ(times, opened_by(20)[name]) << name;
}

/// A record of SHA-256 whose data was read again under SHA-512. `other_bytes` is the file of which the
/// renewal names the hash of something else; none by default.
class RenewedUnderSha512 : public EvidenceAttack {
 protected:
  static constexpr const char* kSegment = "segments/endoscope/00000001.ts.age";
  RenewedUnderSha512() { write(""); }
  void write(const std::string& other_bytes) const {
    using crypto::HashAlgorithm;
    const archive::CaseFolder folder = archive::CaseFolder::open(first_);
    const archive::CaseData data = archive::read_case_data(folder);
    const std::uint64_t lines = data.note_sizes.back();
    const auto group = [&](HashAlgorithm algorithm) {
      evidence::HashList hashes{archive::hash_ledger_at(folder, {lines}, algorithm).at(lines)};
      for (const archive::NamedFile& named : data.files) {
        const bool of_others = algorithm == HashAlgorithm::kSha512 && named.file == other_bytes;
        hashes.push_back(of_others ? crypto::digest(algorithm, bytes_of("something else"))
                                   : archive::hash_named_file(folder, named, algorithm));
      }
      return hashes;
    };
    const std::vector<evidence::EvidenceRecord> begun = evidence::begin_records(
        HashAlgorithm::kSha256, {group(HashAlgorithm::kSha256)}, outside_.at("2027-01-01"));
    write_file(
        record(first_),
        std::string(text_of(evidence::encode_record(evidence::renew_hash_trees(
            begun, HashAlgorithm::kSha512, {group(HashAlgorithm::kSha512)}, outside_.at("2028-01-01"))[0]))));
  }
  [[nodiscard]] VerificationReport judged(const fs::path& folder,
                                          const archive::FileReading* files = nullptr) const {
    archive::VerifyOptions options = archive_.options();
    options.trust = &trust_;
    options.now = day("2030-01-01");
    options.evidence = record(first_);
    options.files = files;
    return archive::verify_case(folder, options);
  }
  [[nodiscard]] fs::path make_excerpt() const {
    archive::ExcerptOptions options;
    options.from_ns = 2'000'000'001;
    options.to_ns = 4'000'000'000;
    options.streams = {"endoscope"};
    archive::make_excerpt(first_, options, archive_.folder() / "excerpt");
    return archive_.folder() / "excerpt";
  }
};

TEST_F(RenewedUnderSha512, EachSegmentIsReadOnceForBothHashes) {
  for (const fs::path& folder : {first_, make_excerpt()}) {
    const CountedReading counted;
    const VerificationReport report = judged(folder, &counted);
    EXPECT_TRUE(has(report, "evidence-holds")) << details(report);
    int segments = 0;
    for (const auto& [name, times] : counted.opened) {
      if (!name.ends_with(".age") || name == "subject.age") continue;
      ++segments;
      EXPECT_EQ(times, 1) << folder << ": " << name;
    }
    EXPECT_GT(segments, 0);
  }
}

TEST_F(RenewedUnderSha512, BytesOfAnotherSha512AreRefusedThoughTheirSha256Fits) {
  write(kSegment);
  for (const fs::path& folder : {first_, make_excerpt()}) {
    const VerificationReport report = judged(folder);
    EXPECT_TRUE(has(report, "evidence-refused")) << details(report);
    EXPECT_THAT(details(report), testing::HasSubstr(kSegment));
    EXPECT_EQ(report.verdict, Verdict::kUnproven);
  }
}

TEST_F(RenewedUnderSha512, FilesAreHashedForARecordOfThisCaseAlone) {
  archive::VerifyOptions options;
  const auto of_case = [&](const fs::path& folder) {
    return archive::further_hashes_of_case(archive::CaseFolder::open(folder), folder.filename().string(),
                                           options);
  };
  EXPECT_EQ(of_case(first_), std::vector{crypto::HashAlgorithm::kSha512});
  EXPECT_TRUE(of_case(second_).empty()) << "it was not renewed";
  write_file(record(second_), read_file(record(first_)));
  EXPECT_TRUE(of_case(second_).empty()) << "it is another case's";
  write_file(record(first_), "<EvidenceRecord/>");
  EXPECT_TRUE(of_case(first_).empty());
  fs::remove(record(first_));
  EXPECT_TRUE(of_case(first_).empty());
}

// A record beside a case that somebody changed does not make up for that.
TEST_F(EvidenceAttack, ARecordDoesNotHideThatACaseWasTamperedWith) {
  const fs::path segment = first_ / "segments/endoscope/00000000.ts.age";
  std::string bytes = read_file(segment);
  bytes.back() = static_cast<char>(bytes.back() ^ 1);
  write_file(segment, bytes);
  EXPECT_EQ(verify().verdict, Verdict::kTampered);
  EXPECT_FALSE(verify().evidence);
}

// After 2029 anybody can sign a log in the device's name: it speaks neither for a case nor against one.
TEST_F(EvidenceAttack, ALogThatRestsOnWhatEndedSpeaksNeitherForACaseNorAgainstIt) {
  const fs::path excerpt = archive_.folder() / "excerpt";
  archive::ExcerptOptions part;
  part.from_ns = 0;
  part.to_ns = 3'000'000'000;
  part.streams = {"endoscope"};
  archive::make_excerpt(first_, part, excerpt);
  archive::VerifyOptions options = archive_.options();
  options.trust = &trust_;
  options.policy = &ended();
  const auto judged = [&](const fs::path& folder, const std::string& today) {
    options.now = day(today);
    return archive::verify_case(folder, options);
  };
  for (const fs::path& folder : {first_, excerpt}) {
    EXPECT_FALSE(has(judged(folder, "2028-01-01"), "log-algorithm-ended"));
    const VerificationReport agrees = judged(folder, "2033-11-01");
    EXPECT_EQ(agrees.verdict, folder == first_ ? Verdict::kIntact : Verdict::kIntactExcerpt)
        << details(agrees);
    EXPECT_TRUE(has(agrees, "log-algorithm-ended")) << details(agrees);
    EXPECT_THAT(details(agrees), testing::HasSubstr("that it knows the same of this case proves nothing"));
  }

  // A log that does not know the case, and that the device signed on.
  const fs::path log = archive_.folder() / "another-log";
  fs::create_directories(log / "checkpoints");
  const std::string lines = read_file(archive_.log_folder() / "ledger.jsonl");
  const std::string boot = lines.substr(0, lines.find('\n'));
  std::string another = boot + "\n";
  crypto::MerkleFrontier tree;
  tree.append(crypto::merkle_leaf_hash(bytes_of(boot)));
  while (tree.size() <= 66) {
    const std::string shutdown = R"({"type":"shutdown","seq":)" + std::to_string(tree.size()) +
                                 R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9000000000000000})";
    another += shutdown + "\n";
    tree.append(crypto::merkle_leaf_hash(bytes_of(shutdown)));
    const crypto::Checkpoint signed_on{archive::log_origin(SampleArchive::kDeviceName), tree.size(),
                                       tree.root()};
    write_file(log / archive::note_path(tree.size()),
               crypto::sign_note(signed_on.to_text(), SampleArchive::kDeviceName, archive_.key()));
  }
  write_file(log / "ledger.jsonl", another);
  options.log = log;
  for (const fs::path& folder : {first_, excerpt}) {
    const VerificationReport before = judged(folder, "2028-01-01");
    EXPECT_EQ(before.verdict, Verdict::kTampered);
    EXPECT_TRUE(has(before, "log-case-unknown"));
    const VerificationReport after = judged(folder, "2033-11-01");
    EXPECT_EQ(after.verdict, Verdict::kUnproven) << details(after);
    EXPECT_TRUE(has(after, "log-doubted")) << details(after);
    EXPECT_TRUE(has(after, "evidence-holds")) << details(after);
    EXPECT_FALSE(has(after, "log-case-unknown"));
  }
  // What the case shows by itself counts as before.
  const fs::path segment = first_ / "segments/endoscope/00000001.ts.age";
  fs::resize_file(segment, fs::file_size(segment) - 1);
  EXPECT_EQ(judged(first_, "2033-11-01").verdict, Verdict::kTampered);
}

// Once the algorithm of its time-stamps ended, anybody can have made them since.
TEST_F(EvidenceAttack, TimeStampsOfAnAlgorithmThatEndedSayNoTime) {
  fs::remove(record(first_));
  const fs::path excerpt = archive_.folder() / "excerpt";
  archive::ExcerptOptions part;
  part.from_ns = 0;
  part.to_ns = 3'000'000'000;
  part.streams = {"endoscope"};
  archive::make_excerpt(first_, part, excerpt);
  for (const bool of_time_stamps : {true, false}) {
    const evidence::Policy policy = evidence::Policy::parse(
        std::string("[[algorithm]]\nname=\"sha256\"\n[[algorithm]]\nname=\"ecdsa\"\n") +
            (of_time_stamps ? "until=2029-12-31\n[[algorithm]]\nname=\"ed25519\"\n"
                            : "[[algorithm]]\nname=\"ed25519\"\nuntil=2029-12-31\n"),
        "policy.toml");
    for (const fs::path& folder : {first_, excerpt}) {
      archive::VerifyOptions options = archive_.options();
      options.policy = &policy;
      options.now = day("2029-06-01");
      const VerificationReport before = archive::verify_case(folder, options);
      EXPECT_EQ(before.time, archive::TimeProof::kSelfIssued) << details(before);
      EXPECT_FALSE(before.brackets.empty());
      options.now = day("2031-01-01");
      const VerificationReport after = archive::verify_case(folder, options);
      EXPECT_EQ(after.verdict, Verdict::kUnproven);
      EXPECT_EQ(after.time, of_time_stamps ? archive::TimeProof::kNone : archive::TimeProof::kSelfIssued)
          << "a time-stamp does not rest on the device's key";
      EXPECT_EQ(after.brackets.empty(), of_time_stamps);
    }
  }
}

// A new time-stamp takes nothing in: that is counted, and mended where somebody asks for it.
TEST_F(EvidenceAttack, EntriesBehindTheRecordAreCountedAndTakenIn) {
  using What = archive::EvidenceRenewal::What;
  AttackedCase attacked(first_);
  fs::create_directory(attacked.outside("evidence"));
  evidence::EvidenceRecord beginning = *evidence::parse_record(bytes_of(read_file(record(first_)))).record;
  beginning.chains.front().resize(1);
  write_file(record(attacked.folder()), std::string(text_of(evidence::encode_record(beginning))));
  const auto renewed = [&](const std::string& today, bool take_in) {
    archive::EvidenceRenewalOptions options;
    options.trust = &trust_;
    options.now = [today] { return day(today); };
    options.stamp = outside_.at(today);
    options.take_in = take_in;
    return archive::renew_evidence(archive::real_file_system(), {attacked.folder()}, options).front();
  };
  EXPECT_EQ(renewed("2028-01-01", false).later_entries, 0U);
  EXPECT_EQ(renewed("2028-01-01", true).what, What::kNothingDue) << "there is nothing to take in";
  attacked.append(archive::ErasedEntry{"endoscope", 0, 0, "thirty days"});
  EXPECT_EQ(renewed("2028-01-01", false).later_entries, 0U) << "nobody signed it";
  const std::size_t size = attacked.lines().size();
  attacked.write_note(size, attacked.origin(), size, attacked.root(size), archive_.key(),
                      SampleArchive::kDeviceName);
  fs::remove(attacked / "segments/endoscope/00000000.ts.age");
  const archive::EvidenceRenewal told = renewed("2028-01-01", false);
  EXPECT_EQ(told.what, What::kNothingDue) << told.text;
  EXPECT_EQ(told.later_entries, 1U);

  archive::VerifyOptions options;
  options.devices = {archive_.device()};
  options.trust = &trust_;
  options.policy = &ended();
  options.now = day("2033-11-01");
  EXPECT_EQ(archive::verify_case(attacked.folder(), options).verdict, Verdict::kUnproven);
  const archive::EvidenceRenewal taken = renewed("2028-02-01", true);
  EXPECT_EQ(taken.what, What::kHashTreeRenewed) << taken.text;
  EXPECT_EQ(taken.text, "1 entry came after what it covers");
  EXPECT_EQ(renewed("2028-03-01", true).later_entries, 0U);
  EXPECT_EQ(renewed("2028-03-01", true).what, What::kNothingDue);
  const VerificationReport covered = archive::verify_case(attacked.folder(), options);
  EXPECT_EQ(covered.verdict, Verdict::kIntactWithGaps) << details(covered);
  // What was taken in is not told as if the record said nothing of it.
  ASSERT_TRUE(covered.evidence.has_value());
  EXPECT_EQ(covered.evidence->entries, size - 1);
  EXPECT_EQ(covered.evidence->later_entries, size);
  EXPECT_EQ(covered.evidence->later_since, day("2028-02-01"));
  EXPECT_THAT(details(covered), testing::HasSubstr("covers the entries up to " + std::to_string(size - 1) +
                                                   " since 2028-02-01T00:00:00"));
}

TEST_F(EvidenceAttack, WhatIsTakenInIsNotProvedBeforeTheTokensInIt) {
  const TestAuthority late = make_test_authority();
  trust_.add_trusted(bytes_of(late.root_pem()), "late");
  AttackedCase attacked(first_);
  fs::create_directory(attacked.outside("evidence"));
  const std::uint64_t size = attacked.lines().size();
  attacked.write_note(size, attacked.origin(), size, attacked.root(size), archive_.key(),
                      SampleArchive::kDeviceName);
  const crypto::Sha256Digest imprint =
      crypto::sha256(bytes_of(read_file(attacked / archive::note_path(size))));
  TokenRecipe recipe;
  recipe.imprint = to_bytes(ByteView(imprint));
  recipe.gen_time = "20310601000000Z";
  recipe.signer = &late.signer;
  recipe.enclosed = {late.signer.certificate.get(), late.ca.certificate.get()};
  const Bytes response = make_response(make_token(recipe));
  archive::TokenEntry token = SampleArchive::facts_of(response);
  token.checkpoint = size;
  token.authority = "late";
  token.file = archive::token_path(size, token.authority);
  token.sha256 = crypto::sha256(response);
  write_file(attacked / token.file, std::string(text_of(response)));
  attacked.append(token);
  attacked.write_note(size + 1, attacked.origin(), size + 1, attacked.root(size + 1), archive_.key(),
                      SampleArchive::kDeviceName);

  evidence::EvidenceRecord beginning = *evidence::parse_record(bytes_of(read_file(record(first_)))).record;
  beginning.chains.front().resize(1);
  const std::string of_the_first_entries(text_of(evidence::encode_record(beginning)));
  const auto taken_in = [&](const std::string& today) {
    write_file(record(attacked.folder()), of_the_first_entries);
    archive::EvidenceRenewalOptions options;
    options.trust = &trust_;
    options.now = [] { return day("2033-11-01"); };
    options.stamp = outside_.at(today);
    options.take_in = true;
    const archive::EvidenceRenewal taken =
        archive::renew_evidence(archive::real_file_system(), {attacked.folder()}, options).front();
    EXPECT_EQ(taken.what, archive::EvidenceRenewal::What::kHashTreeRenewed) << taken.text;
    archive::VerifyOptions verify;
    verify.devices = {archive_.device()};
    verify.trust = &trust_;
    verify.now = day("2033-12-01");
    return archive::verify_case(attacked.folder(), verify);
  };
  EXPECT_TRUE(has(taken_in("2033-11-01"), "evidence-holds")) << details(taken_in("2033-11-01"));
  const VerificationReport report = taken_in("2028-02-01");
  ASSERT_TRUE(has(report, "evidence-refused")) << details(report);
  EXPECT_THAT(details(report), testing::HasSubstr("the first time-stamp of a later chain is of 2028-02-01"));
  EXPECT_FALSE(report.evidence->since);
}

/// An excerpt beside the case, whose record lies where it is looked for.
class ExcerptEvidence : public EvidenceAttack {
 protected:
  ExcerptEvidence() {
    trust_.add_trusted(bytes_of(later_.root_pem()), "later");
    renew("2033-12-01", later_);
    make({});
  }
  void make(archive::ExcerptOptions options) const {
    options.from_ns = 2'000'000'001;
    options.to_ns = 4'000'000'000;
    options.streams = {"endoscope"};
    fs::remove_all(excerpt());
    archive::make_excerpt(first_, options, excerpt());
  }
  [[nodiscard]] fs::path excerpt() const { return archive_.folder() / "excerpt"; }
  [[nodiscard]] VerificationReport judged(const evidence::Policy* policy = nullptr,
                                          const std::optional<fs::path>& given = std::nullopt) const {
    archive::VerifyOptions options = archive_.options();
    options.trust = &trust_;
    options.now = day("2035-01-01");
    options.policy = policy;
    options.evidence = given;
    return archive::verify_case(excerpt(), options);
  }
  static std::string text_of_finding(const VerificationReport& report, const std::string& code) {
    const auto found = std::ranges::find(report.findings, code, &archive::Finding::code);
    return found == report.findings.end() ? "" : found->text;
  }
  PlayedAuthority later_{"Later", "2030-01-01", "2050-01-01"};
};

TEST_F(ExcerptEvidence, OfItTheRecordProvesTheCheckpointAndTheFiles) {
  const VerificationReport report = judged();
  EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt);
  ASSERT_TRUE(report.evidence);
  EXPECT_TRUE(report.evidence->holds) << report.evidence->refusal;
  EXPECT_EQ(report.evidence->since, day("2027-01-01"));
  EXPECT_EQ(report.evidence->time_stamps, 3U);
  EXPECT_NE(text_of_finding(report, "evidence-holds").find("proves the checkpoint over"), std::string::npos);
  EXPECT_EQ(judged(nullptr, record(first_)).verdict, Verdict::kIntactExcerpt);
  // What the record proves stands for a signature that ended; without it the excerpt proves nothing any more.
  EXPECT_EQ(judged(&ended()).verdict, Verdict::kIntactExcerpt);
  fs::remove(record(first_));
  EXPECT_EQ(judged(&ended()).verdict, Verdict::kUnproven);
  EXPECT_TRUE(has(judged(&ended()), "algorithm-ended"));
  EXPECT_EQ(judged().verdict, Verdict::kIntactExcerpt);
  EXPECT_THROW(static_cast<void>(judged(nullptr, record(first_))), UsageError);
}

// Between an excerpt's lines and its checkpoint stands SHA-256 alone, whatever the record hashes with.
TEST_F(ExcerptEvidence, WithoutSha256ItsLinesAreNotProved) {
  const evidence::Policy policy = evidence::Policy::parse(
      "new_hash=\"sha512\"\n[[algorithm]]\nname=\"sha256\"\nuntil=2034-12-01\n"
      "[[algorithm]]\nname=\"sha512\"\n[[algorithm]]\nname=\"ecdsa\"\n[[algorithm]]\nname=\"ed25519\"\n",
      "policy.toml");
  const VerificationReport report = judged(&policy);
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  EXPECT_TRUE(has(report, "algorithm-ended"));
}

TEST_F(ExcerptEvidence, ARecordThatCannotBeShownFromItIsNotJudged) {
  write_file(record(first_), read_file(record(second_)));
  const VerificationReport report = judged();
  EXPECT_EQ(report.verdict, Verdict::kIntactExcerpt);
  EXPECT_NE(text_of_finding(report, "evidence-not-checked").find("verify the whole case"), std::string::npos);
  EXPECT_EQ(judged(&ended()).verdict, Verdict::kUnproven);
  EXPECT_EQ(judged(nullptr, record(second_)).verdict, Verdict::kUnproven);
  write_file(record(first_), "<EvidenceRecord/>");
  EXPECT_TRUE(has(judged(), "evidence-refused"));
}

TEST_F(ExcerptEvidence, ARecordThatLacksASegmentOfItIsRefused) {
  using crypto::HashAlgorithm;
  const archive::CaseFolder folder = archive::CaseFolder::open(first_);
  const archive::CaseData data = archive::read_case_data(folder);
  const auto write_record = [&](const std::string& left_out) {
    const std::uint64_t lines = data.note_sizes.back();
    evidence::HashList group{archive::hash_ledger_at(folder, {lines}, HashAlgorithm::kSha256).at(lines)};
    for (const archive::NamedFile& named : data.files) {
      if (named.file != left_out)
        group.push_back(archive::hash_named_file(folder, named, HashAlgorithm::kSha256));
    }
    write_file(record(first_), std::string(text_of(evidence::encode_record(evidence::begin_records(
                                   HashAlgorithm::kSha256, {group}, later_.at("2031-01-01"))[0]))));
  };
  write_record("");
  EXPECT_TRUE(has(judged(), "evidence-holds"));
  write_record("segments/endoscope/00000001.ts.age");
  EXPECT_TRUE(has(judged(), "evidence-refused"));
  EXPECT_EQ(judged(nullptr, record(first_)).verdict, Verdict::kUnproven);
  // What the excerpt does not hold it does not show.
  write_record("segments/endoscope/00000000.ts.age");
  EXPECT_TRUE(has(judged(), "evidence-holds"));
  EXPECT_TRUE(has(verify(), "evidence-refused"));
}

TEST_F(ExcerptEvidence, OfAReKeyedOneTheRecordProvesTheCheckpoint) {
  const std::uint64_t with_segment = judged().evidence->files;
  EXPECT_EQ(judged().evidence->resealed, 0U);
  archive::ExcerptOptions options;
  options.identities = &archive_.identities();
  options.recipients = archive_.recipients();
  make(options);
  const VerificationReport report = judged();
  ASSERT_TRUE(report.evidence);
  EXPECT_TRUE(report.evidence->holds) << report.evidence->refusal;
  EXPECT_EQ(report.evidence->files + 1, with_segment);
  EXPECT_EQ(report.evidence->resealed, 1U);
  const auto told = std::ranges::find(report.findings, "evidence-holds", &archive::Finding::code);
  ASSERT_NE(told, report.findings.end());
  EXPECT_THAT(told->text, testing::HasSubstr("(not its 1 segment sealed anew)"));
}

}  // namespace
}  // namespace kiroku::test
