// What an appliance and its hospital's aggregator say to each other, as JSON. Both sides take the other one
// for a stranger: everything has a limit, and what does not fit is refused. Values; functions are
// thread-safe.
//
//   POST /stamp                    {"authority", "digest", "nonce"}: 202 {"ticket", "ready_in_ms"}
//   GET  /stamp/AUTHORITY/TICKET   202 {"ready_in_ms"} while the round is not stamped, 200 {"record"} then
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "base/bytes.h"
#include "evidence/shared_stamps.h"

namespace kiroku::fleet {

inline constexpr std::string_view kStampPath = "/stamp";
inline constexpr std::size_t kLargestStampRequest = 1U << 10;
/// Of an evidence record that is handed out: base64 of it fits into what ReportClient takes.
inline constexpr std::size_t kLargestSharedToken = 44U << 10;

struct StampRequest {
  std::string authority;  // a short name (archive::is_short_name)
  Bytes digest, nonce;    // 32 bytes each
};
std::string to_json(const StampRequest& request);
/// Throws kiroku::UsageError, which says what is wrong.
StampRequest parse_stamp_request(std::string_view json);

/// A ticket is 32 hexadecimal digits.
bool is_stamp_ticket(std::string_view text);
std::string stamp_path(const std::string& authority, const std::string& ticket);
struct StampQuestion {
  std::string authority, ticket;
};
/// Of "/stamp/swiss/0123…"; nothing for any other path.
std::optional<StampQuestion> parse_stamp_path(std::string_view path);

std::string place_json(const evidence::SharedStamps::Place& place);
std::string waiting_json(std::chrono::milliseconds ready_in);
std::string record_json(ByteView record);
/// Throw kiroku::Error for what is none of these.
evidence::SharedStamps::Place parse_place(std::string_view json);
Bytes parse_record_answer(std::string_view json);

}  // namespace kiroku::fleet
