#include "apps/kirokud/servers.h"

#include <algorithm>
#include <future>
#include <thread>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "apps/common/file.h"
#include "apps/kiroku/viewer_setup.h"
#include "base/descriptor_limit.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

/// A connection to planning or training takes two descriptors.
viewer::WebServerLimits limits_of_viewer() {
  viewer::WebServerLimits limits;
  constexpr std::uint64_t kFewest = 32;
  const std::uint64_t part = std::max(kFewest, count_descriptors().may / 4);
  limits.connections = std::min<std::size_t>(limits.connections, part);
  limits.connections_of_address = std::min<std::size_t>(limits.connections_of_address, part / 2);
  return limits;
}

std::unique_ptr<viewer::Viewer> open_viewer(const Home& home, const Configuration& configuration,
                                            const ViewerConfiguration& asked, const WritableHome& shared,
                                            LookingOn& looking_on, recorder::Daemon& daemon) {
  std::optional<std::string> certificate, key;
  if (!asked.certificate.empty()) {
    certificate = (home.folder() / asked.certificate).string();
    key = (home.folder() / asked.key).string();
  }
  viewer::ServerCertificate own = viewer_certificate(home, asked.listen, certificate, key);
  viewer::ViewerOptions options{
      .home = viewer_home(home, configuration, shared.key, shared.trust, shared_identities({}, home)),
      .web = {.listen = asked.listen,
              .certificate_pem = std::move(own.certificate_pem),
              .key_pem = std::move(own.key_pem),
              .limits = limits_of_viewer()},
      .sessions = {},
      .page = find_page(),
      .tell = [](const std::string& sentence) { spdlog::warn("viewer: {}", printable(sentence)); }};
  options.home.log = shared.log.get();
  options.home.live = live::live_pictures(looking_on.channels);
  options.home.vitals = [&looking_on](const std::string& room, std::int64_t after_ns) {
    return looking_on.monitors.now(room, after_ns);
  };
  options.home.rooms = {
      .running_case = [&daemon](const std::string& room) { return daemon.running_case(room); },
      .now_ns = [&daemon](const std::string& room) { return daemon.now_ns(room); },
      .point = [&daemon](const std::string& room, media::PointedAt at,
                         const std::string& meant) { return daemon.point(room, std::move(at), meant); }};
  auto server = std::make_unique<viewer::Viewer>(std::move(options));
  spdlog::info("the viewer is at {}", server->url());
  return server;
}

KeptServerListener listener_of(recorder::Daemon& daemon) {
  return {.without =
              [&daemon](const std::string& sentence) {
                spdlog::error("{}", printable(sentence));
                daemon.add_problem(sentence);
              },
          .no_more =
              [&daemon](const std::string& sentence) {
                spdlog::info("no more: {}", printable(sentence));
                daemon.remove_problem(sentence);
              }};
}

std::filesystem::path hook_token_file(const Home& home, const Configuration& configuration) {
  return home.folder() / configuration.daemon.hook_token_file;
}

}  // namespace

std::string hook_token(const Home& home, const Configuration& configuration) {
  if (configuration.daemon.hook_token_file.empty()) return "";
  if (configuration.daemon.listen_address.empty())
    throw UsageError(
        "[daemon] has a hook_token_file and no listen, so that there is nowhere to ask the hook");
  const Bytes text = read_small_file(hook_token_file(home, configuration), "the hook's token");
  std::string token(text_of(text));
  token.erase(token.find_last_not_of(" \r\n") + 1);
  if (token.size() < 16) throw UsageError("the hook's token must have at least 16 characters");
  return token;
}

std::string viewer_certificate_problem(const Home& home, const ViewerConfiguration& asked) {
  if (asked.listen.empty() || asked.certificate.empty()) return "";
  try {
    static_cast<void>(viewer_certificate(home, asked.listen, (home.folder() / asked.certificate).string(),
                                         (home.folder() / asked.key).string()));
    return "";
  } catch (const std::exception& error) {
    return std::string("recording would go on without the viewer: ") + error.what();
  }
}

std::unique_ptr<KeptHttp> serve_http(const Home& home, const Configuration& configuration,
                                     recorder::Daemon& daemon) {
  std::string token;
  try {
    token = hook_token(home, configuration);
    if (const auto file = hook_token_file(home, configuration); !token.empty() && is_open_to_others(file))
      spdlog::warn("the hook's token can be read by others than its owner: chmod 600 {}, and take another",
                   printable(file.string()));
  } catch (const std::exception& error) {
    listener_of(daemon).without(std::string("recording goes on without the hook: ") + error.what());
  }
  KeptHttp::Open open;
  if (!configuration.daemon.listen_address.empty()) {
    open = [&configuration, &daemon, token] {
      recorder::HttpServerOptions options;
      options.address = configuration.daemon.listen_address;
      options.port = configuration.daemon.listen_port;
      options.token = token;
      options.tell = [](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); };
      options.healthy = [&daemon] { return daemon.healthy(); };
      options.metrics = [&daemon] { return daemon.metrics(); };
      options.hook = [&daemon](const std::string& room, const std::string& action, const std::string& body,
                               const std::string& meant) { return daemon.hook(room, action, body, meant); };
      return std::make_unique<recorder::HttpServer>(std::move(options));
    };
  }
  return std::make_unique<KeptHttp>("metrics and the hook", std::move(open), listener_of(daemon),
                                    Clock::system());
}

std::unique_ptr<KeptViewer> serve_viewer(const Home& home, const Configuration& configuration,
                                         const ViewerConfiguration& asked, const WritableHome& shared,
                                         LookingOn& looking_on, recorder::Daemon& daemon) {
  KeptViewer::Open open;
  if (!asked.listen.empty())
    open = [&] { return open_viewer(home, configuration, asked, shared, looking_on, daemon); };
  return std::make_unique<KeptViewer>("the viewer", std::move(open), listener_of(daemon), Clock::system());
}

bool ends_in_time(std::unique_ptr<KeptViewer> viewer) {
  std::promise<void> ended;
  std::future<void> end = ended.get_future();
  std::thread ending([viewer = std::move(viewer), ended = std::move(ended)]() mutable {
    viewer.reset();
    ended.set_value();
  });
  if (end.wait_for(kLongestEndOfViewer) == std::future_status::ready) {
    ending.join();
    return true;
  }
  ending.detach();
  return false;
}

}  // namespace kiroku::apps
