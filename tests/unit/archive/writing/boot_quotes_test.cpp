// A device whose TPM quotes the measured boot, and falls silent: what its log then says.
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/boot_quote.h"
#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "crypto/encoding.h"
#include "tests/support/software_attester.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class BootQuotes : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<ApplianceLog> open_with(const crypto::SigningKey& key) const {
    return ApplianceLog::open(real_file_system(), folder_ / "log", key, "theatre-1");
  }
  [[nodiscard]] std::unique_ptr<ApplianceLog> open_log() const { return open_with(key_); }
  [[nodiscard]] std::vector<LogLine> lines() const { return read_log(folder_ / "log"); }
  [[nodiscard]] std::vector<std::string> types() const {
    std::vector<std::string> types;
    for (const LogLine& line : lines()) types.push_back(line.type);
    return types;
  }
  template <typename Entry>
  [[nodiscard]] Entry entry(std::size_t number) const {
    return std::get<Entry>(parse_log_entry(lines().at(number).json).entry.value().body);
  }
  [[nodiscard]] std::string codes() const {
    VerifyOptions options;
    options.devices = {device_};
    const VerificationReport report = verify_log(folder_ / "log", options);
    std::string codes(verdict_name(report.verdict));
    for (const Finding& each : report.findings) codes += " " + each.code;
    return codes;
  }
  /// The same device by a program that has another attester, or none.
  [[nodiscard]] crypto::SigningKey key_with(std::shared_ptr<const crypto::HardwareSigner> hardware) const {
    return crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
        .with_hardware(std::move(hardware));
  }

  test::TemporaryFolder folder_{test::quick_parent()};
  std::shared_ptr<test::SoftwareTpmKey> hardware_ = std::make_shared<test::SoftwareTpmKey>();
  test::SoftwareAttester& tpm_ = hardware_->its_attester();
  crypto::SigningKey key_ = crypto::SigningKey::generate().with_hardware(hardware_);
  crypto::VerifierKey device_ = crypto::verifier_key_of("theatre-1", key_);
};

TEST_F(BootQuotes, StandInEachBootOnceTheKeyIsStatedWithAFirstOne) {
  open_log()->boot("b1");
  tpm_.start("loader");
  open_log()->boot("b2");
  tpm_.start("another loader");
  const auto log = open_log();
  log->boot("b3");
  log->shutdown();
  EXPECT_THAT(types(), ElementsAre("boot", "device-hardware-added", "device-attestation-added", "boot",
                                   "boot", "shutdown"));
  EXPECT_EQ(log->stated_keys().attestation, 2U);
  EXPECT_EQ(codes(), "intact boot-quotes-hold measured-boot-changed");
}

TEST_F(BootQuotes, AreAskedForWithThePlaceInTheLog) {
  const auto log = open_log();
  log->boot("b1");
  log->access("*", "1", "who");
  log->boot("b2");
  const auto boot = entry<BootEntry>(4);
  std::string problem;
  const auto said = crypto::parse_tpm_quote(from_stated(boot.quote.value()).value().attest, problem);
  ASSERT_TRUE(said) << problem;
  const auto asked = qualifying_data({device_.to_string(), 4, root_of_log(folder_ / "log", 4), "b2"});
  EXPECT_EQ(said->qualifying_data, to_bytes(asked));
}

TEST_F(BootQuotes, AreAskedForOnceEachBootWhoeverWrites) {
  open_log()->boot("b1");
  open_log()->boot("b2");
  const int asked = tpm_.asked();
  for (int i = 0; i < 3; ++i) {
    const auto log = open_log();
    log->boot("b2");
    log->access("*", "what", "who");
  }
  EXPECT_EQ(tpm_.asked(), asked);
}

TEST_F(BootQuotes, OfATpmThatIsSilentAreAWordWhyAndNoMore) {
  open_log()->boot("b1");
  tpm_.fall_silent();
  const auto log = open_log();
  log->boot("b2");
  log->access("*", "what", "who");
  EXPECT_EQ(entry<BootEntry>(3).no_quote, "the test keeps it silent");
  EXPECT_EQ(codes(), "intact boot-quotes-hold boot-not-quoted");
}

TEST_F(BootQuotes, OfAnotherTpmOrOfNoneAreAWordWhy) {
  open_log()->boot("b1");
  /// The device's own key, and another TPM that quotes.
  class Other : public crypto::HardwareSigner {
   public:
    explicit Other(std::shared_ptr<crypto::HardwareSigner> own, bool quotes)
        : own_(std::move(own)), quotes_(quotes) {}
    [[nodiscard]] const crypto::P256PublicKey& public_key() const override { return own_->public_key(); }
    [[nodiscard]] Answer sign(ByteView message) const override { return own_->sign(message); }
    [[nodiscard]] const crypto::BootAttester* attester() const override {
      return quotes_ ? &other_ : nullptr;
    }

   private:
    std::shared_ptr<crypto::HardwareSigner> own_;
    bool quotes_;
    test::SoftwareAttester other_;
  };
  const crypto::SigningKey other = key_with(std::make_shared<Other>(hardware_, true));
  open_with(other)->boot("b2");
  const crypto::SigningKey none = key_with(std::make_shared<Other>(hardware_, false));
  open_with(none)->boot("b3");
  EXPECT_THAT(entry<BootEntry>(3).no_quote.value_or(""), HasSubstr("another attestation key"));
  EXPECT_THAT(entry<BootEntry>(4).no_quote.value_or(""), HasSubstr("no attestation key"));
  open_log()->access("*", "what", "who");
  EXPECT_THAT(codes(), HasSubstr("boot-not-quoted"));
  EXPECT_THAT(codes(), HasSubstr("intact"));
}

TEST_F(BootQuotes, AKeyThatDoesNotQuoteIsNotStatedAndHoldsUpNothing) {
  tpm_.fall_silent();
  const auto log = open_log();
  log->access("*", "1", "who");
  log->access("*", "2", "who");
  EXPECT_EQ(tpm_.asked(), 1) << "not again with each entry";
  EXPECT_FALSE(log->state_keys().attestation);
  EXPECT_EQ(log->stated_keys().not_attested, "the test keeps it silent");
  EXPECT_EQ(codes(), "intact") << "nothing is awaited of a boot";
  tpm_.fall_silent(false);
  EXPECT_EQ(open_log()->state_keys().attestation, 4U);
  EXPECT_EQ(codes(), "intact boot-quotes-hold");
}

TEST_F(BootQuotes, ALogFromBeforeIsWhatItWas) {
  const crypto::SigningKey from_before = key_with(std::make_shared<test::SoftwareHardwareKey>());
  {
    const auto log = ApplianceLog::open(real_file_system(), folder_ / "old", from_before, "theatre-1");
    log->boot("b1");
    log->boot("b2");
    log->access("*", "what", "who");
  }
  VerifyOptions options;
  options.devices = {crypto::verifier_key_of("theatre-1", from_before)};
  const VerificationReport report = verify_log(folder_ / "old", options);
  EXPECT_EQ(report.verdict, Verdict::kIntact);
  EXPECT_TRUE(report.findings.empty());
}

}  // namespace
}  // namespace kiroku::archive
