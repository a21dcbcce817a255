#include <fstream>
#include <future>
#include <latch>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/device_identity.h"
#include "crypto/signed_note.h"
#include "recorder/device_key/bounded_signer.h"
#include "recorder/device_key/hardware_description.h"
#include "recorder/device_key/pkcs11_key.h"
#include "recorder/device_key/tpm_key.h"
#include "tests/support/software_hardware_key.h"
#include "tests/support/software_token.h"
#include "tests/support/software_tpm.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using Kind = HardwareDescription::Kind;

const ByteView kMessage = bytes_of("kiroku/or3/log\n1\nAAAA\n");

TEST(BoundedSigner, WaitsForHangingHardwareOnceAndGoesOnWhenItIsBack) {
  const test::SoftwareHardwareKey key;
  std::latch back(1);
  std::atomic<bool> hangs = true;
  std::promise<void> answered;
  const BoundedSigner signer(
      key.public_key(),
      [&](ByteView message) {
        if (!hangs) return key.sign(message).signature;
        back.wait();
        hangs = false;
        answered.set_value();
        return key.sign(message).signature;
      },
      std::chrono::milliseconds(1));
  EXPECT_THAT(signer.sign(kMessage).why, HasSubstr("did not answer within 1 ms"));
  EXPECT_THAT(signer.sign(kMessage).why, HasSubstr("an earlier request")) << "it does not wait again";
  back.count_down();
  answered.get_future().wait();
  crypto::HardwareSigner::Answer answer;
  while ((answer = signer.sign(kMessage)).signature.empty()) {
  }
  EXPECT_TRUE(crypto::verify_ecdsa_p256(key.public_key(), kMessage, answer.signature));
}

TEST(BoundedSigner, ItsAnswerIsNeverThatToAnEarlierRequest) {
  const test::SoftwareHardwareKey key;
  std::latch back(1);
  std::atomic<int> asked = 0;
  const BoundedSigner signer(
      key.public_key(),
      [&](ByteView message) {
        if (asked++ == 0) back.wait();
        return key.sign(message).signature;
      },
      std::chrono::milliseconds(1));
  EXPECT_NE(signer.sign(bytes_of("an earlier text\n")).why, "");
  back.count_down();
  crypto::HardwareSigner::Answer answer;
  while ((answer = signer.sign(kMessage)).signature.empty()) {
  }
  EXPECT_TRUE(crypto::verify_ecdsa_p256(key.public_key(), kMessage, answer.signature));
}

TEST(BoundedSigner, EndsWhileItsHardwareHangs) {
  const auto key = std::make_shared<test::SoftwareHardwareKey>();
  const auto asked = std::make_shared<std::latch>(1), back = std::make_shared<std::latch>(1);
  const auto ended = std::make_shared<std::promise<void>>();
  {
    const BoundedSigner signer(
        key->public_key(),
        [key, asked, back, ended](ByteView /*message*/) {
          asked->count_down();
          back->wait();
          ended->set_value();
          return Bytes();
        },
        std::chrono::milliseconds(1));
    EXPECT_NE(signer.sign(kMessage).why, "");
    asked->wait();  // the time may be over before the hardware was asked at all
  }
  back->count_down();
  ended->get_future().wait();
}

TEST(BoundedSigner, SaysWhatTheHardwareSays) {
  const test::SoftwareHardwareKey key;
  const BoundedSigner signer(key.public_key(), [](ByteView /*message*/) -> Bytes { throw Error("no TPM"); });
  EXPECT_EQ(signer.sign(kMessage).why, "no TPM");
}

TEST(HardwareDescription, IsReadAsItIsWritten) {
  const HardwareDescription written{Kind::kPkcs11, "pkcs11:token=a", Bytes(32, std::byte{7}),
                                    test::SoftwareHardwareKey().public_key()};
  const HardwareDescription read = HardwareDescription::parse(written.to_json());
  EXPECT_EQ(read.kind, written.kind);
  EXPECT_EQ(read.address, written.address);
  EXPECT_EQ(read.key, written.key);
  EXPECT_EQ(read.public_key, written.public_key);
  for (const char* bad : {"", "[]", "{}", R"({"kind":"usb"})", R"({"kind":"tpm","address":"a","key":"00"})"})
    EXPECT_THROW(HardwareDescription::parse(bad), Error) << bad;
  std::string other_curve = written.to_json();
  other_curve.replace(other_curve.find("MFkw"), 4, "MFkx");
  EXPECT_THAT([&] { HardwareDescription::parse(other_curve); }, ThrowsMessage<Error>(HasSubstr("P-256")));
}

TEST(HardwareNote, IsSignedByBothOrSaysWhyNot) {
  const auto hardware = std::make_shared<test::SoftwareHardwareKey>();
  const crypto::SigningKey key = crypto::SigningKey::generate().with_hardware(hardware);
  const crypto::VerifierKey all = crypto::verifier_key_of("or3", key);
  const crypto::SignedNote by_both = crypto::sign_note_by_all(text_of(kMessage), "or3", key);
  EXPECT_EQ(by_both.hardware_silent, "");
  const crypto::OpenedNote opened = crypto::open_note(by_both.note, {all});
  EXPECT_FALSE(opened.failure) << opened.explanation;
  EXPECT_TRUE(opened.by_hardware);
  hardware->fall_silent();
  const crypto::SignedNote alone = crypto::sign_note_by_all(text_of(kMessage), "or3", key);
  EXPECT_EQ(alone.hardware_silent, "the test keeps it silent");
  EXPECT_EQ(crypto::open_note(alone.note, {all}).failure, crypto::NoteFailure::kLacksHardware);
  EXPECT_FALSE(crypto::open_note(alone.note, {all}).by_hardware);
  EXPECT_THROW(crypto::write_device_identity("or3", key, {}), Error) << "no identity without its signature";
}

class TpmKeyTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::SoftwareTpm::is_installed()) GTEST_SKIP() << test::SoftwareTpm::kWhySkipped;
    tpm_.emplace(folder_.path() / "t");
  }
  test::TemporaryFolder folder_;
  std::optional<test::SoftwareTpm> tpm_;
};

TEST_F(TpmKeyTest, SignsAndIsTheSameKeyAfterPowerWasOff) {
  const HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  const auto signer = hardware_signer(made, {});
  const auto answer = signer->sign(kMessage);
  EXPECT_EQ(answer.why, "");
  EXPECT_TRUE(crypto::verify_ecdsa_p256(made.public_key, kMessage, answer.signature));
  EXPECT_FALSE(crypto::verify_ecdsa_p256(made.public_key, bytes_of("another\n"), answer.signature));

  tpm_->take_away();
  EXPECT_NE(signer->sign(kMessage).why, "") << "it says so and goes on";
  tpm_->start();
  const auto again = signer->sign(kMessage);
  EXPECT_EQ(again.why, "") << "it connects anew by itself";
  EXPECT_TRUE(crypto::verify_ecdsa_p256(made.public_key, kMessage, again.signature));
}

TEST_F(TpmKeyTest, AnotherTpmHasAnotherKey) {
  const HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  test::SoftwareTpm other(folder_.path() / "o");
  EXPECT_NE(TpmKey(other.tcti(), made.key).public_key(), made.public_key)
      << "what lies on the disk is the same, and the key is not in it";
  HardwareDescription moved = made;
  moved.address = other.tcti();
  const crypto::SigningKey key = crypto::SigningKey::generate().with_hardware(hardware_signer(moved, {}));
  const crypto::SignedNote note = crypto::sign_note_by_all(text_of(kMessage), "or3", key);
  EXPECT_THAT(note.hardware_silent, HasSubstr("does not fit the key"))
      << "a line that does not verify would read as a forgery";
  EXPECT_FALSE(crypto::open_note(note.note, {crypto::verifier_key_of("or3", key)}).by_hardware);
}

TEST_F(TpmKeyTest, OneThatHangsDoesNotHoldUpWhoeverSigns) {
  const HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  const auto key = std::make_shared<TpmKey>(made.address, made.key);
  const BoundedSigner signer(
      made.public_key, [key](ByteView message) { return key->sign(message); }, std::chrono::milliseconds(1));
  tpm_->hang();
  EXPECT_THAT(signer.sign(kMessage).why, HasSubstr("did not answer"));
  tpm_->hang(false);
  while (signer.sign(kMessage).signature.empty()) {
  }
}

TEST_F(TpmKeyTest, QuotesTheBootByAKeyThatStaysTheSame) {
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  made.attestation_key = find_attestation_key(made);
  const crypto::Sha256Digest asked = crypto::sha256(kMessage);
  std::vector<crypto::TpmQuote> said;
  for (int boot = 0; boot < 2; ++boot) {
    const auto signer = hardware_signer(made, {});
    EXPECT_EQ(signer->sign(kMessage).why, "");
    const auto answer = signer->attester()->quote(asked);
    ASSERT_TRUE(answer.quote) << answer.why;
    EXPECT_EQ(crypto::why_no_quote(*answer.quote, made.attestation_key, asked), "");
    std::string problem;
    said.push_back(crypto::parse_tpm_quote(answer.quote->attest, problem).value());
    EXPECT_EQ(answer.quote->pcrs.size(), 11U);
    EXPECT_EQ(signer->sign(kMessage).why, "") << "there is room for both keys";
    tpm_->take_away();
    tpm_->start();
  }
  EXPECT_EQ(said[1].resets - said[0].resets, 1U);
  EXPECT_EQ(said[1].pcr_digest, said[0].pcr_digest);
}

TEST_F(TpmKeyTest, SignsNothingFromOutsideByItsAttestationKey) {
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  made.attestation_key = find_attestation_key(made);
  std::string problem;
  const auto key = crypto::parse_attestation_key(made.attestation_key, problem);
  ASSERT_TRUE(key) << problem;
  EXPECT_NE(key->key, made.public_key);
  EXPECT_FALSE(
      crypto::verify_ecdsa_p256(key->key, kMessage, hardware_signer(made, {})->sign(kMessage).signature));
}

TEST_F(TpmKeyTest, WhatIsMeasuredIsQuoted) {
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  made.attestation_key = find_attestation_key(made);
  const auto quote = [&] { return hardware_signer(made, {})->attester()->quote({}).quote.value(); };
  const auto before = quote();
  tpm_->measure(7, 0xaa);
  const auto after = quote();
  for (std::size_t i = 0; i < before.pcrs.size(); ++i)
    EXPECT_EQ(before.pcrs[i] == after.pcrs[i], before.pcrs[i].index != 7) << i;
}

TEST_F(TpmKeyTest, AnotherTpmDoesNotQuoteForThisOne) {
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  made.attestation_key = find_attestation_key(made);
  const test::SoftwareTpm other(folder_.path() / "o");
  made.address = other.tcti();
  EXPECT_THAT(hardware_signer(made, {})->attester()->quote({}).why, HasSubstr("not by the key"));
  EXPECT_THAT([&] { find_attestation_key(made); }, ThrowsMessage<Error>(HasSubstr("another machine's")));
}

TEST_F(TpmKeyTest, OneWithoutSha256RegistersSaysSoAndSigns) {
  tpm_->keep_sha256_bank(false);
  tpm_->take_away();
  tpm_->start();
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  EXPECT_THAT([&] { find_attestation_key(made); }, ThrowsMessage<Error>(HasSubstr("SHA-256 bank")));
  made.attestation_key = TpmKey(made.address, made.key).attestation_key();
  const auto signer = hardware_signer(made, {});
  EXPECT_THAT(signer->attester()->quote({}).why, HasSubstr("SHA-256 bank"));
  EXPECT_EQ(signer->sign(kMessage).why, "");
}

TEST_F(TpmKeyTest, OneThatHangsDoesNotHoldUpWhoeverAsksForAQuote) {
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  made.attestation_key = find_attestation_key(made);
  const auto key = std::make_shared<TpmKey>(made.address, made.key);
  const auto thread = std::make_shared<BoundedThread>(std::chrono::milliseconds(1));
  const BoundedAttester attester(
      made.attestation_key, [key](const crypto::Sha256Digest& asked) { return key->quote(asked); }, thread);
  const BoundedSigner signer(
      made.public_key, [key](ByteView message) { return key->sign(message); }, thread, nullptr);
  tpm_->hang();
  EXPECT_THAT(attester.quote({}).why, HasSubstr("did not answer"));
  EXPECT_THAT(signer.sign(kMessage).why, HasSubstr("an earlier request")) << "nor who signs meanwhile";
  tpm_->hang(false);
  while (signer.sign(kMessage).signature.empty()) {
  }
}

TEST_F(TpmKeyTest, ItsDescriptionHasTheAttestationKey) {
  HardwareDescription made = make_hardware_key(Kind::kTpm, tpm_->tcti());
  EXPECT_EQ(HardwareDescription::parse(made.to_json()).attestation_key, Bytes())
      << "one from before, which is no error";
  EXPECT_EQ(hardware_signer(made, {})->attester(), nullptr);
  made.attestation_key = find_attestation_key(made);
  EXPECT_EQ(HardwareDescription::parse(made.to_json()).attestation_key, made.attestation_key);
  made.attestation_key.back() ^= std::byte{1};
  EXPECT_THAT([&] { HardwareDescription::parse(made.to_json()); },
              ThrowsMessage<Error>(HasSubstr("attestation_key")));
}

TEST(TpmKeyWithoutTpm, NamesTheWayThatLeadsNowhere) {
  EXPECT_THAT([] { make_hardware_key(Kind::kTpm, "swtpm:path=/nowhere"); },
              ThrowsMessage<Error>(HasSubstr("swtpm:path=/nowhere")));
}

class Pkcs11KeyTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::SoftwareToken::is_installed()) GTEST_SKIP() << test::SoftwareToken::kWhySkipped;
    token_.emplace(folder_.path() / "token");
    ASSERT_EQ(token_->made().status, 0) << token_->made().err;
  }
  std::string file_with(const std::string& pin) {
    std::ofstream(folder_ / "another-pin") << pin;
    return (folder_ / "another-pin").string();
  }
  /// The token's URI with this file of its PIN.
  [[nodiscard]] static std::string uri_with(const std::string& file) {
    return std::string("pkcs11:token=kiroku?module-path=") + test::SoftwareToken::kLibrary +
           "&pin-source=file:" + file;
  }

  test::TemporaryFolder folder_;
  std::optional<test::SoftwareToken> token_;
};

TEST_F(Pkcs11KeyTest, SignsByAKeyThatTheTokenKeeps) {
  const HardwareDescription made = make_hardware_key(Kind::kPkcs11, token_->uri());
  const auto answer = hardware_signer(made, {})->sign(kMessage);
  EXPECT_EQ(answer.why, "");
  EXPECT_TRUE(crypto::verify_ecdsa_p256(made.public_key, kMessage, answer.signature));
  HardwareDescription other = made;
  other.key.front() ^= std::byte{1};
  EXPECT_THAT(hardware_signer(other, {})->sign(kMessage).why, HasSubstr("does not hold the device's key"));
}

TEST_F(Pkcs11KeyTest, SaysWhatIsWrongWithTheWayToIt) {
  const auto refusal = [](const std::string& uri, const char* why) {
    EXPECT_THAT([&] { make_hardware_key(Kind::kPkcs11, uri); }, ThrowsMessage<Error>(HasSubstr(why))) << uri;
  };
  const std::string library = std::string("?module-path=") + test::SoftwareToken::kLibrary;
  refusal("token", "no PKCS#11 URI");
  refusal("pkcs11:token=kiroku", "module-path");
  refusal("pkcs11:token=kiroku?module-path=/nowhere.so", "/nowhere.so");
  refusal("pkcs11:token=other" + library + "&pin-source=file:/nowhere", "no token that is plugged in");
  refusal("pkcs11:token=kiroku" + library + "&pin-source=file:" + file_with("00000000\n"), "be unlocked");
  refusal("pkcs11:token=kiroku" + library + "&pin-source=file:/nowhere", "/nowhere");
}

TEST_F(Pkcs11KeyTest, APinInTheUriIsRefusedAndNotTold) {
  const std::string uri =
      std::string("pkcs11:token=kiroku?module-path=") + test::SoftwareToken::kLibrary + "&pin-value=12345678";
  EXPECT_THAT([&] { make_hardware_key(Kind::kPkcs11, uri); },
              ThrowsMessage<UsageError>(testing::AllOf(HasSubstr("use pin-source=file:FILE"),
                                                       testing::Not(HasSubstr("12345678")))));
}

TEST_F(Pkcs11KeyTest, AWrongPinIsTriedOnceUntilTheProgramStartsAnew) {
  const HardwareDescription made = make_hardware_key(Kind::kPkcs11, token_->uri());
  const std::string file = file_with("00000000\n");
  Pkcs11Key key(uri_with(file), made.key);
  const auto refused = ThrowsMessage<Error>(HasSubstr("not tried again"));
  EXPECT_THAT([&] { key.sign(kMessage); }, refused);
  file_with("12345678\n");
  EXPECT_THAT([&] { key.sign(kMessage); }, refused) << "the right PIN would have unlocked it";
  EXPECT_TRUE(crypto::verify_ecdsa_p256(made.public_key, kMessage,
                                        Pkcs11Key(uri_with(file), made.key).sign(kMessage)));
}

TEST_F(Pkcs11KeyTest, TakesAPinFromAFileOfWindows) {
  const HardwareDescription made = make_hardware_key(Kind::kPkcs11, token_->uri());
  EXPECT_TRUE(crypto::verify_ecdsa_p256(
      made.public_key, kMessage, Pkcs11Key(uri_with(file_with("12345678\r\n")), made.key).sign(kMessage)));
}

}  // namespace
}  // namespace kiroku::recorder
