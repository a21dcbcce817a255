#include "archive/format/json_writer.h"

#include <algorithm>

#include "archive/format/strict_json.h"
#include "base/error.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

/// How many bytes at the beginning stand in a text as they are.
std::size_t plain_length(std::string_view text) {
  const auto* const end = std::ranges::find_if(text, [](char c) {
    return c < 0x20 || static_cast<unsigned char>(c) >= 0x7F || c == '"' || c == '\\';
  });
  return static_cast<std::size_t>(end - text.begin());
}

void append_quoted(std::string& out, std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  constexpr std::string_view kReplacement = "\xEF\xBF\xBD";
  out += '"';
  for (std::size_t at = 0; at < text.size();) {
    if (const std::size_t plain = plain_length(text.substr(at)); plain > 0) {
      out += text.substr(at, plain);
      at += plain;
      continue;
    }
    const auto c = static_cast<unsigned char>(text[at]);
    const std::size_t length = utf8_length(text.substr(at));
    if (c == 0 || length == 0) {
      out += kReplacement;
      ++at;
      continue;
    }
    if (c == '"' || c == '\\') {
      out += '\\';
      out += static_cast<char>(c);
    } else if (c < 0x20 || c == 0x7F) {
      out += "\\u00";
      out += kHex[c >> 4U];
      out += kHex[c & 0xFU];
    } else {
      out += text.substr(at, length);
    }
    at += length;
  }
  out += '"';
}

std::string in_quotes(std::string_view text) {
  std::string out;
  append_quoted(out, text);
  return out;
}

}  // namespace

void JsonWriter::begin(std::string_view key) {
  if (members_.size() > 1) {
    members_ += ',';
  }
  append_quoted(members_, key);
  members_ += ':';
}

JsonWriter& JsonWriter::text(std::string_view key, std::string_view value) {
  begin(key);
  append_quoted(members_, value);
  return *this;
}

JsonWriter& JsonWriter::texts(std::string_view key, const std::vector<std::string>& values) {
  std::vector<std::string> items;
  items.reserve(values.size());
  for (const std::string& value : values) {
    items.push_back(in_quotes(value));
  }
  return json(key, json_array(items));
}

JsonWriter& JsonWriter::integer(std::string_view key, std::int64_t value) {
  if (value >= kJsonIntegerLimit || value <= -kJsonIntegerLimit) {
    throw Error("cannot write \"" + std::string(key) + "\": " + std::to_string(value) +
                " does not stay below 2^53 in magnitude, as ledger numbers must");
  }
  return json(key, std::to_string(value));
}

JsonWriter& JsonWriter::count(std::string_view key, std::uint64_t value) {
  if (value >= static_cast<std::uint64_t>(kJsonIntegerLimit)) {
    throw Error("cannot write \"" + std::string(key) + "\": " + std::to_string(value) +
                " is not below 2^53, as ledger numbers must be");
  }
  return json(key, std::to_string(value));
}

JsonWriter& JsonWriter::flag(std::string_view key, bool value) { return json(key, value ? "true" : "false"); }

JsonWriter& JsonWriter::digest(std::string_view key, const crypto::Sha256Digest& value) {
  return text(key, crypto::to_hex(value));
}

JsonWriter& JsonWriter::utc(std::string_view key, UtcTime value) { return text(key, format_utc(value)); }

JsonWriter& JsonWriter::json(std::string_view key, std::string_view value) {
  begin(key);
  members_ += value;
  return *this;
}

std::string json_array(const std::vector<std::string>& values) {
  std::string out = "[";
  for (const std::string& value : values) {
    if (out.size() > 1) {
      out += ',';
    }
    out += value;
  }
  return out + "]";
}

}  // namespace kiroku::archive
