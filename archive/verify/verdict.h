// From findings to the verdict. Pure; thread-safe.
#pragma once

#include <cstdint>

#include "archive/verify/finding.h"
#include "archive/verify/report.h"

namespace kiroku::archive {

/// Files of the folder that no line names: ledger.jsonl; of an excerpt its document, opening line and lines.
/// Checkpoints are counted by themselves.
inline constexpr std::uint64_t kFilesOfACase = 1, kFilesOfAnExcerpt = 3;

/// The verdict that the gravest finding makes.
Verdict verdict_of(Severity worst);
/// The same of an excerpt.
Verdict verdict_of_excerpt(Severity worst);

}  // namespace kiroku::archive
