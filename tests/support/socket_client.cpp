#include "tests/support/socket_client.h"

#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

namespace kiroku::test {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;

struct SocketClient::State {
  asio::io_context io;
  asio::ssl::context tls{asio::ssl::context::tls_client};
  websocket::stream<beast::ssl_stream<beast::tcp_stream>, false> socket{io, tls};
};

SocketClient::SocketClient(std::uint16_t port, const std::string& target, const std::string& cookie,
                           const std::string& origin)
    : state_(std::make_unique<State>()) {
  auto& socket = state_->socket;
  const std::string host = "127.0.0.1:" + std::to_string(port);
  beast::get_lowest_layer(socket).connect({asio::ip::make_address("127.0.0.1"), port});
  socket.next_layer().handshake(asio::ssl::stream_base::client);
  socket.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
    request.set("Cookie", cookie);
    request.set("Origin", origin);
  }));
  socket.handshake(host, target);
}

SocketClient::~SocketClient() = default;

std::optional<SocketClient::Message> SocketClient::receive(std::chrono::seconds limit) {
  beast::flat_buffer buffer;
  boost::system::error_code result = asio::error::timed_out;
  state_->socket.async_read(buffer,
                            [&result](boost::system::error_code failed, std::size_t) { result = failed; });
  state_->io.restart();
  if (state_->io.run_for(limit) == 0 || result) {
    boost::system::error_code ignored;
    beast::get_lowest_layer(state_->socket).socket().close(ignored);
    state_->io.run();
    return {};
  }
  Message message{state_->socket.got_text(), {}, std::chrono::system_clock::now()};
  const auto* data = static_cast<const std::byte*>(buffer.data().data());
  message.bytes.assign(data, data + buffer.size());
  return message;
}

void SocketClient::send_text(const std::string& text) {
  state_->socket.text(true);
  state_->socket.write(asio::buffer(text));
}

void SocketClient::send_bytes(const Bytes& bytes) {
  state_->socket.binary(true);
  state_->socket.write(asio::buffer(bytes.data(), bytes.size()));
}

void SocketClient::close() { state_->socket.close(websocket::close_code::normal); }

std::pair<int, std::string> SocketClient::farewell() const {
  const websocket::close_reason& reason = state_->socket.reason();
  return {reason.code, std::string(reason.reason.data(), reason.reason.size())};
}

}  // namespace kiroku::test
