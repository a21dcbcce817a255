#include "witness/witness_server.h"

#include <string_view>
#include <utility>

#include "base/listen_address.h"
#include "http/server.h"

namespace kiroku::witness {
namespace {

/// A checkpoint has some hundred bytes, and a proof at most 63 lines.
constexpr std::size_t kLargestRequest = 64U << 10;
constexpr ConnectionPlaces::Limits kConnections{.all = 64, .of_holder = 16};
constexpr std::uint16_t kExamplePort = 3171;
constexpr std::string_view kCheckpoint = "/checkpoint";

http::Response respond(Answer answer) {
  return {
      answer.status, {{"Server", "kiroku"}, {"Content-Type", answer.content_type}}, std::move(answer.body)};
}

http::Response method_not_allowed(const char* allowed) {
  http::Response response =
      respond({405, "text/plain; charset=utf-8", std::string("this takes ") + allowed + "\n"});
  response.fields.emplace_back("Allow", allowed);
  return response;
}

std::string about(const Witness& witness) {
  return "This is a witness of transparency logs (https://c2sp.org/tlog-witness).\nIts key: " +
         witness.key().to_string() +
         "\nLogs POST their checkpoints to add-checkpoint; the newest of a log is at "
         "SHA256-OF-ITS-ORIGIN-IN-HEX/checkpoint.\n";
}

http::Response answer_request(Witness& witness, const http::Request& request) {
  const std::string path = request.target.substr(0, request.target.find('?'));
  if (path == "/add-checkpoint") {
    if (request.method != "POST") return method_not_allowed("POST");
    return respond(witness.add_checkpoint(request.body));
  }
  const bool of_log = path.size() > kCheckpoint.size() && path.ends_with(kCheckpoint);
  if (path != "/" && !of_log)
    return respond({404, "text/plain; charset=utf-8", "there is nothing here; / says what there is\n"});
  if (request.method != "GET" && request.method != "HEAD") return method_not_allowed("GET");
  if (path == "/") return respond({200, "text/plain; charset=utf-8", about(witness)});
  return respond(witness.checkpoint(path.substr(1, path.size() - 1 - kCheckpoint.size())));
}

http::Response answer_refused(const http::Refusal& refusal) {
  return respond({refusal.status, "text/plain; charset=utf-8", refusal.why + "\n"});
}

http::ServerOptions options_of(Witness& witness, const ListenAddress& listen,
                               std::chrono::milliseconds time_limit) {
  http::ServerOptions options;
  options.listen = listen;
  options.answer = [&witness](const http::Request& request) { return answer_request(witness, request); };
  options.refuse = answer_refused;
  options.threads = 2;
  options.most_body_bytes = kLargestRequest;
  options.patience = time_limit;
  options.connections = kConnections;
  return options;
}

}  // namespace

struct WitnessServer::State {
  State(Witness& witness, const ListenAddress& listen, std::chrono::milliseconds time_limit)
      : host(listen.host), server(options_of(witness, listen, time_limit)) {}

  const std::string host;
  http::Server server;
};

WitnessServer::WitnessServer(Witness& witness, const std::string& listen,
                             std::chrono::milliseconds time_limit)
    : state_(std::make_unique<State>(witness, parse_listen_address(listen, kExamplePort), time_limit)) {}

WitnessServer::~WitnessServer() = default;

std::uint16_t WitnessServer::port() const { return state_->server.port(); }

std::string WitnessServer::url() const {
  return "http://" + ListenAddress{state_->host, port()}.to_string() + "/";
}

}  // namespace kiroku::witness
