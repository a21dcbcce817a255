#include "archive/format/store_statement.h"

#include <algorithm>
#include <charconv>

#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "crypto/encoding.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kOriginBegin = "kiroku/";
constexpr std::string_view kOriginEnd = "/store-statement";
constexpr std::string_view kUnknown = "unknown";
constexpr std::size_t kLongestStore = 1'000;
constexpr std::string_view kNameEnd = ".note", kTokenEnd = ".tsr";

std::string line_of(std::string_view key, const LinesOfLedger& lines) {
  return std::string(key) + " " + std::to_string(lines.size) + " " +
         crypto::to_base64(lines.root, crypto::Base64Padding::kPadded) + "\n";
}

/// As files of a case are named, in few characters: what is shown to people, and put into a shell.
bool is_path(std::string_view path) {
  if (path.empty() || path.size() > kMaximumPathBytes) return false;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view part = path.substr(begin, end - begin);
    const bool is_plain = std::ranges::all_of(part, [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
             c == '_' || c == '-';
    });
    if (part.empty() || part.front() == '.' || part.front() == '-' || !is_plain) return false;
    begin = end + 1;
  }
  return true;
}

/// Takes the lines of a statement one by one.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}
  /// What follows `key` and a space in the next line, which is taken; nothing where that is another one.
  std::optional<std::string_view> take(std::string_view key) {
    const std::size_t end = text_.find('\n');
    if (end == std::string_view::npos || !text_.starts_with(key) || end <= key.size() ||
        text_[key.size()] != ' ')
      return {};
    const std::string_view value = text_.substr(key.size() + 1, end - key.size() - 1);
    text_.remove_prefix(end + 1);
    return value;
  }
  std::optional<std::string_view> take_first() {
    const std::size_t end = text_.find('\n');
    if (end == std::string_view::npos) return {};
    const std::string_view line = text_.substr(0, end);
    text_.remove_prefix(end + 1);
    return line;
  }
  [[nodiscard]] bool are_over() const { return text_.empty(); }

 private:
  std::string_view text_;
};

std::optional<LinesOfLedger> lines_of(std::optional<std::string_view> text) {
  if (!text) return {};
  const std::size_t space = text->find(' ');
  if (space == std::string_view::npos) return {};
  const std::string_view number = text->substr(0, space);
  LinesOfLedger lines;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), lines.size);
  const auto root = crypto::from_base64(text->substr(space + 1), crypto::Base64Padding::kPadded);
  if (error != std::errc() || std::to_string(lines.size) != number || !root ||
      root->size() != lines.root.size())
    return {};
  std::ranges::copy(*root, lines.root.begin());
  return lines;
}

std::optional<StoreStatement::File> file_of(std::string_view text) {
  constexpr std::size_t kDigits = 64;
  if (text.size() <= kDigits + 2 || text.substr(kDigits, 2) != "  ") return {};
  const auto hash = crypto::from_hex(text.substr(0, kDigits));
  StoreStatement::File file{std::string(text.substr(kDigits + 2)), {}};
  if (!hash || !is_path(file.path)) return {};
  std::ranges::copy(*hash, file.sha256.begin());
  return file;
}

std::optional<UtcTime> time_of(std::string_view text) {
  const std::optional<UtcTime> time = parse_utc(text);
  if (!time || format_utc(*time) != text) return {};
  return time;
}

/// "20260805T170000Z-1a2b3c4d", which has the form of a case's identifier.
bool is_stem(std::string_view stem) { return is_case_id(stem); }

}  // namespace

std::string store_statement_origin(std::string_view device_name) {
  return std::string(kOriginBegin) + std::string(device_name) + std::string(kOriginEnd);
}

std::string StoreStatement::to_text() const {
  std::string text = store_statement_origin(maker) + "\ncase " + case_id + "\ndevice " + device + "\nstore " +
                     store + "\nlooked " + format_utc(looked) + "\nnewest " +
                     (newest ? format_utc(*newest) : std::string(kUnknown)) + "\n" + line_of("log", log) +
                     line_of("entries", entries) + line_of("signed", signed_entries);
  for (const File& file : files) text += "file " + crypto::to_hex(file.sha256) + "  " + file.path + "\n";
  for (const std::string& path : missing) text += "missing " + path + "\n";
  return text;
}

bool StoreStatement::says_the_same(const StoreStatement& other) const {
  return case_id == other.case_id && device == other.device && entries == other.entries &&
         signed_entries == other.signed_entries && files == other.files && missing == other.missing;
}

std::optional<StoreStatement> parse_store_statement(std::string_view text) {
  Lines lines(text);
  StoreStatement statement;
  const auto origin = lines.take_first();
  if (!origin || !origin->starts_with(kOriginBegin) || !origin->ends_with(kOriginEnd) ||
      origin->size() <= kOriginBegin.size() + kOriginEnd.size())
    return {};
  statement.maker =
      origin->substr(kOriginBegin.size(), origin->size() - kOriginBegin.size() - kOriginEnd.size());
  const auto case_id = lines.take("case"), device = lines.take("device"), store = lines.take("store"),
             looked = lines.take("looked"), newest = lines.take("newest");
  if (!case_id || !is_case_id(*case_id) || !device || !store || store->empty() ||
      store->size() > kLongestStore || !looked || !newest)
    return {};
  statement.case_id = *case_id;
  statement.device = *device;
  statement.store = *store;
  const auto looked_at = time_of(*looked);
  statement.newest = time_of(*newest);
  const auto log = lines_of(lines.take("log")), entries = lines_of(lines.take("entries")),
             signed_entries = lines_of(lines.take("signed"));
  if (!looked_at || (!statement.newest && *newest != kUnknown) || !log || !entries || !signed_entries ||
      entries->size == 0 || signed_entries->size > entries->size)
    return {};
  statement.looked = *looked_at;
  statement.log = *log;
  statement.entries = *entries;
  statement.signed_entries = *signed_entries;
  while (const auto line = lines.take("file")) {
    std::optional<StoreStatement::File> file = file_of(*line);
    if (!file || (!statement.files.empty() && file->path <= statement.files.back().path)) return {};
    statement.files.push_back(std::move(*file));
  }
  while (const auto path = lines.take("missing")) {
    if (!is_path(*path) || (!statement.missing.empty() && *path <= statement.missing.back())) return {};
    statement.missing.emplace_back(*path);
  }
  if (!lines.are_over()) return {};
  return statement;
}

fs::path store_statements_folder(const fs::path& case_folder, const std::string& case_id) {
  const fs::path normal = fs::absolute(case_folder).lexically_normal();
  const fs::path folder = normal.has_filename() ? normal : normal.parent_path();
  return folder.parent_path() / kStoreStatementsFolder / case_id;
}

std::string store_statement_name(UtcTime looked, std::uint32_t key_id) {
  Bytes id;
  for (int shift = 24; shift >= 0; shift -= 8)
    id.push_back(static_cast<std::byte>(key_id >> static_cast<unsigned>(shift)));
  return format_utc_compact(looked) + "-" + crypto::to_hex(id) + std::string(kNameEnd);
}

bool is_store_statement_name(std::string_view name) {
  return name.ends_with(kNameEnd) && is_stem(name.substr(0, name.size() - kNameEnd.size()));
}

bool is_store_statement_token_name(std::string_view name) {
  const std::size_t point = name.find('.');
  if (point == std::string_view::npos || !name.ends_with(kTokenEnd) ||
      name.size() < point + 1 + kTokenEnd.size())
    return false;
  return is_stem(name.substr(0, point)) &&
         is_short_name(name.substr(point + 1, name.size() - point - 1 - kTokenEnd.size()));
}

bool is_of_store_statement(std::string_view path) {
  const std::size_t end = path.find('/');
  if (end == std::string_view::npos) return path == kSubjectFile;
  const std::string_view folder = path.substr(0, end);
  return is_path(path) &&
         (folder == kCheckpointsFolder || folder == kTokensFolder || folder == kSegmentsFolder);
}

}  // namespace kiroku::archive
