#include "apps/kiroku/store.h"

#include <optional>

#include "archive/format/case_layout.h"
#include "archive/search/search_key.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "fleet/store_credentials.h"
#include "recorder/daemon/schedule.h"

namespace kiroku::apps {

StoreConfiguration store_of(const Home& home) {
  std::optional<StoreConfiguration> store = home.configuration().store;
  if (!store) {
    throw UsageError(
        home.configuration_file().string() +
        " names no store: write [store] with endpoint, bucket and retain (docs/how-to/ship-to-a-store.md)");
  }
  if (store->appliance.empty()) store->appliance = home.device().name();
  if (!archive::is_short_name(store->appliance)) {
    throw UsageError(
        "the device's name '" + printable(store->appliance) +
        "' cannot begin keys of a store: write appliance = \"...\" into [store], small letters and digits");
  }
  return std::move(*store);
}

std::filesystem::path shipping_list_file(const Home& home, const StoreConfiguration& of) {
  constexpr std::size_t kDigits = 16;
  const std::string store = of.endpoint + "/" + of.bucket + "/" + of.appliance;
  return home.shipping_file(crypto::to_hex(crypto::sha256(bytes_of(store))).substr(0, kDigits));
}

fleet::ObjectStore open_store(const Home& home, const StoreConfiguration& of, const Clock& time) {
  fleet::StoreTerms terms;
  terms.bytes_per_second = [of, &time] { return of.bytes_per_second_at(recorder::local_time(time.utc())); };
  return {{of.endpoint, of.bucket, of.region, of.ca_file.empty() ? "" : home.folder() / of.ca_file},
          fleet::read_credentials(home.folder() / of.credentials),
          terms};
}

std::filesystem::path search_notes_to_ship(const Home& home, const StoreConfiguration& of,
                                           const std::function<void(const std::string& sentence)>& tell) {
  const std::string key = home.configuration().search.key;
  if (key.empty()) return home.search_notes();  // of before
  try {
    const std::string appliance = search::ApplianceKey::read(home.folder() / key).appliance;
    if (appliance == of.appliance) return home.search_notes();
    tell("search notes are not shipped: the key of [search] is of the appliance " + appliance +
         ", and this one ships as " + of.appliance + ". Have one made for that name");
    return {};
  } catch (const Error& error) {
    // Notes of before are good.
    tell(std::string("new cases cannot be found by their patient or procedure: ") + error.what());
    return home.search_notes();
  }
}

}  // namespace kiroku::apps
