#include "viewer/api/playback_store.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

namespace kiroku::viewer {
namespace {

constexpr std::chrono::seconds kSweepEvery{1};
constexpr std::chrono::seconds kOpenCaseStays{15};

}  // namespace

PlaybackStore::PlaybackStore(const std::filesystem::path& folder, std::uint64_t most_bytes,
                             const Clock& clock)
    : cache_(std::make_shared<playback::EncryptedCache>(folder, most_bytes)),
      clock_(clock),
      sweeper_([this] { run(); }) {}

PlaybackStore::~PlaybackStore() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  sweeper_.join();
}

PlaybackStore::Playback PlaybackStore::find(const std::shared_ptr<Session>& session,
                                            const Session::Identities& identities,
                                            const std::filesystem::path& folder) {
  const std::lock_guard guard(mutex_);
  const auto found = std::ranges::find_if(watched_, [&](const Watched& watched) {
    return watched.folder == folder && watched.session.lock() == session &&
           watched.identities.lock() == identities;
  });
  if (found == watched_.end()) return nullptr;
  const bool is_stale =
      !found->playback->recording().closing() && clock_.now() - found->opened > kOpenCaseStays;
  if (is_stale) return nullptr;
  watched_.splice(watched_.begin(), watched_, found);
  return found->playback;
}

PlaybackStore::Playback PlaybackStore::open(const std::shared_ptr<Session>& session,
                                            const Session::Identities& identities,
                                            const playback::CasePlace& place) {
  const std::filesystem::path& folder = place.folder;
  if (Playback playback = find(session, identities, folder)) return playback;
  const std::string name = std::to_string(reinterpret_cast<std::uintptr_t>(identities.get())) + " " +
                           std::to_string(reinterpret_cast<std::uintptr_t>(session.get())) + " " +
                           folder.string();
  return opening_.get(name, [&] {
    if (Playback playback = find(session, identities, folder)) return playback;
    auto playback =
        std::make_shared<playback::CasePlayback>(place.read(), *identities, cache_, place.segments);
    std::list<Watched> gone;  // ends outside the lock: what it does in the background is waited for
    const std::lock_guard guard(mutex_);
    for (auto each = watched_.begin(); each != watched_.end();) {
      const auto at = each++;
      if (at->folder == folder && at->session.lock() == session) gone.splice(gone.end(), watched_, at);
    }
    watched_.push_front({session, session->person(), identities, folder, playback, clock_.now()});
    if (watched_.size() > kMostOpen) gone.splice(gone.end(), watched_, next_to_go());
    return playback;
  });
}

// Whoever opened many cases gives up one of theirs: nobody pushes another's out by opening more.
std::list<PlaybackStore::Watched>::iterator PlaybackStore::next_to_go() {
  std::map<std::string, std::size_t> open_of;
  std::size_t most = 0;
  for (const Watched& each : watched_) most = std::max(most, ++open_of[each.person]);
  auto last = std::prev(watched_.end());
  while (open_of[last->person] < most) --last;
  return last;
}

void PlaybackStore::sweep() {
  std::list<Watched> gone;
  const std::lock_guard guard(mutex_);
  for (auto each = watched_.begin(); each != watched_.end();) {
    const auto at = each++;
    const std::shared_ptr<Session> session = at->session.lock();
    const bool stays = session && !session->has_ended() && session->identities() &&
                       session->identities() == at->identities.lock();
    if (!stays) gone.splice(gone.end(), watched_, at);
  }
}

void PlaybackStore::run() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      if (clock_.wait_for(wake_, lock, kSweepEvery, [this] { return stopping_; })) return;
    }
    sweep();
  }
}

}  // namespace kiroku::viewer
