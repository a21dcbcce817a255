#include "archive/ledger_summary.h"

#include <charconv>
#include <string_view>

#include "archive/case_folder.h"
#include "archive/case_layout.h"
#include "archive/ledger_entry.h"
#include "archive/line_reader.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

constexpr std::string_view kBeginning = R"({"type":")";
constexpr std::string_view kBytesKey = R"("bytes":)";

/// The type of a line that begins as ours do; nothing for a line written otherwise. Inside a JSON string a
/// quotation mark is escaped, so that neither this nor the search below can mistake a value for a key.
std::optional<std::string_view> quick_type(std::string_view line) {
  if (!line.starts_with(kBeginning)) {
    return std::nullopt;
  }
  line.remove_prefix(kBeginning.size());
  return line.substr(0, line.find('"'));
}

std::optional<std::uint64_t> quick_bytes(std::string_view line) {
  const std::size_t at = line.find(kBytesKey);
  if (at == std::string_view::npos) {
    return std::nullopt;
  }
  const char* const first = line.data() + at + kBytesKey.size();
  std::uint64_t bytes = 0;
  const auto [end, error] = std::from_chars(first, line.data() + line.size(), bytes);
  return error == std::errc() && end != first ? std::optional(bytes) : std::nullopt;
}

/// Takes one line into the summary; false if it is no entry.
class Counter {
 public:
  bool take(std::string_view line) {
    if (!begun_) {
      return begin(line);
    }
    const std::optional<std::string_view> type = quick_type(line);
    if (type == "segment") {
      if (const std::optional<std::uint64_t> bytes = quick_bytes(line)) {
        return add_segment(*bytes);
      }
    } else if (type == "token") {
      ++summary_.tokens;
      return true;
    } else if (type && type != "close") {
      return true;
    }
    return take_slowly(line);
  }

  [[nodiscard]] std::optional<LedgerSummary> result() const {
    return begun_ ? std::optional(summary_) : std::nullopt;
  }

 private:
  bool begin(std::string_view line) {
    const EntryParse parsed = parse_case_entry(line);
    if (!parsed.entry || !std::holds_alternative<OpenEntry>(parsed.entry->body)) {
      return false;
    }
    begun_ = true;
    summary_.opened = parsed.entry->at.utc;
    for (const StreamInfo& stream : std::get<OpenEntry>(parsed.entry->body).streams) {
      summary_.streams.push_back(stream.name);
    }
    return true;
  }

  bool add_segment(std::uint64_t bytes) {
    ++summary_.segments;
    summary_.bytes += bytes;
    return true;
  }

  bool take_slowly(std::string_view line) {
    const EntryParse parsed = parse_case_entry(line);
    if (!parsed.entry) {
      return false;
    }
    if (const auto* segment = std::get_if<SegmentEntry>(&parsed.entry->body)) {
      add_segment(segment->file.bytes);
    } else if (std::holds_alternative<TokenEntry>(parsed.entry->body)) {
      ++summary_.tokens;
    } else if (std::holds_alternative<CloseEntry>(parsed.entry->body)) {
      summary_.duration_ns = parsed.entry->at.mono_ns;
    }
    return true;
  }

  LedgerSummary summary_;
  bool begun_ = false;
};

}  // namespace

std::optional<LedgerSummary> summarise_ledger(const std::filesystem::path& case_folder) {
  try {
    const FileOpening ledger = CaseFolder::open(case_folder).open_file(kLedgerFile);
    if (!ledger.file) {
      return std::nullopt;
    }
    LineReader lines(*ledger.file);
    Counter counter;
    LedgerLine line;
    while (lines.next(line) && !line.torn) {
      if (line.too_long || !counter.take(line.text)) {
        return std::nullopt;
      }
    }
    return counter.result();
  } catch (const Error&) {
    return std::nullopt;  // no permission, a disk that fails: listed as unreadable, and verify says why
  }
}

}  // namespace kiroku::archive
