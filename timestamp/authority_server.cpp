#include "timestamp/authority_server.h"

#include <string_view>
#include <utility>

#include "base/ascii.h"
#include "base/listen_address.h"
#include "http/server.h"

namespace kiroku::timestamp {
namespace {

/// A query is about 100 bytes; extensions make it larger, but never this large.
constexpr std::size_t kLargestQuery = 64U << 10;
constexpr ConnectionPlaces::Limits kConnections{.all = 64, .of_holder = 16};
constexpr std::uint16_t kExamplePort = 3161;

constexpr std::string_view kHelp =
    "This is a time-stamping authority (RFC 3161). POST it a query as application/timestamp-query, for "
    "example:\n"
    "openssl ts -query -data FILE -sha256 -cert | curl -H 'Content-Type: application/timestamp-query' "
    "--data-binary @- -o FILE.tsr URL\n";

http::Response respond(int status, const char* type, std::string body) {
  return {status, {{"Server", "kiroku"}, {"Content-Type", type}}, std::move(body)};
}

http::Response respond_text(int status, std::string text) {
  return respond(status, "text/plain; charset=utf-8", std::move(text));
}

http::Response answer(Authority& authority, const http::Request& request) {
  if (request.method != "POST") {
    http::Response response = respond_text(405, std::string(kHelp));
    response.fields.emplace_back("Allow", "POST");
    return response;
  }
  const std::string_view type = request.field("Content-Type");
  if (!same_but_for_case(type.substr(0, type.find(';')), "application/timestamp-query")) {
    return respond_text(415, std::string(kHelp));
  }
  const Bytes response = authority.respond(bytes_of(request.body));
  return respond(200, "application/timestamp-reply", std::string(text_of(response)));
}

http::Response refuse(const http::Refusal& refusal) {
  // RFC 3161 clients know a bad request, and nothing of 431.
  return respond_text(refusal.status == 431 ? 400 : refusal.status, refusal.why + "\n");
}

http::ServerOptions options_of(Authority& authority, const ListenAddress& listen,
                               std::chrono::milliseconds time_limit) {
  http::ServerOptions options;
  options.listen = listen;
  options.answer = [&authority](const http::Request& request) { return answer(authority, request); };
  options.refuse = refuse;
  options.most_body_bytes = kLargestQuery;
  options.patience = time_limit;
  options.connections = kConnections;
  return options;
}

}  // namespace

struct AuthorityServer::State {
  State(Authority& authority, const ListenAddress& listen, std::chrono::milliseconds time_limit)
      : host(listen.host), server(options_of(authority, listen, time_limit)) {}

  const std::string host;
  http::Server server;
};

AuthorityServer::AuthorityServer(Authority& authority, const std::string& listen,
                                 std::chrono::milliseconds time_limit)
    : state_(std::make_unique<State>(authority, parse_listen_address(listen, kExamplePort), time_limit)) {}

AuthorityServer::~AuthorityServer() = default;

std::uint16_t AuthorityServer::port() const { return state_->server.port(); }

std::string AuthorityServer::url() const {
  return "http://" + ListenAddress{state_->host, port()}.to_string() + "/";
}

}  // namespace kiroku::timestamp
