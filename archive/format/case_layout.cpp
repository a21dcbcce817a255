#include "archive/format/case_layout.h"

#include <algorithm>
#include <charconv>

namespace kiroku::archive {

namespace {

constexpr std::size_t kIndexDigits = 8;
constexpr std::string_view kNoteSuffix = ".note";
constexpr std::string_view kResponseSuffix = ".tsr", kSharedSuffix = ".ers";

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_lower(char c) { return c >= 'a' && c <= 'z'; }

std::string in_folder(std::string_view folder, std::string_view name) {
  std::string path(folder);
  path += '/';
  path += name;
  return path;
}

}  // namespace

std::string format_index(std::uint64_t number) {
  std::string digits = std::to_string(number);
  if (digits.size() < kIndexDigits) {
    digits.insert(0, kIndexDigits - digits.size(), '0');
  }
  return digits;
}

std::optional<std::uint64_t> parse_index(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || format_index(number) != text) {
    return std::nullopt;
  }
  return number;
}

std::string note_path(std::uint64_t size) {
  return in_folder(kCheckpointsFolder, format_index(size)).append(kNoteSuffix);
}

std::string token_path(std::uint64_t size, std::string_view authority, TokenForm form) {
  return in_folder(kTokensFolder, format_index(size))
      .append(".")
      .append(authority)
      .append(form == TokenForm::kShared ? kSharedSuffix : kResponseSuffix);
}

std::string segment_path(std::string_view stream, std::uint64_t index, std::string_view extension) {
  return in_folder(in_folder(kSegmentsFolder, stream), format_index(index))
      .append(".")
      .append(extension)
      .append(".age");
}

std::optional<std::uint64_t> size_of_note_name(std::string_view name) {
  if (!name.ends_with(kNoteSuffix)) {
    return std::nullopt;
  }
  return parse_index(name.substr(0, name.size() - kNoteSuffix.size()));
}

std::optional<TokenName> parse_token_name(std::string_view name) {
  const std::size_t dot = name.find('.');
  const TokenForm form = name.ends_with(kSharedSuffix) ? TokenForm::kShared : TokenForm::kResponse;
  const std::string_view suffix = form == TokenForm::kShared ? kSharedSuffix : kResponseSuffix;
  if (dot == std::string_view::npos || !name.ends_with(suffix) || name.size() < dot + 1 + suffix.size()) {
    return std::nullopt;
  }
  const std::optional<std::uint64_t> size = parse_index(name.substr(0, dot));
  const std::string_view authority = name.substr(dot + 1, name.size() - suffix.size() - dot - 1);
  if (!size || !is_short_name(authority)) {
    return std::nullopt;
  }
  return TokenName{*size, std::string(authority), form};
}

std::optional<std::string_view> extension_of_media(std::string_view media) {
  if (media == "video/mp2t") {
    return "ts";
  }
  if (media == "video/x-matroska") {
    return "mkv";
  }
  if (media == kLinesMedia) {
    return "jsonl";
  }
  return std::nullopt;
}

bool is_short_name(std::string_view text) {
  constexpr std::size_t kMaximum = 32;
  return !text.empty() && text.size() <= kMaximum && text.front() != '-' &&
         std::all_of(text.begin(), text.end(), [](char c) { return is_digit(c) || is_lower(c) || c == '-'; });
}

bool is_case_id(std::string_view text) {
  constexpr std::string_view kShape =
      "dddddddd"
      "T"
      "dddddd"
      "Z-"
      "hhhhhhhh";
  return text.size() == kShape.size() &&
         std::equal(text.begin(), text.end(), kShape.begin(), [](char c, char shape) {
           switch (shape) {
             case 'd':
               return is_digit(c);
             case 'h':
               return is_digit(c) || (c >= 'a' && c <= 'f');
             default:
               return c == shape;
           }
         });
}

std::string case_origin(std::string_view device_name, std::string_view case_id) {
  return std::string("kiroku/").append(device_name).append("/").append(case_id);
}

std::string log_origin(std::string_view device_name) {
  return std::string("kiroku/").append(device_name).append("/log");
}

}  // namespace kiroku::archive
