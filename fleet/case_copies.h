// Where else cases lie than in the store that is looked at: other stores, folders. Nothing that they give is
// believed: whoever asks says what fits. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "fleet/object_store.h"

namespace kiroku::fleet {

/// A file of a case.
struct FileOfCase {
  std::string appliance, case_id;
  std::string path;                    // below the case's folder, as the ledger names it
  std::optional<std::uint64_t> bytes;  // where they are known: nothing of another size is taken
  std::uint64_t most_bytes = 0;        // nothing longer is taken
};

class CaseCopy {
 public:
  virtual ~CaseCopy() = default;
  /// As it is stated: "the copy 'second'".
  [[nodiscard]] virtual std::string name() const = 0;
  /// Writes what it has of the file into `into`, one version after the other, until `fits` says yes; whether
  /// it did. Throws StoreError, kiroku::IoError, kiroku::Error.
  virtual bool bring(const FileOfCase& file, const std::filesystem::path& into,
                     const std::function<bool()>& fits) = 0;
};

/// A bucket, in which keys are <appliance>/<case>/<path>, with all versions.
std::unique_ptr<CaseCopy> copy_in_store(std::string name, std::shared_ptr<ObjectStore> store);
/// A folder with <appliance>/<case>/<path> in it. No link below it is followed.
std::unique_ptr<CaseCopy> copy_in_folder(std::string name, std::filesystem::path folder);
/// An appliance's own archive, with <case>/<path> in it, whatever the appliance is called.
std::unique_ptr<CaseCopy> copy_in_archive(std::string name, std::filesystem::path archive);

}  // namespace kiroku::fleet
