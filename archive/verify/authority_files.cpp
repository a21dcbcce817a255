#include "archive/verify/authority_files.h"

#include <optional>

#include "archive/format/case_layout.h"
#include "archive/verify/file_checker.h"
#include "base/error.h"
#include "timestamp/certificate_text.h"

namespace kiroku::archive {

namespace {

/// Of "authorities/swiss.pem"; nothing for any other path.
std::optional<std::string> authority_of(std::string_view path) {
  constexpr std::string_view kSuffix = ".pem";
  if (!is_below_authorities(path) || !path.ends_with(kSuffix)) {
    return std::nullopt;
  }
  path.remove_prefix(kAuthoritiesFolder.size() + 1);
  path.remove_suffix(kSuffix.size());
  return is_short_name(path) ? std::optional(std::string(path)) : std::nullopt;
}

}  // namespace

bool is_below_authorities(std::string_view path) {
  return path.starts_with(kAuthoritiesFolder) && path.size() > kAuthoritiesFolder.size() &&
         path[kAuthoritiesFolder.size()] == '/';
}

NameJudgement judge_authority_file(const CaseFolder& folder, const ListedFile& file,
                                   const std::function<bool(const std::string& authority)>& named,
                                   FindingList& findings) {
  if (file.kind != ListedFile::Kind::kRegular || file.bytes > kMaximumCertificatesBytes) {
    return NameJudgement::kUnnamed;
  }
  std::string_view whole = file.path;
  if (whole.ends_with(kPartSuffix)) {
    whole.remove_suffix(kPartSuffix.size());
    return authority_of(whole) ? NameJudgement::kPart : NameJudgement::kUnnamed;
  }
  const std::optional<std::string> authority = authority_of(whole);
  if (!authority) {
    return NameJudgement::kUnnamed;
  }
  std::optional<std::string> text;
  try {
    const FileOpening opening = folder.open_file(file.path);
    if (!opening.file) {
      report_unopened(findings, {file.path}, opening);
      return NameJudgement::kNamed;  // said
    }
    text = read_small(*opening.file, kMaximumCertificatesBytes);
  } catch (const IoError& error) {
    findings.add("file-unreadable", {file.path}, std::string(error.what()) + "; so it was not checked");
    return NameJudgement::kNamed;  // said
  }
  const bool certificates = text && timestamp::is_certificate_text(*text);
  if (!named(*authority)) {
    // Stored before the entry of its token is: a power cut can come between.
    if (!certificates) {
      return NameJudgement::kUnnamed;
    }
    findings.add("authority-not-named", {file.path},
                 file.path + " holds certificates of an authority that no entry here names");
  } else if (!certificates) {
    findings.add("authority-file-malformed", {file.path},
                 file.path +
                     " is not certificates and nothing else; it is a convenience that nothing was checked "
                     "with");
  }
  return NameJudgement::kNamed;
}

bool is_authority_file(const CaseFolder& folder, const ListedFile& file) {
  if (file.kind != ListedFile::Kind::kRegular || !authority_of(file.path)) {
    return false;
  }
  const FileOpening opening = folder.open_file(file.path);
  const std::optional<std::string> text =
      opening.file ? read_small(*opening.file, kMaximumCertificatesBytes) : std::nullopt;
  return text && timestamp::is_certificate_text(*text);
}

}  // namespace kiroku::archive
