// One request and its answer over a stream, be it a socket or TLS: heads that are judged before they are
// parsed, and answers written by Beast's serializer. Brings Beast. Everything here runs on the stream's
// strand.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio/awaitable.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/http.hpp>

#include "http/body_reader.h"
#include "http/connections.h"
#include "http/http_head.h"
#include "http/message.h"

namespace kiroku::http {

/// What reading a head came to.
struct HeadOutcome {
  bool is_gone = false;  // the connection ended before
  std::optional<Refusal> refusal;
};

/// Reads on until `buffer` begins with a whole head of at most `most_bytes`, and judges that
/// (http/http_head.h). Nothing is taken out of the buffer.
template <typename Stream, typename Buffer>
boost::asio::awaitable<HeadOutcome> read_head(Stream& stream, Buffer& buffer, std::size_t most_bytes) {
  namespace asio = boost::asio;
  constexpr std::size_t kReadUnit = 4U << 10;
  std::size_t searched = 0;
  for (;;) {
    const std::string_view text(static_cast<const char*>(buffer.data().data()), buffer.size());
    const std::size_t end = text.find(kEndOfHttpHead, searched);
    const bool is_whole = end != std::string_view::npos;
    if ((is_whole ? end + kEndOfHttpHead.size() : text.size()) > most_bytes) {
      co_return HeadOutcome{false, Refusal{431, "the header is too large"}};
    }
    if (is_whole) {
      const std::string_view why = http_head_problem(text.substr(0, end + kEndOfHttpHead.size()));
      if (why.empty()) co_return HeadOutcome{};
      co_return HeadOutcome{false, Refusal{400, std::string(why)}};
    }
    searched = text.size() - std::min(text.size(), kEndOfHttpHead.size() - 1);
    boost::system::error_code failed;
    const std::size_t count = co_await stream.async_read_some(
        buffer.prepare(kReadUnit), asio::redirect_error(asio::use_awaitable, failed));
    if (failed) co_return HeadOutcome{true, std::nullopt};
    buffer.commit(count);
  }
}

/// Why what the parser did not take is refused; nothing where the connection ended or was too slow.
std::optional<Refusal> refusal_of(const boost::system::error_code& failed);

/// Says that the body may come (RFC 9110 section 10.1.1). False where the connection ended.
template <typename Stream>
boost::asio::awaitable<bool> send_continue(Stream& stream) {
  namespace beast = boost::beast;
  const beast::http::response<beast::http::empty_body> message(beast::http::status::continue_, 11);
  beast::http::response_serializer<beast::http::empty_body> serializer(message);
  boost::system::error_code failed;
  co_await beast::http::async_write(stream, serializer,
                                    boost::asio::redirect_error(boost::asio::use_awaitable, failed));
  co_return !failed;
}

/// How an answer is sent.
struct Sending {
  bool is_head = false;  // the answer to HEAD: everything but its body
  bool keep_alive = false;
  std::chrono::milliseconds limit{30'000};  // for each unit of the body to be taken
  /// Asked each time the client has taken some of it, with how much that was so far and how long it was
  /// waited for. False: the connection is to end. None: it goes on.
  std::function<bool(std::uint64_t sent, std::chrono::duration<double> waited)> goes_on = {};
};

/// An answer without its body, as Beast takes it. `size` is the body's, if it is known. Throws
/// std::invalid_argument for a field with a line break, which would be a second one.
boost::beast::http::response<boost::beast::http::buffer_body> head_to_send(int status, const Fields& fields,
                                                                           std::optional<std::uint64_t> size,
                                                                           bool keep_alive);

/// False if it could not be sent whole: then the connection must end. `on_worker` runs what may block on
/// another thread than those of the connections, and is awaited. Throws what the body throws.
template <typename Stream, typename OnWorker>
boost::asio::awaitable<bool> send(Stream& stream, int status, const Fields& fields, const Body& body,
                                  Sending how, OnWorker on_worker) {
  namespace asio = boost::asio;
  namespace beast = boost::beast;
  BodyReader reader(body);
  const std::optional<std::uint64_t> size = reader.size();
  auto message = head_to_send(status, fields, size, how.keep_alive);
  beast::http::response_serializer<beast::http::buffer_body> serializer(message);
  boost::system::error_code failed;
  if (how.is_head || status == 204 || status == 304) {
    serializer.split(true);
    allow(stream, how.limit);
    co_await beast::http::async_write_header(stream, serializer,
                                             asio::redirect_error(asio::use_awaitable, failed));
    co_return !failed;
  }
  std::uint64_t sent = 0;
  std::chrono::duration<double> waited{0};
  bool is_last = false;
  while (!failed && !is_last) {
    ByteView unit;
    if (reader.may_block()) {
      unit = co_await on_worker([&reader] { return reader.next(); });
    } else {
      unit = reader.next();
    }
    sent += unit.size();
    is_last = unit.empty() || sent == size;
    auto& next = message.body();
    // Beast reads it alone, through a pointer that is not const.
    next.data = unit.empty()
                    ? nullptr
                    : const_cast<std::byte*>(unit.data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    next.size = unit.size();
    next.more = !is_last;
    allow(stream, how.limit);
    const auto begin = std::chrono::steady_clock::now();
    co_await beast::http::async_write(stream, serializer, asio::redirect_error(asio::use_awaitable, failed));
    waited += std::chrono::steady_clock::now() - begin;
    if (failed == beast::http::error::need_buffer) failed = {};
    const bool is_asked = !failed && !is_last && how.goes_on;
    if (is_asked && !how.goes_on(sent, waited)) co_return false;
  }
  co_return !failed;
}

}  // namespace kiroku::http
