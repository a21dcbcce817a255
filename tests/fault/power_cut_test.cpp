// Power fails, and the disk gives back what it likes of whatever was not flushed: blocks of zeros within a
// file of its full length, half a header, a name without its bytes. The next start recovers. No such case may
// read as tampered, and it must read the same with and without an identity.
#include <algorithm>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/age_layout.h"
#include "archive/format/case_layout.h"
#include "archive/upkeep/recovery.h"
#include "archive/verify/verifier.h"
#include "crypto/age_file.h"
#include "media/inspection/inspector.h"
#include "media/sealed_segment.h"
#include "recorder/checkpoint_stamper.h"
#include "tests/support/asked_number.h"
#include "tests/support/empty_log.h"
#include "tests/support/power_cut_file_system.h"
#include "tests/support/recording.h"
#include "tests/support/sample_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using archive::ApplianceLog;
using archive::Finding;
using archive::VerificationReport;
using test::Names;
using test::PowerCutFileSystem;

constexpr std::uint64_t kSealedChunk = archive::kAgeChunkBytes + archive::kAgeTagBytes;

/// How many power cuts are played: KIROKU_POWER_CUTS, else a sample.
std::size_t power_cuts() {
  constexpr std::size_t kSample = 60;
  return test::asked_number("KIROKU_POWER_CUTS", kSample);
}

std::string text_in(const fs::path& file) {
  std::ifstream input(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(input), {}};
}

bool holds(const VerificationReport& report) {
  return report.verdict == archive::Verdict::kIntact || report.verdict == archive::Verdict::kIntactWithGaps;
}

std::string findings_of(const VerificationReport& report) {
  std::string text(archive::verdict_name(report.verdict));
  for (const Finding& finding : report.findings) {
    text += "\n  " + finding.code + " " + finding.file + ": " + finding.text;
  }
  return text;
}

std::vector<std::string> codes_of(const VerificationReport& report) {
  std::vector<std::string> codes;
  codes.reserve(report.findings.size());
  for (const Finding& finding : report.findings) codes.push_back(finding.code);
  return codes;
}

/// The simulator itself: it may take only what was not flushed, and now and then it does.
TEST(PowerCutFileSystem, KeepsWhatWasFlushedAndLosesOfTheRestByChance) {
  const test::TemporaryFolder folder(test::quick_parent());
  fs::create_directory(folder / "live");
  const std::string flushed(10'000, 'f'), loose(30'000, 'l');
  PowerCutFileSystem files(folder / "live");
  const auto file = files.create(folder / "live" / "a.part");
  file->write(bytes_of(flushed));
  file->sync();
  files.sync_folder(folder / "live");
  file->write(bytes_of(loose));
  files.rename(folder / "live" / "a.part", folder / "live" / "a");
  std::size_t renamed = 0, whole = 0, with_zeros = 0, shorter = 0;
  constexpr std::size_t kSeeds = 200;
  for (std::size_t seed = 0; seed < kSeeds; ++seed) {
    const fs::path cut = folder / "cut";
    fs::remove_all(cut);
    fs::create_directory(cut);
    files.cut_power(files.steps(), seed, seed % 2 == 0 ? Names::kInOrder : Names::kEachForItself, cut);
    const bool has_new_name = fs::exists(cut / "a");
    const std::string text = text_in(cut / (has_new_name ? "a" : "a.part"));
    ASSERT_EQ(text.substr(0, flushed.size()), flushed);
    renamed += has_new_name ? 1U : 0U;
    whole += text == flushed + loose ? 1U : 0U;
    with_zeros += text.find('\0') != std::string::npos ? 1U : 0U;
    shorter += text.size() < flushed.size() + loose.size() ? 1U : 0U;
  }
  for (const std::size_t some : {renamed, whole, with_zeros, shorter}) {
    EXPECT_GT(some, 0U);
    EXPECT_LT(some, kSeeds);
  }
  const auto known = files.flushed(files.steps());
  EXPECT_THAT(known, testing::ElementsAre(testing::Pair(fs::path("a.part"), flushed.size())));
}

/// An archive in which something is recorded, of which every write and flush is known.
class PowerCutStory : public testing::Test {
 protected:
  [[nodiscard]] virtual fs::path archive() const = 0;
  [[nodiscard]] virtual const crypto::AgeIdentities& identities() const = 0;
  virtual void record(archive::FileSystem& files) = 0;
  virtual std::vector<archive::CaseRecovery> recover(archive::FileSystem& files) = 0;
  [[nodiscard]] virtual archive::VerifyOptions options(bool with_identity) const = 0;

  void clear() const {
    fs::remove_all(archive());
    fs::create_directory(archive());
  }

  [[nodiscard]] std::vector<fs::path> cases() const {
    std::vector<fs::path> found;
    for (const fs::directory_entry& entry : fs::directory_iterator(archive())) {
      if (archive::is_case_id(entry.path().filename().string())) found.push_back(entry.path());
    }
    return found;
  }

  /// Whole chunks that were flushed before power failed must be there afterwards, and open.
  void expect_flushed_chunks(const std::map<fs::path, std::uint64_t>& flushed) const {
    for (const auto& [path, bytes] : flushed) {
      const fs::path below = path.lexically_relative(*path.begin());
      if (bytes <= kSealedChunk || !archive::is_case_id(path.begin()->string()) ||
          *below.begin() != archive::kSegmentsFolder) {
        continue;
      }
      fs::path file = archive() / path;
      if (!fs::exists(file) && file.extension() == archive::kPartSuffix) file.replace_extension();
      ASSERT_TRUE(fs::exists(file)) << path << ", of which " << bytes << " bytes were flushed";
      const auto source = crypto::open_file_source(file);
      const auto sealed = crypto::AgeFile::open(*source, identities(), crypto::Truncation::kTolerate);
      const std::uint64_t payload = bytes - std::min(bytes, sealed.header_size() + archive::kAgeNonceBytes);
      EXPECT_GE(sealed.plaintext_size(), payload / kSealedChunk * archive::kAgeChunkBytes)
          << path << ", of which " << bytes << " bytes were flushed";
    }
  }

  void expect_all_holds(std::map<std::string, std::size_t>& tally) const {
    for (const fs::path& folder : cases()) {
      const VerificationReport sealed = archive::verify_case(folder, options(false));
      const VerificationReport opened = archive::verify_case(folder, options(true));
      EXPECT_TRUE(holds(sealed)) << "without identity: " << findings_of(sealed);
      EXPECT_TRUE(holds(opened)) << "with identity: " << findings_of(opened);
      EXPECT_EQ(archive::verdict_name(sealed.verdict), archive::verdict_name(opened.verdict))
          << findings_of(opened);
      ++tally[std::string(archive::verdict_name(opened.verdict))];
      for (const char* const code : {"segment-incomplete", "segment-part-lost"}) {
        tally[code] += testing::Value(codes_of(opened), testing::Contains(std::string(code))) ? 1U : 0U;
      }
    }
    const VerificationReport log = archive::verify_log(archive() / "log", options(false));
    if (test::is_empty_log(archive() / "log")) {
      EXPECT_EQ(log.verdict, archive::Verdict::kUnproven) << "nobody signed anything";
    } else {
      EXPECT_TRUE(holds(log)) << "the log: " << findings_of(log);
    }
  }

  /// A copy of the disk that nobody recovered. (Half a line behind `close` is damage until then.)
  void expect_unrecovered_is_no_tampering(std::map<std::string, std::size_t>& tally) const {
    for (const fs::path& folder : cases()) {
      archive::VerifyOptions alone = options(false);
      alone.log.reset();
      const VerificationReport report = archive::verify_case(folder, alone);
      if (report.closed) continue;
      ++tally["before recovery " + std::string(archive::verdict_name(report.verdict))];
      EXPECT_NE(archive::verdict_name(report.verdict), "tampered")
          << "not recovered: " << findings_of(report);
    }
  }

  void expect_recovered(const std::vector<archive::CaseRecovery>& recoveries) const {
    for (const archive::CaseRecovery& recovery : recoveries) {
      EXPECT_EQ(recovery.problem, "");
      EXPECT_NE(recovery.outcome, archive::CaseRecovery::Outcome::kRefused);
    }
  }

  /// What is on the disk after a cut of `files`, as far as nobody may take it back.
  struct Flushed {
    std::map<fs::path, std::uint64_t> files;
    std::map<fs::path, std::string> ledgers;  // of cases: their flushed bytes
  };

  Flushed cut_power(const PowerCutFileSystem& files, std::size_t steps, std::uint64_t seed) const {
    clear();
    files.cut_power(steps, seed, seed % 2 == 0 ? Names::kInOrder : Names::kEachForItself, archive());
    Flushed flushed;
    flushed.files = files.flushed(steps);
    for (const auto& [path, bytes] : flushed.files) {
      if (archive::is_case_id(path.parent_path().string()) && path.filename() == archive::kLedgerFile) {
        flushed.ledgers[path] = text_in(archive() / path).substr(0, static_cast<std::size_t>(bytes));
      }
    }
    return flushed;
  }

  void expect_flushed_lines(const Flushed& flushed) const {
    for (const auto& [path, text] : flushed.ledgers) {
      std::string whole = text.substr(0, text.rfind('\n') + 1);
      const std::string kept = text_in(archive() / path);
      // A `close` that nobody had signed yet is cut off by recovery, which says so, and stated again behind
      // `recovered`. Where the power goes again in between, the next recovery finds nothing to cut off.
      const std::size_t last = whole.rfind('\n', whole.size() - 2) + 1;
      if (whole.find(R"("type":"close")", last) == last + 1 &&
          kept.find(R"("type":"recovered")", last) == last + 1) {
        whole.resize(last);
      }
      const auto differ = std::ranges::mismatch(kept, whole).in2;
      EXPECT_TRUE(kept.starts_with(whole)) << path << " lost what was flushed:\n"
                                           << std::string(differ, whole.end()) << "and has\n"
                                           << kept.substr(static_cast<std::size_t>(differ - whole.begin()));
    }
  }

  void play_power_cuts() {
    clear();
    PowerCutFileSystem recording(archive());
    record(recording);
    std::map<std::string, std::size_t> tally;
    expect_all_holds(tally);
    ASSERT_EQ(tally["intact"], 1U);
    tally.clear();
    const std::size_t cuts = power_cuts();
    constexpr std::uint64_t kMuch = 8192;
    const std::vector<std::size_t> loose = recording.steps_with_unflushed(kMuch);
    ASSERT_FALSE(loose.empty());
    std::mt19937_64 random(20'261'123);
    // A recording's steps are never quite the same, and of a sample no cut may lose anything: it is longer
    // then.
    const auto enough = [&](std::size_t done) {
      return done >= cuts && (tally["segment-part-lost"] > 0 || done >= 5 * cuts);
    };
    std::size_t cut = 0;
    for (; !enough(cut) && !HasFailure(); ++cut) {
      // Half of them while much is not flushed, which is a small part of all steps.
      const std::size_t steps =
          cut % 2 == 0 ? loose.at(random() % loose.size()) : 1 + random() % recording.steps();
      SCOPED_TRACE("cut " + std::to_string(cut) + " after step " + std::to_string(steps) + " of " +
                   std::to_string(recording.steps()));
      const Flushed flushed = cut_power(recording, steps, random());
      expect_unrecovered_is_no_tampering(tally);
      if (cut % 3 == 0) {  // and once more while it is being recovered
        PowerCutFileSystem recovering(archive());
        expect_recovered(recover(recovering));
        const std::size_t again = random() % (recovering.steps() + 1);
        const Flushed flushed_again = cut_power(recovering, again, random());
        expect_recovered(recover(archive::real_file_system()));
        expect_flushed_lines(flushed_again);
      } else {
        expect_recovered(recover(archive::real_file_system()));
      }
      expect_flushed_lines(flushed);
      expect_flushed_chunks(flushed.files);
      expect_all_holds(tally);
      EXPECT_TRUE(recover(archive::real_file_system()).empty()) << "once is enough";
    }
    ASSERT_FALSE(HasFailure());
    EXPECT_GT(tally["segment-part-lost"], 0U) << "nothing was lost: the cuts prove nothing";
    std::cout << cut << " power cuts in " << recording.steps() << " steps:";
    for (const auto& [what, count] : tally) std::cout << " " << count << " " << what << ",";
    std::cout << " 0 tampered\n";
  }
};

/// The whole recorder with its threads: pictures, vital signs and a mark. All of it must decode.
class RecorderLosesPower : public PowerCutStory {
 protected:
  [[nodiscard]] fs::path archive() const override { return folder_ / "archive"; }
  [[nodiscard]] const crypto::AgeIdentities& identities() const override { return bench_.identities(); }

  [[nodiscard]] std::unique_ptr<ApplianceLog> log(archive::FileSystem& files) const {
    return ApplianceLog::open(files, archive() / "log", *bench_.options().key, "test");
  }

  void record(archive::FileSystem& files) override {
    const auto log = this->log(files);
    SessionOptions options = bench_.options();
    options.archive = archive();
    options.files = &files;
    options.log = log.get();
    options.segment_duration = 500ms;
    options.video = {bench_.stream("endoscope", "synthetic:pattern?size=640x480&rate=25&speed=max")};
    options.vitals = {bench_.stream("vitals", "synthetic:patient?speed=max")};
    options.duration = 2s;
    options.stamp_interval = 50ms;
    Session session(options);
    session.mark("incision");
    session.run();
  }

  std::vector<archive::CaseRecovery> recover(archive::FileSystem& files) override {
    const auto log = this->log(files);
    const SessionOptions known = bench_.options();
    archive::RecoveryOptions options;
    options.archive = archive();
    options.key = known.key;
    options.device_name = known.device_name;
    options.boot_id = "another";
    options.log = log.get();
    options.stamp = checkpoint_stamper(known.authorities, known.trust, nullptr);
    const archive::RecordingLock lock = archive::RecordingLock::take(files, archive());
    return archive::recover_archive(files, options, lock);
  }

  [[nodiscard]] archive::VerifyOptions options(bool with_identity) const override {
    const SessionOptions known = bench_.options();
    archive::VerifyOptions options;
    options.devices = {crypto::VerifierKey(known.device_name, known.key->public_key())};
    options.trust = known.trust;
    options.log = archive() / "log";
    options.threads = 1;
    if (with_identity) {
      options.identities = &bench_.identities();
      options.inspect = media::decoding_inspector();
    }
    return options;
  }

  test::RecorderBench bench_;
  test::TemporaryFolder folder_{test::quick_parent()};  // flushes are played, and cost nothing there
};

TEST_F(RecorderLosesPower, AtAnyMomentItIsAStatedLossAndNeverTampering) { play_power_cuts(); }

/// The archive's writer alone, call by call, so that each run is like the other: segments of many chunks,
/// some flushed on the way, several entered at once.
class WriterLosesPower : public PowerCutStory {
 protected:
  [[nodiscard]] fs::path archive() const override { return archive_.folder(); }
  [[nodiscard]] const crypto::AgeIdentities& identities() const override { return archive_.identities(); }

  void record(archive::FileSystem& files) override {
    constexpr std::int64_t kSecond = 1'000'000'000;
    test::SampleCase sample(archive_, true, files);
    sample.record();
    std::vector<archive::CaseEntryBody> waiting;
    for (std::uint64_t index = 3; index < 9; ++index) {
      const auto begun = sample.writer().begin_segment(0, index);
      for (int part = 0; part < 6; ++part) {
        begun->write(Bytes(2 * archive::kAgeChunkBytes, static_cast<std::byte>(part)));
        if (part % 4 == 1) begun->sync();
      }
      begun->seal();
      archive::SegmentEntry entry;
      entry.stream = "endoscope";
      entry.index = index;
      entry.file = begun->commit();
      entry.span.start_ns = static_cast<std::int64_t>(2 * index) * kSecond;
      entry.span.end_ns = entry.span.start_ns + 2 * kSecond;
      entry.time_base = "1/90000";
      entry.first_pts = static_cast<std::int64_t>(index) * 180'000;
      entry.frames = 50;
      waiting.emplace_back(std::move(entry));
      archive_.now_ns = static_cast<std::int64_t>(2 * index + 2) * kSecond;
      if (waiting.size() == 3) {
        sample.writer().append(std::exchange(waiting, {}), archive_.now());
        sample.stamp();
      }
    }
    sample.writer().append({sample.segment(1, 1, {6 * kSecond, 12 * kSecond}),
                            sample.segment(1, 2, {12 * kSecond, archive_.now_ns})},
                           archive_.now());
    sample.close();
  }

  std::vector<archive::CaseRecovery> recover(archive::FileSystem& files) override {
    archive_.now_ns = 100'000'000'000;
    const auto log =
        ApplianceLog::open(files, archive_.log_folder(), archive_.key(), test::SampleArchive::kDeviceName);
    archive::RecoveryOptions options;
    options.archive = archive_.folder();
    options.key = &archive_.key();
    options.device_name = test::SampleArchive::kDeviceName;
    options.boot_id = "another";
    options.log = log.get();
    options.now = [this] { return archive_.now().utc; };
    options.stamp = [this](const archive::StoredCheckpoint& over) {
      archive::CheckpointStamp stamp;
      stamp.authority = test::SampleArchive::kAuthorityName;
      stamp.response = archive_.stamp(over.note);
      stamp.facts = test::SampleArchive::facts_of(stamp.response);
      return std::vector<archive::CheckpointStamp>{stamp};
    };
    const archive::RecordingLock lock = archive::RecordingLock::take(files, archive_.folder());
    return archive::recover_archive(files, options, lock);
  }

  [[nodiscard]] archive::VerifyOptions options(bool with_identity) const override {
    archive::VerifyOptions options = archive_.options();
    if (with_identity) {
      options.identities = &archive_.identities();
      // The sample's streams hold noise, which is no film: what is looked at is whether a cut segment of
      // pictures opens.
      options.inspect = [](const auto& stream, const auto& segment, const auto& file,
                           const auto& identities) -> std::optional<archive::InspectionProblem> {
        if (segment.complete || stream.kind != "video") return std::nullopt;
        try {
          static_cast<void>(media::SealedSegment::decrypt(file, segment.complete, identities));
          return std::nullopt;
        } catch (const Error& error) {
          return archive::InspectionProblem{error.what()};
        }
      };
    }
    return options;
  }

  test::SampleArchive archive_;
};

TEST_F(WriterLosesPower, AtAnyMomentItIsAStatedLossAndNeverTampering) { play_power_cuts(); }

/// A segment that was being written when power failed, and what the disk made of it.
class CutSegment : public WriterLosesPower {
 protected:
  static constexpr std::uint64_t kBlock = 4096;

  CutSegment() {
    test::SampleCase sample(archive_);
    sample.record();
    folder_ = sample.folder();
    const auto begun = sample.writer().begin_segment(0, 3);
    header_and_nonce_ = begun->bytes();
    begun->write(Bytes(5 * archive::kAgeChunkBytes + 1, std::byte{7}));
    part_ = folder_ / "segments/endoscope/00000003.ts.age.part";
  }

  [[nodiscard]] std::string contents() const { return text_in(part_); }
  void set_contents(const std::string& text) const { std::ofstream(part_, std::ios::binary) << text; }
  [[nodiscard]] static std::string with_zeros(std::string text, std::size_t from, std::size_t count) {
    std::fill_n(text.begin() + static_cast<std::ptrdiff_t>(from), count, '\0');
    return text;
  }

  std::vector<archive::CaseRecovery> recover_now() { return recover(archive::real_file_system()); }
  [[nodiscard]] VerificationReport verify(bool with_identity) const {
    return archive::verify_case(folder_, options(with_identity));
  }

  /// Recovers, and expects the stated loss with and without identity.
  void expect_stated_loss() {
    const auto recovered = recover_now();
    ASSERT_EQ(recovered.size(), 1U);
    EXPECT_EQ(recovered[0].problem, "");
    EXPECT_EQ(recovered[0].outcome, archive::CaseRecovery::Outcome::kRecovered);
    for (const bool with_identity : {false, true}) {
      const VerificationReport report = verify(with_identity);
      EXPECT_EQ(archive::verdict_name(report.verdict), "intact-with-gaps")
          << (with_identity ? "with identity: " : "without: ") << findings_of(report);
    }
  }

  /// The text of the finding of the lost part; "" if there is none.
  [[nodiscard]] std::string loss() const {
    for (const Finding& finding : verify(true).findings) {
      if (finding.code == "segment-part-lost") return finding.text;
    }
    return "";
  }

  fs::path folder_, part_;
  std::uint64_t header_and_nonce_ = 0;
};

TEST_F(CutSegment, OneBlockWithAHeaderAndZerosHoldsNothing) {
  set_contents(contents().substr(0, header_and_nonce_) + std::string(kBlock - header_and_nonce_, '\0'));
  ASSERT_EQ(fs::file_size(part_), kBlock);
  expect_stated_loss();
  EXPECT_FALSE(fs::exists(part_));
}

TEST_F(CutSegment, OneBlockWithTheBeginningOfAChunkIsAStatedLoss) {
  set_contents(contents().substr(0, kBlock));
  expect_stated_loss();
  EXPECT_TRUE(fs::exists(part_));
}

TEST_F(CutSegment, AChunkThatIsZerosBetweenOthersIsAStatedLossFromThereOn) {
  const std::uint64_t second = header_and_nonce_ + kSealedChunk;
  const std::uint64_t block = (second / kBlock + 1) * kBlock;
  set_contents(with_zeros(contents(), block, kBlock));
  expect_stated_loss();
  EXPECT_THAT(loss(), testing::HasSubstr("from byte " + std::to_string(second) + " on"));
}

TEST_F(CutSegment, ALostFirstBlockIsAStatedLossOfEverything) {
  set_contents(with_zeros(contents(), 0, kBlock));
  expect_stated_loss();
  EXPECT_TRUE(fs::exists(part_)) << "something was sealed in it: that is for people to look at";
  EXPECT_THAT(loss(), testing::HasSubstr("nothing of"));
}

TEST_F(CutSegment, ALostNonceIsAStatedLossOfEverything) {
  set_contents(with_zeros(contents(), header_and_nonce_ - archive::kAgeNonceBytes, archive::kAgeNonceBytes));
  expect_stated_loss();
  EXPECT_THAT(loss(), testing::HasSubstr("from byte " + std::to_string(header_and_nonce_) + " on"));
}

TEST_F(CutSegment, EveryBlockOfTheHeaderAndTheFirstChunkMayBeLost) {
  const std::string whole = contents();
  for (std::uint64_t sector = 0; sector < 2 * kBlock; sector += 512) {
    set_contents(with_zeros(whole, sector, 512));
    const VerificationReport before = verify(true);
    EXPECT_EQ(archive::verdict_name(before.verdict), "incomplete") << findings_of(before);
  }
  set_contents(with_zeros(whole, 512, kBlock));
  expect_stated_loss();
}

TEST_F(CutSegment, ZerosBehindWhatWasFlushedAreStatedInWords) {
  const std::uint64_t flushed = (header_and_nonce_ + 2 * kSealedChunk) / kBlock * kBlock;
  set_contents(with_zeros(contents(), flushed, contents().size() - flushed));
  const std::uint64_t zeros = contents().size() - flushed;
  expect_stated_loss();
  EXPECT_THAT(findings_of(verify(false)), testing::HasSubstr("the last " + std::to_string(zeros)));
  EXPECT_THAT(loss(),
              testing::HasSubstr("from byte " + std::to_string(header_and_nonce_ + kSealedChunk) + " on"));
}

TEST_F(CutSegment, OneThatHoldsNothingIsEnteredWhereAnotherFollows) {
  const std::string whole = contents();
  std::ofstream(folder_ / "segments/endoscope/00000004.ts.age.part", std::ios::binary) << whole;
  set_contents("");
  expect_stated_loss();
  EXPECT_TRUE(fs::exists(part_));
}

TEST_F(CutSegment, WhatChangedAfterRecoverySignedItIsTampering) {
  expect_stated_loss();
  set_contents(with_zeros(contents(), 2 * kBlock, kBlock));
  for (const bool with_identity : {false, true}) {
    const VerificationReport report = verify(with_identity);
    EXPECT_EQ(archive::verdict_name(report.verdict), "tampered");
    EXPECT_THAT(codes_of(report), testing::Contains("file-hash-differs"));
  }
}

/// The excuse is for what recovery found. A recorder that lives says itself what it could not finish, and
/// knows what is in it.
TEST_F(CutSegment, AChunkThatDoesNotOpenIsTamperingWhereARecorderEnteredIt) {
  archive_.clear();
  test::SampleCase sample(archive_);
  sample.record();
  folder_ = sample.folder();
  part_ = folder_ / "segments/endoscope/00000003.ts.age.part";
  const auto begun = sample.writer().begin_segment(0, 3);
  begun->write(Bytes(5 * archive::kAgeChunkBytes + 1, std::byte{7}));
  set_contents(with_zeros(contents(), header_and_nonce_ + kSealedChunk, kBlock));
  archive::SegmentEntry entry;
  entry.stream = "endoscope";
  entry.index = 3;
  entry.file = *begun->salvage();
  entry.span = {6'000'000'000, 7'000'000'000};
  entry.time_base = "1/90000";
  entry.first_pts = 540'000;
  entry.frames = 20;
  entry.complete = false;
  sample.writer().append({entry}, archive_.now());
  sample.close();
  EXPECT_EQ(archive::verdict_name(verify(false).verdict), "intact-with-gaps");
  const VerificationReport report = verify(true);
  EXPECT_EQ(archive::verdict_name(report.verdict), "tampered");
  EXPECT_THAT(codes_of(report), testing::Contains("segment-undecryptable"));
}

TEST_F(CutSegment, ZerosWhereLinesOfTheLedgerWereAreCutOff) {
  const std::string flushed = text_in(folder_ / archive::kLedgerFile);
  const std::string tail = std::string(700, '\0') + "\"frames\":50}\n{\"type\":\"segment\",\"seq\":12}\n";
  std::ofstream(folder_ / archive::kLedgerFile, std::ios::app) << tail;
  const VerificationReport before = verify(true);
  EXPECT_EQ(archive::verdict_name(before.verdict), "incomplete") << findings_of(before);
  expect_stated_loss();
  EXPECT_TRUE(text_in(folder_ / archive::kLedgerFile).starts_with(flushed));
  EXPECT_THAT(findings_of(verify(false)), testing::HasSubstr(std::to_string(tail.size()) + " bytes behind"));
}

TEST_F(CutSegment, ZerosInAWholeLineUnderACheckpointAreTampering) {
  const fs::path ledger = folder_ / archive::kLedgerFile;
  std::string text = text_in(ledger);
  const std::size_t second = text.find('\n') + 1;
  text = with_zeros(text, second, 20);
  std::ofstream(ledger, std::ios::binary) << text;
  EXPECT_EQ(archive::verdict_name(verify(false).verdict), "tampered");
  const auto recovered = recover_now();
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].outcome, archive::CaseRecovery::Outcome::kRefused);
  EXPECT_EQ(text_in(ledger), text) << "nothing is cut off that was signed";
}

}  // namespace
}  // namespace kiroku::recorder
