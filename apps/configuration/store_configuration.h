// [store] of kiroku.toml: where copies of a home's cases go ('kiroku ship').
#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>
#include <optional>
#include <string>

#include "recorder/daemon/schedule.h"

namespace kiroku::apps {

class TableReader;

struct StoreConfiguration {
  std::string endpoint, bucket;  // required
  std::string region = "us-east-1";
  std::string credentials = "store-credentials";  // a file, relative to the home
  std::string ca_file;                            // PEM, relative to the home; "": the system's roots
  std::string appliance;                          // "": the device's name
  std::chrono::hours retain{0};                   // required
  std::int64_t megabytes_per_second = 0;          // 0: no limit
  recorder::Schedule unlimited;                   // windows of local time in which there is no such limit
  bool publish_log = false;                       // the appliance log's tree, for whoever follows it

  /// Most that is sent, in bytes a second, when clocks on the wall show `local`; 0: no limit.
  [[nodiscard]] std::uint64_t bytes_per_second_at(const std::tm& local) const;
};

/// What a [store] is for: an appliance ships to it, a hospital's program only reads what appliances shipped.
enum class StoreUse { kShip, kRead };
/// [store], out of the whole file; nothing where there is none. To read takes address and credentials alone.
/// Throws kiroku::UsageError with line and column.
std::optional<StoreConfiguration> read_store(TableReader& top, StoreUse use = StoreUse::kShip);

}  // namespace kiroku::apps
