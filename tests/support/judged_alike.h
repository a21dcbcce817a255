// Judges a token alone, with an empty CertificatePool, and again with that pool: all three must say the same.
#pragma once

#include <gtest/gtest.h>

#include "timestamp/token_verifier.h"

namespace kiroku::test {

inline timestamp::TokenJudgement judge_alike(ByteView token, timestamp::Expectation expectation,
                                             const timestamp::TrustStore& trust) {
  timestamp::TokenJudgement alone = timestamp::judge_token(token, expectation, trust);
  timestamp::CertificatePool pool;
  expectation.pool = &pool;
  for (int i = 0; i < 2; ++i) {
    const timestamp::TokenJudgement pooled = timestamp::judge_token(token, expectation, trust);
    EXPECT_EQ(pooled.code, alone.code) << alone.explanation << " / " << pooled.explanation;
    EXPECT_EQ(pooled.explanation, alone.explanation);
    EXPECT_EQ(pooled.signer_subject, alone.signer_subject);
    EXPECT_EQ(pooled.root_subject, alone.root_subject);
    EXPECT_EQ(pooled.chain, alone.chain);
    EXPECT_EQ(pooled.signatures, alone.signatures);
    EXPECT_EQ(pooled.valid_until, alone.valid_until);
    EXPECT_EQ(pooled.authority, alone.authority);
    EXPECT_EQ(pooled.info.has_value(), alone.info.has_value());
  }
  return alone;
}

}  // namespace kiroku::test
