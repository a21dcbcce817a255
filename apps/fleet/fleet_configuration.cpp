#include "apps/fleet/fleet_configuration.h"

#include <algorithm>
#include <cstdlib>

#include <toml++/toml.h>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/configuration/retention_configuration.h"
#include "apps/configuration/table_reader.h"
#include "base/error.h"
#include "base/listen_address.h"
#include "fleet/store_credentials.h"
#include "recorder/clock/whole_seconds.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

std::chrono::hours hours_of(const std::string& text, const std::string& what) {
  const std::chrono::nanoseconds age = parse_age(text, what);
  if (age < std::chrono::hours(1) || age > std::chrono::hours(24) * 3653) {
    throw UsageError(what + " is '" + printable(text) +
                     "': it takes an hour at least, and ten years (3653d) at most");
  }
  return std::chrono::duration_cast<std::chrono::hours>(age);
}

void read_verification(TableReader& top, FleetConfiguration& into) {
  const toml::table* table = top.table("verification");
  if (table == nullptr) return;
  TableReader reader(*table, "[verification]", top.file());
  const fs::path folder = into.file.parent_path();
  reader.text("devices", [&](const std::string& text) { into.devices = folder / text; });
  reader.texts("trust", [&](const std::vector<std::string>& files) {
    for (const std::string& each : files) into.trust.push_back(folder / each);
  });
  reader.texts("own_authority", [&](const std::vector<std::string>& files) {
    for (const std::string& each : files) into.own_authority.push_back(folder / each);
  });
  reader.text("every", [&](const std::string& text) { into.verify_every = hours_of(text, "'every'"); });
  constexpr std::int64_t kWeek = 7 * 24 * 60;
  std::int64_t minutes = into.settles.count();
  reader.integer("settle_minutes", 0, kWeek, minutes);
  into.settles = std::chrono::minutes(minutes);
  reader.refuse_unknown_keys();
}

void read_reports(TableReader& top, FleetConfiguration& into) {
  const toml::table* table = top.table("reports");
  if (table == nullptr) return;
  TableReader reader(*table, "[reports]", top.file());
  constexpr std::uint16_t kExamplePort = 8444;
  reader.text("listen", [&](const std::string& text) {
    parse_listen_address(text, kExamplePort);
    into.reports_listen = text;
  });
  reader.text("authority", [&](const std::string& text) { into.authority = into.file.parent_path() / text; });
  reader.text("certificates_last", [&](const std::string& text) {
    into.certificates_last = hours_of(text, "'certificates_last'");
  });
  reader.refuse_unknown_keys();
}

void read_sharing(TableReader& top, FleetConfiguration& into) {
  into.authorities = read_authorities(top, AuthorityUse::kOfFleet);
  const toml::table* table = top.table("sharing");
  if (table != nullptr) {
    TableReader reader(*table, "[sharing]", top.file());
    reader.text("every", [&](const std::string& text) {
      const std::chrono::nanoseconds every = parse_stated_duration(text, "'every'");
      if (every < std::chrono::seconds(1) || every > std::chrono::minutes(5))
        throw UsageError("'every' is '" + text + "': a round lasts between 1s and 5m");
      into.round = every;
    });
    reader.refuse_unknown_keys();
    if (into.authorities.empty())
      reader.refuse(table->source(), "[sharing] needs an [[authority]] with name and url");
  }
  for (const AuthorityConfiguration& authority : into.authorities) {
    if (authority.min_interval > into.round)
      throw UsageError(top.file() + ": rounds are stamped each " + recorder::whole_seconds(into.round) +
                       ", more often than 'min_interval' of " + authority.name +
                       " allows: write a longer 'every' in [sharing]");
  }
}

void read_copies(TableReader& top, FleetConfiguration& into) {
  for_each_table(top, "copy", [&](const toml::table& table) {
    CopyConfiguration copy;
    TableReader reader(table, "[[copy]]", top.file());
    reader.text("name", [&](const std::string& text) {
      require_short_name(text);
      if (std::ranges::find(into.copies, text, &CopyConfiguration::name) != into.copies.end())
        throw UsageError("two copies named '" + text + "'");
      copy.name = text;
    });
    reader.text("folder", [&](const std::string& text) { copy.folder = text; });
    const bool is_folder = !copy.folder.empty();
    const auto take = [&](const char* key, std::string& text) {
      if (!is_folder) reader.text(key, [&](const std::string& given) { text = given; });
    };
    take("endpoint", copy.store.endpoint);
    take("bucket", copy.store.bucket);
    take("region", copy.store.region);
    take("credentials", copy.store.credentials);
    take("ca_file", copy.store.ca_file);
    reader.refuse_unknown_keys();
    if (copy.name.empty() || (!is_folder && (copy.store.endpoint.empty() || copy.store.bucket.empty())))
      reader.refuse(table.source(), "[[copy]] needs 'name', and either 'folder', or 'endpoint' and 'bucket'");
    into.copies.push_back(std::move(copy));
  });
}

void read_mending(TableReader& top, FleetConfiguration& into) {
  read_copies(top, into);
  const toml::table* table = top.table("mending");
  if (table == nullptr) {
    if (!into.copies.empty())
      throw UsageError(top.file() + ": nothing uses the copy '" + into.copies.front().name +
                       "' without [mending]: name the 'home' in whose log it is stated what was mended");
    return;
  }
  MendingConfiguration mending;
  TableReader reader(*table, "[mending]", top.file());
  reader.text("home", [&](const std::string& text) { mending.home = text; });
  reader.text("credentials", [&](const std::string& text) { mending.credentials = text; });
  reader.refuse_unknown_keys();
  if (mending.home.empty())
    reader.refuse(table->source(), "[mending] needs 'home', in whose log it is stated what was mended");
  into.mending = std::move(mending);
}

void read_evidence(TableReader& top, FleetConfiguration& into) {
  const toml::table* table = top.table("evidence");
  if (table == nullptr) return;
  TableReader reader(*table, "[evidence]", top.file());
  reader.text("policy", [&](const std::string& text) { into.evidence.policy = text; });
  reader.text("credentials", [&](const std::string& text) { into.evidence.credentials = text; });
  reader.text("every",
              [&](const std::string& text) { into.evidence.look_every = hours_of(text, "'every'"); });
  reader.refuse_unknown_keys();
}

}  // namespace

FleetConfiguration FleetConfiguration::parse(std::string_view toml, const fs::path& file) {
  toml::table root;
  try {
    root = toml::parse(toml);
  } catch (const toml::parse_error& error) {
    throw UsageError(file.string() + ":" + std::to_string(error.source().begin.line) + ":" +
                     std::to_string(error.source().begin.column) + ": " + std::string(error.description()));
  }
  FleetConfiguration configuration;
  configuration.file = file;
  configuration.devices = file.parent_path() / "devices";
  TableReader top(root, "the file", file.string());
  const std::optional<StoreConfiguration> store = read_store(top, StoreUse::kRead);
  const toml::table* catalogue = top.table("catalogue");
  if (!store || catalogue == nullptr) {
    throw UsageError(file.string() +
                     " needs [store] with endpoint and bucket, and [catalogue] with connection "
                     "(docs/how-to/run-a-fleet.md)");
  }
  configuration.store = *store;
  TableReader reader(*catalogue, "[catalogue]", file.string());
  reader.text("connection", [&](const std::string& text) { configuration.connection = text; });
  reader.refuse_unknown_keys();
  if (configuration.connection.empty())
    reader.refuse(catalogue->source(),
                  "[catalogue] needs 'connection', such as \"host=db.example dbname=kiroku\"");
  read_verification(top, configuration);
  configuration.authority = file.parent_path() / "authority";
  read_reports(top, configuration);
  read_sharing(top, configuration);
  read_mending(top, configuration);
  read_evidence(top, configuration);
  if (!configuration.authorities.empty() && configuration.trust.empty() &&
      configuration.own_authority.empty())
    throw UsageError(file.string() +
                     ": tokens of an [[authority]] are judged before they are handed out: name its root in "
                     "'trust' of [verification]");
  top.refuse_unknown_keys();
  return configuration;
}

FleetConfiguration FleetConfiguration::read(const fs::path& file) {
  return parse(text_of(read_small_file(file, "the configuration")), file);
}

fleet::ObjectStore FleetConfiguration::open_store(const StoreConfiguration& of) const {
  const fs::path folder = file.parent_path();
  return {{of.endpoint, of.bucket, of.region, of.ca_file.empty() ? fs::path() : folder / of.ca_file},
          fleet::read_credentials(folder / of.credentials)};
}

fleet::FleetCatalogue FleetConfiguration::open_catalogue() const {
  return fleet::FleetCatalogue(fleet::Postgres(connection));
}

fleet::FleetReports FleetConfiguration::open_reports() const {
  return fleet::FleetReports(fleet::Postgres(connection));
}

std::optional<fs::path> FleetConfiguration::policy_file() const {
  if (evidence.policy.empty()) return {};
  return file.parent_path() / evidence.policy;
}

timestamp::TrustStore FleetConfiguration::trust_store() const {
  timestamp::TrustStore roots;
  for (const fs::path& file_of_roots : trust) roots.add_trusted_file(file_of_roots);
  for (const fs::path& file_of_roots : own_authority) roots.add_own_authority_file(file_of_roots);
  return roots;
}

void add_fleet_configuration_option(Command& command, std::string& into) {
  const char* const given = std::getenv("KIROKU_FLEET");
  into = given != nullptr && *given != '\0' ? given : "/etc/kiroku/fleet.toml";
  command.option("--config", "FILE", into, "what to work with");
}

}  // namespace kiroku::apps
