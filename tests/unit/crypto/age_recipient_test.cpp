#include "crypto/age_recipient.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "crypto/identity_text.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

// The example of C2SP age.
constexpr std::string_view kIdentity =
    "AGE-SECRET-KEY-1GFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPQ4EGAEX";
constexpr std::string_view kRecipient = "age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwj";
constexpr int kQuick = 4;  // work factor of passphrases in tests

Secret never_asked(const std::string&) { throw std::logic_error("asked for a passphrase without need"); }

void write_file(const std::filesystem::path& file, ByteView content) {
  std::ofstream out(file, std::ios::binary);
  out << text_of(content);
}

TEST(AgeRecipient, BelongsToThePublishedIdentity) {
  EXPECT_EQ(recipient_of(kIdentity), kRecipient);
  EXPECT_EQ(parse_recipient(kRecipient)->to_string(), kRecipient);
}

TEST(AgeRecipient, GeneratedPairsBelongTogetherAndDiffer) {
  const AgeKeyPair first = generate_age_key();
  const AgeKeyPair second = generate_age_key();
  EXPECT_EQ(recipient_of(first.identity_text.text()), first.recipient);
  EXPECT_NE(first.recipient, second.recipient);
}

TEST(AgeRecipient, RefusesOtherTextsAndNamesThem) {
  for (const std::string text :
       {"", "age1", "age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwk",
        "AGE1ZVKYG2LQZRAA2LNJVQEJ32NKUU0UES2S82HZRYE869XEEXVN73EQUNUJWJ", "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5",
        "age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwj "})
    EXPECT_THAT([&] { parse_recipient(text); }, ThrowsMessage<UsageError>(HasSubstr("\"" + text + "\"")))
        << text;
}

TEST(AgeRecipient, RefusesIdentitiesWithoutRepeatingThem) {
  const std::string damaged = std::string(kIdentity.substr(0, kIdentity.size() - 1)) + "A";
  try {
    parse_identity(damaged);
    FAIL() << "accepted";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no age identity"));
    EXPECT_THAT(error.what(), testing::Not(HasSubstr("GFPYYSJZ")));
  }
  EXPECT_THROW(parse_identity(kRecipient), UsageError);
  EXPECT_THROW(parse_recipient(kIdentity), UsageError);
}

TEST(AgeRecipient, ReadsRecipientFiles) {
  const std::string other = generate_age_key().recipient;
  const auto recipients =
      parse_recipients("# theatre 1\n\n" + std::string(kRecipient) + "\r\n" + other, "recipients.txt");
  ASSERT_EQ(recipients.size(), 2U);
  EXPECT_EQ(recipients[0]->to_string(), kRecipient);
  EXPECT_EQ(recipients[1]->to_string(), other);
}

TEST(AgeRecipient, RecipientFilesNameTheWrongLine) {
  EXPECT_THAT([] { parse_recipients("# c\nage1nonsense\n", "recipients.txt"); },
              ThrowsMessage<UsageError>(HasSubstr("recipients.txt, line 2")));
  EXPECT_THAT([] { parse_recipients("# nobody\n", "recipients.txt"); },
              ThrowsMessage<UsageError>(HasSubstr("recipients.txt names no recipient")));
}

TEST(AgeRecipient, APointOfLowOrderIsRefusedWhenSealing) {
  const auto recipient = parse_recipient(to_bech32("age", Bytes(32)));
  EXPECT_THAT([&] { seal_bytes({}, {recipient}); }, ThrowsMessage<UsageError>(HasSubstr("low order")));
}

TEST(AgePassphrase, OpensWithTheSamePassphraseOnly) {
  const Secret passphrase = Secret::copy_of("correct horse");
  const Bytes sealed = seal_bytes(bytes_of("secret"), {passphrase_recipient(passphrase, kQuick)});
  EXPECT_EQ(text_of(unseal_bytes(sealed, {passphrase_identity(passphrase)})), "secret");
  try {
    unseal_bytes(sealed, {passphrase_identity(Secret::copy_of("battery staple"))});
    FAIL() << "opened";
  } catch (const AgeError& error) {
    EXPECT_EQ(error.failure(), AgeFailure::kNoMatch);
  }
}

TEST(AgePassphrase, RefusesMoreWorkThanAllowedBeforeDoingIt) {
  const Secret passphrase = Secret::copy_of("p");
  const Bytes sealed = seal_bytes({}, {passphrase_recipient(passphrase, kQuick + 1)});
  EXPECT_THAT([&] { unseal_bytes(sealed, {passphrase_identity(passphrase, kQuick)}); },
              ThrowsMessage<AgeError>(HasSubstr("more work than the 2^4 allowed")));
}

TEST(AgePassphrase, MustBeAlone) {
  const auto passphrase = passphrase_recipient(Secret::copy_of("p"), kQuick);
  EXPECT_THAT(
      [&] {
        seal_bytes({}, {passphrase, parse_recipient(kRecipient)});
      },
      ThrowsMessage<UsageError>(HasSubstr("cannot have other recipients")));
}

TEST(AgePassphrase, RefusesEmptyPassphrasesAndImpossibleWork) {
  EXPECT_THROW(passphrase_recipient(Secret(), kQuick), UsageError);
  EXPECT_THROW(passphrase_recipient(Secret::copy_of("p"), 0), UsageError);
  EXPECT_THROW(passphrase_recipient(Secret::copy_of("p"), 31), UsageError);
}

TEST(IdentityFile, ReadsWhatAgeKeygenWrites) {
  const test::TemporaryFolder folder;
  const AgeKeyPair second = generate_age_key();
  write_file(folder / "key.txt",
             bytes_of("# created: 2026-08-05T09:15:02Z\n# public key: " + std::string(kRecipient) + "\n" +
                      std::string(kIdentity) + "\n" + std::string(second.identity_text.text()) + "\n"));
  const auto identities = load_identity_file(folder / "key.txt", never_asked);
  EXPECT_EQ(identities.size(), 2U);
  for (const std::string_view recipient : {kRecipient, std::string_view(second.recipient)}) {
    const Bytes sealed = seal_bytes(bytes_of("film"), {parse_recipient(recipient)});
    EXPECT_EQ(text_of(unseal_bytes(sealed, identities)), "film");
  }
}

TEST(IdentityFile, OpensASealedOneWithItsPassphrase) {
  const test::TemporaryFolder folder;
  const Secret passphrase = Secret::copy_of("correct horse");
  write_file(folder / "key.age", seal_bytes(bytes_of("# sealed\n" + std::string(kIdentity) + "\n"),
                                            {passphrase_recipient(passphrase, kQuick)}));
  std::string asked_for;
  const auto identities = load_identity_file(folder / "key.age", [&](const std::string& what_for) {
    asked_for = what_for;
    return passphrase.clone();
  });
  EXPECT_EQ(identities.size(), 1U);
  EXPECT_THAT(asked_for, HasSubstr("key.age"));
  EXPECT_THAT(
      [&] { load_identity_file(folder / "key.age", [](const auto&) { return Secret::copy_of("wrong"); }); },
      ThrowsMessage<Error>(HasSubstr("the passphrase does not open the identity file")));
}

TEST(IdentityOfAStranger, IsRefusedBeforeMuchWorkIsDone) {
  // Made by hand: sealing it would be the work.
  const std::string dear = "age-encryption.org/v1\n-> scrypt AAAAAAAAAAAAAAAAAAAAAA 19\n" +
                           std::string(43, 'A') + "\n--- " + std::string(43, 'A') + "\n" +
                           std::string(32, '\0');
  EXPECT_THAT(
      [&] {
        read_identities(
            Secret::copy_of(dear), "the identity", [](const auto&) { return Secret::copy_of("p"); },
            kLimitsOfStrangers);
      },
      ThrowsMessage<Error>(HasSubstr("more work than the 2^18 allowed")));
}

TEST(IdentityOfAStranger, HasAsManyKeysAsAPersonHas) {
  const auto read = [](std::size_t keys) {
    std::string text;
    for (std::size_t i = 0; i < keys; ++i) text += std::string(kIdentity) + "\n";
    return read_identities(Secret::copy_of(text), "the identity", never_asked, kLimitsOfStrangers);
  };
  EXPECT_EQ(read(kLimitsOfStrangers.keys).size(), kLimitsOfStrangers.keys);
  EXPECT_THAT([&] { read(kLimitsOfStrangers.keys + 1); },
              ThrowsMessage<UsageError>(HasSubstr("holds more than 16 keys")));
}

TEST(IdentityFile, RefusesWhatIsNone) {
  const test::TemporaryFolder folder;
  const auto refuses = [&](std::string_view content, const std::string& why) {
    write_file(folder / "key.txt", bytes_of(content));
    EXPECT_THAT([&] { load_identity_file(folder / "key.txt", never_asked); },
                ThrowsMessage<Error>(testing::AllOf(HasSubstr("key.txt"), HasSubstr(why))))
        << content;
  };
  refuses("", "holds no identity");
  refuses("# nothing\n", "holds no identity");
  refuses(std::string(kRecipient) + "\n", "line 1: this is no age identity");
  refuses("-----BEGIN AGE ENCRYPTED FILE-----\n", "ASCII-armored");
  refuses(std::string(2 << 20, '#'), "larger than a megabyte");
  EXPECT_THROW(load_identity_file(folder / "absent", never_asked), IoError);
  EXPECT_THROW(load_identity_file(folder.path(), never_asked), UsageError);
}

}  // namespace
}  // namespace kiroku::crypto
