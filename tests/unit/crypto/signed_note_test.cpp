#include "crypto/signed_note.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/utf8.h"
#include "tests/support/ed25519_seed.h"

namespace kiroku::crypto {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

// The example of golang.org/x/mod/sumdb/note, where the format comes from.
constexpr std::string_view kPeterNeumann =
    "PeterNeumann+c74f20a3+ARpc2QcUPDhMQegwxbzhKqiBfsVkmqq/LDE4izWy10TW";
constexpr std::string_view kPeterNeumannSeed = "AYEKFALVFGyNhPJEMzD1QIDr+Y7hfZx09iUvxdXHKDFz";
constexpr std::string_view kText =
    "If you think cryptography is the answer to your problem,\n"
    "then you don't know what your problem is.\n";
constexpr std::string_view kSignature =
    "\u2014 PeterNeumann "
    "x08go/ZJkuBS9UG/SffcvIAQxVBtiFupLLr8pAcElZInNIuGUgYN1FFYC2pZSNXgKvqfqdngotpRZb6KE6RyyBwJnAM=\n";

std::string published_note() { return std::string(kText) + "\n" + std::string(kSignature); }

SigningKey peter_neumanns_key() {
  const auto typed_seed = *from_base64(kPeterNeumannSeed, Base64Padding::kPadded);
  return test::key_from_seed(ByteView(typed_seed).subspan(1));
}

TEST(SignedNote, OpensThePublishedNote) {
  const auto opened = open_note(published_note(), {VerifierKey::parse(kPeterNeumann)});
  EXPECT_FALSE(opened.failure) << opened.explanation;
  EXPECT_EQ(opened.text, kText);
  EXPECT_THAT(opened.signers, ElementsAre("PeterNeumann"));
}

TEST(SignedNote, SigningGivesThePublishedNote) {
  EXPECT_EQ(sign_note(kText, "PeterNeumann", peter_neumanns_key()), published_note());
}

TEST(SignedNote, KeepsBlankLinesInsideTheText) {
  const SigningKey key = SigningKey::generate();
  const VerifierKey verifier("device", key.public_key());
  for (const std::string text : {"a\n\nb\n", "a\n\n", "\n", "\u2014 not a signature\n"}) {
    const auto opened = open_note(sign_note(text, "device", key), {verifier});
    EXPECT_FALSE(opened.failure) << opened.explanation;
    EXPECT_EQ(opened.text, text);
  }
}

TEST(SignedNote, RefusesAChangedText) {
  std::string note = published_note();
  note[0] = 'i';
  const auto opened = open_note(note, {VerifierKey::parse(kPeterNeumann)});
  EXPECT_EQ(opened.failure, NoteFailure::kBadSignature);
  EXPECT_THAT(opened.explanation, HasSubstr("PeterNeumann"));
}

TEST(SignedNote, IsOfUnknownKeyToOtherVerifiers) {
  const VerifierKey other("PeterNeumann", SigningKey::generate().public_key());
  const auto opened = open_note(published_note(), {other});
  EXPECT_EQ(opened.failure, NoteFailure::kUnknownKey);
  EXPECT_EQ(opened.text, kText);
  EXPECT_EQ(open_note(published_note(), {}).failure, NoteFailure::kUnknownKey);
}

TEST(SignedNote, IgnoresUnknownSignaturesBesideAKnownOne) {
  const std::string witness = sign_note(kText, "witness", SigningKey::generate());
  const std::string note = published_note() + witness.substr(kText.size() + 1);
  const auto opened = open_note(note, {VerifierKey::parse(kPeterNeumann)});
  EXPECT_FALSE(opened.failure);
  EXPECT_THAT(opened.signers, ElementsAre("PeterNeumann", "witness"));
}

TEST(SignedNote, NamesTheKeysThatItDidNotCheck) {
  const SigningKey key = SigningKey::generate();
  const std::string witness = sign_note(kText, "witness", key);
  const std::string note = published_note() + witness.substr(kText.size() + 1);
  const std::string full = VerifierKey("witness", key.public_key()).to_string();
  const std::string named = full.substr(0, std::string("witness+01234567").size());
  EXPECT_THAT(open_note(note, {VerifierKey::parse(kPeterNeumann)}).unchecked, ElementsAre(named));
  EXPECT_THAT(open_note(note, {VerifierKey::parse(kPeterNeumann), VerifierKey("witness", key.public_key())})
                  .unchecked,
              ElementsAre());
  EXPECT_THAT(open_note(published_note(), {}).unchecked, ElementsAre("PeterNeumann+c74f20a3"));
}

TEST(SignedNote, AnotherKeyInAKnownNameFailsTheNote) {
  const std::string other = sign_note(kText, "PeterNeumann", SigningKey::generate());
  const std::string note = published_note() + other.substr(kText.size() + 1);
  EXPECT_EQ(open_note(note, {VerifierKey::parse(kPeterNeumann)}).failure, NoteFailure::kBadSignature);
  // By that key alone it is a note of somebody else.
  EXPECT_EQ(open_note(other, {VerifierKey::parse(kPeterNeumann)}).failure, NoteFailure::kUnknownKey);
}

TEST(SignedNote, TwoLinesOfOneKeyAreNoForm) {
  const std::string twice = published_note() + std::string(kSignature);
  EXPECT_EQ(open_note(twice, {VerifierKey::parse(kPeterNeumann)}).failure, NoteFailure::kMalformed);
  const std::string witness = sign_note(kText, "witness", SigningKey::generate()).substr(kText.size() + 1);
  EXPECT_EQ(open_note(published_note() + witness + witness, {VerifierKey::parse(kPeterNeumann)}).failure,
            NoteFailure::kMalformed);
}

TEST(SignedNote, OneBadSignatureOfAKnownKeyFailsTheNote) {
  const SigningKey key = SigningKey::generate();
  const std::string elsewhere = sign_note("another text\n", "device", key);
  const std::string note = published_note() + elsewhere.substr(elsewhere.find("\n\n") + 2);
  const auto opened =
      open_note(note, {VerifierKey::parse(kPeterNeumann), VerifierKey("device", key.public_key())});
  EXPECT_EQ(opened.failure, NoteFailure::kBadSignature);
}

// An Ed25519 signature of one text is one: who could make two would let a verifier check a hundred.
TEST(SignedNote, TakesOneSignatureOfAKey) {
  const VerifierKey peter = VerifierKey::parse(kPeterNeumann);
  const std::string line = published_note().substr(kText.size() + 1);
  const std::string elsewhere = sign_note("another text\n", "PeterNeumann", peter_neumanns_key());
  const std::string other_line = elsewhere.substr(elsewhere.find("\n\n") + 2);
  const std::string text_part = published_note().substr(0, kText.size() + 1);
  for (const std::string& second : {line, other_line}) {
    EXPECT_EQ(open_note(published_note() + second, {peter}).failure, NoteFailure::kMalformed);
    EXPECT_EQ(open_note(text_part + second + line, {peter}).failure, NoteFailure::kMalformed);
  }
}

TEST(SignedNote, RefusesMalformedNotes) {
  const std::string good = published_note();
  const std::string text(kText);
  const std::string signature(kSignature);
  const std::string cases[] = {
      "",
      "\n",
      text,
      text + "\n",
      text + signature,                                                // no blank line
      good.substr(0, good.size() - 1),                                 // last newline missing
      text + "\n" + signature.substr(0, signature.size() - 2) + "\n",  // base64 cut
      text + "\n- PeterNeumann x08go/ZJ\n",                            // a hyphen is no em dash
      text + "\n\u2014 Peter Neumann x08go/ZJ\n",
      text + "\n\u2014 PeterNeumann x08goA==\n",  // key id alone
      text + "\n\u2014  x08go/ZJkuBS\n",
      text + "\r\n" + signature,
      text + "\n" + signature + "trailing\n",
      std::string("\0", 1) + good,
      "\xff" + good,
      std::string(1'000'001, 'a') + good,
  };
  for (const auto& note : cases) {
    const auto opened = open_note(note, {VerifierKey::parse(kPeterNeumann)});
    EXPECT_EQ(opened.failure, NoteFailure::kMalformed) << note.substr(0, 300);
    EXPECT_THAT(opened.explanation, HasSubstr("not a signed note"));
    EXPECT_EQ(opened.text, "");
  }
}

TEST(SignedNote, RefusesToSignWhatNobodyCouldOpen) {
  const SigningKey key = SigningKey::generate();
  EXPECT_THROW(sign_note("no newline", "device", key), UsageError);
  EXPECT_THROW(sign_note("a\r\n", "device", key), UsageError);
  EXPECT_THROW(sign_note("\xc0\xaf\n", "device", key), UsageError);
  EXPECT_THROW(sign_note("a\n", "two words", key), UsageError);
}

TEST(VerifierKey, RoundTripsThePublishedKey) {
  const VerifierKey key = VerifierKey::parse(kPeterNeumann);
  EXPECT_EQ(key.name(), "PeterNeumann");
  EXPECT_EQ(key.key_id(), 0xc74f20a3U);
  EXPECT_EQ(key.to_string(), kPeterNeumann);
  EXPECT_EQ(key, VerifierKey("PeterNeumann", peter_neumanns_key().public_key()));
}

TEST(VerifierKey, SaysWhatIsWrong) {
  const auto refuses = [](const std::string& text, const std::string& why) {
    EXPECT_THAT([&] { VerifierKey::parse(text); }, ThrowsMessage<UsageError>(HasSubstr(why))) << text;
  };
  const std::string key = "ARpc2QcUPDhMQegwxbzhKqiBfsVkmqq/LDE4izWy10TW";
  refuses("", "three parts");
  refuses("PeterNeumann+c74f20a3", "three parts");
  refuses("+c74f20a3+" + key, "its name");
  refuses("Peter Neumann+c74f20a3+" + key, "its name");
  refuses("PeterNeumann+c74f20a+" + key, "8 lower-case hex digits");
  refuses("PeterNeumann+C74F20A3+" + key, "8 lower-case hex digits");
  refuses("PeterNeumann+c74f20a4+" + key, "does not belong");
  refuses("peterneumann+c74f20a3+" + key, "does not belong");
  refuses("PeterNeumann+c74f20a3+" + key + "=", "not base64");
  refuses("PeterNeumann+c74f20a3+Ahpc2QcUPDhMQegwxbzhKqiBfsVkmqq/LDE4izWy10TW", "not Ed25519");
  refuses("PeterNeumann+c74f20a3+ARpc2QcUPDhMQegwxbzhKqiBfsVkmqq/LDE4izWy", "32 bytes");
}

TEST(VerifierKey, RefusesNamesThatCannotStandInANote) {
  const Ed25519PublicKey key{};
  for (const std::string name : {"", "a b", "a+b", "a\nb", "a\tb", "\u00a0", "a\u2028", "\xff"})
    EXPECT_THROW(VerifierKey(name, key), UsageError) << name;
  EXPECT_NO_THROW(VerifierKey("kiroku/\u624b\u8853\u5ba4-1", key));
}

// The example of C2SP tlog-checkpoint.
constexpr std::string_view kCheckpoint =
    "example.com/behind-the-sofa\n20852163\nCsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=\n";

TEST(Checkpoint, RoundTripsThePublishedExample) {
  const auto checkpoint = Checkpoint::parse(kCheckpoint);
  ASSERT_TRUE(checkpoint);
  EXPECT_EQ(checkpoint->origin, "example.com/behind-the-sofa");
  EXPECT_EQ(checkpoint->size, 20852163U);
  EXPECT_EQ(to_hex(checkpoint->root), "0ac5186a91863e8e1d90c808014aa89bf5da8e3ee1d9f07630f0378f68f1ab62");
  EXPECT_EQ(checkpoint->to_text(), kCheckpoint);
}

TEST(Checkpoint, RefusesEverythingElse) {
  const std::string root = "CsUYapGGPo4dkMgIAUqom/Xajj7h2fB2MPA3j2jxq2I=";
  for (const std::string& text :
       {std::string(), "o\n1\n" + root, "\n1\n" + root + "\n", "o\n01\n" + root + "\n",
        "o\n-1\n" + root + "\n", "o\n+1\n" + root + "\n", "o\n1 \n" + root + "\n", "o\n\n" + root + "\n",
        "o\n18446744073709551616\n" + root + "\n", "o\n1\n" + root + "\nextension\n", "o\n1\n" + root + "=\n",
        std::string("o\n1\nAAAA\n")})
    EXPECT_FALSE(Checkpoint::parse(text)) << text;
  EXPECT_TRUE(Checkpoint::parse("o\n18446744073709551615\n" + root + "\n"));
  EXPECT_TRUE(Checkpoint::parse("o\n0\n" + root + "\n"));
}

TEST(Utf8, AcceptsOnlyTheShortestFormOfRealCharacters) {
  for (const std::string_view good : {"", "a", "\u00e9", "\u2014", "\U0001f52c", "\xf4\x8f\xbf\xbf"})
    EXPECT_TRUE(is_utf8(good)) << good;
  for (const std::string_view bad : {"\x80", "\xc0\x80", "\xe0\x80\x80", "\xed\xa0\x80", "\xf0\x80\x80\x80",
                                     "\xf4\x90\x80\x80", "\xf8\x88\x80\x80\x80", "\xe2\x80", "\xff"})
    EXPECT_FALSE(is_utf8(bad)) << bad;
}

}  // namespace
}  // namespace kiroku::crypto
