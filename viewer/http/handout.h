// Files made for one download: they lie under a name for as long as they are being made, in a folder that is
// the server's alone, and then only for as long as somebody reads them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "viewer/http/own_folder.h"
#include "viewer/http/response.h"

namespace kiroku::viewer {

/// The folder, and which names are free in it. Thread-safe.
class Handouts {
 public:
  /// Makes a folder of its own in `parent` (own_folder.h). Throws kiroku::IoError.
  explicit Handouts(const std::filesystem::path& parent);

  /// A folder for one file in the making; it and everything in it is removed with the object.
  class Place {
   public:
    explicit Place(std::filesystem::path folder);
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

   private:
    std::filesystem::path folder_;
  };
  /// Refusal 507 where less than `bytes` and what a recorder should always have would be free.
  [[nodiscard]] std::shared_ptr<const Place> make_place(std::uint64_t bytes) const;

 private:
  OwnFolder own_;
};

/// The file's bytes, which stay readable when its name is gone. Throws kiroku::IoError.
FileBody open_body(const std::filesystem::path& file);

}  // namespace kiroku::viewer
