// fleet.toml: the store, the catalogue and the keys that kiroku-fleet works with.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/configuration/authority_configuration.h"
#include "apps/configuration/store_configuration.h"
#include "fleet/catalogue/fleet_catalogue.h"
#include "fleet/catalogue/fleet_reports.h"
#include "fleet/object_store.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {

/// [[copy]]: another place where cases lie, a store or a folder.
struct CopyConfiguration {
  std::string name;  // a short one
  StoreConfiguration store;
  std::filesystem::path folder;  // relative to the file; "": a store
};
/// [mending]: 'kiroku-fleet verify' puts what the store has lost again.
struct MendingConfiguration {
  std::filesystem::path home;  // in whose log it is stated; relative to the file
  std::string credentials;     // of an access key that may put; "": those of [store]
};

/// [evidence]: how evidence records of stored cases are judged and renewed.
struct EvidenceOfFleet {
  std::filesystem::path policy;  // a TOML file, relative to the file; "": no algorithm ends
  std::string credentials;       // of an access key that may put; "": those of [store]
  std::chrono::hours look_every{24 * 91};
};

struct FleetConfiguration {
  std::filesystem::path file;
  StoreConfiguration store;
  std::string connection;  // of libpq, to the catalogue
  std::filesystem::path
      devices;  // folder: or-1.pub is the key of the appliance or-1, or-1.identity both of its keys
  std::vector<std::filesystem::path> trust;          // PEM files: roots of outside authorities,
  std::vector<std::filesystem::path> own_authority;  // and of the appliances' own
  std::chrono::hours verify_every{24 * 91};
  std::chrono::minutes settles{60};  // after its end a case is left alone for so long
  /// [reports]: where appliances report ("" for nowhere on this server), the folder of the authority that
  /// issues their certificates, and for how long.
  std::string reports_listen;
  std::filesystem::path authority;
  std::chrono::hours certificates_last{24 * 90};
  /// Authorities by which appliances have their checkpoints stamped together, where they report; and how
  /// often.
  std::vector<AuthorityConfiguration> authorities;
  std::chrono::nanoseconds round = std::chrono::seconds(60);
  std::optional<MendingConfiguration> mending;
  EvidenceOfFleet evidence;
  std::vector<CopyConfiguration> copies;  // asked in this order

  /// Throws kiroku::UsageError with line and column, kiroku::Error where the file cannot be read.
  static FleetConfiguration read(const std::filesystem::path& file);
  static FleetConfiguration parse(std::string_view toml, const std::filesystem::path& file);

  [[nodiscard]] fleet::ObjectStore open_store() const { return open_store(store); }
  /// Another one than [store]; names of files are relative to the file here, too.
  [[nodiscard]] fleet::ObjectStore open_store(const StoreConfiguration& of) const;
  [[nodiscard]] fleet::FleetCatalogue open_catalogue() const;
  [[nodiscard]] fleet::FleetReports open_reports() const;
  /// Where the policy of [evidence] is; nothing where none is named.
  [[nodiscard]] std::optional<std::filesystem::path> policy_file() const;
  /// Roots by which the time-stamps of all appliances are judged.
  [[nodiscard]] timestamp::TrustStore trust_store() const;
};

/// --config, with its default.
void add_fleet_configuration_option(Command& command, std::string& into);

}  // namespace kiroku::apps
