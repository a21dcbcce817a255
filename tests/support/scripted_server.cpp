#include "tests/support/scripted_server.h"

#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/streambuf.hpp>
#include <boost/asio/write.hpp>

namespace kiroku::test {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

struct Connection {
  explicit Connection(asio::ip::tcp::socket the_socket) : socket(std::move(the_socket)) {}
  asio::ip::tcp::socket socket;
  asio::streambuf request;
  std::string answer;
};

}  // namespace

struct ScriptedServer::State {
  explicit State(std::string the_answer)
      : answer(std::move(the_answer)), acceptor(context, {asio::ip::make_address("127.0.0.1"), 0}) {}

  void accept() {
    acceptor.async_accept([this](error_code error, asio::ip::tcp::socket socket) {
      if (error) return;
      read(std::make_shared<Connection>(std::move(socket)));
      accept();
    });
  }

  void read(const std::shared_ptr<Connection>& connection) {
    asio::async_read_until(connection->socket, connection->request, "\r\n\r\n",
                           [this, connection](error_code error, std::size_t size) {
                             if (error) return;
                             const auto* data = static_cast<const char*>(connection->request.data().data());
                             const std::lock_guard guard(mutex);
                             request.assign(data, size);
                             ++requests;
                             const bool of_part = request.find("\r\nRange:") != std::string::npos;
                             connection->answer = of_part && range_answer ? *range_answer : answer;
                             if (connection->answer.empty()) {
                               wait(connection);
                             } else {
                               asio::async_write(connection->socket, asio::buffer(connection->answer),
                                                 [connection](error_code, std::size_t) {});
                             }
                           });
  }

  /// Holds the connection open until the client leaves.
  void wait(const std::shared_ptr<Connection>& connection) {
    asio::async_read_until(connection->socket, connection->request, "never sent",
                           [connection](error_code, std::size_t) {});
  }

  std::mutex mutex;
  std::string answer;
  std::optional<std::string> range_answer;
  std::string request;
  std::size_t requests = 0;
  asio::io_context context{1};
  asio::ip::tcp::acceptor acceptor;
  std::thread thread;
};

ScriptedServer::ScriptedServer(std::string answer) : state_(std::make_unique<State>(std::move(answer))) {
  state_->accept();
  state_->thread = std::thread([state = state_.get()] { state->context.run(); });
}

ScriptedServer::~ScriptedServer() {
  state_->context.stop();
  state_->thread.join();
}

std::uint16_t ScriptedServer::port() const { return state_->acceptor.local_endpoint().port(); }

std::string ScriptedServer::url() const { return "http://127.0.0.1:" + std::to_string(port()) + "/"; }

std::string ScriptedServer::last_request() const {
  const std::lock_guard guard(state_->mutex);
  return state_->request;
}

std::size_t ScriptedServer::requests() const {
  const std::lock_guard guard(state_->mutex);
  return state_->requests;
}

void ScriptedServer::answer_with(std::string answer) {
  const std::lock_guard guard(state_->mutex);
  state_->answer = std::move(answer);
}

void ScriptedServer::answer_ranges_with(std::string answer) {
  const std::lock_guard guard(state_->mutex);
  state_->range_answer = std::move(answer);
}

std::string http_answer(const std::string& status, const std::string& content_type, const std::string& body) {
  return "HTTP/1.1 " + status + "\r\nContent-Type: " + content_type +
         "\r\nContent-Length: " + std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body;
}

}  // namespace kiroku::test
