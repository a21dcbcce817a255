#include "apps/kiroku/serving.h"

#include <filesystem>
#include <iostream>
#include <memory>
#include <mutex>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/kiroku/viewer_setup.h"
#include "base/descriptor_limit.h"
#include "base/json_or_null.h"

namespace kiroku::apps {
namespace {

void print_start(const ServingRequest& request, const Served& served, const viewer::Viewer& server,
                 const std::string& sign_in, const std::string& fingerprint) {
  if (request.json) {
    nlohmann::ordered_json told{
        {"url", or_null(server.url())}, {"sign_in", or_null(sign_in)}, {"fingerprint", or_null(fingerprint)}};
    if (served.tell_more) served.tell_more(told);
    print_json(told);
    std::cout << std::flush;
    return;
  }
  std::cout << served.first_line(server.url()) << "\n";
  if (server.url().empty()) {
    std::cout << "\nPeople reach it through the viewer of this home, with its sign-in: 'kiroku view', or "
                 "kirokud with "
                 "[viewer]\nin kiroku.toml. An address of its own comes by --listen.\n\nCtrl-C ends it.\n"
              << std::flush;
    return;
  }
  if (!sign_in.empty())
    std::cout << "\nOpen this address, which signs in once without a password:\n  " << sign_in << "\n";
  std::cout << "\nThe server's certificate "
            << (request.certificate ? "" : "is its own, which browsers ask about once; it ")
            << "has the SHA-256 fingerprint\n  " << fingerprint << "\n\nCtrl-C ends it.\n"
            << std::flush;
}

}  // namespace

void add_serving_options(Command& command, ServingRequest& request) {
  const bool is_behind = !request.own_port.empty();
  const std::string port =
      is_behind ? ":" + request.own_port : request.listen.substr(request.listen.rfind(':'));
  command.option("--listen", "ADDRESS", request.listen,
                 (is_behind ? "an address of its own, as 127.0.0.1" : "where to, as 127.0.0.1") + port +
                     ", [::1]" + port + " or 0.0.0.0" + port +
                     "; beyond this machine only once there is a user" +
                     (is_behind ? "; without one the viewer of the home leads here" : ""));
  command.option("--certificate", "FILE", request.certificate,
                 "the server's certificate and those up to its authority, PEM", "its own, made in the home");
  command.option("--key", "FILE", request.key, "its private key, PEM, without passphrase");
  command.option("--web", "DIR", request.web, "folder of the page's files",
                 "the one that belongs to this program");
  add_home_option(command, request.home);
  command.flag("--json", request.json, "prints one JSON object once it serves");
}

std::optional<std::filesystem::path> page_of(const ServingRequest& request) {
  return request.web ? std::filesystem::path(*request.web) : find_page();
}

std::function<void(const std::string&)> tell_on_standard_error() {
  return [mutex = std::make_shared<std::mutex>()](const std::string& sentence) {
    const std::lock_guard guard(*mutex);
    print_error("kiroku", sentence);
  };
}

void serve_until_stopped(const ServingRequest& request, const Home& home, Served served) {
  const crypto::SigningKey device_key = home.signing_key();
  const timestamp::TrustStore trust = home.trust();
  const bool has_address = !request.listen.empty();
  if (!has_address && (request.certificate || request.key))
    throw UsageError("--certificate and --key are of an address of its own: give --listen too");
  viewer::ServerCertificate certificate;
  std::string fingerprint;
  if (has_address) {
    certificate = viewer_certificate(home, request.listen, request.certificate, request.key);
    fingerprint = viewer::fingerprint(certificate.certificate_pem);
  }
  viewer::ViewerOptions options{
      .home = viewer_home(home, home.configuration(), device_key, trust, std::move(served.identities)),
      .web = {.listen = request.listen,
              .certificate_pem = std::move(certificate.certificate_pem),
              .key_pem = std::move(certificate.key_pem),
              .limits = {}},
      .sessions = {},
      .page = has_address ? page_of(request) : std::nullopt,
      .more_routes = std::move(served.more_routes),
      .tell = std::move(served.tell)};
  options.home.serves = served.serves;
  if (served.change_home) served.change_home(options.home);
  raise_descriptor_limit();  // a thousand connections need more than a shell gives
  std::error_code ignored;
  const bool is_demonstration = has_address && std::filesystem::exists(home.identity_file(), ignored) &&
                                viewer::is_loopback(request.listen);
  end_when_told();
  // As each process of this home writes it: what a recorder beside this one signed is never cut off.
  const OpenedLog log = open_kept_log(home, device_key);
  for (const std::string& each : {log.why_another, log.log->damage()}) {
    if (!each.empty()) options.tell(each);
  }
  log.log->tell_of_remarks(options.tell);
  options.home.log = log.log.get();
  viewer::Viewer server(std::move(options));
  print_start(request, served, server, is_demonstration ? server.sign_in_url("demo") : "", fingerprint);
  wait_until_told();
}

}  // namespace kiroku::apps
