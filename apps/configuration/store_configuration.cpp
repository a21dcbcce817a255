#include "apps/configuration/store_configuration.h"

#include <vector>

#include "apps/common/format.h"
#include "apps/configuration/retention_configuration.h"
#include "apps/configuration/table_reader.h"
#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::apps {

std::uint64_t StoreConfiguration::bytes_per_second_at(const std::tm& local) const {
  constexpr std::uint64_t kMegabyte = 1'000'000;
  return unlimited.contains(local) ? 0 : static_cast<std::uint64_t>(megabytes_per_second) * kMegabyte;
}

std::optional<StoreConfiguration> read_store(TableReader& top, StoreUse use) {
  const toml::table* table = top.table("store");
  if (table == nullptr) return {};
  StoreConfiguration store;
  TableReader reader(*table, "[store]", top.file());
  const auto into = [&](const char* key, std::string& text) {
    reader.text(key, [&](const std::string& given) { text = given; });
  };
  into("endpoint", store.endpoint);
  into("bucket", store.bucket);
  into("region", store.region);
  into("credentials", store.credentials);
  into("ca_file", store.ca_file);
  if (use == StoreUse::kRead) {
    reader.refuse_unknown_keys();
    if (store.endpoint.empty() || store.bucket.empty())
      reader.refuse(table->source(), "[store] needs 'endpoint' and 'bucket'");
    return store;
  }
  reader.text("appliance", [&](const std::string& text) {
    if (!archive::is_short_name(text)) {
      throw UsageError("'appliance' is '" + printable(text) +
                       "': it takes up to 32 small letters, digits and hyphens, and begins with no hyphen");
    }
    store.appliance = text;
  });
  reader.text("retain", [&](const std::string& text) {
    const std::chrono::nanoseconds age = parse_age(text, "'retain'");
    if (age < std::chrono::hours(1) || age > std::chrono::hours(24) * 36'525) {
      throw UsageError("'retain' is '" + printable(text) +
                       "': objects are locked for an hour at least, and a hundred years (36525d) at most");
    }
    store.retain = std::chrono::duration_cast<std::chrono::hours>(age);
  });
  reader.integer("megabytes_per_second", 1, 100'000, store.megabytes_per_second);
  reader.texts("unlimited", [&](const std::vector<std::string>& windows) {
    store.unlimited = recorder::Schedule::parse(windows);
  });
  reader.flag("publish_log", store.publish_log);
  reader.refuse_unknown_keys();
  if (!store.unlimited.empty() && store.megabytes_per_second == 0) {
    reader.refuse(table->source(),
                  "[store] has windows without a limit in 'unlimited', and no limit beside them: write "
                  "'megabytes_per_second', too");
  }
  if (store.endpoint.empty() || store.bucket.empty() || store.retain.count() == 0)
    reader.refuse(table->source(), "[store] needs 'endpoint', 'bucket' and 'retain', such as \"3653d\"");
  return store;
}

}  // namespace kiroku::apps
