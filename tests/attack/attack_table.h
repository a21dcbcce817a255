// A table of attacks and what each must be told as.
#pragma once

#include <functional>
#include <optional>
#include <ostream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/attack/attacked_case.h"
#include "tests/support/report_text.h"

namespace kiroku::test {

struct Attack {
  std::string name;
  std::function<void(AttackedCase&)> tamper;
  std::string code;                    // a finding that must be there,
  std::string file;                    // in this file,
  std::optional<std::uint64_t> entry;  // and at this entry
  archive::Verdict verdict = archive::Verdict::kTampered;
  bool with_log = false;  // most attacks must be told without it
};
inline void PrintTo(const Attack& attack, std::ostream* out) { *out << attack.name; }

inline void expect_told(const Attack& attack) {
  AttackedCase victim;
  ASSERT_EQ(summary(victim.verify()), "intact");
  attack.tamper(victim);
  const archive::VerificationReport report = victim.verify(attack.with_log);
  EXPECT_EQ(archive::verdict_name(report.verdict), archive::verdict_name(attack.verdict)) << details(report);
  bool told = false;
  for (const archive::Finding& finding : report.findings) {
    told = told || (finding.code == attack.code && finding.file == attack.file &&
                    (!attack.entry || finding.entry == attack.entry));
  }
  EXPECT_TRUE(told) << "wanted " << attack.code << " " << attack.file << details(report);
}

inline std::string name_of(const ::testing::TestParamInfo<Attack>& tested) { return tested.param.name; }

}  // namespace kiroku::test
