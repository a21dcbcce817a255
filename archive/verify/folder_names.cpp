#include "archive/verify/folder_names.h"

#include <algorithm>
#include <array>
#include <string>
#include <unordered_map>

#include "archive/format/case_layout.h"
#include "base/ascii.h"

namespace kiroku::archive {

namespace {

/// The rest of a path below `folder`; nothing if it is not directly in it.
std::optional<std::string_view> name_in(std::string_view folder, std::string_view path) {
  if (!path.starts_with(folder) || path.size() <= folder.size() || path[folder.size()] != '/') {
    return std::nullopt;
  }
  return path.substr(folder.size() + 1);
}

void check_kind(const ListedFile& file, FindingList& findings) {
  switch (file.kind) {
    case ListedFile::Kind::kLink:
      findings.add("file-not-regular", {file.path},
                   file.path + " is a symbolic link, which is never followed");
      break;
    case ListedFile::Kind::kSpecial:
      findings.add("file-not-regular", {file.path}, file.path + " is a special file, which is never opened");
      break;
    case ListedFile::Kind::kUnreadable:
      findings.add("file-unreadable", {file.path},
                   file.path + " cannot be looked at; so what is in it was not checked");
      break;
    case ListedFile::Kind::kRegular:
    case ListedFile::Kind::kFolder:
      break;
  }
}

/// What operating systems put into folders that they show or copy, without being asked; of a folder with such
/// a name all that lies in it.
bool is_left_by_a_system(const ListedFile& file) {
  constexpr auto kFiles = std::to_array<std::string_view>({".DS_Store", "Thumbs.db", "desktop.ini"});
  constexpr std::string_view kMarkOfTheWeb = ":Zone.Identifier";
  constexpr std::string_view kFolder = "/@eaDir/";
  const std::string path = "/" + file.path;
  const std::string_view name = std::string_view(path).substr(path.rfind('/') + 1);
  const bool is_folder = file.kind == ListedFile::Kind::kFolder;
  if ((is_folder ? path + "/" : path).find(kFolder) != std::string::npos) return true;
  const bool is_mark = name.ends_with(kMarkOfTheWeb) && name.size() > kMarkOfTheWeb.size();
  return !is_folder && (is_mark || std::ranges::find(kFiles, name) != kFiles.end());
}

}  // namespace

bool is_note_path(std::string_view path) {
  const auto name = name_in(kCheckpointsFolder, path);
  return name && size_of_note_name(*name).value_or(0) > 0;
}

bool is_note_file(const ListedFile& file) {
  return file.kind != ListedFile::Kind::kFolder && is_note_path(file.path);
}

std::optional<TokenName> token_of_path(std::string_view path) {
  const auto name = name_in(kTokensFolder, path);
  return name ? parse_token_name(*name) : std::nullopt;
}

LeftBySystems check_folder_names(const std::vector<ListedFile>& listing, FindingList& findings,
                                 const std::function<NameJudgement(const ListedFile&)>& judge) {
  LeftBySystems left;
  std::unordered_map<std::string, std::string_view> seen;
  for (const ListedFile& file : listing) {
    const auto [other, fresh] = seen.emplace(lower_case(file.path), file.path);
    if (!fresh) {
      findings.add(
          "name-clash", {file.path},
          file.path + " and " + std::string(other->second) + " are one name where case does not count");
    }
    const bool plain = file.kind == ListedFile::Kind::kRegular || file.kind == ListedFile::Kind::kFolder;
    switch (judge(file)) {
      case NameJudgement::kNamed:
        break;
      case NameJudgement::kPart:
        check_kind(file, findings);
        if (plain) {
          findings.add("part-file", {file.path},
                       file.path + " was not finished when recording stopped, or is being written");
        }
        break;
      case NameJudgement::kTokenNotEntered:
        check_kind(file, findings);
        if (plain) {
          findings.add("token-not-entered", {file.path}, file.path + " has no entry in the ledger yet");
        }
        break;
      case NameJudgement::kSegmentNotEntered:
        check_kind(file, findings);
        if (plain) {
          findings.add("segment-not-entered", {file.path}, file.path + " has no entry in the ledger yet");
        }
        break;
      case NameJudgement::kUnnamed:
        check_kind(file, findings);
        if (plain && is_left_by_a_system(file)) {
          findings.add("file-of-a-system", {file.path},
                       "nobody recorded " + file.path + ": operating systems leave such files behind");
          const bool is_file = file.kind == ListedFile::Kind::kRegular;
          left.files += is_file ? 1U : 0U;
          left.bytes += is_file ? file.bytes : 0U;
        } else if (plain) {
          findings.add("file-unnamed", {file.path}, "nothing names " + file.path);
        }
        break;
    }
  }
  return left;
}

}  // namespace kiroku::archive
