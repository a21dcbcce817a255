#include "archive/verify/found_files.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <set>
#include <string>
#include <tuple>
#include <unistd.h>

#include "archive/format/age_layout.h"
#include "archive/format/segment_media.h"
#include "archive/storage/file_system.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/token_rules.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "timestamp/token.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kReadBytes = 1U << 20U;

/// Regular files of a folder, by name; none if it is not there.
std::vector<fs::path> regular_files(const FileReading& files, const fs::path& folder) {
  std::vector<fs::path> found;
  if (!files.is_folder(folder)) {
    return found;
  }
  for (const std::string& name : files.names_in(folder)) {
    const std::optional<FileStatus> status = files.status(folder / name);
    if (status && status->kind == FileStatus::Kind::kRegular) {
      found.push_back(folder / name);
    }
  }
  return found;
}

/// Where the last byte that is not zero ends.
std::uint64_t end_of_content(const ReadableFile& file) {
  std::vector<std::byte> buffer(kReadBytes);
  for (std::uint64_t end = file.size(); end > 0;) {
    const std::uint64_t start = end - std::min<std::uint64_t>(end, kReadBytes);
    const auto piece = std::span(buffer).first(static_cast<std::size_t>(end - start));
    // Bytes that do not come are not zeros: a part would pass for empty and be removed.
    file.read_wholly_at(start, piece);
    std::size_t filled = piece.size();
    while (filled > 0 && piece[filled - 1] == std::byte{0}) {
      --filled;
    }
    if (filled > 0) {
      return start + filled;
    }
    end = start;
  }
  return 0;
}

/// Whether the first `size` bytes are the beginning of an age header and no more.
bool is_begun_header(const ReadableFile& file, std::uint64_t size) {
  std::string text(static_cast<std::size_t>(size), '\0');
  file.read_wholly_at(0, std::as_writable_bytes(std::span(text.data(), text.size())));
  return (text.starts_with(kAgeFirstLine) || kAgeFirstLine.starts_with(text)) &&
         text.find('\0') == std::string::npos;
}

/// Clean pages of the file leave the cache. A hint: where it is not taken, nothing is worse than before.
void forget_cached(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (descriptor >= 0) {
    ::posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED);
    ::close(descriptor);
  }
}

}  // namespace

std::vector<FoundSegment> found_segments(const FileReading& files, const fs::path& case_folder,
                                         const StreamInfo& stream, std::uint64_t first_index) {
  std::vector<FoundSegment> found;
  for (const fs::path& file : regular_files(files, case_folder / kSegmentsFolder / stream.name)) {
    const std::string name = file.filename().string();
    const std::optional<std::uint64_t> index = parse_index(name.substr(0, name.find('.')));
    if (!index || *index < first_index) {
      continue;
    }
    for (const std::string& extension : extensions_of(stream)) {
      const std::string path = segment_path(stream.name, *index, extension);
      const std::string whole = fs::path(path).filename().string();
      if (name != whole && name != whole + std::string(kPartSuffix)) continue;
      const std::optional<FileStatus> status = files.status(file);
      if (!status) {
        throw IoError("examine", file, ENOENT);
      }
      found.push_back({*index, name == whole, file, status->last_change, path});
    }
  }
  std::sort(found.begin(), found.end(), [](const FoundSegment& a, const FoundSegment& b) {
    return std::make_tuple(a.index, !a.complete) < std::make_tuple(b.index, !b.complete);
  });
  return found;
}

std::vector<TokenName> found_tokens(const fs::path& case_folder, const FileReading& files) {
  std::vector<TokenName> found;
  for (const fs::path& file : regular_files(files, case_folder / kTokensFolder)) {
    if (const std::optional<TokenName> name = parse_token_name(file.filename().string())) {
      found.push_back(*name);
    }
  }
  std::sort(found.begin(), found.end(), [](const TokenName& a, const TokenName& b) {
    return std::tie(a.size, a.authority, a.form) < std::tie(b.size, b.authority, b.form);
  });
  return found;
}

std::vector<TokenName> tokens_to_judge(std::vector<TokenName> found, const fs::path& case_folder,
                                       const FileReading& files, std::size_t& left) {
  left = 0;
  if (found.size() <= kMostFoundTokens) return found;
  std::set<std::uint64_t> sizes;
  for (const std::string& name : files.names_in(case_folder / kCheckpointsFolder)) {
    if (const auto size = size_of_note_name(name)) sizes.insert(*size);
  }
  left = found.size();
  std::erase_if(found, [&](const TokenName& name) { return !sizes.contains(name.size); });
  if (found.size() > kMostFoundTokens) {
    found.erase(found.begin(), found.end() - static_cast<std::ptrdiff_t>(kMostFoundTokens));
  }
  left -= found.size();
  return found;
}

std::optional<evidence::StampJudging> judging_of(TokenForm form, ByteView file, ByteView note,
                                                 std::string& explanation) {
  if (form == TokenForm::kShared) return evidence::judging_shared(file, note, explanation);
  return evidence::judging_response(file, note);
}

std::optional<TokenEntry> token_in_folder(const CaseFolder& folder, const TokenName& name,
                                          const timestamp::TrustStore* trust) {
  const auto file =
      folder.read_if_there(token_path(name.size, name.authority, name.form), kMaximumTokenBytes);
  const auto text = folder.read_if_there(note_path(name.size), kMaximumNoteBytes);
  if (!file || !text) {
    return std::nullopt;
  }
  std::string ignored;
  const auto judging = judging_of(name.form, bytes_of(*file), bytes_of(*text), ignored);
  const auto parsed = judging ? timestamp::parse_response(judging->token, ignored) : std::nullopt;
  const auto info = parsed ? timestamp::parse_token_info(parsed->token, ignored) : std::nullopt;
  if (!info || !judging->is_over_data(*info)) {
    return std::nullopt;
  }
  if (trust != nullptr && timestamp::judge_token(judging->token, judging->expectation, *trust).code !=
                              timestamp::TokenCode::kValid) {
    return std::nullopt;
  }
  TokenEntry facts;
  facts.gen_time = info->gen_time;
  facts.accuracy_ns = info->accuracy_ns;
  facts.serial = info->serial;
  return facts;
}

PartContents look_into(const FileReading& files, const fs::path& part) {
  const ReadableFile file = files.open_to_read(part);
  const std::uint64_t end = end_of_content(file);
  PartContents contents;
  contents.zeros_at_end = file.size() - end;
  if (const std::optional<std::uint64_t> header = age_header_bytes(file)) {
    contents.holds_sealed_bytes = end > *header + kAgeNonceBytes;
  } else {
    // Lost or half there. Text without a zero is the beginning of a header; anything else stood behind one.
    contents.holds_sealed_bytes = end > kMaximumAgeHeaderBytes || !is_begun_header(file, end);
  }
  return contents;
}

bool may_be_found_complete(const crypto::ByteSource& file, const StreamInfo& stream) {
  const AgeForm form = age_form(file);
  return form == AgeForm::kHolding || (form == AgeForm::kEmpty && stream.media == kLinesMedia);
}

bool was_found_cut_off(const SegmentEntry& segment) { return !segment.complete && !segment.counted; }

std::uint64_t newest_note(const fs::path& folder, const FileReading& files) {
  std::uint64_t newest = 0;
  for (const std::string& name : files.names_in(folder / kCheckpointsFolder)) {
    newest = std::max(newest, size_of_note_name(name).value_or(0));
  }
  return newest;
}

FileReference measure_file(const FileReading& files, const fs::path& file) {
  const ReadableFile input = files.open_to_read(file);
  FileReference reference;
  crypto::Sha256 hash;
  std::vector<std::byte> buffer(kReadBytes);
  while (const std::size_t count = input.read_at(reference.bytes, buffer)) {
    hash.update(std::span(buffer).first(count));
    reference.bytes += count;
  }
  input.require_read_to_end(reference.bytes);
  reference.sha256 = hash.finish();
  return reference;
}

FileReference make_durable(FileSystem& files, const fs::path& file) {
  files.append_to(file)->sync_all();
  files.sync_folder(file.parent_path());
  forget_cached(file);
  return measure_file(files, file);
}

void remove_unfinished_files(FileSystem& files, const fs::path& case_folder) {
  for (const std::string_view folder : {kCheckpointsFolder, kTokensFolder, kAuthoritiesFolder}) {
    for (const fs::path& file : regular_files(files, case_folder / folder)) {
      if (file.extension() == kPartSuffix) {
        files.remove(file);
      }
    }
  }
}

}  // namespace kiroku::archive
