#include "witness/tiles.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <utility>

#include "archive/format/case_folder.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"
#include "witness/http_exchange.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;

constexpr unsigned kLevelBits = 8;  // a full tile stands for one hash eight levels higher

void make_folders(archive::FileSystem& files, const fs::path& below, const fs::path& relative) {
  fs::path folder = below;
  for (const fs::path& part : relative) {
    folder /= part;
    if (files.exists(folder)) continue;
    files.make_folder(folder);
    files.sync_folder(folder.parent_path());
  }
}

/// In groups of three digits, all but the last with an x before it.
std::string index_path(std::uint64_t index) {
  constexpr std::uint64_t kGroup = 1000;
  std::array<char, 8> digits{};
  std::snprintf(digits.data(), digits.size(), "%03u", static_cast<unsigned>(index % kGroup));
  std::string path = digits.data();
  for (index /= kGroup; index > 0; index /= kGroup) {
    std::snprintf(digits.data(), digits.size(), "x%03u/", static_cast<unsigned>(index % kGroup));
    path.insert(0, digits.data());
  }
  return path;
}

crypto::Sha256Digest root_of(const std::vector<crypto::Sha256Digest>& hashes) {
  crypto::MerkleFrontier tree;
  for (const crypto::Sha256Digest& hash : hashes) tree.append(hash);
  return tree.root();
}

class FolderTiles final : public TileSource {
 public:
  explicit FolderTiles(const fs::path& folder) : folder_(archive::CaseFolder::open(folder)) {}
  [[nodiscard]] std::optional<Bytes> read(const std::string& path, std::size_t most) const override {
    const archive::FileOpening opening = folder_.open_file(path);
    if (!opening.file) {
      if (opening.problem == archive::FileProblem::kMissing) return std::nullopt;
      throw Error((folder_.path() / path).string() + " " + opening.explanation);
    }
    const std::optional<std::string> text = archive::read_small(*opening.file, most);
    if (!text)
      throw Error((folder_.path() / path).string() + " has more than " + std::to_string(most) + " bytes");
    const ByteView bytes = bytes_of(*text);
    return Bytes(bytes.begin(), bytes.end());
  }

 private:
  archive::CaseFolder folder_;
};

class HttpTiles final : public TileSource {
 public:
  HttpTiles(std::string address, std::chrono::milliseconds time_limit)
      : address_(std::move(address)), exchange_(time_limit) {
    if (!address_.ends_with('/')) address_ += '/';
  }
  [[nodiscard]] std::optional<Bytes> read(const std::string& path, std::size_t most) const override {
    constexpr long kFound = 200, kNotFound = 404;
    const std::string address = address_ + path;
    HttpReply reply;
    try {
      reply = exchange_.get(address, most);
    } catch (const Error& error) {
      throw Error(address + " " + error.what());
    }
    if (reply.status == kNotFound) return std::nullopt;
    if (reply.status != kFound) throw Error(address + " answered " + std::to_string(reply.status));
    const ByteView bytes = bytes_of(reply.body);
    return Bytes(bytes.begin(), bytes.end());
  }

 private:
  std::string address_;
  HttpExchange exchange_;
};

class TreeTiles final : public TileSource {
 public:
  explicit TreeTiles(const LogToShow& log) : log_(&log) {
    for (std::uint64_t first = 0; first < log.checkpoint.size; first += kTileWidth) {
      const std::uint64_t last = std::min(first + kTileWidth, log.checkpoint.size);
      paths_.emplace(tile_path(0, first / kTileWidth, last - first), first);
    }
  }
  [[nodiscard]] std::optional<Bytes> read(const std::string& path, std::size_t) const override {
    if (path == kPublishedCheckpoint) {
      const ByteView bytes = bytes_of(log_->note);
      return Bytes(bytes.begin(), bytes.end());
    }
    const auto found = paths_.find(path);
    if (found == paths_.end()) return std::nullopt;
    Bytes tile;
    const std::uint64_t last = std::min(found->second + kTileWidth, log_->checkpoint.size);
    for (std::uint64_t leaf = found->second; leaf < last; ++leaf) {
      const crypto::Sha256Digest& hash = log_->tree.leaf(leaf);
      tile.insert(tile.end(), hash.begin(), hash.end());
    }
    return tile;
  }

 private:
  const LogToShow* log_;
  std::map<std::string, std::uint64_t> paths_;  // of level 0, and the first leaf of each
};

/// A tile of level 0 with at least `width` hashes. One that is full by now has taken the place of its
/// beginning.
Bytes leaf_tile(const TileSource& source, std::uint64_t index, std::uint64_t width) {
  constexpr std::size_t kFullBytes = kTileWidth * sizeof(crypto::Sha256Digest);
  const std::string path = tile_path(0, index, width);
  std::optional<Bytes> tile = source.read(path, kFullBytes);
  std::uint64_t expected = width;
  if (!tile && width < kTileWidth) {
    tile = source.read(tile_path(0, index), kFullBytes);
    expected = kTileWidth;
  }
  if (!tile) throw Error("the tile " + path + " is not there");
  if (tile->size() != expected * sizeof(crypto::Sha256Digest))
    throw Error("the tile " + path + " has " + std::to_string(tile->size()) +
                " bytes, which no such tile has");
  return std::move(*tile);
}

}  // namespace

std::string tile_path(unsigned level, std::uint64_t index, std::uint64_t width) {
  return "tile/" + std::to_string(level) + "/" + index_path(index) +
         (width < kTileWidth ? ".p/" + std::to_string(width) : "");
}

std::unique_ptr<TileSource> tiles_in_folder(const fs::path& folder) {
  return std::make_unique<FolderTiles>(folder);
}
std::unique_ptr<TileSource> tiles_over_http(std::string address, std::chrono::milliseconds time_limit) {
  return std::make_unique<HttpTiles>(std::move(address), time_limit);
}
std::unique_ptr<TileSource> tiles_of(const LogToShow& log) { return std::make_unique<TreeTiles>(log); }

void for_each_leaf(const TileSource& source, std::uint64_t size, std::uint64_t first, std::uint64_t last,
                   const std::function<void(const crypto::Sha256Digest&)>& visit) {
  while (first < last) {
    const std::uint64_t index = first / kTileWidth;
    const std::uint64_t begin = index * kTileWidth;
    const Bytes tile = leaf_tile(source, index, std::min(kTileWidth, size - begin));
    for (const std::uint64_t end = std::min(begin + kTileWidth, last); first < end; ++first) {
      crypto::Sha256Digest leaf;
      const auto* from = tile.data() + (first - begin) * leaf.size();
      std::copy(from, from + leaf.size(), leaf.begin());
      visit(leaf);
    }
  }
}

void TileWriter::append(const crypto::Sha256Digest& leaf) {
  crypto::Sha256Digest hash = leaf;
  for (unsigned level = 0;; ++level) {
    if (level == levels_.size()) levels_.emplace_back();
    Level& at = levels_[level];
    at.hashes.push_back(hash);
    if (at.hashes.size() < kTileWidth) return;
    const bool is_known = at.full < known_ >> (kLevelBits * (level + 1));
    if (!is_known) write(level, at.full, at.hashes);
    hash = root_of(at.hashes);
    at.hashes.clear();
    ++at.full;
  }
}

void TileWriter::finish() {
  for (unsigned level = 0; level < levels_.size(); ++level) {
    const Level& at = levels_[level];
    if (!at.hashes.empty()) write(level, at.full, at.hashes);
  }
}

void TileWriter::write(unsigned level, std::uint64_t index, const std::vector<crypto::Sha256Digest>& hashes) {
  const fs::path file = folder_ / tile_path(level, index, hashes.size());
  make_folders(files_, folder_, fs::path(tile_path(level, index, hashes.size())).parent_path());
  Bytes bytes;
  bytes.reserve(hashes.size() * sizeof(crypto::Sha256Digest));
  for (const crypto::Sha256Digest& hash : hashes) bytes.insert(bytes.end(), hash.begin(), hash.end());
  files_.write_durably(file, bytes);
  if (hashes.size() == kTileWidth) {
    const fs::path beginnings = folder_ / (tile_path(level, index) + ".p");
    if (files_.is_folder(beginnings)) archive::remove_tree(files_, beginnings);
  }
}

}  // namespace kiroku::witness
