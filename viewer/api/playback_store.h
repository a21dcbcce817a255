// Cases that are being watched, each opened with the identities of the session that watches it. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "viewer/http/file_stamp.h"
#include "viewer/people/session.h"
#include "viewer/playback/case_place.h"
#include "viewer/playback/case_playback.h"
#include "viewer/playback/encrypted_cache.h"
#include "viewer/playback/single_flight.h"

namespace kiroku::viewer {

/// Keeps a case open while its session watches it, and lets go of it, keys and all, within a second of the
/// session's being locked or ended. A case may be erased meanwhile: one whose ledger says more than when it
/// was opened is not shown as it was, and within a second its copies are gone, too.
class PlaybackStore {
 public:
  using Playback = std::shared_ptr<playback::CasePlayback>;

  /// Of all people together. Whoever has the most open gives up the one that was used longest ago.
  static constexpr std::size_t kMostOpen = 12;
  /// Cases of which copies are kept.
  static constexpr std::size_t kMostCopied = 256;

  using StampOf = std::function<FileStamp(const std::filesystem::path& file)>;

  /// Viewing copies go to `folder`. Throws kiroku::IoError if it cannot be used.
  PlaybackStore(const std::filesystem::path& folder, std::uint64_t most_bytes,
                const Clock& clock = Clock::system(), StampOf stamp_of = file_stamp);
  ~PlaybackStore();
  PlaybackStore(const PlaybackStore&) = delete;
  PlaybackStore& operator=(const PlaybackStore&) = delete;

  /// The case at `place`, opened with `identities`, which are the session's now. One that is still being
  /// recorded is opened anew now and then. Throws kiroku::Error if it cannot be read.
  Playback open(const std::shared_ptr<Session>& session, const Session::Identities& identities,
                const playback::CasePlace& place);

 private:
  struct Watched {
    std::weak_ptr<Session> session;
    std::string person;
    std::weak_ptr<const crypto::AgeIdentities> identities;
    std::filesystem::path folder;
    Playback playback;
    Clock::Time opened;
    FileStamp ledger;  // as it was when it was read, or before
  };
  /// A case of which there may be copies.
  struct Copied {
    FileStamp ledger;
    bool is_closed = false;
  };
  /// Let go of while somebody may still use it, and so still make copies.
  struct Leaving {
    std::weak_ptr<playback::CasePlayback> playback;
    std::filesystem::path folder;
  };

  /// What is there already; null if nothing is.
  Playback find(const std::shared_ptr<Session>& session, const Session::Identities& identities,
                const std::filesystem::path& folder);
  /// Whose place the next one takes; there are some.
  std::list<Watched>::iterator next_to_go();
  void sweep();
  /// Lets go of cases of which something may have been erased, and of their copies.
  void let_go_of_changed();
  [[nodiscard]] std::vector<std::filesystem::path> changed();
  /// Each is looked at once a second: where they are too many, those that nobody watches.
  [[nodiscard]] std::vector<std::filesystem::path> beyond_most_copied();
  [[nodiscard]] FileStamp ledger_of(const std::filesystem::path& folder) const;
  void each_second(void (PlaybackStore::*work)());

  const std::shared_ptr<playback::EncryptedCache> cache_;
  const Clock& clock_;
  const StampOf stamp_of_;
  playback::SingleFlight<Playback> opening_;
  std::mutex mutex_;  // guards what follows, but for the threads
  std::condition_variable wake_;
  std::list<Watched> watched_;  // what was used last in front
  std::map<std::filesystem::path, Copied> copied_;
  std::vector<Leaving> leaving_;
  bool stopping_ = false;
  /// Two: an archive that hangs, as one on a network does, must keep no keys of a session that was locked.
  std::thread sweeper_, looker_;
};

}  // namespace kiroku::viewer
