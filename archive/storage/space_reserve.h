// Space kept back on the disk so that a full disk can still state the gap and close: a file that holds real
// blocks and gives them up, step by step, when a small durable write (ledger line, note, token) finds none.
// Thread-safe; several processes may share one file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>

#include "archive/storage/file_system.h"

namespace kiroku::archive {

class SpaceReserve {
 public:
  /// A case's whole remaining paperwork is a few dozen kilobytes.
  static constexpr std::uint64_t kBytes = 8U << 20U;
  /// Given up at a time, so that a video stream that still writes cannot take all of it at once.
  static constexpr std::uint64_t kStep = 1U << 20U;

  /// Touches nothing until asked. By custom the file is `<archive>/.reserve`.
  SpaceReserve(FileSystem& files, std::filesystem::path file);

  /// Allocates what is missing. Throws kiroku::IoError where the disk is full.
  void fill();
  /// Gives kStep back to the file system; false if nothing is left to give.
  bool release_step();

  /// Runs a small write; each time the disk is full, gives up a step and runs it again, so `write` must undo
  /// what it did before it throws. A SyncError is passed on at once.
  template <typename Write>
  void support(Write write) {
    for (;;) {
      try {
        write();
        return;
      } catch (const SyncError&) {
        throw;
      } catch (const IoError& error) {
        if (!error.disk_full() || !release_step()) {
          throw;
        }
      }
    }
  }
  /// FileSystem::write_durably, supported.
  void write_durably(const std::filesystem::path& file, ByteView bytes);

 private:
  FileSystem* files_;
  std::filesystem::path file_;
  std::mutex mutex_;
};

/// Where an archive keeps its reserve.
std::filesystem::path reserve_file(const std::filesystem::path& archive);

}  // namespace kiroku::archive
