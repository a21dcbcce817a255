// A file system that remembers every write, flush and change of a name, passes all of them on to the real
// one, and afterwards makes the folder that a disk may give back when power fails at any moment of that
// history. What was flushed is there. Of what was not, each block of 4096 bytes, each size and each name is
// there or not by chance, so that a file may have its full length and zeros in it. Thread-safe while it
// records.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"

namespace kiroku::test {

/// Which names outlast a power cut, of those that no flush of their folder covers.
enum class Names {
  kInOrder,       // one journal: all changes up to a moment (ext4, XFS)
  kEachForItself  // each folder up to a moment of its own, as POSIX allows (btrfs flushes by folder)
};

class PowerCutFileSystem final : public archive::FileSystem {
 public:
  /// What lies in `root` now counts as flushed.
  explicit PowerCutFileSystem(std::filesystem::path root);

  /// How many steps the history has. A power cut comes after any number of them.
  [[nodiscard]] std::size_t steps() const;
  /// Numbers of steps after which at least so many bytes of one file are not flushed.
  [[nodiscard]] std::vector<std::size_t> steps_with_unflushed(std::uint64_t bytes) const;
  /// Fills the empty folder `target` with what the disk may hold if power failed after `steps` steps. Equal
  /// seeds give equal folders.
  void cut_power(std::size_t steps, std::uint64_t seed, Names names,
                 const std::filesystem::path& target) const;
  /// Bytes of each file that were flushed after `steps` steps under a name that was flushed, by its path
  /// below the root.
  [[nodiscard]] std::map<std::filesystem::path, std::uint64_t> flushed(std::size_t steps) const;

  std::unique_ptr<archive::WritableFile> create(const std::filesystem::path& file) override;
  std::unique_ptr<archive::WritableFile> append_to(const std::filesystem::path& file) override;
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override;
  void remove(const std::filesystem::path& file) override;
  void make_folder(const std::filesystem::path& folder) override;
  void sync_folder(const std::filesystem::path& folder) override;

 private:
  class File;
  class Disk;
  using Node = std::size_t;  // a file or folder, whatever it is called
  enum class Kind { kWrite, kTruncate, kFlush, kLink, kUnlink, kRename, kFlushFolder };
  struct Step {
    Kind kind = Kind::kWrite;
    Node node = 0;  // the file; of names the folder
    std::uint64_t place =
        0;                 // kWrite: offset; kTruncate: size; flushes: how many steps came before their call
    Bytes bytes;           // kWrite
    std::string name;      // kLink, kUnlink, kRename
    Node other = 0;        // kLink: what the name is of; kRename: the folder it goes to
    std::string new_name;  // kRename
  };

  [[nodiscard]] std::size_t all_steps() const;
  Node new_node(bool is_folder);
  [[nodiscard]] Node node_of(const std::filesystem::path& path) const;
  void import(const std::filesystem::path& folder, Node node);

  std::filesystem::path root_;
  archive::FileSystem& real_;
  mutable std::mutex mutex_;
  std::vector<Step> history_;
  std::size_t imported_ = 0;                   // steps that made what lay there
  std::vector<bool> is_folder_;                // by node; the root is 0
  std::vector<std::uint64_t> sizes_;           // by node, as of now
  std::map<std::filesystem::path, Node> now_;  // what each path is of, as of now
};

}  // namespace kiroku::test
