// A file system that plays faults: it passes everything on to the real one, keeps lists of the calls that
// write and of those that read, and on request lets one fail, stops those that write as a kill would, or
// takes back what was never flushed as a power cut would. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"

namespace kiroku::test {

/// Thrown instead of a call that a killed program never made. No kiroku::Error, so that nothing handles it.
class Killed : public std::runtime_error {
 public:
  Killed() : std::runtime_error("killed") {}
};

class FaultFileSystem final : public archive::FileSystem {
 public:
  /// Paths in calls() are relative to `root`.
  explicit FaultFileSystem(std::filesystem::path root);

  /// One line a call, in order: "create a", "open a", "write a 120", "sync a", "sync_all a", "reserve a 100",
  /// "writeback a", "truncate a 0", "rename a b", "remove a", "make_folder d", "sync_folder d", "lock a".
  [[nodiscard]] std::vector<std::string> calls() const;
  void forget_calls();
  /// How many calls there were since the beginning or forget_calls().
  [[nodiscard]] std::size_t count() const { return calls().size(); }

  /// After `spared` calls that begin with `prefix` ("write", "sync a") and pass, `times` of them fail with
  /// `error_number`. A failing write leaves half of its bytes in the file. Until heal().
  void fail(std::string prefix, int error_number, std::size_t spared = 0,
            std::size_t times = std::numeric_limits<std::size_t>::max());
  /// What becomes of a call that reads.
  enum class ReadFault {
    kFails,     // EIO
    kHalf,      // half of the bytes, at least one, as a signal may leave it; of other calls: nothing
    kEndsEarly  // 0 bytes, as if the file ended here; of other calls: nothing
  };
  /// One line a call, in order: "open a", "read a 4096 100" (offset, bytes asked for), "examine a", "list d".
  [[nodiscard]] std::vector<std::string> reads() const;
  void forget_reads();
  /// After `spared` calls that read, begin with `prefix` and pass, `times` of them come out so. Until heal().
  void fail_reading(std::string prefix, ReadFault fault, std::size_t spared = 0,
                    std::size_t times = std::numeric_limits<std::size_t>::max());
  /// How many calls came out so since fail_reading().
  [[nodiscard]] std::size_t faults_played() const;

  /// The call number `at` from now (0: the next) is not made, except that a write leaves half of its bytes;
  /// it and all later ones throw Killed.
  void kill_at(std::size_t at);
  /// No fault from now on.
  void heal();
  /// What is on the disk after a power cut: names and bytes that were never flushed are gone, renames whose
  /// folder was not flushed are undone.
  void lose_power();

  std::unique_ptr<archive::WritableFile> create(const std::filesystem::path& file) override;
  std::unique_ptr<archive::WritableFile> append_to(const std::filesystem::path& file) override;
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override;
  void remove(const std::filesystem::path& file) override;
  void make_folder(const std::filesystem::path& folder) override;
  void sync_folder(const std::filesystem::path& folder) override;

  int open_at(int folder, const std::string& name, int flags,
              const std::filesystem::path& path) const override;
  ssize_t read_at(int descriptor, std::uint64_t offset, std::span<std::byte> into,
                  const std::filesystem::path& path) const override;
  int status_at(int folder, const std::string& name, struct stat& status,
                const std::filesystem::path& path) const override;
  const dirent* next_name(DIR* folder, const std::filesystem::path& path) const override;

 private:
  class File;
  /// What of a file is on the disk.
  struct Content {
    std::uint64_t flushed_bytes = 0;
  };
  struct Rename {
    std::filesystem::path from, to;
    std::optional<std::string> replaced;  // what stood there under that name
  };
  enum class Outcome { kDo, kFail };

  /// Enters the call and says what becomes of it; throws Killed.
  Outcome enter(const std::string& call);
  /// The same for a call that reads: what is to become of it, or nothing where it passes.
  std::optional<ReadFault> enter_reading(const std::string& call) const;
  std::string relative(const std::filesystem::path& path) const;
  std::shared_ptr<Content> content_of(const std::filesystem::path& file);
  void move_known_paths(const std::filesystem::path& from, const std::filesystem::path& to);

  std::filesystem::path root_;
  archive::FileSystem& real_;
  mutable std::mutex mutex_;
  std::vector<std::string> calls_;
  std::string failing_prefix_;
  int error_number_ = 0;
  std::size_t spared_ = 0;
  std::size_t failures_left_ = 0;
  std::optional<std::size_t> calls_until_kill_;
  bool killed_ = false;
  struct Reads {
    std::vector<std::string> calls;
    std::string failing_prefix;
    ReadFault fault = ReadFault::kFails;
    std::size_t spared = 0, failures_left = 0, played = 0;
  };
  mutable Reads reads_;
  std::map<std::filesystem::path, std::shared_ptr<Content>> contents_;
  std::vector<std::filesystem::path> unflushed_names_;  // files and folders, oldest first
  std::vector<Rename> unflushed_renames_;
};

}  // namespace kiroku::test
