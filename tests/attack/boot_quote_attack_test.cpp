// Somebody with the device's own keys, and its disk, has the log tell of another boot than there was. The
// quotes are a real TPM's, which swtpm plays. What somebody could do who has the attestation key itself is in
// tests/foreign/forgeries.py.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/boot_quote.h"
#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "recorder/device_key/hardware_description.h"
#include "tests/support/software_tpm.h"
#include "tests/support/temporary_folder.h"

namespace kiroku {
namespace {

namespace fs = std::filesystem;
using archive::BootEntry;
using archive::LogEntry;
using archive::StatedQuote;

class BootQuoteAttack : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::SoftwareTpm::is_installed()) GTEST_SKIP() << test::SoftwareTpm::kWhySkipped;
    tpm_.emplace(folder_ / "t");
    description_ = recorder::make_hardware_key(recorder::HardwareDescription::Kind::kTpm, tpm_->tcti());
    description_.attestation_key = recorder::find_attestation_key(description_);
    measure_firmware();
    boot("b1");
    start_again();
    boot("b2");
    start_again();
    boot("b3");
  }

  [[nodiscard]] crypto::SigningKey key() const {
    return copied_key().with_hardware(recorder::hardware_signer(description_, {}));
  }
  [[nodiscard]] crypto::SigningKey copied_key() const {
    return crypto::SigningKey::from_pem(pem_.text(), nullptr);
  }
  /// The recorder starts, signs, and lets go of the TPM.
  void boot(const std::string& boot_id) {
    const crypto::SigningKey key = this->key();
    const auto log = archive::ApplianceLog::open(archive::real_file_system(), log_, key, "theatre-1");
    log->boot(boot_id);
    log->shutdown();
  }
  void start_again() {
    start_unmeasured();
    measure_firmware();
  }
  void start_unmeasured() {
    tpm_->take_away();
    tpm_->start();
  }
  /// As every firmware does.
  void measure_firmware() {
    for (unsigned pcr = 0; pcr < 8; ++pcr) tpm_->measure(pcr, 0x11);
  }
  [[nodiscard]] std::vector<LogEntry> entries() const {
    std::vector<LogEntry> entries;
    for (const archive::LogLine& line : archive::read_log(log_))
      entries.push_back(archive::parse_log_entry(line.json).entry.value());
    return entries;
  }
  /// The log made anew of these entries, and signed by all keys of the device.
  void sign_anew(const std::vector<LogEntry>& entries) const {
    const crypto::SigningKey key = signs_by_hardware_ ? this->key() : copied_key();
    fs::remove_all(log_ / archive::kCheckpointsFolder);
    fs::create_directories(log_ / archive::kCheckpointsFolder);
    std::ofstream out(log_ / archive::kLedgerFile, std::ios::binary);
    crypto::MerkleFrontier tree;
    for (const LogEntry& entry : entries) {
      const std::string line = archive::to_line(entry);
      out << line << '\n';
      tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
      const crypto::Checkpoint checkpoint{archive::log_origin("theatre-1"), tree.size(), tree.root()};
      std::ofstream(log_ / archive::note_path(tree.size()), std::ios::binary)
          << crypto::sign_note(checkpoint.to_text(), "theatre-1", key);
    }
  }
  [[nodiscard]] std::string verdict() const {
    archive::VerifyOptions options;
    options.devices = {crypto::verifier_key_of("theatre-1", signs_by_hardware_ ? key() : copied_key())};
    const archive::VerificationReport report = archive::verify_log(log_, options);
    std::string said(archive::verdict_name(report.verdict));
    for (const archive::Finding& each : report.findings) {
      if (each.code != "boot-quotes-hold")
        said += " " + each.code + (each.entry ? " " + std::to_string(*each.entry) : "");
    }
    return said;
  }
  static BootEntry& boot_of(LogEntry& entry) { return std::get<BootEntry>(entry.body); }
  static StatedQuote& quote_of(LogEntry& entry) { return boot_of(entry).quote.value(); }
  /// What the TPM that this description names quotes for the place of an entry.
  [[nodiscard]] StatedQuote ask(const recorder::HardwareDescription& tpm,
                                const std::vector<LogEntry>& entries, std::uint64_t number) const {
    crypto::MerkleFrontier tree;
    for (std::uint64_t i = 0; i < number; ++i)
      tree.append(crypto::merkle_leaf_hash(bytes_of(archive::to_line(entries.at(i)))));
    const auto& boot = std::get<BootEntry>(entries.at(number).body);
    const auto signer = recorder::hardware_signer(tpm, {});
    const auto answer =
        signer->attester()->quote(archive::qualifying_data({boot.device, number, tree.root(), boot.boot_id}));
    return archive::to_stated(answer.quote.value());
  }

  // boot, device-hardware-added, device-attestation-added, shutdown, boot, shutdown, boot, shutdown
  static constexpr std::uint64_t kSecondBoot = 4, kThirdBoot = 6;
  bool signs_by_hardware_ = true;
  test::TemporaryFolder folder_;
  fs::path log_ = folder_ / "log";
  std::optional<test::SoftwareTpm> tpm_;
  recorder::HardwareDescription description_;
  const crypto::Secret pem_ = crypto::SigningKey::generate().to_pem(nullptr);
};

TEST_F(BootQuoteAttack, NobodyAttacks) {
  EXPECT_EQ(verdict(), "intact");
  const auto before = entries();
  sign_anew(before);
  EXPECT_EQ(verdict(), "intact") << "whoever signs the same anew changes nothing";
}

TEST_F(BootQuoteAttack, AnotherBootLoaderIsToldAndIsNoForgery) {
  start_again();
  tpm_->measure(4, 0xbb);
  boot("b4");
  EXPECT_EQ(verdict(), "intact measured-boot-changed 8");
}

TEST_F(BootQuoteAttack, RegistersWithNothingInThemSayNothingOfTheBoot) {
  // The firmware measures into another bank, so that whoever starts the machine fills these as they like.
  start_unmeasured();
  boot("b4");
  EXPECT_EQ(verdict(), "intact boot-not-measured 8 measured-boot-changed 8");
  start_unmeasured();
  for (unsigned pcr = 0; pcr < 7; ++pcr) tpm_->measure(pcr, 0x11);
  boot("b5");
  EXPECT_EQ(verdict(), "intact measured-boot-changed 8 boot-not-measured 10 measured-boot-changed 10")
      << "one that is empty says it of all";
}

TEST_F(BootQuoteAttack, AnotherKernelOutOfTheRunningOneIsTold) {
  boot("b4");
  EXPECT_EQ(verdict(), "intact boot-without-reset 8")
      << "kexec: the registers are those of the kernel before";
}

TEST_F(BootQuoteAttack, BootsUnderAnotherDeviceKeyThatNobodyQuotesAreTold) {
  auto changed = entries();
  const std::string device = boot_of(changed[0]).device;
  changed.push_back({changed.size(), changed.back().at, archive::DeviceKeyChangedEntry{device}});
  changed.push_back({changed.size(), changed.back().at, BootEntry{"b4", device}});
  changed.push_back({changed.size(), changed.back().at, BootEntry{"b5", device}});
  sign_anew(changed);
  EXPECT_THAT(verdict(), testing::HasSubstr(" boot-not-quoted 10"));
}

TEST_F(BootQuoteAttack, AQuoteOfAnotherBootIsReplayed) {
  auto changed = entries();
  quote_of(changed[kThirdBoot]) = quote_of(changed[kSecondBoot]);
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered boot-quote-of-elsewhere 6");
}

TEST_F(BootQuoteAttack, TheHistoryBeforeAQuoteIsMadeAnew) {
  auto changed = entries();
  changed[kThirdBoot - 1].at.mono_ns += 1;
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered boot-quote-of-elsewhere 6") << "the device's keys do not do for it";
}

TEST_F(BootQuoteAttack, AnotherTpmQuotes) {
  test::SoftwareTpm other(folder_ / "o");
  auto theirs = recorder::make_hardware_key(recorder::HardwareDescription::Kind::kTpm, other.tcti());
  theirs.attestation_key = recorder::find_attestation_key(theirs);
  auto changed = entries();
  quote_of(changed[kThirdBoot]) = ask(theirs, changed, kThirdBoot);
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered boot-quote-signature-invalid 6");
}

TEST_F(BootQuoteAttack, TheRegistersReadOtherwise) {
  auto changed = entries();
  quote_of(changed[kThirdBoot]).pcrs.at(4) = "4:" + std::string(64, 'b');
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered boot-pcrs-differ 6");
  quote_of(changed[kThirdBoot]).pcrs.pop_back();
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered boot-pcrs-differ 6");
}

TEST_F(BootQuoteAttack, NoByteOfAQuoteCanBeChangedOrCutOff) {
  signs_by_hardware_ = false;  // it would be asked some hundred times
  const auto sound = entries();
  const auto quote = archive::from_stated(std::get<BootEntry>(sound[kThirdBoot].body).quote.value()).value();
  for (std::size_t at = 0; at < quote.attest.size(); at += 3) {
    auto changed = sound;
    auto flipped = quote;
    flipped.attest[at] ^= std::byte{1};
    quote_of(changed[kThirdBoot]) = archive::to_stated(flipped);
    sign_anew(changed);
    EXPECT_THAT(verdict(), testing::StartsWith("tampered boot-quote-")) << at;
    auto cut = quote;
    cut.attest.resize(at);
    quote_of(changed[kThirdBoot]) = archive::to_stated(cut);
    sign_anew(changed);
    EXPECT_EQ(verdict(), "tampered boot-quote-malformed 6") << at;
  }
}

TEST_F(BootQuoteAttack, AQuoteIsTakenAway) {
  auto changed = entries();
  boot_of(changed[kThirdBoot]).quote.reset();
  sign_anew(changed);
  EXPECT_EQ(verdict(), "unproven boot-quote-missing 6");
  boot_of(changed[kThirdBoot]).no_quote = "it did not answer";
  sign_anew(changed);
  EXPECT_EQ(verdict(), "intact boot-not-quoted 6") << "who has the keys may say so, and it is told";
}

TEST_F(BootQuoteAttack, TheTpmIsPutBackToWhatItWas) {
  // As a virtual machine can be, whose log is kept elsewhere.
  const fs::path state = folder_ / "t" / "tpm2-00.permall", kept = folder_ / "kept";
  tpm_->take_away();
  fs::copy_file(state, kept);
  tpm_->start();
  tpm_->measure(16, 0xaa);  // once it answers, it has counted its start
  start_again();
  auto changed = entries();
  for (const char* boot_id : {"b4", "b5"})
    changed.push_back({changed.size(), changed.back().at, BootEntry{boot_id, boot_of(changed[0]).device}});
  const std::uint64_t fourth = changed.size() - 2, fifth = changed.size() - 1;
  boot_of(changed[fourth]).quote = ask(description_, changed, fourth);
  tpm_->take_away();
  fs::copy_file(kept, state, fs::copy_options::overwrite_existing);
  tpm_->start();
  boot_of(changed[fifth]).quote = ask(description_, changed, fifth);
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered boots-not-entered 8 boot-clock-went-back 9");
}

TEST_F(BootQuoteAttack, ASecondAttestationKeyIsStated) {
  test::SoftwareTpm other(folder_ / "o");
  auto theirs = recorder::make_hardware_key(recorder::HardwareDescription::Kind::kTpm, other.tcti());
  theirs.attestation_key = recorder::find_attestation_key(theirs);
  auto changed = entries();
  auto added = std::get<archive::DeviceAttestationEntry>(changed[2].body);
  added.attestation = crypto::to_base64(theirs.attestation_key, crypto::Base64Padding::kPadded);
  changed.push_back({changed.size(), changed.back().at, added});
  sign_anew(changed);
  EXPECT_EQ(verdict(), "tampered device-attestation-differs 8");
}

}  // namespace
}  // namespace kiroku
