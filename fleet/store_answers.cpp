#include "fleet/store_answers.h"

#include <charconv>
#include <pugixml.hpp>

#include <curl/curl.h>

#include "base/ascii.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::fleet {
namespace {

constexpr std::size_t kMostHeaders = 100;

/// Some stores tell nanoseconds, which do not matter.
std::optional<UtcTime> time_of(const std::string& text) {
  const std::size_t point = text.find('.');
  return parse_utc(point == std::string::npos ? text : text.substr(0, point) + "Z");
}

UtcTime time_of_lock(const std::string& text) {
  const std::optional<UtcTime> time = time_of(text);
  if (!time) throw Error("the store tells the end of a lock as '" + printable(text) + "', which is no time");
  return *time;
}

std::optional<std::uint64_t> number_of(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::string_view without_space(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\r' || c == '\n' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

std::string header_of(const AnswerHeaders& headers, const std::string& name) {
  const auto found = headers.find(name);
  return found == headers.end() ? "" : found->second;
}

}  // namespace

void take_header(std::string_view line, AnswerHeaders& headers) {
  const std::size_t colon = line.find(':');
  if (line.starts_with("HTTP/")) {
    headers.clear();
  } else if (colon != std::string_view::npos && headers.size() < kMostHeaders) {
    headers[lower_case(line.substr(0, colon))] = std::string(without_space(line.substr(colon + 1)));
  }
}

std::string error_code_of(std::string_view body) {
  pugi::xml_document document;
  if (!document.load_buffer(body.data(), body.size())) return "";
  return document.child("Error").child_value("Code");
}

StoredObject object_of(const std::string& key, const AnswerHeaders& headers) {
  StoredObject object;
  const std::optional<std::uint64_t> bytes = number_of(header_of(headers, "content-length"));
  if (!bytes) throw Error("the store does not say how long " + key + " is");
  object.bytes = *bytes;
  object.version = header_of(headers, "x-amz-version-id");
  object.sha256 = header_of(headers, "x-amz-meta-kiroku-sha256");
  object.compliance = header_of(headers, "x-amz-object-lock-mode") == "COMPLIANCE";
  if (const std::string ends = header_of(headers, "x-amz-object-lock-retain-until-date"); !ends.empty())
    object.lock_ends = time_of_lock(ends);
  object.legal_hold = header_of(headers, "x-amz-object-lock-legal-hold") == "ON";
  return object;
}

std::optional<UtcTime> time_of_answer(const AnswerHeaders& headers) {
  const std::string text = header_of(headers, "date");
  const std::time_t seconds = text.empty() ? -1 : curl_getdate(text.c_str(), nullptr);
  if (seconds < 0) return std::nullopt;
  return UtcTime(std::chrono::seconds(seconds));
}

VersionPage version_page_of(std::string_view body) {
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(body.data(), body.size());
  const pugi::xml_node list = document.child("ListVersionsResult");
  if (!parsed || !list) throw Error("the store's list of versions is none: it answered something else");
  VersionPage page;
  for (const pugi::xml_node version : list.children("Version")) {
    const std::optional<std::uint64_t> bytes = number_of(version.child_value("Size"));
    ListedVersion listed{version.child_value("Key"), version.child_value("VersionId"), bytes.value_or(0),
                         std::string_view(version.child_value("IsLatest")) == "true",
                         time_of(version.child_value("LastModified"))};
    if (!bytes || listed.key.empty() || listed.version.empty()) {
      throw Error("the store's list of versions has one without key, version or size: '" +
                  printable(listed.key) + "'");
    }
    page.versions.push_back(std::move(listed));
  }
  for (const pugi::xml_node folder : list.children("CommonPrefixes"))
    page.folders.emplace_back(folder.child_value("Prefix"));
  page.more = std::string_view(list.child_value("IsTruncated")) == "true";
  page.next_key = list.child_value("NextKeyMarker");
  page.next_version = list.child_value("NextVersionIdMarker");
  if (page.more && page.next_key.empty())
    throw Error("the store's list of versions goes on, and it does not say where");
  return page;
}

}  // namespace kiroku::fleet
