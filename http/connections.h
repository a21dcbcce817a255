// Listening, and who may stay: the sockets of a server, whatever is said over them. Brings Asio and Beast, so
// for the files that serve alone. What is a coroutine runs on the strand of its connection.
#pragma once

#include <chrono>
#include <cstddef>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/stream_traits.hpp>
#include <boost/beast/core/tcp_stream.hpp>

#include "base/connection_places.h"
#include "base/descriptor_limit.h"
#include "base/error.h"
#include "base/listen_address.h"

namespace kiroku::http {

/// The threads of a server's connections, from construction to stop() or destruction. A connection that fails
/// (out of memory) ends by itself, never the others.
class IoThreads {
 public:
  /// `context` must outlive it.
  IoThreads(boost::asio::io_context& context, std::size_t count);
  ~IoThreads() { stop(); }
  IoThreads(const IoThreads&) = delete;
  IoThreads& operator=(const IoThreads&) = delete;
  /// Waits for what runs; what waits for a client does not go on.
  void stop();

 private:
  boost::asio::io_context& context_;
  std::vector<std::thread> threads_;
};

/// Throws kiroku::Error: "cannot listen on ADDRESS: why" and `advice`.
void listen_on(boost::asio::ip::tcp::acceptor& acceptor, const ListenAddress& address,
               const std::string& advice = "");

/// Hands every connection to `welcome`, each on a strand of its own. One for which `welcome` throws (out of
/// memory) is let go; the next ones are accepted all the same. So is one that would take the last descriptors
/// (base/descriptor_limit.h).
template <typename Acceptor, typename Welcome>
boost::asio::awaitable<void> accept_all(Acceptor& acceptor, boost::asio::io_context& context,
                                        Welcome welcome) {
  namespace asio = boost::asio;
  // Out of descriptors, say: asking again at once would spin.
  constexpr std::chrono::milliseconds kPause{100};
  asio::steady_timer pause(acceptor.get_executor());
  for (;;) {
    boost::system::error_code failed;
    typename Acceptor::protocol_type::socket socket = co_await acceptor.async_accept(
        asio::make_strand(context), asio::redirect_error(asio::use_awaitable, failed));
    if (failed) {
      pause.expires_after(kPause);
      co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
      continue;
    }
    if (is_kept_back(socket.native_handle())) continue;
    try {
      welcome(std::move(socket));
    } catch (const std::exception&) {
      continue;
    }
  }
}

/// A place for a connection of `holder`, or null where none can be made: then it is let go, and may come
/// again. The connection is closed when it makes room for another.
template <typename Stream, typename Executor>
std::unique_ptr<ConnectionPlaces::Place> take_place(ConnectionPlaces& places, const std::string& holder,
                                                    const std::shared_ptr<Stream>& stream,
                                                    const Executor& executor) {
  return places.enter(holder, [leaving = std::weak_ptr<Stream>(stream), executor] {
    boost::asio::post(executor, [leaving] {
      if (const auto open = leaving.lock()) boost::beast::get_lowest_layer(*open).close();
    });
  });
}

/// What is begun on the stream from now on must be done within `limit`, or fails.
template <typename Stream>
void allow(Stream& stream, std::chrono::milliseconds limit) {
  boost::beast::get_lowest_layer(stream).expires_after(limit);
}

}  // namespace kiroku::http
