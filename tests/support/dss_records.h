// The evidence records of the European Commission's DSS (https://github.com/esig/dss). They are no part of
// this project: KIROKU_DSS names a folder with a checkout; without it the tests of them are skipped.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "evidence/record_verifier.h"
#include "tests/support/shared_data.h"

namespace kiroku::test {

/// One of DSS's test classes. What `tokens` says is the test's own.
struct DssExpectation {
  const char* name;
  const char* file;
  std::vector<std::string> data;  // the bytes, "file:NAME", or "sha256:BASE64" and the like
  std::size_t found;              // values of the first list that are of the data
  std::size_t orphans;            // values that are not
  const char* tokens;
  /// What our judgement says beside that: "record-link-missing [1][0]" refuses, with " open" it could not be
  /// checked. What is said of the tokens themselves is left out, as no root is trusted.
  std::string problems = {};

  friend void PrintTo(const DssExpectation& expected, std::ostream* out) { *out << expected.name; }
};

class DssTest : public ::testing::TestWithParam<DssExpectation> {
 protected:
  void SetUp() override {
    if (std::getenv("KIROKU_DSS") == nullptr)
      GTEST_SKIP() << "needs a checkout of esig/dss: set KIROKU_DSS to its folder";
  }
  /// Of the module's test resources.
  static Bytes resource(const std::string& module, const std::string& name) {
    return read_whole(std::filesystem::path(std::getenv("KIROKU_DSS")) / module / "src/test/resources" /
                      name);
  }
};

/// That the judgement itself has what DSS finds, and for any other reason refuses nothing. DSS counts values
/// that stand twice twice; an object is covered once.
inline void expect_judged(const evidence::RecordJudgement& judgement, std::size_t objects,
                          const DssExpectation& expected) {
  constexpr std::size_t kAny = std::size_t(-1),
                        kSequence = std::string_view("archiveTimeStampSequence").size();
  const evidence::TimeStampJudgement& first = judgement.time_stamps.front();
  if (expected.found != kAny) {
    EXPECT_EQ(first.objects.size(), std::min(expected.found, objects));
  }
  if (expected.orphans != kAny) {
    EXPECT_EQ(first.other_values, expected.orphans);
  }
  std::string problems;
  for (const evidence::Problem& each : judgement.problems) {
    if (each.code.starts_with("token-")) continue;
    problems += (problems.empty() ? "" : ", ") + each.code + " " + each.place.substr(kSequence) +
                (each.standing == evidence::Standing::kCouldNotCheck ? " open" : "");
  }
  EXPECT_EQ(problems, expected.problems);
}

/// Of "sha256:BASE64 sha512:BASE64": data of which only these hashes are known.
inline evidence::DataObject object_by_hashes(const std::string& text) {
  return {text, [text](crypto::HashAlgorithm algorithm) -> std::optional<Bytes> {
            const std::string name = std::string(crypto::hash_name(algorithm)) + ":";
            const std::size_t at = text.find(name);
            if (at == std::string::npos) return {};
            const std::string value = text.substr(at + name.size());
            return crypto::from_base64(value.substr(0, value.find(' ')), crypto::Base64Padding::kPadded);
          }};
}

}  // namespace kiroku::test
