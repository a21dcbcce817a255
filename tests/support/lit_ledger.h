// A ledger that grows by an entry each second, and the codes of a display that follows it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "archive/format/ledger_entry.h"
#include "light/ledger_lights.h"

namespace kiroku::test {

inline constexpr std::int64_t kLitBegin = 1'790'000'000;  // Unix time of its first entry, and case clock 0
inline constexpr std::int64_t kLitSecond = 1'000'000'000;

/// Another ledger for each `salt`; `apart` are the seconds between two entries.
inline std::vector<std::string> lit_lines(int entries, std::int64_t salt, int apart = 1) {
  std::vector<std::string> lines;
  for (int i = 0; i < entries; ++i) {
    archive::CaseEntry entry;
    entry.seq = static_cast<std::uint64_t>(i);
    entry.at = {UtcTime(std::chrono::seconds(kLitBegin + std::int64_t{i} * apart)), i * kLitSecond * apart};
    entry.body = archive::ClockEntry{true, salt, 0, 0, 0};
    lines.push_back(archive::to_line(entry));
  }
  return lines;
}

inline light::LedgerLights lights_of(const std::vector<std::string>& lines) {
  light::LedgerLights lights;
  for (const std::string& line : lines) lights.add_line(line);
  lights.finish();
  return lights;
}

/// What a display shows that has seen each line as soon as it was written.
inline std::uint64_t shown_in(const light::LedgerLights& lights, std::int64_t second) {
  const auto entries = static_cast<std::uint64_t>(second - kLitBegin + 1);
  for (const light::LedgerCode& code : lights.codes_of(second, second))
    if (code.entries == entries) return code.code;
  ADD_FAILURE() << "the ledger has no code of second " << second - kLitBegin;
  return 0;
}

}  // namespace kiroku::test
