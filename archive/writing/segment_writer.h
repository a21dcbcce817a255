// One sealed segment file being written (docs/reference/format.md, "Segments"). The object belongs to one
// thread at a time, except where stated; the hand-over from the encoder's thread to the one that makes files
// durable is the caller's.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "archive/format/ledger_entry.h"
#include "base/bytes.h"
#include "crypto/age_recipient.h"

namespace kiroku::archive {

class FileSystem;

/// Seals plaintext with age into `<name>.part`, hashing the ciphertext as it goes; durable and renamed by
/// commit(). Every sealed chunk (64 KiB) goes to the kernel at once, so that a killed program loses only the
/// chunk that was not full yet; write-back to the disk is begun every few MiB, so that commit() finds little
/// left to do.
class SegmentWriter {
 public:
  /// `final_path` is the segment's path; its folder must exist. `relative` is what the ledger calls it.
  SegmentWriter(FileSystem& files, std::filesystem::path final_path, std::string relative,
                const crypto::AgeRecipients& recipients);
  ~SegmentWriter();  // an uncommitted file stays as .part
  SegmentWriter(const SegmentWriter&) = delete;
  SegmentWriter& operator=(const SegmentWriter&) = delete;

  /// Seals and writes. Throws kiroku::IoError (disk full); the writer is then good for salvage() only.
  void write(ByteView plaintext);
  /// Seals the last chunk and writes it: nothing may be written after. Fast, does not wait for the disk.
  void seal();
  /// fdatasync of what was written so far; the first time also fsync of the folder, for the part's name. May
  /// be called from one other thread while write() runs, not while commit() or salvage() does. After it
  /// failed, everything is refused.
  void sync();
  /// After seal(): fsync, rename to the final name, fsync of the folder. Only then the ledger may name it.
  FileReference commit();
  /// After a failed write: makes durable what is in the `.part` file and returns its reference (for an entry
  /// with complete = false), hashed from the file's own bytes; nothing if no picture can be in it, and then
  /// the file is removed. Not after a failed flush: what the disk holds is unknown then.
  std::optional<FileReference> salvage();
  [[nodiscard]] std::uint64_t bytes() const;  // ciphertext so far; from any thread
  [[nodiscard]] std::uint64_t plaintext_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::archive
