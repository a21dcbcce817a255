#include "archive/catalogue/ledger_summary.h"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

constexpr std::string_view kBeginning = R"({"type":")";
constexpr std::string_view kBytesKey = R"("bytes":)";
constexpr std::string_view kStreamKey = R"("stream":")";

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

std::optional<std::string_view> quick_stream(std::string_view line) {
  const std::size_t at = line.find(kStreamKey);
  if (at == std::string_view::npos) {
    return std::nullopt;
  }
  line.remove_prefix(at + kStreamKey.size());
  return line.substr(0, line.find('"'));
}

/// Takes one line into the summary; false if it is no entry.
class Counter {
 public:
  bool take(std::string_view line) {
    if (!begun_) {
      return begin(line);
    }
    const std::optional<std::string_view> type = quick_type(line);
    const bool known = take_quickly(type, line);
    if (!known && !take_slowly(line)) {
      return false;
    }
    if (!cut_off_) {
      before_ = line;
    }
    return true;
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
    before_ = line;
    summary_.opened = parsed.entry->at.utc;
    const auto& open = std::get<OpenEntry>(parsed.entry->body);
    begins_ns_ = open.begins_ns;
    for (const StreamInfo& stream : open.streams) {
      summary_.streams.push_back(stream.name);
    }
    return true;
  }

  bool take_quickly(std::optional<std::string_view> type, std::string_view line) {
    if (type == "segment") {
      const std::optional<std::uint64_t> bytes = quick_bytes(line);
      const std::optional<std::string_view> stream = quick_stream(line);
      if (bytes && stream) {
        add_segment(*stream, *bytes);
        return true;
      }
      return false;
    }
    if (type == "token") {
      ++summary_.tokens;
      return true;
    }
    return type && type != "close" && type != "erased" && type != "recovered";
  }

  void add_segment(std::string_view stream, std::uint64_t bytes) {
    ++summary_.segments;
    summary_.bytes += bytes;
    const auto found =
        std::find_if(sizes_.begin(), sizes_.end(), [&](const auto& each) { return each.first == stream; });
    auto& sizes = found == sizes_.end()
                      ? sizes_.emplace_back(stream, std::vector<std::optional<std::uint64_t>>())
                      : *found;
    sizes.second.push_back(bytes);
  }

  /// Indexes count from 0 without a hole, so the order in the ledger is the index.
  void take(const ErasedEntry& erased) {
    for (auto& [stream, sizes] : sizes_) {
      for (std::uint64_t i = erased.first_index;
           stream == erased.stream && i <= erased.last_index && i < sizes.size(); ++i) {
        if (sizes[i]) {
          summary_.bytes -= *sizes[i];
          --summary_.segments;
          sizes[i].reset();
        }
      }
    }
  }

  bool take_slowly(std::string_view line) {
    const EntryParse parsed = parse_case_entry(line);
    if (!parsed.entry) {
      return false;
    }
    if (const auto* segment = std::get_if<SegmentEntry>(&parsed.entry->body)) {
      add_segment(segment->stream, segment->file.bytes);
    } else if (std::holds_alternative<TokenEntry>(parsed.entry->body)) {
      ++summary_.tokens;
    } else if (const auto* erased = std::get_if<ErasedEntry>(&parsed.entry->body)) {
      take(*erased);
    } else if (std::holds_alternative<RecoveredEntry>(parsed.entry->body)) {
      take_interruption();
    } else if (std::holds_alternative<CloseEntry>(parsed.entry->body)) {
      summary_.duration_ns = (cut_off_ ? *cut_off_ : parsed.entry->at.mono_ns) - begins_ns_;
    }
    return true;
  }

  void take_interruption() {
    const EntryParse before = parse_case_entry(before_);
    if (!cut_off_ && before.entry) {
      cut_off_ = before.entry->at.mono_ns;
    }
  }

  LedgerSummary summary_;
  bool begun_ = false;
  std::string before_;  // the last line, until recording was cut off
  std::optional<std::int64_t> cut_off_;
  std::vector<std::pair<std::string, std::vector<std::optional<std::uint64_t>>>> sizes_;  // of segments
  std::int64_t begins_ns_ = 0;
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
