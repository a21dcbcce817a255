#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/told_to_end.h"
#include "timestamp/authority_server.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string listen = "127.0.0.1:3161";
  std::optional<std::string> home;
  bool json = false;
};

int run(const Request& request) {
  const Home home = Home::open(request.home);
  timestamp::Authority authority = timestamp::Authority::open(home.authority_folder());
  end_when_told();
  const timestamp::AuthorityServer server(authority, request.listen);
  const std::string root = (home.authority_folder() / "ca.pem").string();
  if (request.json) {
    print_json({{"url", server.url()}, {"root", root}});
  } else {
    std::cout << "Answering RFC 3161 time-stamp queries on " << server.url() << "\n"
              << "Its root certificate: " << root << "\n"
              << "Ctrl-C ends it.\n";
  }
  std::cout.flush();
  wait_until_told();
  return kDone;
}

}  // namespace

void add_tsa_command(Command& program) {
  Command& tsa = program.add_command("tsa", "the home's own time-stamping authority");
  Command& command = tsa.add_command("serve", "answers RFC 3161 queries over HTTP until Ctrl-C");
  const auto request = std::make_shared<Request>();
  command.option("--listen", "ADDRESS:PORT", request->listen, "where to listen; port 0 takes a free one");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object with the URL, then serves");
  command.explain(
      "For demonstration and closed networks: its time is this machine's, so verification calls what rests "
      "on it "
      "self-issued. Nothing protects the port; anybody who reaches it gets time-stamps.");
  command.example("kiroku tsa serve --listen 127.0.0.1:3161", "serves this machine");
  command.example(
      "openssl ts -query -data FILE -sha256 -cert | curl -sS -H 'Content-Type: "
      "application/timestamp-query' --data-binary @- http://127.0.0.1:3161/ -o FILE.tsr",
      "asks it with stock tools");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
