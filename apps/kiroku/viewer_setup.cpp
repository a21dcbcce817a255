#include "apps/kiroku/viewer_setup.h"

#include <algorithm>
#include <unistd.h>
#include <utility>

#include "apps/kiroku/standing_consents.h"
#include "base/error.h"
#include "base/listen_address.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::uint16_t kExamplePort = 8443;

}  // namespace

std::optional<fs::path> find_page() {
  std::error_code failed;
  const fs::path here = fs::read_symlink("/proc/self/exe", failed).parent_path();
  // Beside a build; from bin, where kirokud is; from libexec/kiroku.
  for (const char* candidate : {"../viewer/web", "../share/kiroku/web", "../../share/kiroku/web"}) {
    if (fs::exists(here / candidate / "index.html", failed)) return (here / candidate).lexically_normal();
  }
  return {};
}

fs::path find_full_program() {
  std::error_code failed;
  const fs::path here = fs::read_symlink("/proc/self/exe", failed).parent_path();
  for (const char* candidate : {"kiroku-full", "../libexec/kiroku/kiroku-full"}) {
    fs::path program = (here / candidate).lexically_normal();
    if (::access(program.c_str(), X_OK) == 0) return program;
  }
  return {};
}

viewer::ServerCertificate viewer_certificate(const Home& home, const std::string& listen,
                                             const std::optional<std::string>& certificate,
                                             const std::optional<std::string>& key) {
  if (certificate.has_value() != key.has_value()) {
    throw UsageError("--certificate and --key belong together: give both or none");
  }
  if (certificate) return viewer::load_certificate(*certificate, *key);
  std::vector<std::string> names = viewer::machine_names();
  const ListenAddress address = parse_listen_address(listen, kExamplePort);
  if (!address.is_any() && std::ranges::count(names, address.host) == 0) names.push_back(address.host);
  bool made = false;
  return viewer::own_certificate(home.folder(), names, made);
}

viewer::Session::Identities shared_identities(const std::vector<std::string>& files, const Home& home) {
  std::error_code ignored;
  if (files.empty() && !fs::exists(home.identity_file(), ignored)) return nullptr;
  return std::make_shared<const crypto::AgeIdentities>(load_identities(files, home));
}

viewer::ViewerHome viewer_home(const Home& home, const Configuration& configuration,
                               const crypto::SigningKey& device_key, const timestamp::TrustStore& trust,
                               viewer::Session::Identities identities) {
  return {.archive = home.archive(),
          .catalogue_file = home.catalogue_file(),
          .log_folder = home.log_folder(),
          .users_file = home.folder() / "users.sqlite",
          .control_socket = home.control_socket(configuration),
          .copies_folder = home.folder() / "viewing-copies",
          .handout_folder = home.folder() / "viewer-files",
          .comparisons_folder = home.comparisons_folder(),
          .folder = home.folder(),
          .plans_folder = home.plans_folder(),
          .comparison_program = find_full_program(),
          .planning_socket = home.folder() / "planning.sock",
          .breathing_socket = home.folder() / "breathing.sock",
          .training_socket = home.folder() / "training.sock",
          .device_key = &device_key,
          .device = home.device(),
          .trust = &trust,
          .identities = std::move(identities),
          .consent = {.purposes =
                          [home] {
                            ConsentConfiguration site = consent_configuration(home);
                            return viewer::SitePurposes{std::move(site.purposes), site.demand_purpose};
                          },
                      .consents = [home] { return standing_consents(home); }}};
}

}  // namespace kiroku::apps
