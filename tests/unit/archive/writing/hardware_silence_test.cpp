// A device whose hardware signs, and falls silent: what its log and its cases then are.
#include <algorithm>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/retention.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "tests/support/case_kit.h"
#include "tests/support/software_hardware_key.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class HardwareSilence : public testing::Test {
 protected:
  std::unique_ptr<ApplianceLog> open_log() {
    return ApplianceLog::open(real_file_system(), folder_ / "log", key_, "theatre-1");
  }
  [[nodiscard]] std::vector<std::string> log_types() const {
    std::vector<std::string> types;
    for (const LogLine& line : read_log(folder_ / "log")) types.push_back(line.type);
    return types;
  }
  /// A case that is being recorded.
  std::unique_ptr<CaseWriter> begin() {
    CaseWriter::Options options = kit_.options();
    options.key = &key_;
    options.streams.resize(1);
    options.stream_recipients.resize(1);
    auto writer = CaseWriter::create(real_file_system(), options, test::moment(0));
    writer->checkpoint(test::moment(1));
    return writer;
  }
  std::unique_ptr<CaseWriter> take_up(const fs::path& folder) {
    return CaseWriter::resume(real_file_system(), folder, key_, "theatre-1", nullptr,
                              [](const CaseEntry&) {});
  }
  static GapEntry gap() { return {"room", {1, 2}}; }
  static void end(CaseWriter& writer) {
    writer.append({test::commit_segment(writer, 0, "room", 0, "pictures")}, test::moment(3'000'000'000));
    writer.close("ended", test::moment(4'000'000'000));
    writer.checkpoint(test::moment(4'000'000'000));
  }
  Erasure erase(const fs::path& folder, const crypto::SigningKey& key) {
    RetentionOptions options;
    options.key = &key;
    options.device_name = "theatre-1";
    return erase_stream(real_file_system(), options, folder, "room", "room: 30 days");
  }
  [[nodiscard]] static std::string text_of_file(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] crypto::SigningKey copied() const {
    return crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr);
  }
  [[nodiscard]] VerificationReport verify(const fs::path& folder) const {
    VerifyOptions options;
    options.devices = {device_};
    return verify_case(folder, options);
  }
  [[nodiscard]] static std::vector<std::string> codes(const VerificationReport& report) {
    std::vector<std::string> codes;
    for (const Finding& finding : report.findings) codes.emplace_back(finding.code);
    return codes;
  }

  test::TemporaryFolder folder_{test::quick_parent()};
  test::CaseKit kit_{folder_.path()};
  std::shared_ptr<test::SoftwareHardwareKey> hardware_ = std::make_shared<test::SoftwareHardwareKey>();
  crypto::SigningKey key_ = crypto::SigningKey::generate().with_hardware(hardware_);
  crypto::VerifierKey device_ = crypto::verifier_key_of("theatre-1", key_);
};

TEST_F(HardwareSilence, IsStatedInTheLogOnceEachTime) {
  const auto log = open_log();
  log->access("*", "1", "who");
  hardware_->fall_silent();
  log->access("*", "2", "who");
  log->access("*", "3", "who");
  log->access("*", "4", "who");
  hardware_->fall_silent(false);
  log->access("*", "5", "who");
  hardware_->fall_silent();
  log->access("*", "6", "who");
  log->access("*", "7", "who");
  EXPECT_THAT(log_types(),
              ElementsAre("boot", "device-hardware-added", "access", "access", "device-hardware-silent",
                          "access", "access", "access", "access", "device-hardware-silent", "access"));
  const auto stated = parse_log_entry(read_log(folder_ / "log")[4].json);
  EXPECT_EQ(std::get<DeviceHardwareSilentEntry>(stated.entry->body).why, "the test keeps it silent");
  EXPECT_EQ(open_log()->stated_keys().hardware, 1U);
}

TEST_F(HardwareSilence, OfAKeyThatIsNotGivenIsStatedToo) {
  open_log()->access("*", "1", "who");
  const crypto::SigningKey without = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr);
  ApplianceLog::open(real_file_system(), folder_ / "log", without, "theatre-1")->access("*", "2", "who");
  EXPECT_THAT(log_types(),
              ElementsAre("boot", "device-hardware-added", "access", "device-hardware-silent", "access"));
}

TEST_F(HardwareSilence, AnotherKeyInHardwareSignsNothingInThatLog) {
  open_log()->access("*", "1", "who");
  const crypto::SigningKey other = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
                                       .with_hardware(std::make_shared<test::SoftwareHardwareKey>());
  EXPECT_THAT([&] { ApplianceLog::open(real_file_system(), folder_ / "log", other, "theatre-1"); },
              testing::ThrowsMessage<Error>(HasSubstr("another key in the hardware")));
}

TEST_F(HardwareSilence, ASilentLogIsUnprovenAndOneThatIsSignedAgainIsNot) {
  const auto log = open_log();
  log->access("*", "1", "who");
  hardware_->fall_silent();
  log->access("*", "2", "who");
  VerifyOptions options;
  options.devices = {device_};
  EXPECT_THAT(codes(verify_log(folder_ / "log", options)), Contains("checkpoint-not-by-hardware"));
  hardware_->fall_silent(false);
  log->access("*", "3", "who");
  const VerificationReport again = verify_log(folder_ / "log", options);
  EXPECT_THAT(codes(again), Contains("checkpoint-hardware-missing"));
  EXPECT_THAT(codes(again), Not(Contains("checkpoint-not-by-hardware")));
  EXPECT_EQ(again.signatures, SignaturesChecked::kHardware);
}

TEST_F(HardwareSilence, UntilTheEndOfACaseIsUnprovenAndLosesNothing) {
  const auto writer = begin();
  hardware_->fall_silent();
  end(*writer);
  const VerificationReport report = verify(writer->folder());
  EXPECT_EQ(report.verdict, Verdict::kUnproven);
  EXPECT_THAT(codes(report), Contains("checkpoint-not-by-hardware"));
  EXPECT_EQ(report.signatures, SignaturesChecked::kEd25519);
  EXPECT_EQ(report.checkpoints, 2U) << "all that was recorded is there, and signed by Ed25519";
}

TEST_F(HardwareSilence, InTheMiddleOfACaseIsCountedAndCovered) {
  const auto writer = begin();
  hardware_->fall_silent();
  writer->append({gap()}, test::moment(2));
  writer->checkpoint(test::moment(2));
  hardware_->fall_silent(false);
  end(*writer);
  const VerificationReport report = verify(writer->folder());
  EXPECT_THAT(codes(report), Contains("checkpoint-hardware-missing"));
  EXPECT_THAT(codes(report), Not(Contains("checkpoint-not-by-hardware")));
  EXPECT_EQ(report.signatures, SignaturesChecked::kHardware);
}

TEST_F(HardwareSilence, ACaseThatIsTakenUpWithoutItsHardwareIsNotSignedByItLater) {
  fs::path folder;
  {
    const auto writer = begin();
    folder = writer->folder();
    // Somebody with a copy of the other keys, and the disk, writes on; or the hardware was silent.
    hardware_->fall_silent();
    writer->append({gap()}, test::moment(2));
    writer->checkpoint(test::moment(2));
  }
  hardware_->fall_silent(false);
  const auto writer = take_up(folder);
  writer->close("ended", test::moment(4'000'000'000));
  writer->checkpoint(test::moment(4'000'000'000));
  EXPECT_THAT(codes(verify(folder)), Contains("checkpoint-not-by-hardware"));
}

TEST_F(HardwareSilence, ACaseThatTheHardwareSignedIsTakenUpAndSignedByIt) {
  fs::path folder;
  {
    const auto writer = begin();
    folder = writer->folder();
  }
  const auto writer = take_up(folder);
  writer->close("ended", test::moment(4'000'000'000));
  writer->checkpoint(test::moment(4'000'000'000));
  const VerificationReport report = verify(folder);
  EXPECT_THAT(codes(report), Not(Contains("checkpoint-not-by-hardware")));
  EXPECT_EQ(report.signatures, SignaturesChecked::kHardware);
}

TEST_F(HardwareSilence, AfterTheNewestClaimTakesNothingFromACaseThatIsTakenUp) {
  fs::path folder;
  {
    const auto writer = begin();
    folder = writer->folder();
    hardware_->fall_silent();
    writer->append({TokenMissedEntry{writer->covered(), "none", "no authority was at hand"}},
                   test::moment(2));
    writer->checkpoint(test::moment(2));
  }
  hardware_->fall_silent(false);
  const auto writer = take_up(folder);
  EXPECT_TRUE(writer->rests_on_hardware());
  writer->close("ended", test::moment(4'000'000'000));
  writer->checkpoint(test::moment(4'000'000'000));
  const VerificationReport report = verify(folder);
  EXPECT_THAT(codes(report), Not(Contains("checkpoint-not-by-hardware")));
  EXPECT_EQ(report.signatures, SignaturesChecked::kHardware);
}

TEST_F(HardwareSilence, HasNothingErasedFromACaseThatTheHardwareSigned) {
  auto writer = begin();
  const fs::path folder = writer->folder();
  end(*writer);
  writer.reset();
  ASSERT_THAT(codes(verify(folder)), Not(Contains("checkpoint-not-by-hardware")));
  const std::string before = text_of_file(folder / kLedgerFile);
  const auto refused = testing::ThrowsMessage<Error>(HasSubstr("nothing was erased"));
  hardware_->fall_silent();
  EXPECT_THAT([&] { erase(folder, key_); }, refused);
  EXPECT_THAT([&] { erase(folder, copied()); }, refused) << "nor by a program that has no such key";
  EXPECT_EQ(text_of_file(folder / kLedgerFile), before);
  hardware_->fall_silent(false);
  EXPECT_EQ(erase(folder, key_).segments, 1U);
  EXPECT_THAT(codes(verify(folder)), Not(Contains("checkpoint-not-by-hardware")));
}

TEST_F(HardwareSilence, LetsErasureBeWhereACaseEndedInIt) {
  auto writer = begin();
  const fs::path folder = writer->folder();
  hardware_->fall_silent();
  end(*writer);
  writer.reset();
  EXPECT_EQ(erase(folder, key_).segments, 1U) << "it is unproven already";
}

TEST_F(HardwareSilence, OfAnotherKeyThanTheOneToBeStatedIsNotStatedForGood) {
  /// A TPM that was cleared, or another machine's: it signs, and by no key that anybody knows.
  class Cleared : public crypto::HardwareSigner {
   public:
    [[nodiscard]] const crypto::P256PublicKey& public_key() const override { return known_.public_key(); }
    [[nodiscard]] Answer sign(ByteView message) const override { return now_.sign(message); }

   private:
    test::SoftwareHardwareKey known_, now_;
  };
  const crypto::SigningKey key = copied().with_hardware(std::make_shared<Cleared>());
  const auto log = ApplianceLog::open(real_file_system(), folder_ / "log", key, "theatre-1");
  EXPECT_THAT([&] { log->state_keys(); }, testing::ThrowsMessage<Error>(HasSubstr("does not fit the key")));
  EXPECT_FALSE(log->stated_keys().hardware);
}

TEST_F(HardwareSilence, TheRootOfALogIsThatOfItsFirstLines) {
  const auto log = open_log();
  log->access("*", "1", "who");
  const ApplianceLog::Head head = log->head();
  log->access("*", "2", "who");
  EXPECT_EQ(root_of_log(folder_ / "log", head.size), head.root);
  EXPECT_THROW(root_of_log(folder_ / "log", log->size() + 1), Error);
}

}  // namespace
}  // namespace kiroku::archive
