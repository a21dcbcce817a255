// A monitor's end of an MLLP connection, for tests: plain blocking calls, bytes as they are.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>

#include "recorder/vitals/mllp_framing.h"

namespace kiroku::test {

class MllpClient {
 public:
  /// Connects from `source` ("": any address), over TLS (the server's certificate is not judged) if asked to,
  /// with a certificate of its own where a PEM file with it and its key is named. Throws
  /// boost::system::system_error.
  MllpClient(const std::string& host, std::uint16_t port, const std::string& source = "", bool tls = false,
             const std::string& certificate = "")
      : tls_context_(boost::asio::ssl::context::tls_client), stream_(context_, tls_context_), tls_(tls) {
    boost::asio::ip::tcp::resolver resolver(context_);
    if (!certificate.empty()) {
      SSL_use_certificate_chain_file(stream_.native_handle(), certificate.c_str());
      SSL_use_PrivateKey_file(stream_.native_handle(), certificate.c_str(), SSL_FILETYPE_PEM);
    }
    if (source.empty()) {
      boost::asio::connect(stream_.next_layer(), resolver.resolve(host, std::to_string(port)));
    } else {
      stream_.next_layer().open(boost::asio::ip::tcp::v4());
      stream_.next_layer().bind({boost::asio::ip::make_address(source), 0});
      stream_.next_layer().connect({boost::asio::ip::make_address(host), port});
    }
    stream_.next_layer().set_option(boost::asio::ip::tcp::no_delay(true));
    if (tls_) {
      stream_.handshake(boost::asio::ssl::stream_base::client);
    }
  }

  void send(std::string_view bytes) {
    if (tls_) {
      boost::asio::write(stream_, boost::asio::buffer(bytes));
    } else {
      boost::asio::write(stream_.next_layer(), boost::asio::buffer(bytes));
    }
  }
  void send_message(std::string_view message) { send(recorder::mllp_frame(message)); }

  /// The next message of the other side; nothing if none came within the limit, or the connection ended.
  std::optional<std::string> receive(std::chrono::milliseconds limit = std::chrono::seconds(10)) {
    for (;;) {
      if (auto event = deframer_.feed(unread_)) {
        return event->text;
      }
      std::optional<boost::system::error_code> result;
      std::size_t count = 0;
      const auto done = [&](const boost::system::error_code& error, std::size_t read) {
        result = error;
        count = read;
      };
      if (tls_) {
        stream_.async_read_some(boost::asio::buffer(buffer_), done);
      } else {
        stream_.next_layer().async_read_some(boost::asio::buffer(buffer_), done);
      }
      context_.restart();
      context_.run_for(limit);
      if (!result) {
        stream_.next_layer().cancel();
        context_.run();
        return std::nullopt;
      }
      if (*result) {
        return std::nullopt;
      }
      unread_ = std::string_view(buffer_.data(), count);
    }
  }

  void close() {
    boost::system::error_code ignored;
    stream_.next_layer().close(ignored);
  }

 private:
  boost::asio::io_context context_;
  boost::asio::ssl::context tls_context_;
  boost::asio::ssl::stream<boost::asio::ip::tcp::socket> stream_;
  bool tls_;
  recorder::MllpDeframer deframer_{1U << 20};
  std::array<char, 64U << 10> buffer_{};
  std::string_view unread_;
};

}  // namespace kiroku::test
