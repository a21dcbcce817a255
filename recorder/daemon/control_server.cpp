#include "recorder/daemon/control_server.h"

#include <chrono>
#include <memory>
#include <sys/socket.h>
#include <sys/stat.h>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio.hpp>
#include <nlohmann/json.hpp>

#include "base/connection_places.h"
#include "base/foreign_json.h"
#include "recorder/control/control_client.h"

namespace kiroku::recorder {
namespace {

namespace asio = boost::asio;
using asio::local::stream_protocol;
using boost::system::error_code;

constexpr std::size_t kLongestLine = 1U << 20;
/// A request that waits until a case has begun or ended holds one; each room has at most two of those.
constexpr std::size_t kThreads = 16;
constexpr mode_t kSocketMode = 0660;
/// For a whole request to come, and for its answer to be taken.
constexpr std::chrono::seconds kPatience{60};
constexpr ConnectionPlaces::Limits kConnections{.all = 128, .of_holder = 64};

/// One connection. Its members belong to its strand.
struct Peer {
  explicit Peer(stream_protocol::socket connected)
      : socket(std::move(connected)), limit(socket.get_executor()) {}
  void close() {
    error_code ignored;
    limit.cancel();
    socket.close(ignored);
  }
  stream_protocol::socket socket;
  asio::steady_timer limit;
};

/// Whose connection it is for the limits: the user on the other end.
std::string holder_of(stream_protocol::socket& socket) {
  ucred user{};
  socklen_t size = sizeof user;
  if (::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &user, &size) != 0) return "";
  return std::to_string(user.uid);
}

/// Closes it if what it waits for is not over in time.
void watch(const std::shared_ptr<Peer>& peer) {
  peer->limit.expires_after(kPatience);
  peer->limit.async_wait([watched = std::weak_ptr<Peer>(peer)](const error_code& cancelled) {
    const std::shared_ptr<Peer> late = watched.lock();
    if (!cancelled && late && late->limit.expiry() <= asio::steady_timer::clock_type::now()) late->close();
  });
}

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
      threads.emplace_back([this] { run(); });
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

  /// Whatever fails for one connection (out of memory) ends neither the others nor the recorder.
  void run() {
    for (;;) {
      try {
        context.run();
        return;
      } catch (const std::exception&) {
        continue;
      }
    }
  }

  asio::awaitable<void> accept() {
    for (;;) {
      error_code failed;
      stream_protocol::socket connected = co_await acceptor.async_accept(
          asio::make_strand(context), asio::redirect_error(asio::use_awaitable, failed));
      if (!failed) {
        try {
          welcome(std::move(connected));
        } catch (const std::exception&) {
          // One connection failed (out of memory); the next one is awaited.
        }
        continue;
      }
      // Out of descriptors, for instance: others will be free again.
      asio::steady_timer pause(context, std::chrono::milliseconds(100));
      co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
    }
  }

  /// Serves it if there is a place for it; else it is let go, and may come again.
  void welcome(stream_protocol::socket connected) {
    const std::string holder = holder_of(connected);
    const auto peer = std::make_shared<Peer>(std::move(connected));
    auto place = places.enter(holder, [leaving = std::weak_ptr<Peer>(peer)] {
      const std::shared_ptr<Peer> open = leaving.lock();
      if (open) asio::post(open->socket.get_executor(), [open] { open->close(); });
    });
    if (place) asio::co_spawn(peer->socket.get_executor(), serve(peer, std::move(place)), asio::detached);
  }

  asio::awaitable<void> serve(std::shared_ptr<Peer> peer, std::unique_ptr<ConnectionPlaces::Place> place) {
    std::string received;
    for (;;) {
      error_code failed;
      watch(peer);
      const std::size_t length =
          co_await asio::async_read_until(peer->socket, asio::dynamic_buffer(received, kLongestLine), '\n',
                                          asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return;
      peer->limit.expires_at(asio::steady_timer::time_point::max());
      place->note(ConnectionPlaces::Standing::kSpoken);
      place->set_busy(true);
      const std::string reply = answer(received.substr(0, length));
      place->set_busy(false);
      received.erase(0, length);
      watch(peer);
      co_await asio::async_write(peer->socket, asio::buffer(reply),
                                 asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return;
    }
  }

  [[nodiscard]] std::string answer(const std::string& line) const {
    const nlohmann::json request = parse_foreign_json(line);
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
  ConnectionPlaces places{kConnections};
  asio::io_context context;
  stream_protocol::acceptor acceptor;
  std::vector<std::thread> threads;
};

ControlServer::ControlServer(std::filesystem::path socket, ControlHandler handler)
    : state_(std::make_unique<State>(std::move(socket), std::move(handler))) {}
ControlServer::~ControlServer() = default;

void ControlServer::check(const std::filesystem::path& socket) {
  namespace fs = std::filesystem;
  require_socket_path(socket);
  std::error_code ignored;
  const fs::path folder = fs::absolute(socket, ignored).parent_path();
  const bool is_made_at_start = folder.string().starts_with("/run/");
  if (!fs::is_directory(folder, ignored) && !is_made_at_start)
    throw UsageError("[daemon] socket is " + socket.string() + ", and there is no folder " + folder.string() +
                     ": make it, or name another place");
  const fs::file_type there = fs::symlink_status(socket, ignored).type();
  if (there != fs::file_type::not_found && there != fs::file_type::socket && there != fs::file_type::none)
    throw UsageError("[daemon] socket is " + socket.string() +
                     ", where something else lies already: remove that, or name another place");
}

}  // namespace kiroku::recorder
