#include "apps/kiroku/home.h"

#include <cstdlib>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/user_name.h"
#include "apps/verify/verify_command.h"
#include "archive/format/case_layout.h"
#include "archive/format/log_aside.h"
#include "archive/format/store_statement.h"
#include "archive/storage/file_system.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "crypto/pkcs8.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

crypto::Secret read_secret(const fs::path& file, const std::string& what) {
  Bytes bytes = read_small_file(file, what);
  crypto::Secret secret = crypto::Secret::copy_of(bytes);
  crypto::zeroise(bytes);
  return secret;
}

bool is_home(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "device.pub", ignored);
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// Folders of the archive whose name begins with `beginning`.
std::vector<std::string> cases_beginning(const fs::path& archive, const std::string& beginning) {
  std::vector<std::string> found;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(archive, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name != "log" && name != archive::kEvidenceFolder && name != archive::kStoreStatementsFolder &&
        !archive::is_log_aside_name(name) && name.starts_with(beginning) && entry.is_directory(ignored) &&
        !archive::is_excerpt(entry.path())) {
      found.push_back(name);
    }
  }
  return found;
}

constexpr const char* kOwnRoots = "the roots of the home's own authority";

/// Whether a file is there and says anything but blank lines and '#' comments.
bool says_anything(const fs::path& file, const char* what) {
  std::error_code failed;
  if (fs::status(file, failed).type() == fs::file_type::not_found) return false;
  const Bytes text = read_small_file(file, what);
  std::istringstream lines{std::string(text_of(text))};
  for (std::string line; std::getline(lines, line);) {
    const std::size_t at = line.find_first_not_of(" \t\r");
    if (at != std::string::npos && line[at] != '#') return true;
  }
  return false;
}

}  // namespace

Home::Home(fs::path folder) : folder_(std::move(folder)) {}

fs::path Home::default_folder() {
  if (const std::string home = environment("KIROKU_HOME"); !home.empty()) return home;
  if (const std::string data = environment("XDG_DATA_HOME"); !data.empty()) return fs::path(data) / "kiroku";
  if (const std::string user = environment("HOME"); !user.empty())
    return fs::path(user) / ".local/share/kiroku";
  throw UsageError("neither KIROKU_HOME nor HOME is set: name the home with --home DIR");
}

Home Home::open(const std::optional<std::string>& asked) {
  const fs::path folder = asked ? fs::path(*asked) : default_folder();
  if (!is_home(folder)) {
    throw UsageError("there is no Kiroku home in " + folder.string() +
                     ": make one with 'kiroku init', or name another with --home DIR");
  }
  return Home(folder);
}

std::optional<Home> Home::find(const std::optional<std::string>& asked) {
  if (asked) return open(asked);
  try {
    const fs::path folder = default_folder();
    if (is_home(folder)) return Home(folder);
  } catch (const UsageError&) {
    return {};
  }
  return {};
}

fs::path Home::control_socket(const Configuration& configuration) const {
  // An absolute path replaces the home.
  return folder_ / (configuration.daemon.socket.empty() ? "control.sock" : configuration.daemon.socket);
}

Configuration Home::configuration() const {
  const Bytes text = read_small_file(configuration_file(), "the configuration");
  return parse_configuration(text_of(text), configuration_file().string());
}

crypto::VerifierKey Home::device() const {
  const Bytes text = read_small_file(device_file(), "the device's public key");
  const crypto::VerifierKey key = parse_device_keys(text_of(text), device_file().string()).front();
  std::error_code ignored;
  if (!fs::exists(device_identity_file(), ignored)) return key;
  const Bytes identity = read_small_file(device_identity_file(), "the device's identity");
  const crypto::VerifierKey both =
      parse_device_keys(text_of(identity), device_identity_file().string()).front();
  if (both != key) {
    throw Error(device_identity_file().string() + " is not the identity of " + key.to_string() +
                ", the key in " + device_file().string() + ": put the right one back");
  }
  return both;
}

std::optional<crypto::Secret> Home::key_passphrase() const {
  const crypto::Secret pem = read_secret(device_key_file(), "the device key");
  if (!crypto::SigningKey::pem_is_encrypted(pem.text())) return {};
  return ask_passphrase("the device key " + device_key_file().string());
}

crypto::SigningKey Home::signing_key() const { return signing_key(key_passphrase()); }

crypto::SigningKey Home::signing_key(const std::optional<crypto::Secret>& passphrase) const {
  const crypto::Secret pem = read_secret(device_key_file(), "the device key");
  const crypto::Secret* const its = passphrase ? &*passphrase : nullptr;
  crypto::SigningKey key = crypto::SigningKey::from_pem(pem.text(), its);
  std::error_code ignored;
  if (fs::exists(hardware_file(), ignored)) {
    key = std::move(key).with_hardware(hardware_signer());
  }
  if (!fs::exists(ml_dsa_key_file(), ignored)) return key;
  const crypto::Secret ml_dsa_pem = read_secret(ml_dsa_key_file(), "the device's ML-DSA key");
  const bool encrypted = crypto::SigningKey::pem_is_encrypted(ml_dsa_pem.text());
  std::optional<crypto::MlDsaPrivateKey> ml_dsa =
      crypto::ml_dsa_of_pem(crypto::MlDsaSet::k65, ml_dsa_pem.text(), encrypted ? its : nullptr);
  if (!ml_dsa) {
    throw Error(ml_dsa_key_file().string() +
                " is no ML-DSA-65 key in PKCS#8, or has another passphrase than " +
                device_key_file().string() + ": put the file back that belongs to it");
  }
  return std::move(key).with_ml_dsa(std::move(*ml_dsa));
}

std::shared_ptr<const crypto::HardwareSigner> Home::hardware_signer() const {
  return recorder::hardware_signer(hardware(), boot_approvals_folder());
}

recorder::HardwareDescription Home::hardware() const {
  const Bytes text = read_small_file(hardware_file(), "the description of the key in hardware");
  try {
    return recorder::HardwareDescription::parse(text_of(text));
  } catch (const Error& error) {
    throw Error("cannot read " + hardware_file().string() + ": " + error.what() + "; put the file back");
  }
}

std::vector<fs::path> Home::outside_root_files() const {
  if (says_anything(trust_file(), "the trusted roots")) return {trust_file()};
  return {};
}

std::vector<fs::path> Home::own_root_files() const {
  std::vector<fs::path> files;
  for (const fs::path& file : possible_own_root_files()) {
    if (says_anything(file, kOwnRoots)) files.push_back(file);
  }
  return files;
}

std::vector<fs::path> Home::possible_own_root_files() const {
  return {own_authority_file(), authority_folder() / "ca.pem"};
}

timestamp::TrustStore Home::trust(const TellWithout& without) const {
  timestamp::TrustStore trust;
  const auto attempt = [&](const auto& add) {
    try {
      add();
    } catch (const Error& error) {
      if (!without) throw;
      without(std::string("the roots of time-stamping authorities are not all there: ") + error.what());
    }
  };
  attempt([&] {
    for (const fs::path& file : outside_root_files()) trust.add_trusted_file(file);
  });
  for (const fs::path& file : possible_own_root_files()) {
    attempt([&] {
      if (says_anything(file, kOwnRoots)) trust.add_own_authority_file(file);
    });
  }
  return trust;
}

bool Home::holds(const fs::path& case_folder) const {
  std::error_code failed;
  const fs::path parent = fs::canonical(case_folder, failed).parent_path();
  if (failed) return false;
  const fs::path own = fs::canonical(archive(), failed);
  return !failed && parent == own;
}

crypto::AgeRecipients load_recipients(const fs::path& file) {
  const Bytes text = read_small_file(file, "the recipients");
  crypto::AgeRecipients recipients = crypto::parse_recipients(text_of(text), file.string());
  if (recipients.empty()) throw UsageError(file.string() + " names no recipient: write one age1... a line");
  return recipients;
}

fs::path find_case(const std::optional<Home>& home, const std::string& named) {
  std::error_code ignored;
  if (named.empty()) throw UsageError("an empty text names no case: give a folder or an identifier");
  if (fs::exists(named, ignored)) return named;
  const bool looks_like_path = named.find('/') != std::string::npos;
  if (looks_like_path || !home) {
    throw UsageError("there is no case folder " + named +
                     (home || looks_like_path
                          ? ": look at the path"
                          : " and no home whose archive could hold it: look at the path, or "
                            "name the home with --home DIR"));
  }
  const std::vector<std::string> found = cases_beginning(home->archive(), named);
  if (found.empty()) {
    throw UsageError("'" + named + "' is neither a folder nor a case in " + home->archive().string() +
                     ": 'kiroku cases' lists what there is");
  }
  if (found.size() > 1) {
    throw UsageError("'" + named + "' begins the names of " + std::to_string(found.size()) +
                     " cases, such as " + found[0] + " and " + found[1] + ": write more of the identifier");
  }
  return home->archive() / found.front();
}

void log_access(const std::optional<Home>& home, const fs::path& case_folder, const std::string& what) {
  if (!home || !home->holds(case_folder)) return;
  try {
    const crypto::SigningKey key = home->signing_key();
    const auto log = open_log(*home, key);
    log->access(fs::canonical(case_folder).filename().string(), what, user_name());
  } catch (const Error& error) {
    print_error("kiroku",
                std::string("warning: the appliance log does not know of this access: ") + error.what());
  }
}

crypto::AgeIdentities load_identities(const std::vector<std::string>& files,
                                      const std::optional<Home>& home) {
  std::vector<std::string> names = files;
  std::error_code ignored;
  if (names.empty() && home && fs::exists(home->identity_file(), ignored)) {
    names.push_back(home->identity_file().string());
  }
  if (names.empty()) throw UsageError("only a recipient's identity opens this: give it with --identity FILE");
  crypto::AgeIdentities identities;
  for (const std::string& name : names) {
    for (auto& identity : crypto::load_identity_file(name, ask_passphrase))
      identities.push_back(std::move(identity));
  }
  return identities;
}

}  // namespace kiroku::apps
