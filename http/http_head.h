// The head of an HTTP request, judged as it came off the wire (RFC 9112): a parser joins folded lines and
// fields that stand twice, and two programs that join them differently see two different requests. Pure
// function, thread-safe.
#pragma once

#include <string_view>

namespace kiroku {

/// Ends a head.
inline constexpr std::string_view kEndOfHttpHead = "\r\n\r\n";

/// Why a request with this head is refused (400) and its connection closed; "" where it may be answered.
/// `head` is everything from the request line to kEndOfHttpHead, both included. Refused are: a line folded
/// over the next, a bare CR or LF, a NUL, a field without a proper name; Host absent (HTTP/1.1) or twice;
/// Content-Length twice, beside Transfer-Encoding, or no decimal number; Transfer-Encoding twice, of
/// HTTP/1.0, or anything but "chunked".
std::string_view http_head_problem(std::string_view head);

}  // namespace kiroku
