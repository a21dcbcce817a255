// Cases that are being watched, each opened with the identities of the session that watches it. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "viewer/people/session.h"
#include "viewer/playback/case_place.h"
#include "viewer/playback/case_playback.h"
#include "viewer/playback/encrypted_cache.h"
#include "viewer/playback/single_flight.h"

namespace kiroku::viewer {

/// Keeps a case open while its session watches it, and lets go of it, keys and all, within a second of the
/// session's being locked or ended.
class PlaybackStore {
 public:
  using Playback = std::shared_ptr<playback::CasePlayback>;

  /// Of all people together. Whoever has the most open gives up the one that was used longest ago.
  static constexpr std::size_t kMostOpen = 12;

  /// Viewing copies go to `folder`. Throws kiroku::IoError if it cannot be used.
  PlaybackStore(const std::filesystem::path& folder, std::uint64_t most_bytes,
                const Clock& clock = Clock::system());
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
  };

  /// What is there already; null if nothing is.
  Playback find(const std::shared_ptr<Session>& session, const Session::Identities& identities,
                const std::filesystem::path& folder);
  /// Whose place the next one takes; there are some.
  std::list<Watched>::iterator next_to_go();
  void sweep();
  void run();

  const std::shared_ptr<playback::EncryptedCache> cache_;
  const Clock& clock_;
  playback::SingleFlight<Playback> opening_;
  std::mutex mutex_;  // guards the three below
  std::condition_variable wake_;
  std::list<Watched> watched_;  // what was used last in front
  bool stopping_ = false;
  std::thread sweeper_;
};

}  // namespace kiroku::viewer
