// A camera on the network that speaks RTSP (RFC 2326) and sends an MPEG transport stream by RTP (RFC 2250),
// as libavformat's own client is to find it. It knows the transports it is told to, and refuses others with
// 461.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <boost/asio/buffer.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/streambuf.hpp>
#include <boost/asio/write.hpp>

#include "base/bytes.h"

namespace kiroku::test {

/// Serves one client after the other from a thread of its own. `film` is sent again and again, so many
/// packets of 188 bytes a second.
class RtspCamera {
 public:
  struct Options {
    Bytes film;
    std::set<std::string> transports{"tcp", "udp"};
    /// Whether an RTP packet, by its number, is lost on the way.
    std::function<bool(std::uint64_t)> lost = [](std::uint64_t) { return false; };
    std::chrono::milliseconds interval{5};  // between RTP packets
  };

  explicit RtspCamera(Options options)
      : options_(std::move(options)),
        acceptor_(io_, {boost::asio::ip::make_address("127.0.0.1"), 0}),
        port_(acceptor_.local_endpoint().port()) {
    acceptor_.non_blocking(true);
    thread_ = std::thread([this] { run(); });
  }
  ~RtspCamera() {
    ending_ = true;
    thread_.join();
  }
  RtspCamera(const RtspCamera&) = delete;
  RtspCamera& operator=(const RtspCamera&) = delete;

  [[nodiscard]] std::string host() const { return "127.0.0.1:" + std::to_string(port_); }
  /// RTP packets that were sent, by transport.
  [[nodiscard]] std::uint64_t sent(const std::string& transport) const {
    return transport == "tcp" ? sent_by_tcp_ : sent_by_udp_;
  }

 private:
  using Tcp = boost::asio::ip::tcp;
  using Udp = boost::asio::ip::udp;
  static constexpr std::size_t kPacketsOfOne = 7, kPacketBytes = 188;

  void run() {
    while (!ending_) {
      boost::system::error_code none;
      Tcp::socket client(io_);
      acceptor_.accept(client, none);
      if (none) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        continue;
      }
      try {
        serve(client);
      } catch (const std::exception&) {
        // The client went away.
      }
    }
  }

  struct Setup {
    bool tcp = false;
    Udp::endpoint to;
  };

  void serve(Tcp::socket& client) {
    client.non_blocking(true);
    std::string received;
    Setup setup;
    bool playing = false;
    auto due = std::chrono::steady_clock::now();
    Udp::socket udp(io_, Udp::endpoint(boost::asio::ip::make_address("127.0.0.1"), 0));
    while (!ending_) {
      char bytes[4096];
      boost::system::error_code none;
      const std::size_t count = client.read_some(boost::asio::buffer(bytes), none);
      if (!none) {
        received.append(bytes, count);
      } else if (none != boost::asio::error::would_block) {
        return;
      }
      for (std::size_t end = 0; (end = received.find("\r\n\r\n")) != std::string::npos;) {
        const std::string asked = received.substr(0, end + 2);
        received.erase(0, end + 4);
        playing = answer(client, asked, setup, udp) || playing;
      }
      if (playing && std::chrono::steady_clock::now() >= due) {
        due += options_.interval;
        send(client, setup, udp);
      } else {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
  }

  static std::string field(const std::string& asked, const std::string& name) {
    const std::size_t at = asked.find("\r\n" + name + ": ");
    if (at == std::string::npos) return "";
    const std::size_t begin = at + name.size() + 4;
    return asked.substr(begin, asked.find("\r\n", begin) - begin);
  }

  void say(Tcp::socket& client, const std::string& text) {
    client.non_blocking(false);
    boost::asio::write(client, boost::asio::buffer(text));
    client.non_blocking(true);
  }

  /// Whether it asked to play.
  bool answer(Tcp::socket& client, const std::string& asked, Setup& setup, const Udp::socket& udp) {
    const std::string method = asked.substr(0, asked.find(' '));
    const std::string sequence = "CSeq: " + field(asked, "CSeq") + "\r\n";
    const std::string good = "RTSP/1.0 200 OK\r\n" + sequence;
    if (method == "DESCRIBE") {
      const std::string session =
          "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\nm=video 0 RTP/AVP "
          "33\r\na=control:track\r\n";
      say(client, good + "Content-Type: application/sdp\r\nContent-Length: " +
                      std::to_string(session.size()) + "\r\n\r\n" + session);
    } else if (method == "SETUP") {
      const std::string transport = field(asked, "Transport");
      setup.tcp = transport.find("TCP") != std::string::npos;
      const bool multicast = transport.find("multicast") != std::string::npos;
      if (multicast || options_.transports.count(setup.tcp ? "tcp" : "udp") == 0) {
        say(client, "RTSP/1.0 461 Unsupported transport\r\n" + sequence + "\r\n");
        return false;
      }
      std::string chosen = "RTP/AVP/TCP;unicast;interleaved=0-1";
      if (!setup.tcp) {
        const std::string ports = transport.substr(transport.find("client_port=") + 12);
        setup.to = {boost::asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(std::stoi(ports))};
        const unsigned own = udp.local_endpoint().port();
        chosen = "RTP/AVP;unicast;client_port=" + ports.substr(0, ports.find(';')) +
                 ";server_port=" + std::to_string(own) + "-" + std::to_string(own + 1);
      }
      say(client, good + "Session: 1\r\nTransport: " + chosen + "\r\n\r\n");
    } else if (method == "OPTIONS") {
      say(client, good + "Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n\r\n");
    } else {
      say(client, good + "Session: 1\r\n\r\n");
    }
    return method == "PLAY";
  }

  /// One RTP packet.
  void send(Tcp::socket& client, const Setup& setup, Udp::socket& udp) {
    const std::uint64_t number = number_++;
    std::string packet = "\x80\x21";
    const auto put = [&packet](std::uint64_t value, int bytes) {
      while (bytes-- > 0) packet += static_cast<char>(value >> (8 * bytes));
    };
    put(number & 0xffff, 2);
    put((number * 450) & 0xffffffff, 4);
    put(0x4b49524f, 4);
    for (std::size_t i = 0; i < kPacketsOfOne; ++i) {
      const std::size_t at =
          next_packet_++ * kPacketBytes % (options_.film.size() / kPacketBytes * kPacketBytes);
      packet.append(reinterpret_cast<const char*>(options_.film.data() + at), kPacketBytes);  // NOLINT
    }
    if (options_.lost(number)) return;
    if (setup.tcp) {
      std::string framed("$\0", 2);
      framed += static_cast<char>(packet.size() >> 8);
      framed += static_cast<char>(packet.size());
      say(client, framed + packet);
      ++sent_by_tcp_;
    } else {
      udp.send_to(boost::asio::buffer(packet), setup.to);
      ++sent_by_udp_;
    }
  }

  const Options options_;
  boost::asio::io_context io_;
  Tcp::acceptor acceptor_;
  const std::uint16_t port_;
  std::atomic<bool> ending_ = false;
  std::uint64_t number_ = 0, next_packet_ = 0;
  std::atomic<std::uint64_t> sent_by_tcp_ = 0, sent_by_udp_ = 0;
  std::thread thread_;
};

}  // namespace kiroku::test
