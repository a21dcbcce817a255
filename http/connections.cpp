#include "http/connections.h"

namespace kiroku::http {

namespace asio = boost::asio;
using asio::ip::tcp;

IoThreads::IoThreads(asio::io_context& context, std::size_t count) : context_(context) {
  for (std::size_t i = 0; i < count; ++i) {
    threads_.emplace_back([this] {
      for (;;) {
        try {
          context_.run();
          return;
        } catch (const std::exception&) {
          continue;
        }
      }
    });
  }
}

void IoThreads::stop() {
  context_.stop();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void listen_on(tcp::acceptor& acceptor, const ListenAddress& address, const std::string& advice) {
  boost::system::error_code error;
  const tcp::endpoint endpoint(asio::ip::make_address(address.host, error), address.port);
  if (!error) acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) throw Error("cannot listen on " + address.to_string() + ": " + error.message() + advice);
}

}  // namespace kiroku::http
