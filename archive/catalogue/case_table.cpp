#include "archive/catalogue/case_table.h"

#include <algorithm>

#include "archive/catalogue/ledger_summary.h"
#include "archive/format/case_layout.h"

namespace kiroku::archive {
namespace {

/// The start in "20260805T091502Z-3f9c21ab"; 1970 for any other name.
UtcTime opened_by_name(const std::string& name) {
  if (!is_case_id(name)) return {};
  const std::string rfc3339 = name.substr(0, 4) + "-" + name.substr(4, 2) + "-" + name.substr(6, 5) + ":" +
                              name.substr(11, 2) + ":" + name.substr(13, 3);
  return parse_utc(rfc3339).value_or(UtcTime{});
}

}  // namespace

std::string joined_names(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

std::vector<std::string> split_names(const std::string& text) {
  std::vector<std::string> names;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    names.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return names;
}

CatalogueRow read_catalogue_row(const std::string& case_id, const std::filesystem::path& case_folder) {
  CatalogueRow row;
  row.case_id = case_id;
  const std::optional<LedgerSummary> summary = summarise_ledger(case_folder);
  if (!summary) {
    row.state = "unreadable";
    row.opened = opened_by_name(case_id);
    return row;
  }
  row.state = summary->duration_ns ? "closed" : "open";
  row.opened = summary->opened;
  row.duration_ns = summary->duration_ns;
  row.streams = summary->streams;
  row.segments = summary->segments;
  row.bytes = summary->bytes;
  row.tokens = summary->tokens;
  return row;
}

}  // namespace kiroku::archive
