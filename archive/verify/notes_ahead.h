// Opens signed notes ahead of whoever judges them one after the other: a signature takes longer than all else
// about a note, and no note waits for another's.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// A note as it was read, and the hash of its bytes.
struct ReadNote {
  crypto::OpenedNote opened;
  crypto::Sha256Digest hash;
};

/// Used by one thread, which opens notes like the others while the one that it asks for is not ready.
class NotesAhead {
 public:
  /// Nothing where the note cannot be had; called from several threads.
  using Open = std::function<std::optional<ReadNote>(std::uint64_t size)>;

  /// `sizes`: of the notes, ascending. `threads`: of all that open them, the asking one among them.
  NotesAhead(std::vector<std::uint64_t> sizes, std::size_t threads, Open open);
  ~NotesAhead();
  NotesAhead(const NotesAhead&) = delete;
  NotesAhead& operator=(const NotesAhead&) = delete;

  /// The note of this size, once. Sizes are asked for in rising order; one that is left out is given up.
  /// Nothing where it cannot be had, or is none of the sizes. Throws what opening it threw.
  std::optional<ReadNote> take(std::uint64_t size);

 private:
  /// One that is being opened, or was.
  struct Place {
    bool ready = false;
    std::optional<ReadNote> note;
    std::exception_ptr failure;
  };
  [[nodiscard]] Place& place_of(std::size_t index) { return places_[index % places_.size()]; }
  /// Notes wait for whoever asks, and they may be large: so many at most.
  [[nodiscard]] bool has_room() const { return begun_ < sizes_.size() && begun_ < given_ + places_.size(); }
  /// Opens the next note; the lock is free meanwhile.
  void open_next(std::unique_lock<std::mutex>& lock);
  void work();

  const std::vector<std::uint64_t> sizes_;
  const Open open_;
  std::mutex mutex_;
  std::condition_variable room_, ready_;
  std::vector<Place> places_;  // a ring
  std::size_t begun_ = 0;      // notes that are being opened or were
  std::size_t given_ = 0;      // notes that were asked for or left out
  bool stopped_ = false;
  std::vector<std::jthread> workers_;  // last: use the rest
};

}  // namespace kiroku::archive
