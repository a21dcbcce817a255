#include "recorder/daemon/control_server.h"

#include <array>
#include <sys/stat.h>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio.hpp>
#include <nlohmann/json.hpp>

#include "recorder/control/control_client.h"

namespace kiroku::recorder {
namespace {

namespace asio = boost::asio;
using asio::local::stream_protocol;
using boost::system::error_code;

constexpr std::size_t kLongestLine = 1U << 20;
constexpr std::size_t kThreads = 8;
constexpr mode_t kSocketMode = 0660;

bool somebody_answers(const std::filesystem::path& socket) {
  asio::io_context context;
  stream_protocol::socket probe(context);
  error_code failed;
  probe.connect(stream_protocol::endpoint(socket.string()), failed);
  return !failed;
}

nlohmann::ordered_json refusal(const std::string& sentence) { return {{"ok", false}, {"error", sentence}}; }

}  // namespace

struct ControlServer::State {
  State(std::filesystem::path at, ControlHandler answers)
      : path(std::move(at)), handler(std::move(answers)), acceptor(context) {
    require_socket_path(path);
    if (somebody_answers(path)) {
      throw Error("another recorder answers on " + path.string() + ": only one may run on a home");
    }
    std::error_code ignored;
    if (std::filesystem::is_socket(path, ignored)) std::filesystem::remove(path, ignored);
    try {
      const stream_protocol::endpoint endpoint(path.string());
      acceptor.open(endpoint.protocol());
      acceptor.bind(endpoint);
      ::chmod(path.c_str(), kSocketMode);
      acceptor.listen();
    } catch (const boost::system::system_error& error) {
      throw Error("cannot listen on " + path.string() + ": " + error.code().message());
    }
    asio::co_spawn(context, accept(), asio::detached);
    for (std::size_t i = 0; i < kThreads; ++i) {
      threads.emplace_back([this] { context.run(); });
    }
  }
  ~State() {
    context.stop();
    for (std::thread& thread : threads) thread.join();
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  asio::awaitable<void> accept() {
    for (;;) {
      error_code failed;
      stream_protocol::socket peer =
          co_await acceptor.async_accept(asio::redirect_error(asio::use_awaitable, failed));
      if (!failed) {
        asio::co_spawn(asio::make_strand(context), serve(std::move(peer)), asio::detached);
        continue;
      }
      // Out of descriptors, for instance: others will be free again.
      asio::steady_timer pause(context, std::chrono::milliseconds(100));
      co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
    }
  }

  asio::awaitable<void> serve(stream_protocol::socket peer) {
    std::string received;
    for (;;) {
      error_code failed;
      const std::size_t length =
          co_await asio::async_read_until(peer, asio::dynamic_buffer(received, kLongestLine), '\n',
                                          asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return;
      const std::string reply = answer(received.substr(0, length));
      received.erase(0, length);
      co_await asio::async_write(peer, asio::buffer(reply),
                                 asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return;
    }
  }

  [[nodiscard]] std::string answer(const std::string& line) const {
    const nlohmann::json request = nlohmann::json::parse(line, nullptr, false);
    nlohmann::ordered_json reply;
    if (!request.is_object()) {
      reply = refusal("a request is one JSON object on one line");
    } else {
      try {
        reply = handler(request);
        reply["ok"] = true;
      } catch (const std::exception& error) {
        reply = refusal(error.what());
      }
    }
    return reply.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  }

  const std::filesystem::path path;
  const ControlHandler handler;
  asio::io_context context;
  stream_protocol::acceptor acceptor;
  std::vector<std::thread> threads;
};

ControlServer::ControlServer(std::filesystem::path socket, ControlHandler handler)
    : state_(std::make_unique<State>(std::move(socket), std::move(handler))) {}
ControlServer::~ControlServer() = default;

}  // namespace kiroku::recorder
