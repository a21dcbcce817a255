#include "apps/kiroku/view_command.h"

#include <memory>
#include <string>
#include <vector>

#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/serving.h"
#include "apps/kiroku/viewer_setup.h"

namespace kiroku::apps {
namespace {

struct Request {
  ServingRequest serving{.listen = "127.0.0.1:8443"};
  std::vector<std::string> identities;
};

int run(const Request& request) {
  const Home home = Home::open(request.serving.home);
  const bool has_page = page_of(request.serving).has_value();
  serve_until_stopped(request.serving, home,
                      {.serves = "cases",
                       .identities = shared_identities(request.identities, home),
                       .more_routes = {},
                       .tell = tell_on_standard_error(),
                       .first_line =
                           [has_page](const std::string& url) {
                             return "Serving " + url + (has_page ? "" : " (the API alone: no page is built)");
                           },
                       .tell_more = {}});
  return kDone;
}

}  // namespace

void add_view_command(Command& program) {
  Command& command = program.add_command("view", "serves the viewer: cases, playback, verification");
  const auto request = std::make_shared<Request>();
  command.option(
      "-i,--identity", "FILE", request->identities,
      "opens recordings for everybody who may watch; in a --demo home its own. Without one everybody "
      "unlocks with their own, which stays in memory");
  add_serving_options(command, request->serving);
  command.explain(
      "People sign in with a name and password ('kiroku user add'). In a --demo home, and on a loopback "
      "address "
      "alone, an address is printed that signs in once without. What is watched, unlocked or exported is "
      "entered "
      "in the appliance log before it leaves. docs/reference/viewer.md tells who may do what. Ctrl-C ends "
      "it.");
  command.example("kiroku view", "the home's cases on https://127.0.0.1:8443/");
  command.example("kiroku view --listen 0.0.0.0:443 --certificate or-3.pem --key or-3.key",
                  "for the whole network, with the hospital's certificate");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
