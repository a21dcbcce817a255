// The tree of a log as files that any web server can give out (C2SP tlog-tiles.md): hashes in tiles, and the
// newest checkpoint. The bundles of entries that the specification has beside them are left out: entries name
// users and cases. Functions and sources are used by one thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/storage/file_system.h"
#include "base/bytes.h"
#include "crypto/hash.h"
#include "witness/cosigning.h"

namespace kiroku::witness {

inline constexpr std::uint64_t kTileWidth = 256;  // hashes in a full tile
inline constexpr std::string_view kPublishedCheckpoint = "checkpoint";
/// A log of more entries is not read: their hashes are held in memory. An appliance makes some 200,000 a
/// year.
inline constexpr std::uint64_t kMostPublishedEntries = 1U << 24;

/// "tile/0/x001/x234/067"; with fewer hashes than a full one "tile/0/x001/x234/067.p/12".
std::string tile_path(unsigned level, std::uint64_t index, std::uint64_t width = kTileWidth);

/// Where a log is published. Whoever runs it may be an adversary: what comes is no more than bytes.
class TileSource {
 public:
  virtual ~TileSource() = default;
  /// The file's bytes; nothing where it is not there. Throws kiroku::Error where it cannot be read or has
  /// more than `most` bytes.
  [[nodiscard]] virtual std::optional<Bytes> read(const std::string& path, std::size_t most) const = 0;
};
/// Links in it are not followed. Throws kiroku::UsageError if there is no such folder.
std::unique_ptr<TileSource> tiles_in_folder(const std::filesystem::path& folder);
/// Below an address of http or https. `time_limit` is each file's.
std::unique_ptr<TileSource> tiles_over_http(std::string address,
                                            std::chrono::milliseconds time_limit = std::chrono::seconds(10));
/// Made of a log itself, which must outlive it.
std::unique_ptr<TileSource> tiles_of(const LogToShow& log);

/// Visits the leaf hashes [first, last) of a log that was published with `size` entries, in order. Throws
/// kiroku::Error where a tile is not there or has another length.
void for_each_leaf(const TileSource& source, std::uint64_t size, std::uint64_t first, std::uint64_t last,
                   const std::function<void(const crypto::Sha256Digest&)>& visit);

/// Writes a tree's tiles into a folder, leaf by leaf. Of full tiles only those are written that a tree of
/// `known` leaves did not have; what it had of them is removed.
class TileWriter {
 public:
  TileWriter(archive::FileSystem& files, std::filesystem::path folder, std::uint64_t known)
      : files_(files), folder_(std::move(folder)), known_(known) {}
  void append(const crypto::Sha256Digest& leaf);
  /// The tiles that are not full yet.
  void finish();

 private:
  struct Level {
    std::vector<crypto::Sha256Digest> hashes;  // of the tile that is being filled
    std::uint64_t full = 0;                    // tiles before it
  };
  void write(unsigned level, std::uint64_t index, const std::vector<crypto::Sha256Digest>& hashes);

  archive::FileSystem& files_;
  std::filesystem::path folder_;
  std::uint64_t known_;
  std::vector<Level> levels_;
};

}  // namespace kiroku::witness
