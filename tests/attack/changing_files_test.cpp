// Attacks on a file between the moment when it is hashed and the moment when it is decrypted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/forger.h"
#include "tests/support/patterned_bytes.h"
#include "tests/support/recorded_case.h"
#include "tests/support/report_text.h"
#include "tests/support/sample_case.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// A case with one film, and somebody who verifies it with an identity.
class AttackWhileReading : public testing::Test {
 protected:
  void record(std::size_t film_bytes) {
    film_ = patterned_bytes(film_bytes);
    case_ = record_case(folder_ / "archive", {{"room", "video", "video/mp2t", {film_}, {25}}},
                        reader_.recipients);
    file_ = case_ / kFilm;
    honest_ = read_file(file_);
  }
  /// `act` happens when a header is opened.
  archive::VerificationReport verify_while(const std::function<void()>& act) {
    const crypto::AgeIdentities identities = observed(reader_.identities, act);
    archive::VerifyOptions options;
    options.identities = &identities;
    options.threads = 1;
    options.inspect = inspect_;
    return archive::verify_case(case_, options);
  }
  /// What verification says of the film.
  static std::vector<std::string> said(const archive::VerificationReport& report) {
    std::vector<std::string> texts;
    for (const archive::Finding& finding : report.findings) {
      if (finding.file == kFilm) texts.push_back(finding.code + ": " + finding.text);
    }
    return texts;
  }
  /// Decrypts all, as a decoder would.
  archive::SegmentInspector reading(bool pass_over_errors = false) {
    return [this, pass_over_errors](
               const archive::StreamInfo&, const archive::SegmentEntry&, const crypto::ByteSource& sealed,
               const crypto::AgeIdentities& identities) -> std::optional<archive::InspectionProblem> {
      try {
        shown_.clear();
        crypto::AgeFile::open(sealed, identities).read_all([&](ByteView piece) { append(shown_, piece); });
      } catch (const Error&) {
        if (!pass_over_errors) throw;
      }
      return std::nullopt;
    };
  }

  static constexpr const char* kFilm = "segments/room/00000000.ts.age";
  static constexpr std::size_t kSmall = 70'000, kLarge = 3'000'000;
  static constexpr const char* kChanged =
      "file-hash-differs: segments/room/00000000.ts.age changed while it was checked";

  TemporaryFolder folder_;
  Reader reader_ = make_reader();
  fs::path case_, file_;
  Bytes film_;
  std::string honest_;
  archive::SegmentInspector inspect_;
  Bytes shown_;
};

TEST_F(AttackWhileReading, NothingIsSaidOfAnHonestFilm) {
  for (const std::size_t size : {kSmall, kLarge}) {
    record(size);
    inspect_ = reading();
    EXPECT_THAT(said(verify_while([] {})), testing::IsEmpty());
    EXPECT_EQ(shown_, film_);
  }
}

TEST_F(AttackWhileReading, AnotherFilmUnderTheSameKeyIsTold) {
  record(kLarge);
  for (const std::size_t size : {kLarge, kSmall, 2 * kLarge}) {
    const std::string forged = resealed(honest_, reader_.identities, patterned_bytes(size, 7));
    const auto report = verify_while([&] { write_into(file_, forged); });
    EXPECT_EQ(report.verdict, archive::Verdict::kTampered) << size;
    EXPECT_THAT(said(report), testing::ElementsAre(HasSubstr(kChanged))) << size;
    write_into(file_, honest_);
  }
}

TEST_F(AttackWhileReading, OfASmallFilmWhatIsDecryptedIsWhatWasHashed) {
  record(kSmall);
  inspect_ = reading();
  const std::string forged = resealed(honest_, reader_.identities, patterned_bytes(kSmall, 7));
  EXPECT_THAT(said(verify_while([&] { write_into(file_, forged); })), testing::IsEmpty());
  EXPECT_EQ(shown_, film_);
  EXPECT_EQ(read_file(file_), forged) << "the forger was at work";
}

TEST_F(AttackWhileReading, AnotherFilmBeforeTheDecoderIsTold) {
  for (const bool passes_over : {false, true}) {
    record(kLarge);
    const std::string forged = sealed_anew(patterned_bytes(kLarge, 7), reader_.recipients);
    ASSERT_EQ(forged.size(), honest_.size());
    const archive::SegmentInspector decoder = reading(passes_over);
    inspect_ = [&](const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                   const crypto::ByteSource& sealed, const crypto::AgeIdentities& identities) {
      write_into(file_, forged);
      return decoder(stream, entry, sealed, identities);
    };
    const auto report = verify_while([] {});
    EXPECT_EQ(report.verdict, archive::Verdict::kTampered);
    EXPECT_THAT(said(report), testing::ElementsAre(HasSubstr(kChanged))) << passes_over;
    EXPECT_THAT(shown_, testing::IsEmpty()) << "not a byte of the forgery";
  }
}

TEST_F(AttackWhileReading, AFileThatIsMadeGoodAgainIsNotCalledAForgersWork) {
  // What was hashed is damaged. What is read next is the film that was recorded, and of course it decrypts.
  record(kLarge);
  std::string damaged = honest_;
  damaged[kLarge / 2] ^= 1;
  write_into(file_, damaged);
  const auto report = verify_while([&] { write_into(file_, honest_); });
  EXPECT_THAT(said(report), testing::ElementsAre(testing::AllOf(
                                HasSubstr(kChanged), Not(HasSubstr("somebody who knows a recipient")))));
}

// A checkpoint is read to judge its signature, and again for the token over it. Whoever answers otherwise the
// second time has a token over other bytes, from years ago perhaps.
TEST(AttackWhileReadingNotes, ATokenOverOtherBytesThanTheSignatureIsTold) {
  SampleArchive archive;
  fs::path folder;
  std::uint64_t size = 0;
  const std::string older = "what the authority stamped long ago\n";
  {
    SampleCase sample(archive);
    sample.record();
    const archive::StoredCheckpoint checkpoint = sample.writer().checkpoint(archive.now());
    size = checkpoint.size;
    // More files than wait to be hashed: the first is opened before the token's entry is read.
    std::vector<archive::CaseEntryBody> segments;
    for (std::uint64_t index = 1; index < 100; ++index) {
      const auto end = static_cast<std::int64_t>(6'000'000'000 + index);
      segments.emplace_back(sample.segment(1, index, {end - 1, end}));
    }
    sample.writer().append(segments, archive.now());
    const Bytes response = archive.stamp(older);
    sample.writer().add_token(checkpoint, SampleArchive::kAuthorityName, response,
                              SampleArchive::facts_of(response), archive.now());
    sample.close();
    folder = sample.folder();
  }
  const fs::path note = folder / archive::note_path(size);
  const std::string honest = read_file(note);
  archive::VerifyOptions options = archive.options();
  options.threads = 1;
  const auto said = [&] { return details(archive::verify_case(folder, options)); };
  EXPECT_THAT(said(), HasSubstr("token-imprint-differs"));
  // Files are opened in the ledger's order: these lie behind the checkpoint.
  constexpr int kFilesBefore = 8;
  int opened = 0;
  const crypto::AgeIdentities identities = observed(archive.identities(), [&] {
    if (++opened == kFilesBefore) {
      write_file(note, older);
    }
  });
  options.identities = &identities;
  EXPECT_THAT(said(), HasSubstr("changed while it was checked"));
  EXPECT_EQ(read_file(note), older) << "the forger was at work";
}

}  // namespace
}  // namespace kiroku::test
