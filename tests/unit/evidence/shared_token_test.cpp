#include "evidence/shared_token.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

constexpr auto kRoundHash = crypto::HashAlgorithm::kSha256;

Bytes note_hash(const std::string& text) { return test::hash_of(kRoundHash, text); }

/// A round of so many notes, each with a nonce or without one, and the file for each.
struct Round {
  explicit Round(int notes, bool with_nonces = false) {
    std::vector<HashList> groups;
    for (int i = 0; i < notes; ++i) {
      groups.push_back({note_hash("note " + std::to_string(i))});
      if (with_nonces) groups.back().push_back(nonce_of(i));
    }
    const Stamp stamp = authority.at("2026-06-01");
    const StampedRound round(std::move(groups), [&](crypto::HashAlgorithm algorithm, ByteView imprint) {
      ++asked;
      return stamp(algorithm, imprint);
    });
    for (int i = 0; i < notes; ++i) files.push_back(round.file_of(std::size_t(i)));
    trust.add_trusted(bytes_of(authority.root_pem()), "root");
  }
  static Bytes nonce_of(int note) { return note_hash("nonce " + std::to_string(note)); }
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
  const StampedRound twice({{note}, {note}, {note_hash("note 1")}}, round.authority.at("2026-06-01"));
  EXPECT_EQ(round.judge(twice.file_of(0), "note 0"), timestamp::TokenCode::kValid);
  EXPECT_EQ(round.judge(twice.file_of(1), "note 0"), timestamp::TokenCode::kValid);
  EXPECT_THROW(StampedRound({}, round.authority.at("2026-06-01")), UsageError);
}

TEST(SharedToken, HoldsWithANonceBesideItsNoteAndSaysWhichNonceThatWas) {
  for (const int notes : {1, 2, 7}) {
    const Round round(notes, true);
    for (int i = 0; i < notes; ++i) {
      const Bytes& file = round.files[std::size_t(i)];
      EXPECT_EQ(round.judge(file, "note " + std::to_string(i)), timestamp::TokenCode::kValid);
      const SharedToken shared = *parse_shared_token(file).shared;
      EXPECT_TRUE(shared.begins_with(Round::nonce_of(i)));
      EXPECT_FALSE(shared.begins_with(Round::nonce_of(i + 1)));
    }
  }
  EXPECT_FALSE(parse_shared_token(Round(1).files[0]).shared->begins_with(Round::nonce_of(0)));
}

// Else whoever gets a file would know the notes of the others: they could tell that two cases are the same.
TEST(SharedToken, TellsNothingOfOtherNotesThatHaveANonce) {
  const Round round(8, true);
  const std::string file(text_of(round.files[0]));
  for (int i = 1; i < 8; ++i) {
    EXPECT_EQ(file.find(text_of(note_hash("note " + std::to_string(i)))), std::string::npos) << i;
    EXPECT_EQ(file.find(text_of(Round::nonce_of(i))), std::string::npos) << i;
  }
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
