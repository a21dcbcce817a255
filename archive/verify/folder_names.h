// Names in a folder that nothing accounts for, are no plain files, or differ only in case. Functions;
// thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/finding_list.h"

namespace kiroku::archive {

enum class NameJudgement {
  kNamed,              // something names it, and what it is was or is checked elsewhere
  kPart,               // was being written when recording stopped, or is now
  kTokenNotEntered,    // its entry is not written yet
  kSegmentNotEntered,  // likewise
  kUnnamed
};

/// Files that operating systems left (file-of-a-system): nobody recorded them, and they can be as long as
/// somebody likes.
struct LeftBySystems {
  std::uint64_t files = 0, bytes = 0;
};

/// Judges every name of a listing. ASCII case alone counts for clashes: every name of the format is ASCII.
LeftBySystems check_folder_names(const std::vector<ListedFile>& listing, FindingList& findings,
                                 const std::function<NameJudgement(const ListedFile&)>& judge);

/// "checkpoints/00000042.note", of a size above 0.
bool is_note_path(std::string_view path);
/// A name of that form that is no folder, so that the note is looked into.
bool is_note_file(const ListedFile& file);
/// Of "tokens/00000042.swiss.tsr" or "….ers"; nothing for any other path.
std::optional<TokenName> token_of_path(std::string_view path);

}  // namespace kiroku::archive
