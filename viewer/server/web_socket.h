// A connection that has become a WebSocket: its queue, its life. For web_server.cpp alone, since it brings
// Beast.
#pragma once

#include <memory>
#include <mutex>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>

#include "viewer/server/dispatcher.h"

namespace kiroku::viewer {

using TlsStream = boost::beast::ssl_stream<boost::beast::tcp_stream>;
/// Of a Unix socket, which needs no TLS.
using LocalStream = boost::beast::basic_stream<boost::asio::local::stream_protocol>;

/// The sockets that are open, so that none takes anything more once their server ends. Thread-safe.
class OpenSockets {
 public:
  class Output : public SocketOutput {
   public:
    /// Whatever is sent from now on is refused.
    virtual void close() = 0;
  };
  void add(const std::shared_ptr<Output>& output);
  void close_all();

 private:
  std::mutex mutex_;
  std::vector<std::weak_ptr<Output>> outputs_;
};

/// Whether the request asks for a WebSocket.
bool is_socket_request(const RequestHead& head);

using UpgradeRequest = boost::beast::http::request<boost::beast::http::empty_body>;

/// Accepts and serves until the browser goes, falls silent, or the session ends. `admission` is of a route
/// with a socket; `upgrade` is the request's head. False: nothing was accepted, the connection still is HTTP,
/// and `refusal` is to be sent. `Stream` is TlsStream or LocalStream.
template <typename Stream>
boost::asio::awaitable<bool> serve_socket(Stream& stream, const UpgradeRequest& upgrade,
                                          const Dispatcher& dispatcher,
                                          const Dispatcher::Admission& admission,
                                          boost::asio::thread_pool& workers, OpenSockets& sockets,
                                          Response& refusal);

}  // namespace kiroku::viewer
