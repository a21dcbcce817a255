#include "fleet/stored_case.h"

#include <algorithm>
#include <iterator>

#include "archive/format/case_layout.h"
#include "archive/format/store_statement.h"
#include "base/error.h"
#include "crypto/byte_source.h"
#include "crypto/file_hash.h"
#include "fleet/held_objects.h"

namespace kiroku::fleet {
namespace {

std::string of_parts(const std::string& appliance, const std::string& name) {
  return appliance + "/growing/" + name + "/";
}

}  // namespace

StoredCase list_case(ObjectStore& store, const std::string& appliance, const std::string& case_id) {
  StoredCase of;
  std::size_t listed = 0;
  const auto take = [&](const ListedVersion& each) {
    if (++listed > kMostVersions) {
      throw Error("the store lists more than " + std::to_string(kMostVersions) + " objects of '" + case_id +
                  "', which no recording has");
    }
    // From the newest to the oldest, where a store does not say which is the newest: of what a mark hides
    // none is.
    const auto [known, is_new] = of.newest.emplace(each.key, each.version);
    if (!is_new && each.newest) known->second = each.version;
    if (each.put && (!of.put || *each.put >= *of.put)) {
      of.put = each.put;
      of.newest_key = each.key;
    }
  };
  store.for_each_version(appliance + "/" + case_id + "/", take);
  store.for_each_version(of_parts(appliance, case_id), take);
  return of;
}

std::vector<std::string> StoredCase::telling_keys(const std::string& appliance,
                                                  const std::string& case_id) const {
  std::vector<std::string> keys{appliance + "/" + case_id + "/" + std::string(archive::kLedgerFile)};
  // Parts are named by the byte that they begin with, so that the last one in order came last.
  const std::string parts = of_parts(appliance, case_id);
  const auto behind = newest.upper_bound(parts + "\x7f");
  if (behind != newest.begin() && std::prev(behind)->first.starts_with(parts))
    keys.push_back(std::prev(behind)->first);
  if (!newest_key.empty()) keys.push_back(newest_key);
  return keys;
}

std::optional<UtcTime> log_came_last(ObjectStore& store, const std::string& appliance) {
  std::optional<UtcTime> last;
  store.for_each_version(of_parts(appliance, "log"), [&](const ListedVersion& each) {
    if (each.put && (!last || *each.put > *last)) last = each.put;
  });
  return last;
}

std::string store_statements_prefix(const std::string& appliance, const std::string& case_id) {
  return appliance + "/" + std::string(archive::kStoreStatementsFolder) + "/" + case_id + "/";
}

PutBeside put_beside(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                     const StoredCase& of, const std::filesystem::path& file, UtcTime until) {
  PutLock lock = longest_lock(store, of.telling_keys(appliance, case_id));
  lock.ends = std::max(lock.ends.value_or(until), until);
  const std::string key = store_statements_prefix(appliance, case_id) + file.filename().string();
  const crypto::FileHash hash = crypto::hash_file(file);
  const std::string version = store.put(key, *crypto::open_file_source(file), hash.sha256, lock);
  require_held(store, key, version, hash, lock);
  return {key, version, *lock.ends};
}

}  // namespace kiroku::fleet
