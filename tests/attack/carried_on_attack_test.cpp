// Attacks on the link between cases of one operation: by somebody without any key, by somebody with a device
// of their own, and by the owner of the device. The chain of three cases is made as a recorder makes it.
#include <algorithm>

#include "archive/format/case_layout.h"
#include "archive/upkeep/recovery.h"
#include "archive/verify/found_files.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "tests/attack/attack_table.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::CarriedOn;
using archive::Verdict;
using archive::VerificationReport;
using ::testing::HasSubstr;
using ::testing::Not;

/// The earlier case as a later one names it.
CarriedOn named(const fs::path& folder) {
  CarriedOn earlier{folder.filename().string(), archive::newest_note(folder), {}};
  const std::string text = read_file(folder / archive::kLedgerFile);
  crypto::MerkleFrontier tree;
  std::size_t at = 0;
  while (tree.size() < earlier.size) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) throw std::logic_error("the ledger is shorter than its newest note");
    tree.append(crypto::merkle_leaf_hash(bytes_of(std::string_view(text).substr(at, end - at))));
    at = end + 1;
  }
  earlier.root = tree.root();
  return earlier;
}

archive::CaseWriter::Options writing(const SampleArchive& archive, const crypto::SigningKey& key) {
  archive::CaseWriter::Options options;
  options.archive = archive.folder();
  options.key = &key;
  options.device_name = SampleArchive::kDeviceName;
  options.streams = {
      {"endoscope", "video", "video/mp2t", "/dev/video0", "mpeg2", "endoscope", {}, "arrival", ""},
      {"events", "events", "application/jsonl", "operator", "jsonl", "", {}, "arrival", ""}};
  options.stream_recipients = {archive.recipients(), archive.recipients()};
  options.boot_id = "00000000-0000-4000-8000-000000000000";
  return options;
}

/// A case of an operation, of which the recorder dies; then its recovery, which announces `later` ("": none).
fs::path record_and_recover(SampleArchive& archive, const std::string& id,
                            const std::optional<CarriedOn>& earlier, const std::string& later) {
  archive::FileSystem& files = archive::real_file_system();
  const auto log =
      archive::ApplianceLog::open(files, archive.log_folder(), archive.key(), SampleArchive::kDeviceName);
  archive::CaseWriter::Options options = writing(archive, archive.key());
  options.log = log.get();
  options.case_id = id;
  options.carries_on = earlier;
  archive.now_ns = 0;
  fs::path folder;
  {
    const auto writer = archive::CaseWriter::create(files, options, archive.now());
    folder = writer->folder();
    archive.now_ns = kSecond;
    writer->append({archive::ClockEntry{true, 0, 1'000'000, 0}}, archive.now());
    writer->checkpoint(archive.now(), true);
  }
  archive::RecoveryOptions recovery;
  recovery.archive = archive.folder();
  recovery.key = &archive.key();
  recovery.device_name = SampleArchive::kDeviceName;
  recovery.boot_id = options.boot_id;
  recovery.log = log.get();
  recovery.now = [&archive] { return archive.now().utc; };
  recovery.carry_on = [&later](const archive::CutOffCase&) { return later; };
  const archive::RecordingLock lock = archive::RecordingLock::take(files, archive.folder());
  archive::recover_archive(files, recovery, lock);
  return folder;
}

constexpr const char* kFirst = "20260805T091502Z-00000001";
constexpr const char* kMiddle = "20260805T091502Z-00000002";
constexpr const char* kLast = "20260805T091502Z-00000003";
constexpr const char* kNever = "20260805T091502Z-00000004";

struct Operation {
  Operation() {
    const fs::path first = record_and_recover(archive, kFirst, {}, kMiddle);
    const fs::path middle = record_and_recover(archive, kMiddle, named(first), kLast);
    record_and_recover(archive, kLast, named(middle), "");
  }
  SampleArchive archive;
  static Operation& get() {
    static Operation operation;
    return operation;
  }
};

class AttackOnAnOperation : public ::testing::Test {
 protected:
  AttackOnAnOperation() {
    fs::copy(Operation::get().archive.folder(), archive_, fs::copy_options::recursive);
  }

  [[nodiscard]] fs::path folder(const std::string& id) const { return archive_ / id; }
  [[nodiscard]] VerificationReport verify(const std::string& id) const {
    return archive::verify_case(folder(id), options());
  }
  [[nodiscard]] VerificationReport verify_log() const {
    return archive::verify_log(archive_ / "log", options());
  }
  /// Text of the findings of one code.
  static std::string told(const VerificationReport& report, const std::string& code) {
    std::string text;
    for (const archive::Finding& finding : report.findings) {
      if (finding.code == code) text += finding.text + "\n";
    }
    return text;
  }
  void expect_broken(const std::string& id, const std::string& why) const {
    const VerificationReport report = verify(id);
    EXPECT_EQ(report.verdict, Verdict::kTampered) << id << details(report);
    EXPECT_THAT(told(report, "carrying-on-broken"), HasSubstr(why)) << id << details(report);
  }
  /// Whatever lies in the place of the other case, this one's device did not sign it there.
  void expect_not_compared(const std::string& id, const std::string& why) const {
    const VerificationReport report = verify(id);
    EXPECT_NE(report.verdict, Verdict::kTampered) << id << details(report);
    EXPECT_THAT(told(report, "carried-on-not-compared"), HasSubstr(why)) << id << details(report);
    EXPECT_EQ(told(report, "carrying-on-broken"), "") << id;
  }
  void expect_not_here(const std::string& id, const std::string& other) const {
    const VerificationReport report = verify(id);
    EXPECT_NE(report.verdict, Verdict::kTampered) << id << details(report);
    EXPECT_THAT(told(report, "carried-on-not-here"), HasSubstr(other)) << id << details(report);
  }
  void replace_in_ledger(const std::string& id, const std::string& from, const std::string& to) const {
    std::string text = read_file(folder(id) / archive::kLedgerFile);
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    write_file(folder(id) / archive::kLedgerFile, text.replace(at, from.size(), to));
  }
  /// A case with any key in the place of `id`, closed by its recorder.
  void put_in_place(const std::string& id, const crypto::SigningKey& key,
                    const std::optional<CarriedOn>& earlier, int more_entries = 0) {
    SampleArchive elsewhere;
    archive::CaseWriter::Options options = writing(elsewhere, key);
    options.case_id = id;
    options.carries_on = earlier;
    const auto writer = archive::CaseWriter::create(archive::real_file_system(), options, elsewhere.now());
    for (int i = 0; i < more_entries; ++i) {
      writer->append({archive::ClockEntry{true, 0, 1'000'000, 0}}, elsewhere.now());
    }
    writer->close("operator", elsewhere.now());
    writer->finish(elsewhere.now());
    fs::remove_all(folder(id));
    fs::copy(writer->folder(), folder(id), fs::copy_options::recursive);
  }

  void log_goes_on(int entries) const {
    const auto log = archive::ApplianceLog::open(archive::real_file_system(), archive_ / "log",
                                                 Operation::get().archive.key(), SampleArchive::kDeviceName);
    for (int i = 0; i < entries; ++i) log->access("*", "unlocked", "sato");
  }

 private:
  [[nodiscard]] archive::VerifyOptions options() const {
    archive::VerifyOptions options = Operation::get().archive.options();
    options.log = archive_ / "log";
    return options;
  }

  TemporaryFolder temporary_;
  const fs::path archive_ = temporary_ / "archive";
};

TEST_F(AttackOnAnOperation, NobodyDidAnything) {
  for (const char* id : {kFirst, kMiddle, kLast}) {
    const VerificationReport report = verify(id);
    EXPECT_NE(report.verdict, Verdict::kTampered) << id << details(report);
    EXPECT_THAT(told(report, "carrying-on-holds"), Not("")) << id << details(report);
    EXPECT_EQ(told(report, "carrying-on-broken") + told(report, "carried-on-not-here"), "") << id;
  }
  // The middle one is compared with both.
  EXPECT_THAT(told(verify(kMiddle), "carrying-on-holds"), HasSubstr(kFirst));
  EXPECT_THAT(told(verify(kMiddle), "carrying-on-holds"), HasSubstr(kLast));
  EXPECT_NE(verify_log().verdict, Verdict::kTampered) << details(verify_log());
}

TEST_F(AttackOnAnOperation, ALinkThatWasWrittenAnewIsSeenInItsOwnLedger) {
  replace_in_ledger(kLast, std::string("carries on case ") + kMiddle,
                    std::string("carries on case ") + kFirst);
  EXPECT_THAT(summary(verify(kLast)), HasSubstr("ledger-changed"));
  replace_in_ledger(kFirst, std::string("carried on as case ") + kMiddle,
                    std::string("carried on as case ") + kLast);
  EXPECT_EQ(verify(kFirst).verdict, Verdict::kTampered);
  EXPECT_THAT(summary(verify(kFirst)), HasSubstr("ledger-changed"));
}

TEST_F(AttackOnAnOperation, AHiddenMiddleCaseIsMissedFromBothSidesAndByTheLog) {
  fs::remove_all(folder(kMiddle));
  expect_not_here(kFirst, kMiddle);
  expect_not_here(kLast, kMiddle);
  EXPECT_EQ(verify_log().verdict, Verdict::kTampered);
  EXPECT_THAT(told(verify_log(), "case-missing"), HasSubstr(kMiddle));
}

TEST_F(AttackOnAnOperation, TheLastCaseUnderTheNameOfTheHiddenOneIsToldAsNeither) {
  fs::remove_all(folder(kMiddle));
  fs::copy(folder(kLast), folder(kMiddle), fs::copy_options::recursive);
  expect_not_compared(kFirst, "does not say that it carries this one on");
  expect_not_compared(kLast, kMiddle);
  EXPECT_THAT(summary(verify(kMiddle)), HasSubstr("folder-of-another-case"));
  EXPECT_EQ(verify_log().verdict, Verdict::kTampered);
}

TEST_F(AttackOnAnOperation, AnEarlierCopyOfTheCaseThatIsCarriedOnIsTold) {
  const std::string text = read_file(folder(kMiddle) / archive::kLedgerFile);
  const std::size_t last_line = text.rfind('\n', text.size() - 2);
  write_file(folder(kMiddle) / archive::kLedgerFile, text.substr(0, last_line + 1));
  expect_not_compared(kLast, "the end of that one was removed");
  EXPECT_EQ(verify(kMiddle).verdict, Verdict::kTampered);
}

TEST_F(AttackOnAnOperation, WhatAnybodyPutsIntoThePlaceOfAnotherCaseAccusesNoneOfThem) {
  for (const std::string text : {"", "hello\n", "{}\n"}) {
    write_file(folder(kMiddle) / archive::kLedgerFile, text);
    expect_not_compared(kFirst, "");
    expect_not_compared(kLast, "");
    EXPECT_EQ(verify(kMiddle).verdict, Verdict::kTampered);
  }
}

TEST_F(AttackOnAnOperation, AnotherEarlierCaseInItsPlaceIsTold) {
  replace_in_ledger(kMiddle, "\"synchronised\":true", "\"synchronised\":false");
  expect_not_compared(kLast, "which the device did not sign");
  // The same by the device.
  put_in_place(kMiddle, Operation::get().archive.key(), named(folder(kFirst)), 20);
  expect_broken(kLast, "are not those of the one beside it");
}

TEST_F(AttackOnAnOperation, ACaseElsewhereIsNoReproachAndIsNotReadOverALink) {
  TemporaryFolder elsewhere;
  fs::copy(folder(kMiddle), elsewhere / kMiddle, fs::copy_options::recursive);
  fs::remove_all(folder(kMiddle));
  fs::create_directory_symlink(elsewhere / kMiddle, folder(kMiddle));
  expect_not_here(kFirst, kMiddle);
  expect_not_here(kLast, kMiddle);
}

TEST_F(AttackOnAnOperation, AStrangersDeviceCannotWriteTheCaseThatWasAnnounced) {
  put_in_place(kMiddle, crypto::SigningKey::generate(), named(folder(kFirst)));
  expect_not_compared(kFirst, "names another device");
  expect_not_compared(kLast, kMiddle);
  EXPECT_NE(verify(kMiddle).verdict, Verdict::kIntact);
}

TEST_F(AttackOnAnOperation, TheDevicesOwnerCannotCarryOnWhatAnnouncedAnotherCase) {
  put_in_place(kNever, Operation::get().archive.key(), named(folder(kFirst)));
  expect_broken(kNever, "which does not announce it");
  // The appliance log, which went on, does not know it, either.
  log_goes_on(65);
  EXPECT_THAT(summary(verify(kNever)), HasSubstr("log-case-unknown"));
}

TEST_F(AttackOnAnOperation, MoreEntriesThanThereAreCostNothing) {
  CarriedOn earlier = named(folder(kFirst));
  earlier.size = std::numeric_limits<std::uint64_t>::max();
  put_in_place(kMiddle, Operation::get().archive.key(), earlier);
  // A later copy of that one can have them; the appliance log knows that the device never did.
  EXPECT_THAT(told(verify(kMiddle), "carried-on-not-compared"),
              HasSubstr("entries, and what lies beside it has"));
  EXPECT_THAT(summary(verify(kMiddle)), HasSubstr("log-opening-differs"));
  expect_broken(kFirst, "than there are here");
  expect_broken(kFirst, "the end of this one was removed, or it is a copy from before");
}

// Whoever saw the later case can write its first line, or one that names the earlier case likewise.
TEST_F(AttackOnAnOperation, AFirstLineThatNobodySignedIsNoLaterCase) {
  const std::string text = read_file(folder(kLast) / archive::kLedgerFile);
  fs::remove_all(folder(kLast));
  fs::create_directory(folder(kLast));
  write_file(folder(kLast) / archive::kLedgerFile, text.substr(0, text.find('\n') + 1));
  expect_not_compared(kMiddle, "did not sign what lies there");
  EXPECT_THAT(told(verify(kMiddle), "carrying-on-holds"), Not(HasSubstr(kLast)));
}

TEST_F(AttackOnAnOperation, ALedgerWithoutAFirstEntryBesideItIsNoCrash) {
  // Whoever owns the device can name any bytes as the first entries of a case.
  const std::string close = "{\"type\":\"close\"}\n";
  fs::remove_all(folder(kFirst) / "checkpoints");
  write_file(folder(kFirst) / archive::kLedgerFile, close);
  crypto::MerkleFrontier tree;
  tree.append(crypto::merkle_leaf_hash(bytes_of(std::string_view(close).substr(0, close.size() - 1))));
  put_in_place(kMiddle, Operation::get().archive.key(), CarriedOn{kFirst, 1, tree.root()});
  expect_broken(kMiddle, "which does not announce it");
}

}  // namespace
}  // namespace kiroku::test
