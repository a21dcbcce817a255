// [store] of kiroku.toml: where copies of a home's cases go ('kiroku ship').
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

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
};

/// [store], out of the whole file; nothing where there is none. Throws kiroku::UsageError with line and
/// column.
std::optional<StoreConfiguration> read_store(TableReader& top);

}  // namespace kiroku::apps
