#include "apps/kiroku/view_command.h"

#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/serving.h"
#include "apps/kiroku/viewer_setup.h"
#include "base/error.h"
#include "base/json_or_null.h"
#include "viewer/server/viewer.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  std::optional<std::string> home, certificate, key, web;
  std::string listen = "127.0.0.1:8443";
  std::vector<std::string> identities;
  bool json = false;
};

void print_start(const Request& request, const viewer::Viewer& server, const std::string& sign_in,
                 const std::string& fingerprint, bool is_own, bool has_page) {
  if (request.json) {
    print_json({{"url", server.url()}, {"sign_in", or_null(sign_in)}, {"fingerprint", fingerprint}});
    std::cout << std::flush;
    return;
  }
  std::cout << "Serving " << server.url() << (has_page ? "" : " (the API alone: no page is built)") << "\n";
  if (!sign_in.empty()) {
    std::cout << "\nOpen this address, which signs in once without a password:\n  " << sign_in << "\n";
  }
  std::cout << "\nThe server's certificate "
            << (is_own ? "is its own, which browsers ask about once; it " : "")
            << "has the SHA-256 fingerprint\n  " << fingerprint << "\n\nCtrl-C ends it.\n"
            << std::flush;
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const auto identities = shared_identities(request.identities, home);
  const crypto::SigningKey device_key = home.signing_key();
  const timestamp::TrustStore trust = home.trust();
  viewer::ServerCertificate certificate =
      viewer_certificate(home, request.listen, request.certificate, request.key);
  const std::string fingerprint = viewer::fingerprint(certificate.certificate_pem);
  const std::optional<fs::path> page = request.web ? fs::path(*request.web) : find_page();

  viewer::ViewerOptions options{
      .home = viewer_home(home, home.configuration(), device_key, trust, identities),
      .web = {.listen = request.listen,
              .certificate_pem = std::move(certificate.certificate_pem),
              .key_pem = std::move(certificate.key_pem),
              .limits = {}},
      .sessions = {},
      .page = page,
      .tell = tell_on_standard_error()};
  serve_until_stopped(
      std::move(options), home, [&](const viewer::Viewer& server, const std::string& sign_in) {
        print_start(request, server, sign_in, fingerprint, !request.certificate, page.has_value());
      });
  return kDone;
}

}  // namespace

void add_view_command(Command& program) {
  Command& command = program.add_command("view", "serves the viewer: cases, playback, verification");
  const auto request = std::make_shared<Request>();
  command.option(
      "--listen", "ADDRESS", request->listen,
      "where to, as 127.0.0.1:8443, [::1]:8443 or 0.0.0.0:8443; beyond this machine only once there "
      "is a user");
  command.option(
      "-i,--identity", "FILE", request->identities,
      "opens recordings for everybody who may watch; in a --demo home its own. Without one everybody "
      "unlocks with their own, which stays in memory");
  command.option("--certificate", "FILE", request->certificate,
                 "the server's certificate and those up to its authority, PEM", "its own, made in the home");
  command.option("--key", "FILE", request->key, "its private key, PEM, without passphrase");
  command.option("--web", "DIR", request->web, "folder of the page's files",
                 "the one that belongs to this program");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object once it serves");
  command.explain(
      "People sign in with a name and password ('kiroku user add'). In a --demo home, and on a loopback "
      "address "
      "alone, an address is printed that signs in once without. What is watched, unlocked or exported is "
      "entered "
      "in the appliance log before it leaves. docs/viewer.md tells who may do what. Ctrl-C ends it.");
  command.example("kiroku view", "the home's cases on https://127.0.0.1:8443/");
  command.example("kiroku view --listen 0.0.0.0:443 --certificate or-3.pem --key or-3.key",
                  "for the whole network, with the hospital's certificate");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
