#include "tests/support/https_client.h"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <csignal>
#include <netinet/in.h>
#include <poll.h>
#include <stdexcept>
#include <sys/socket.h>

#include <openssl/ssl.h>

#include "base/descriptor.h"

namespace kiroku::test {
namespace {

/// No answer of these tests takes longer, on a machine as slow as it may be.
constexpr timeval kPatience{.tv_sec = 60, .tv_usec = 0};

struct SslDeleter {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(SSL* ssl) const { SSL_free(ssl); }
};

sockaddr_in address_of(const std::string& host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  inet_pton(AF_INET, host.c_str(), &address.sin_addr);
  return address;
}

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

struct HttpsConnection::State {
  Descriptor socket;
  std::unique_ptr<SSL_CTX, SslDeleter> context;
  std::unique_ptr<SSL, SslDeleter> ssl;
  std::string received;

  bool read_more() {
    std::array<char, 16384> some{};
    const int count = SSL_read(ssl.get(), some.data(), static_cast<int>(some.size()));
    if (count > 0) received.append(some.data(), static_cast<std::size_t>(count));
    return count > 0;
  }
  std::optional<std::string> take_until(const std::string& end) {
    std::size_t at = std::string::npos;
    while ((at = received.find(end)) == std::string::npos) {
      if (!read_more()) return {};
    }
    std::string out = received.substr(0, at);
    received.erase(0, at + end.size());
    return out;
  }
  std::optional<std::string> take(std::size_t count) {
    while (received.size() < count) {
      if (!read_more()) return {};
    }
    std::string out = received.substr(0, count);
    received.erase(0, count);
    return out;
  }
};

HttpsConnection::HttpsConnection(std::uint16_t port, const std::string& source)
    : state_(std::make_unique<State>()) {
  // OpenSSL writes with write(): a server that closed first would end the whole test program.
  ::signal(SIGPIPE, SIG_IGN);
  state_->socket = Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const int number = state_->socket.number();
  const sockaddr_in from = address_of(source, 0);
  const sockaddr_in to = address_of("127.0.0.1", port);
  ::setsockopt(number, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  ::setsockopt(number, SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
  if (::bind(number, reinterpret_cast<const sockaddr*>(&from), sizeof from) != 0 ||
      ::connect(number, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    throw std::runtime_error("cannot connect");
  }
  state_->context.reset(SSL_CTX_new(TLS_client_method()));
  state_->ssl.reset(SSL_new(state_->context.get()));
  SSL_set_fd(state_->ssl.get(), number);
  if (SSL_connect(state_->ssl.get()) != 1) throw std::runtime_error("no handshake");
}

HttpsConnection::~HttpsConnection() = default;
HttpsConnection::HttpsConnection(HttpsConnection&&) noexcept = default;

bool HttpsConnection::send(const std::string& bytes) {
  return SSL_write(state_->ssl.get(), bytes.data(), static_cast<int>(bytes.size())) ==
         static_cast<int>(bytes.size());
}

HttpResponse HttpsConnection::receive(bool has_body) {
  HttpResponse out;
  const auto head = state_->take_until("\r\n\r\n");
  if (!head || !head->starts_with("HTTP/1.1 ")) return {};
  std::size_t at = head->find("\r\n");
  const int status = std::stoi(head->substr(9, 3));
  while (at != std::string::npos) {
    const std::size_t begin = at + 2;
    at = head->find("\r\n", begin);
    const std::string line = head->substr(begin, at == std::string::npos ? at : at - begin);
    const std::size_t colon = line.find(": ");
    out.headers[lower_case(line.substr(0, colon))] = line.substr(colon + 2);
  }
  if (has_body && out.headers.contains("content-length")) {
    const auto body = state_->take(std::stoul(out.headers["content-length"]));
    if (!body) return {};
    out.body = *body;
  } else if (has_body && out.headers.contains("transfer-encoding")) {
    while (true) {
      const auto size = state_->take_until("\r\n");
      if (!size) return {};
      const auto chunk = state_->take(std::stoul(*size, nullptr, 16) + 2);
      if (!chunk) return {};
      if (chunk->size() == 2) break;
      out.body.append(*chunk, 0, chunk->size() - 2);
    }
  }
  out.status = status;
  return out;
}

bool HttpsConnection::is_closed_within(std::chrono::milliseconds limit) {
  pollfd waiting{.fd = state_->socket.number(), .events = POLLIN, .revents = 0};
  const auto end = std::chrono::steady_clock::now() + limit;
  while (true) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0 || ::poll(&waiting, 1, static_cast<int>(left.count())) <= 0) return false;
    if (!state_->read_more()) return true;
  }
}

std::string http_request(const std::string& method, const std::string& target,
                         const std::map<std::string, std::string>& headers, const std::string& body) {
  std::map<std::string, std::string> fields{{"Host", "localhost"}};
  if (method != "GET" && method != "HEAD") fields["X-Kiroku-Request"] = "1";
  if (!body.empty()) {
    fields["Content-Type"] = "application/json";
    fields["Content-Length"] = std::to_string(body.size());
  }
  for (const auto& [name, value] : headers) fields[name] = value;
  std::string out = method + " " + target + " HTTP/1.1\r\n";
  for (const auto& [name, value] : fields) {
    if (!value.empty()) out.append(name).append(": ").append(value).append("\r\n");
  }
  return out + "\r\n" + body;
}

HttpResponse ask_once(std::uint16_t port, const std::string& request, const std::string& source) {
  HttpsConnection connection(port, source);
  connection.send(request);
  return connection.receive(!request.starts_with("HEAD"));
}

}  // namespace kiroku::test
