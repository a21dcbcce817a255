// Signature lines that somebody appends to a checkpoint. A token is over a note's exact bytes; the last note
// of a case has none.
#include "crypto/signed_note.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

constexpr const char* kStamped = "checkpoints/00000010.note";
constexpr const char* kLastNote = "checkpoints/00000011.note";

/// The signature line that `key` makes over a note's text in the name of `name`.
std::string line_over(const std::string& note, const std::string& name, const crypto::SigningKey& key) {
  const std::string text = note.substr(0, note.find("\n\n") + 1);
  return crypto::sign_note(text, name, key).substr(text.size() + 1);
}

class SignatureLines : public ::testing::Test {
 protected:
  void append(const std::string& file, const std::string& lines) {
    write_file(victim_ / file, read_file(victim_ / file) + lines);
  }
  std::string line(const std::string& name, const crypto::SigningKey& key) {
    return line_over(read_file(victim_ / kLastNote), name, key);
  }
  AttackedCase victim_;
  crypto::SigningKey other_ = crypto::SigningKey::generate();
};

TEST_F(SignatureLines, OfAnotherKeyOnTheLastNoteAreToldWithTheirNames) {
  append(kLastNote, line("witness.example", other_));
  const archive::VerificationReport report = victim_.verify();
  ASSERT_EQ(summary(report), std::string("intact\ncheckpoint-cosigned ") + kLastNote + " -");
  EXPECT_THAT(report.findings[0].text, ::testing::HasSubstr("witness.example"));
}

TEST_F(SignatureLines, OfAKeyThatDoesNotEvenSignTheTextAreTold) {
  std::string forged = line("witness.example", other_);
  forged[forged.size() - 5] = forged[forged.size() - 5] == 'A' ? 'B' : 'A';
  append(kLastNote, forged);
  EXPECT_EQ(summary(victim_.verify()), std::string("intact\ncheckpoint-cosigned ") + kLastNote + " -");
}

TEST_F(SignatureLines, ManyAndLongNamesAreToldInOneSentence) {
  std::string lines = line(std::string(5'000, 'w'), other_);
  for (int i = 0; i < 50; ++i) {
    lines += line("w" + std::to_string(i), other_);
  }
  append(kLastNote, lines);
  const archive::VerificationReport report = victim_.verify();
  ASSERT_EQ(summary(report), std::string("intact\ncheckpoint-cosigned ") + kLastNote + " -");
  EXPECT_THAT(report.findings[0].text, ::testing::HasSubstr("51 keys"));
  EXPECT_LT(report.findings[0].text.size(), 1'000U);
}

TEST_F(SignatureLines, InTheDevicesNameByAnotherKeyAreTampering) {
  append(kLastNote, line(SampleArchive::kDeviceName, other_));
  EXPECT_THAT(summary(victim_.verify()), ::testing::StartsWith(std::string("tampered\n")));
  EXPECT_THAT(summary(victim_.verify()),
              ::testing::HasSubstr(std::string("checkpoint-signature-invalid ") + kLastNote + " -"));
}

TEST_F(SignatureLines, OfTheDeviceOnceMoreThatDoNotVerifyAreMalformed) {
  std::string forged = line(SampleArchive::kDeviceName, SoundCases::get().archive.key());
  const std::size_t at = forged.size() - 20;
  forged[at] = forged[at] == 'A' ? 'B' : 'A';
  append(kLastNote, forged);
  EXPECT_THAT(summary(victim_.verify()),
              ::testing::HasSubstr(std::string("checkpoint-malformed ") + kLastNote + " -"));
}

TEST_F(SignatureLines, RepeatedAreMalformed) {
  const std::string witness = line("witness.example", other_);
  append(kLastNote, witness + witness);
  EXPECT_THAT(summary(victim_.verify()),
              ::testing::HasSubstr(std::string("checkpoint-malformed ") + kLastNote + " -"));
}

TEST_F(SignatureLines, OfTheDeviceItselfRepeatedAreMalformed) {
  append(kLastNote, line(SampleArchive::kDeviceName, SoundCases::get().archive.key()));
  EXPECT_THAT(summary(victim_.verify()),
              ::testing::HasSubstr(std::string("checkpoint-malformed ") + kLastNote + " -"));
}

TEST_F(SignatureLines, ThatAreNoneAreMalformed) {
  append(kLastNote, "a film, for instance\n");
  EXPECT_THAT(summary(victim_.verify()),
              ::testing::HasSubstr(std::string("checkpoint-malformed ") + kLastNote + " -"));
}

TEST_F(SignatureLines, OnAStampedNoteAreToldByItsToken) {
  append(kStamped, line_over(read_file(victim_ / kStamped), "witness.example", other_));
  EXPECT_THAT(summary(victim_.verify()), ::testing::HasSubstr("token-imprint-differs"));
}

TEST_F(SignatureLines, OnANoteOfTheLogAreTold) {
  const std::filesystem::path note = victim_.log() / "checkpoints/00000002.note";
  write_file(note, read_file(note) + line_over(read_file(note), "witness.example", other_));
  EXPECT_EQ(summary(victim_.verify()), "intact\ncheckpoint-cosigned log/checkpoints/00000002.note -");
}

}  // namespace
}  // namespace kiroku::test
