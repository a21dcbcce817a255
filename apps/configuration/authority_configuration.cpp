#include "apps/configuration/authority_configuration.h"

#include <algorithm>

#include "apps/common/format.h"
#include "apps/configuration/table_reader.h"
#include "base/error.h"

namespace kiroku::apps {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

namespace {

void require_url(const std::string& url) {
  if (url != "embedded" && !url.starts_with("http://") && !url.starts_with("https://")) {
    throw UsageError("'url' is '" + url + "': it must begin with http:// or https://, or be embedded");
  }
}

/// proxy and interface, of an [[authority]] or of one of its paths.
void read_path(TableReader& reader, timestamp::AuthorityPath& into) {
  reader.text("proxy", [&](const std::string& text) { into.proxy = text; });
  reader.text("interface", [&](const std::string& text) { into.network_interface = text; });
}

void read_paths(const toml::node& node, const TableReader& top, const std::string& file,
                AuthorityConfiguration& into) {
  const timestamp::AuthorityPath common = into.paths.front();
  if (into.is_embedded()) {
    top.refuse(node.source(), "the embedded authority is asked without a network: it has no paths");
  }
  if (!common.proxy.empty() || !common.network_interface.empty()) {
    top.refuse(node.source(), "write 'proxy' and 'interface' either in [[authority]] or in its paths");
  }
  const toml::array* entries = node.as_array();
  if (entries == nullptr || !entries->is_homogeneous(toml::node_type::table)) {
    top.refuse(node.source(), "paths are written as [[authority.path]]");
  }
  into.paths.clear();
  for (const toml::node& entry : *entries) {
    timestamp::AuthorityPath path = common;
    TableReader reader(*entry.as_table(), "[[authority.path]]", file);
    read_path(reader, path);
    reader.refuse_unknown_keys();
    into.paths.push_back(std::move(path));
  }
}

AuthorityConfiguration read_authority(const toml::table& table, const std::string& file, AuthorityUse use) {
  AuthorityConfiguration authority;
  timestamp::AuthorityPath path;
  TableReader reader(table, "[[authority]]", file);
  reader.text("name", [&](const std::string& text) {
    require_short_name(text);
    authority.name = text;
  });
  reader.text("url", [&](const std::string& text) {
    require_url(text);
    authority.url = text;
  });
  read_path(reader, path);
  const auto limited = [&reader](const std::string& key, nanoseconds least, nanoseconds most,
                                 const std::string& range, const auto& take) {
    reader.text(key, [&](const std::string& text) {
      const nanoseconds duration = parse_stated_duration(text, "'" + key + "'");
      if (duration < least || duration > most) {
        throw UsageError("'" + key + "' is '" + text + "': it must be between " + range);
      }
      take(duration);
    });
  };
  const auto timeout = [&limited](const std::string& key, milliseconds& into) {
    limited(key, milliseconds(100), std::chrono::minutes(5), "100ms and 5m",
            [&into](nanoseconds duration) { into = std::chrono::duration_cast<milliseconds>(duration); });
  };
  timeout("connect_timeout", path.connect_timeout);
  timeout("total_timeout", path.total_timeout);
  limited("min_interval", milliseconds(1), std::chrono::hours(24), "1ms and 24h",
          [&authority](nanoseconds duration) { authority.min_interval = duration; });
  path.url = authority.url;
  authority.paths = {path};
  if (const toml::node* paths = reader.find("path")) read_paths(*paths, reader, file, authority);
  if (use == AuthorityUse::kOfAppliance) {
    reader.flag("shared", authority.shared);
    limited("shared_patience", std::chrono::seconds(2), std::chrono::minutes(10), "2s and 10m",
            [&authority](nanoseconds duration) { authority.shared_patience = duration; });
  }
  reader.refuse_unknown_keys();
  if (authority.name.empty()) reader.refuse(table.source(), "an [[authority]] needs a 'name'");
  if (authority.url.empty()) reader.refuse(table.source(), "an [[authority]] needs a 'url'");
  if (authority.is_embedded() && (authority.shared || use == AuthorityUse::kOfFleet))
    reader.refuse(table.source(), "the embedded authority is this machine's own: others cannot share it");
  return authority;
}

}  // namespace

std::vector<AuthorityConfiguration> read_authorities(TableReader& top, AuthorityUse use) {
  std::vector<AuthorityConfiguration> all;
  const toml::node* node = top.find("authority");
  if (node == nullptr) return all;
  const toml::array* entries = node->as_array();
  if (entries == nullptr) top.refuse(node->source(), "authorities are written as [[authority]]");
  for (const toml::node& entry : *entries) {
    if (!entry.is_table()) top.refuse(entry.source(), "authorities are written as [[authority]]");
    AuthorityConfiguration authority = read_authority(*entry.as_table(), top.file(), use);
    const bool twice =
        std::any_of(all.begin(), all.end(), [&](const auto& other) { return other.name == authority.name; });
    if (twice) top.refuse(entry.source(), "there are two authorities named '" + authority.name + "'");
    all.push_back(std::move(authority));
  }
  return all;
}

}  // namespace kiroku::apps
