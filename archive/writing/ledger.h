// An append-only file of lines with the Merkle tree over them (docs/reference/format.md, "Ledger entries"):
// what a case and the appliance log have in common. Knows nothing of what the lines say. Not thread-safe;
// other processes are kept off by a lock.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/storage/file_system.h"
#include "archive/storage/space_reserve.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

/// Somebody else holds a shared ledger's file: whoever may read it can lock it. Nothing was written.
class LedgerHeldError : public Error {
 public:
  using Error::Error;
};

class Ledger {
 public:
  /// kExclusive: one writer from open() to the end (a case). kShared: several processes take turns, each
  /// holding the file only while it appends (the appliance log).
  enum class Sharing { kExclusive, kShared };
  /// Called for every line found in the file and every line appended, in order, without its LF.
  using Visitor = std::function<void(std::uint64_t seq, std::string_view line)>;
  /// Lines to append, without LF, given how many there are; called once the file is ours and up to date.
  using MakeLines = std::function<std::vector<std::string>(std::uint64_t size)>;
  /// How many lines checkpoints cover. Asked only where zeros are found, or a torn line, also later.
  static constexpr std::uint64_t kNobodyKnows = std::numeric_limits<std::uint64_t>::max();
  using Covered = std::function<std::uint64_t()>;
  /// Whether a line counts only once a checkpoint covers it. Asked only of lines that none covers.
  using NeedsSignature = std::function<bool(std::string_view line)>;
  /// Puts `lines` in place of all that stands in the file from there on, durably. Throws kiroku::IoError;
  /// only some of them may stand there then.
  using Replace = std::function<void(const ReadableFile& lines)>;
  enum class Aside {
    kStays,
    kMayGo,    // it is kept elsewhere, or nobody misses it
    kReplaced  // by `replace`
  };
  /// What becomes of what stands in the file from byte `offset` on, where line number `seq` begins, which is
  /// no line of the format.
  using SetAside = std::function<Aside(std::uint64_t seq, std::uint64_t offset, const Replace& replace)>;

  /// Opens `file`, or makes it, with its name durable. A last line without LF is one whose writing a crash or
  /// power cut ended: nothing ever counted on it; it is cut off, and torn_bytes() tells. A power cut may also
  /// leave zeros where blocks of the last append were not flushed, and lines behind them that were: with
  /// `covered`, everything from the first line with a zero byte on is cut off, unless a checkpoint covers
  /// that line. So is everything from the first line on that `needs_signature` and has none: whoever can
  /// write to the disk could have put it there, and unsigned_bytes() tells. What stands from a line on that
  /// is longer than the format's is cut off where `set_aside` says so, also later; torn_bytes() tells. So is
  /// later what stands from a line on that holds a zero byte, and that no checkpoint covers; and where
  /// covered lines hold more zeros than are read, it is asked for those. Throws UsageError if another writer
  /// has it (kExclusive), kiroku::Error for such a line that stays, kiroku::IoError. `files` and `reserve`
  /// must outlive the object; `reserve` may be null.
  static std::unique_ptr<Ledger> open(FileSystem& files, std::filesystem::path file, Sharing sharing,
                                      SpaceReserve* reserve, Visitor visitor = {}, Covered covered = {},
                                      NeedsSignature needs_signature = {}, SetAside set_aside = {});
  Ledger(const Ledger&) = delete;
  Ledger& operator=(const Ledger&) = delete;

  /// Appends all lines with one write and one fdatasync. The line is only in the tree once it is durable. On
  /// a full disk the reserve is used; if that does not do, nothing of it stands in the file, IoError is
  /// thrown and a later append may succeed. After any other failure an exclusive ledger refuses everything; a
  /// shared one, which outlives many cases, is opened anew with the next turn: the lines of which nobody
  /// knows whether they reached the disk are cut off unless others built upon them, and the rest is read
  /// again.
  void append(const MakeLines& make_lines);

  /// kShared: has `tell` called whenever the file was read anew since lines of it stand elsewhere, or no
  /// more: lines before them may be others. Without it a ledger whose lines are others refuses everything. It
  /// must neither throw nor call the ledger.
  void when_read_anew(std::function<void()> tell) { tell_read_anew_ = std::move(tell); }
  /// kShared: takes in what other processes appended. (append() does so by itself.)
  void catch_up();
  /// kShared: takes the newest lines back, durably, until `size` are left, and calls the visitor anew, from
  /// the first line on, for those that stay. For lines that nobody counts on; torn_bytes() tells of them if
  /// `another` process left them. Throws kiroku::IoError.
  void take_back(std::uint64_t size, bool another);
  /// kShared: reads the whole file anew, and calls the visitor for all of it: lines that stood there are
  /// others now. Throws kiroku::Error.
  void read_again();
  /// Gives back the blocks allocated ahead; for a ledger that ends.
  void trim();

  [[nodiscard]] std::uint64_t size() const { return tree_.size(); }
  [[nodiscard]] crypto::Sha256Digest root() const { return tree_.root(); }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// Bytes of torn lines cut off, and of others' lines taken back, and not followed by a successful append()
  /// yet, which may state them: of more than an entry can state, so many.
  [[nodiscard]] std::uint64_t torn_bytes() const { return torn_bytes_; }
  /// Bytes cut off by open() since a line of them needs a signature and had none.
  [[nodiscard]] std::uint64_t unsigned_bytes() const { return unsigned_bytes_; }

  /// Of a shared one: how long a turn is waited for. Once nobody gave it for so long, the next ones wait a
  /// moment each until one is given.
  void wait_at_most(std::chrono::milliseconds patience) { patience_ = patience; }

  /// Holds the file of a shared ledger over several operations; may be nested. Does nothing for an exclusive
  /// one, which is held anyway.
  class Turn {
   public:
    /// Throws LedgerHeldError; kiroku::Error where a ledger that had failed cannot be opened anew.
    explicit Turn(Ledger& ledger);
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    ~Turn();

   private:
    Ledger& ledger_;
  };

 private:
  Ledger(FileSystem& files, std::filesystem::path file, Sharing sharing, SpaceReserve* reserve,
         Visitor visitor);
  void refuse_if_failed() const;
  void take_lock();
  /// With the lock, of a file that was opened anew.
  void repair();
  /// Whether the line that was read last is still where it was. Another process cuts off a line of its own
  /// that it could not flush, and this one may have read it before.
  [[nodiscard]] bool still_stands(const ReadableFile& input) const;
  void forget_lines();
  void read_anew();
  /// Those beyond `most` are cut off.
  void read_new_lines(std::optional<std::uint64_t> most = std::nullopt);
  [[noreturn]] void refuse_endless_zeros() const;
  [[noreturn]] void refuse_long_line() const;
  /// Of the next line, which is none of the format, up to byte `end`. True where nothing of it stands any
  /// more, and reading goes on with what does.
  bool is_put_aside(std::uint64_t end);
  void replace_end(const ReadableFile& lines);
  /// What was entered is not there any more, as `problem` says. Throws, unless somebody is told.
  void tell_or_refuse(const std::string& problem);
  /// Of the next line, which holds a zero byte. What is to be kept of it elsewhere is, then.
  [[nodiscard]] bool is_cut_off_for_zeros();
  /// The next line, by a checkpoint.
  [[nodiscard]] bool is_covered();
  [[nodiscard]] bool is_surely_covered();
  [[nodiscard]] bool lacks_signature(std::string_view line) const;
  /// Cuts off what stands behind the last accepted line.
  void cut_end();
  void cut_torn_line(std::uint64_t end);
  void accept(std::string_view line);
  void write_durably(std::string_view text);
  void undo_write(std::string_view text);
  void allocate_ahead(std::uint64_t coming);

  FileSystem* files_;
  std::filesystem::path file_;
  Sharing sharing_;
  SpaceReserve* reserve_;
  Visitor visitor_;
  // Only while the file is opened: later nobody finds what a power cut left.
  Covered covered_;
  Covered covered_when_opened_;  // for when it is opened anew, and for zeros that are found later
  std::optional<std::uint64_t> covered_size_;  // while lines are read: what it says, once it was asked
  NeedsSignature needs_signature_;
  SetAside set_aside_;
  std::function<void()> tell_read_anew_;  // may be null
  int replaced_ = 0;                      // so often while lines are read
  std::unique_ptr<WritableFile> written_;
  crypto::MerkleFrontier tree_;
  std::uint64_t bytes_ = 0;            // of whole lines in the tree
  std::uint64_t allocated_until_ = 0;  // no allocation is asked for before bytes_ comes near
  std::uint64_t torn_bytes_ = 0;
  std::uint64_t unsigned_bytes_ = 0;
  unsigned turns_ = 0;   // nested holders of the lock
  std::string failure_;  // once set, every call is refused with it, of a shared ledger until the next turn
  std::string unsure_;   // what was written last, where nobody knows whether it reached the disk
  struct Known {
    std::uint64_t size = 0;
    crypto::Sha256Digest root{};
  };
  std::optional<Known> known_;  // what must stand in the file again
  // Of a shared one:
  std::optional<Known> mine_;  // after the last lines that were appended by this object
  std::string last_line_;      // that was read or appended
  std::chrono::milliseconds patience_ = std::chrono::seconds(10);
  bool is_held_up_ = false;
};

}  // namespace kiroku::archive
