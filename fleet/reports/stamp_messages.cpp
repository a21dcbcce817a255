#include "fleet/reports/stamp_messages.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"

namespace kiroku::fleet {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kTicketDigits = 32;
constexpr auto kPadding = crypto::Base64Padding::kPadded;

/// Nothing where there is no such text.
std::optional<std::string> text_in(const json& object, const char* name) {
  if (!object.is_object()) return {};
  const auto found = object.find(name);
  if (found == object.end() || !found->is_string()) return {};
  return found->get<std::string>();
}

Bytes hash_in(const json& object, const char* name) {
  const std::optional<std::string> text = text_in(object, name);
  std::optional<Bytes> bytes = text ? crypto::from_hex(*text) : std::nullopt;
  if (!bytes || bytes->size() != sizeof(crypto::Sha256Digest))
    throw UsageError("'" + std::string(name) + "' is not 64 hexadecimal digits in lower case");
  return std::move(*bytes);
}

[[noreturn]] void refuse_answer() {
  throw Error("whoever answers there is no aggregator of this version of Kiroku");
}

}  // namespace

std::string to_json(const StampRequest& request) {
  return ordered_json{{"authority", request.authority},
                      {"digest", crypto::to_hex(request.digest)},
                      {"nonce", crypto::to_hex(request.nonce)}}
      .dump();
}

StampRequest parse_stamp_request(std::string_view text) {
  if (text.size() > kLargestStampRequest) throw UsageError("the body is larger than 1 KiB");
  const json told = parse_foreign_json(text);
  const std::optional<std::string> authority = text_in(told, "authority");
  if (!authority || !archive::is_short_name(*authority))
    throw UsageError("the body is no JSON object with 'authority', a short name");
  return {*authority, hash_in(told, "digest"), hash_in(told, "nonce")};
}

bool is_stamp_ticket(std::string_view text) {
  return text.size() == kTicketDigits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

std::string stamp_path(const std::string& authority, const std::string& ticket) {
  return std::string(kStampPath) + "/" + authority + "/" + ticket;
}

std::optional<StampQuestion> parse_stamp_path(std::string_view path) {
  if (!path.starts_with(kStampPath) || !path.substr(kStampPath.size()).starts_with('/')) return {};
  path.remove_prefix(kStampPath.size() + 1);
  const std::size_t slash = path.find('/');
  if (slash == std::string_view::npos) return {};
  StampQuestion question{std::string(path.substr(0, slash)), std::string(path.substr(slash + 1))};
  if (!archive::is_short_name(question.authority) || !is_stamp_ticket(question.ticket)) return {};
  return question;
}

std::string place_json(const evidence::SharedStamps::Place& place) {
  return ordered_json{{"ticket", place.ticket}, {"ready_in_ms", place.ready_in.count()}}.dump();
}
std::string waiting_json(std::chrono::milliseconds ready_in) {
  return ordered_json{{"ready_in_ms", ready_in.count()}}.dump();
}
std::string record_json(ByteView record) {
  return ordered_json{{"record", crypto::to_base64(record, kPadding)}}.dump();
}

evidence::SharedStamps::Place parse_place(std::string_view text) {
  const json told = parse_foreign_json(text);
  std::optional<std::string> ticket = text_in(told, "ticket");
  if (!ticket || !is_stamp_ticket(*ticket) || !told.contains("ready_in_ms") ||
      !told["ready_in_ms"].is_number_unsigned())
    refuse_answer();
  // Longer than anybody waits, and short enough to be added to a time.
  constexpr std::uint64_t kDay_ms = 86'400'000;
  const std::uint64_t ready_in = std::min(told["ready_in_ms"].get<std::uint64_t>(), kDay_ms);
  return {std::move(*ticket), std::chrono::milliseconds(ready_in)};
}

Bytes parse_record_answer(std::string_view text) {
  const std::optional<std::string> record = text_in(parse_foreign_json(text), "record");
  std::optional<Bytes> bytes = record ? crypto::from_base64(*record, kPadding) : std::nullopt;
  if (!bytes || bytes->size() > kLargestSharedToken) refuse_answer();
  return std::move(*bytes);
}

}  // namespace kiroku::fleet
