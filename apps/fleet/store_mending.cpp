#include "apps/fleet/store_mending.h"

#include <utility>

#include "apps/common/format.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/stated_mending.h"
#include "apps/verify/verify_command.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

std::vector<std::unique_ptr<fleet::CaseCopy>> copies_of(const FleetConfiguration& configuration) {
  std::vector<std::unique_ptr<fleet::CaseCopy>> copies;
  for (const CopyConfiguration& each : configuration.copies) {
    const std::string name = "the copy '" + each.name + "'";
    if (!each.folder.empty()) {
      copies.push_back(fleet::copy_in_folder(name, configuration.file.parent_path() / each.folder));
    } else {
      copies.push_back(fleet::copy_in_store(
          name, std::make_shared<fleet::ObjectStore>(configuration.open_store(each.store))));
    }
  }
  return copies;
}

StoreConfiguration store_to_mend(const FleetConfiguration& configuration) {
  StoreConfiguration store = configuration.store;
  if (!configuration.mending->credentials.empty()) store.credentials = configuration.mending->credentials;
  return store;
}

}  // namespace

StoreMending::StoreMending(const FleetConfiguration& configuration, const fs::path& scratch)
    : home_(Home::open((configuration.file.parent_path() / configuration.mending->home).string())),
      key_(home_.signing_key()),
      mender_(std::make_shared<fleet::ObjectStore>(configuration.open_store(store_to_mend(configuration))),
              copies_of(configuration), scratch) {
  // Nothing is mended that cannot be stated: better told now than over the first damaged case.
  open_log(home_, key_);
}

fleet::Mending StoreMending::mend(const std::string& appliance, const std::string& case_id,
                                  const fs::path& device, const fleet::FetchedCase& fetched) {
  std::unique_ptr<archive::ApplianceLog> log;
  const std::string case_name = appliance + "~" + case_id;
  StatedMending stated(home_.log_folder(), case_name);
  return mender_.mend(appliance, case_id, load_device_keys(device.string()), fetched,
                      [&](const std::string& what) {
                        if (!log) log = open_log(home_, key_);
                        if (stated.is_news(printable(what)))
                          log->access(case_name, printable(what), "kiroku-fleet");
                      });
}

}  // namespace kiroku::apps
