#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "tests/support/forger.h"
#include "tests/support/patterned_bytes.h"
#include "tests/support/temporary_folder.h"
#include "viewer/kept/kept_comparison.h"

namespace kiroku::compare {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class KeptFilmTest : public testing::Test {
 protected:
  KeptFilmTest() {
    const std::string zeros(64, '0');
    const std::string document =
        R"({"format": "kiroku-comparison/1", "made_by": "Dr. Sato", "made_at": "2026-08-05T09:00:00Z",)"
        R"( "program": "kiroku", "case": {"id": "c", "names_plan": null, "ledger": {"size": 1, "root": ")" +
        zeros + R"("}}, "plan": {"name": "p", "seal": ")" + zeros +
        R"(", "sealed": false, "files": []}, "outputs": [{"role": "replay", "name": "plan.replay.mp4", "bytes": )" +
        std::to_string(film_.size()) + R"(, "sha256": ")" + crypto::to_hex(crypto::sha256(film_)) + "\"}]}";
    test::write_into(place_.sealed_document(), test::sealed_anew(bytes_of(document), recipients_));
    test::write_into(place_.sealed_replay(), honest_);
  }
  [[nodiscard]] Bytes shown() {
    const KeptFilm film(place_, "replay", identities_, hashed_);
    Bytes bytes(film.size());
    film.read_at(0, bytes);
    return bytes;
  }

  test::TemporaryFolder folder_;
  crypto::AgeKeyPair pair_ = crypto::generate_age_key();
  crypto::AgeRecipients recipients_{crypto::parse_recipient(pair_.recipient)};
  crypto::AgeIdentities identities_{crypto::parse_identity(pair_.identity_text.text())};
  KeptPlace place_{folder_.path(), "plan"};
  Bytes film_ = test::patterned_bytes(1'500'000);
  std::string honest_ = test::sealed_anew(film_, recipients_);
  crypto::HashTrails hashed_;
};

TEST_F(KeptFilmTest, IsTheOneThatTheDocumentNames) {
  EXPECT_EQ(shown(), film_);
  EXPECT_EQ(shown(), film_) << "also where its hash is remembered";
  EXPECT_THAT([&] { (void)KeptFilm(place_, "radiographs", identities_, hashed_); },
              ThrowsMessage<Error>(HasSubstr("names no such film")));
}

TEST_F(KeptFilmTest, AnotherOneForTheSameReaderIsNotShown) {
  const std::string forged = test::sealed_anew(test::patterned_bytes(film_.size(), 7), recipients_);
  test::write_into(place_.sealed_replay(), forged);
  EXPECT_THAT([&] { (void)shown(); },
              ThrowsMessage<Error>(HasSubstr("is not the film that the comparison 'plan' was made with")));
  test::write_into(place_.sealed_replay(), honest_);
  EXPECT_EQ(shown(), film_);
  test::write_into(place_.sealed_replay(), forged);
  EXPECT_THAT([&] { (void)shown(); }, ThrowsMessage<Error>(HasSubstr("changed after it was hashed")))
      << "the hash is remembered, the file is not believed";
}

TEST_F(KeptFilmTest, OneExchangedWhileItIsWatchedIsNotShown) {
  const KeptFilm film(place_, "replay", identities_, hashed_);
  Bytes part(1000);
  film.read_at(0, part);
  EXPECT_TRUE(std::equal(part.begin(), part.end(), film_.begin()));
  test::write_into(place_.sealed_replay(),
                   test::resealed(honest_, identities_, test::patterned_bytes(film_.size(), 7)));
  EXPECT_THAT([&] { film.read_at(1'000'000, part); },
              ThrowsMessage<Error>(HasSubstr("changed after it was hashed")));
}

}  // namespace
}  // namespace kiroku::compare
