// ML-DSA tests run for each parameter set and for each implementation that is here.
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "crypto/ml_dsa.h"

namespace kiroku::test {

struct MlDsaCase {
  crypto::MlDsaSet set;
  crypto::MlDsaProvider provider;
};

inline std::vector<crypto::MlDsaProvider> ml_dsa_providers() {
  using crypto::MlDsaProvider;
  if (crypto::ml_dsa_provider() == MlDsaProvider::kOwn) return {MlDsaProvider::kOwn};
  return {MlDsaProvider::kOwn, MlDsaProvider::kOpenSsl};
}

inline std::vector<MlDsaCase> ml_dsa_cases() {
  std::vector<MlDsaCase> cases;
  for (const auto set : {crypto::MlDsaSet::k44, crypto::MlDsaSet::k65})
    for (const auto provider : ml_dsa_providers()) cases.push_back({set, provider});
  return cases;
}

inline std::string ml_dsa_case_name(const testing::TestParamInfo<MlDsaCase>& info) {
  return std::string(info.param.provider == crypto::MlDsaProvider::kOwn ? "Own" : "OpenSsl") +
         (info.param.set == crypto::MlDsaSet::k44 ? "44" : "65");
}

}  // namespace kiroku::test

namespace kiroku::crypto {

class MlDsa : public testing::TestWithParam<test::MlDsaCase> {
 protected:
  static MlDsaSet set() { return GetParam().set; }
  static MlDsaPrivateKey key_of(ByteView seed) { return {set(), seed, GetParam().provider}; }
  static bool verify(ByteView public_key, ByteView message, ByteView signature, ByteView context) {
    return verify_ml_dsa(set(), public_key, message, signature, context, GetParam().provider);
  }
};

}  // namespace kiroku::crypto
