// What may lie in `authorities/` of a case or an excerpt: certificates of the authorities that its entries
// name, as a convenience. No hash of them is in the ledger, so anything else could hide there. Functions;
// thread-safe.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "archive/format/case_folder.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/folder_names.h"

namespace kiroku::archive {

/// Of one authority. A chain has four certificates or so, each of 2 KiB.
inline constexpr std::size_t kMaximumCertificatesBytes = 256U << 10U;

/// Whether a path is below `authorities/`, at any depth.
bool is_below_authorities(std::string_view path);

/// Judges a file below `authorities/`. `named` tells whether an entry names an authority. Adds a finding
/// where there is more to say than the judgement does.
NameJudgement judge_authority_file(const CaseFolder& folder, const ListedFile& file,
                                   const std::function<bool(const std::string& authority)>& named,
                                   FindingList& findings);

/// Whether a file below `authorities/` is certificates of the authority that its name says. Throws
/// kiroku::IoError.
bool is_authority_file(const CaseFolder& folder, const ListedFile& file);

}  // namespace kiroku::archive
