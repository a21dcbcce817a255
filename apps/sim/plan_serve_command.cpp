// 'kiroku plan serve': planning on a page.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/serving.h"
#include "apps/kiroku/viewer_setup.h"
#include "apps/sim/number_option.h"
#include "apps/sim/plan_command.h"
#include "base/error.h"
#include "viewer/planning/planning_api.h"
#include "viewer/server/viewer.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  std::optional<std::string> home, plans, certificate, key, web, transfer, gpu, at_once;
  std::string listen = "127.0.0.1:8445";
  bool json = false;
};

viewer::PlanningOptions planning_options(const Request& request, const Home& home) {
  constexpr std::size_t kMostAtOnce = 64;
  viewer::PlanningOptions options;
  options.plans = request.plans ? fs::path(*request.plans) : home.folder() / "plans";
  if (request.transfer) options.table.transfer = *request.transfer;
  static_cast<void>(sim::find_transfer_function(options.table.transfer));  // refuses what is none, in time
  options.table.gpu = request.gpu.value_or("auto") == "off" ? sim::GpuUse::kOff : sim::GpuUse::kAuto;
  options.at_once = request.at_once ? parse_count(*request.at_once, "--at-once", 1, kMostAtOnce)
                                    : std::max(1U, std::thread::hardware_concurrency() / 2);
  options.tell = tell_on_standard_error();
  return options;
}

void print_start(const Request& request, const viewer::Viewer& server, const std::string& sign_in,
                 const std::string& fingerprint, const viewer::PlanningRoom& room) {
  const std::string plans = room.options().plans.string();
  const std::size_t count = room.folder().plans().size();
  if (request.json) {
    print_json(
        {{"url", server.url()},
         {"sign_in", sign_in.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(sign_in)},
         {"fingerprint", fingerprint},
         {"folder", plans},
         {"plans", count},
         {"at_once", room.options().at_once}});
  } else {
    std::cout << "Planning at " << server.url() << " on " << count << (count == 1 ? " plan" : " plans")
              << " of " << plans << ", " << room.options().at_once
              << (room.options().at_once == 1 ? " person" : " persons") << " at a time\n";
    if (!sign_in.empty())
      std::cout << "\nOpen this address, which signs in once without a password:\n  " << sign_in << "\n";
    std::cout << "\nThe server's certificate has the SHA-256 fingerprint\n  " << fingerprint
              << "\n\nCtrl-C ends it.\n";
  }
  std::cout << std::flush;
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const std::optional<fs::path> page = request.web ? fs::path(*request.web) : find_page();
  if (!page) throw UsageError("there is no page to plan on: it was not built; name its folder with --web");
  const crypto::SigningKey device_key = home.signing_key();
  const timestamp::TrustStore trust = home.trust();
  viewer::ServerCertificate certificate =
      viewer_certificate(home, request.listen, request.certificate, request.key);
  const std::string fingerprint = viewer::fingerprint(certificate.certificate_pem);
  viewer::PlanningRoom room(planning_options(request, home));

  viewer::ViewerOptions options{
      .home = viewer_home(home, home.configuration(), device_key, trust, nullptr),
      .web = {.listen = request.listen,
              .certificate_pem = std::move(certificate.certificate_pem),
              .key_pem = std::move(certificate.key_pem),
              .limits = {}},
      .sessions = {},
      .page = page,
      .more_routes = [&room](viewer::Router& router) { viewer::add_planning_routes(router, room); },
      .tell = room.options().tell};
  options.home.serves = "planning";
  serve_until_stopped(std::move(options), home,
                      [&](const viewer::Viewer& server, const std::string& sign_in) {
                        print_start(request, server, sign_in, fingerprint, room);
                      });
  return kDone;
}

}  // namespace

void add_plan_serve_command(Command& plan) {
  Command& command = plan.add_command("serve", "serves a page to plan on: grasp, press, cut, undo, save");
  const auto request = std::make_shared<Request>();
  command.option("--plans", "DIR", request->plans,
                 "the plans that may be opened: documents in it and in the folders directly below it; new "
                 "ones are saved beside them",
                 "plans in the home");
  command.option(
      "--listen", "ADDRESS", request->listen,
      "where to, as 127.0.0.1:8445 or 0.0.0.0:8445; beyond this machine only once there is a user");
  command.option("--transfer", "NAME", request->transfer,
                 "how tissue looks: a name of 'kiroku sim transfer', or a file of your own (.json)", "liver");
  command.choice("--gpu", {"auto", "off"}, request->gpu,
                 "auto takes a graphics processor where one is there; off computes pictures in software",
                 "auto");
  command.option("--at-once", "N", request->at_once, "people who plan at a time",
                 "half as many as there are cores");
  command.option("--certificate", "FILE", request->certificate,
                 "the server's certificate and those up to its authority, PEM", "its own, made in the home");
  command.option("--key", "FILE", request->key, "its private key, PEM, without passphrase");
  command.option("--web", "DIR", request->web, "folder of the page's files",
                 "the one that belongs to this program");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object once it serves");
  command.explain(
      "Surgeons and administrators sign in as in the viewer ('kiroku user add'), open a plan, and do by hand "
      "what becomes its steps. What is saved is a new plan for 'kiroku plan check', 'run', 'replay' and "
      "'seal'; no plan is overwritten.");
  command.example("kiroku plan serve --plans plans", "the planner on https://127.0.0.1:8445/");
  command.example("kiroku plan serve --plans plans --transfer kidney --gpu off", "with a kidney's colours");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
