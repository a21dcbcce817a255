// Files made for one download: they lie under a name for as long as they are being made, in a folder that is
// the server's alone, and then only for as long as somebody reads them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>

#include "viewer/http/own_folder.h"
#include "viewer/http/response.h"

namespace kiroku::viewer {

/// The folder, and which names are free in it. Thread-safe.
class Handouts {
 public:
  /// Makes a folder of its own in `parent` (own_folder.h). Throws kiroku::IoError.
  explicit Handouts(const std::filesystem::path& parent);

  /// What files in the making may still take.
  struct Promised {
    std::mutex mutex;
    std::uint64_t bytes = 0;
  };
  /// A folder for one file in the making; it and everything in it is removed with the object.
  class Place {
   public:
    Place(std::filesystem::path folder, std::shared_ptr<Promised> promised, std::uint64_t bytes);
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
    /// What it takes of the disk is on it now.
    void is_made();

   private:
    std::filesystem::path folder_;
    const std::shared_ptr<Promised> promised_;
    std::uint64_t bytes_;  // still promised
  };
  /// Refusal 507 where less than `bytes`, what others were promised, and what a recorder should always have
  /// would be free.
  [[nodiscard]] std::shared_ptr<Place> make_place(std::uint64_t bytes);

 private:
  const std::shared_ptr<Promised> promised_ = std::make_shared<Promised>();
  OwnFolder own_;
};

/// The file's bytes, which stay readable when its name is gone. Throws kiroku::IoError.
FileBody open_body(const std::filesystem::path& file);

}  // namespace kiroku::viewer
