#include "evidence/shared_token.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

constexpr auto kRoundHash = crypto::HashAlgorithm::kSha256;

Bytes note_hash(const std::string& text) { return test::hash_of(kRoundHash, text); }

/// A round of so many notes, and the file for each.
struct Round {
  explicit Round(int notes) {
    std::vector<Bytes> digests;
    for (int i = 0; i < notes; ++i) digests.push_back(note_hash("note " + std::to_string(i)));
    const Stamp stamp = authority.at("2026-06-01");
    files = share_token(digests, [&](crypto::HashAlgorithm algorithm, ByteView imprint) {
      ++asked;
      return stamp(algorithm, imprint);
    });
    trust.add_trusted(bytes_of(authority.root_pem()), "root");
  }
  timestamp::TokenCode judge(ByteView file, const std::string& note) const {
    std::string why;
    const auto judging = judging_shared(file, bytes_of(note), why);
    if (!judging) return timestamp::TokenCode::kNotAToken;
    return timestamp::judge_token(judging->token, judging->expectation, trust).code;
  }

  test::PlayedAuthority authority{"outside", "2026-01-01", "2030-01-01"};
  timestamp::TrustStore trust;
  std::vector<Bytes> files;
  int asked = 0;
};

TEST(SharedToken, OneRequestGivesEachNoteOfARoundAFileThatHoldsAlone) {
  for (const int notes : {1, 2, 3, 5, 8, 100}) {
    const Round round(notes);
    EXPECT_EQ(round.asked, 1);
    ASSERT_EQ(round.files.size(), std::size_t(notes));
    for (int i = 0; i < notes; ++i) {
      EXPECT_EQ(round.judge(round.files[std::size_t(i)], "note " + std::to_string(i)),
                timestamp::TokenCode::kValid);
    }
  }
}

TEST(SharedToken, IsNoTokenOverAnotherNote) {
  const Round round(5);
  EXPECT_EQ(round.judge(round.files[0], "note 4"), timestamp::TokenCode::kImprintDiffers);
  EXPECT_EQ(round.judge(round.files[0], "a note of nobody"), timestamp::TokenCode::kImprintDiffers);
}

TEST(SharedToken, NotesThatAreTheSameCountOnce) {
  const Bytes note = note_hash("note 0");
  const Round round(1);
  const auto files = share_token({note, note, note_hash("note 1")}, round.authority.at("2026-06-01"));
  EXPECT_EQ(round.judge(files[0], "note 0"), timestamp::TokenCode::kValid);
  EXPECT_EQ(round.judge(files[1], "note 0"), timestamp::TokenCode::kValid);
  EXPECT_THROW(share_token({}, round.authority.at("2026-06-01")), UsageError);
}

TEST(SharedToken, IsToldFromAResponseByItsFirstBytes) {
  const Round round(2);
  EXPECT_TRUE(begins_as_record(round.files[0]));
  EXPECT_FALSE(begins_as_record(parse_shared_token(round.files[0]).shared->token));
  EXPECT_FALSE(begins_as_record({}));
}

// Whatever stands there: it is refused, or it is not valid. Nothing throws.
TEST(SharedToken, DoesNotHoldWithAnyByteOfItsPathChangedOrCutOff) {
  const Round round(5);
  const Bytes& file = round.files[0];
  const std::size_t token = parse_shared_token(file).shared->token.size();
  for (std::size_t at = 0; at < file.size() - token; ++at) {
    for (const int bit : {0, 3, 7}) {
      Bytes changed = file;
      changed[at] ^= std::byte(1 << bit);
      EXPECT_NE(round.judge(changed, "note 0"), timestamp::TokenCode::kValid) << at;
    }
    EXPECT_FALSE(parse_shared_token(ByteView(file).first(at)).shared) << at;
  }
}

}  // namespace
}  // namespace kiroku::evidence
