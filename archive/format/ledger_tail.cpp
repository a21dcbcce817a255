#include "archive/format/ledger_tail.h"

#include <algorithm>
#include <string>
#include <string_view>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

constexpr std::uint64_t kFirstLook = 64U << 10U, kLongestLook = 64U << 20U;

/// The last `size` bytes of a file.
std::string last_bytes(const ReadableFile& file, std::uint64_t size) {
  std::string text(static_cast<std::size_t>(size), '\0');
  file.read_wholly_at(file.size() - size, std::as_writable_bytes(std::span(text.data(), text.size())));
  return text;
}

bool may_follow_close(const CaseEntryBody& body) {
  return std::holds_alternative<TokenEntry>(body) || std::holds_alternative<TokenMissedEntry>(body) ||
         std::holds_alternative<ErasedEntry>(body);
}

/// Takes whole lines from the end until one decides; false if the text ends before.
bool take_backwards(std::string_view text, LedgerTail& tail, bool& readable) {
  bool is_last = true;
  while (text.size() > 1) {
    const std::size_t start = text.rfind('\n', text.size() - 2);
    if (start == std::string_view::npos) {
      return false;  // of this line, the beginning may be further up
    }
    const EntryParse parse = parse_case_entry(text.substr(start + 1, text.size() - start - 2));
    readable = parse.entry.has_value();
    if (!readable) {
      return true;
    }
    if (is_last) {
      tail.entries = parse.entry->seq + 1;
      is_last = false;
    }
    if (!may_follow_close(parse.entry->body)) {
      tail.closed = std::holds_alternative<CloseEntry>(parse.entry->body);
      return true;
    }
    if (const auto* erased = std::get_if<ErasedEntry>(&parse.entry->body)) {
      tail.erased.push_back(*erased);
    }
    text = text.substr(0, start + 1);
  }
  return true;
}

}  // namespace

std::optional<LedgerTail> read_ledger_tail(const std::filesystem::path& case_folder,
                                           const FileReading& files) {
  try {
    const CaseFolder folder = CaseFolder::open(case_folder, files);
    const FileOpening ledger = folder.open_file(kLedgerFile);
    if (!ledger.file || ledger.file->size() == 0) {
      return std::nullopt;
    }
    // Behind `close` stand a few lines of a thousand bytes. A file that has nothing but a hole of a
    // terabyte before its last line is read line by line, by whoever takes the case up.
    for (std::uint64_t look = kFirstLook; look <= kLongestLook; look *= 2) {
      const bool whole = look >= ledger.file->size();
      // What stands before the first line of a file ends it, too.
      const std::string text =
          (whole ? "\n" : "") + last_bytes(*ledger.file, std::min(look, ledger.file->size()));
      if (!text.ends_with('\n')) {
        return std::nullopt;
      }
      LedgerTail tail;
      bool readable = true;
      if (take_backwards(text, tail, readable) || whole) {
        tail.covered = folder.open_file(note_path(tail.entries)).file.has_value();
        return readable ? std::optional(tail) : std::nullopt;
      }
    }
    return std::nullopt;
  } catch (const Error&) {
    return std::nullopt;  // no permission, a disk that fails: whoever takes the case up is told why
  }
}

}  // namespace kiroku::archive
