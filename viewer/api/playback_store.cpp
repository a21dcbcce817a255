#include "viewer/api/playback_store.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_tail.h"

namespace kiroku::viewer {
namespace {

constexpr std::chrono::seconds kSweepEvery{1};
constexpr std::chrono::seconds kOpenCaseStays{15};

bool is_closed(const PlaybackStore::Playback& playback) {
  return playback->recording().closing().has_value();
}

}  // namespace

PlaybackStore::PlaybackStore(const std::filesystem::path& folder, std::uint64_t most_bytes,
                             const Clock& clock, StampOf stamp_of)
    : cache_(std::make_shared<playback::EncryptedCache>(folder, most_bytes)),
      clock_(clock),
      stamp_of_(std::move(stamp_of)),
      sweeper_([this] { each_second(&PlaybackStore::sweep); }),
      looker_([this] { each_second(&PlaybackStore::let_go_of_changed); }) {}

PlaybackStore::~PlaybackStore() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  sweeper_.join();
  looker_.join();
}

FileStamp PlaybackStore::ledger_of(const std::filesystem::path& folder) const {
  return stamp_of_(folder / archive::kLedgerFile);
}

PlaybackStore::Playback PlaybackStore::find(const std::shared_ptr<Session>& session,
                                            const Session::Identities& identities,
                                            const std::filesystem::path& folder) {
  const FileStamp ledger = ledger_of(folder);
  const std::lock_guard guard(mutex_);
  const auto found = std::ranges::find_if(watched_, [&](const Watched& watched) {
    return watched.folder == folder && watched.session.lock() == session &&
           watched.identities.lock() == identities;
  });
  if (found == watched_.end()) return nullptr;
  // The ledger of one that is being recorded changes all the time, and nothing of it is erased.
  const bool is_stale =
      is_closed(found->playback) ? found->ledger != ledger : clock_.now() - found->opened > kOpenCaseStays;
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
    const FileStamp ledger = ledger_of(folder);
    auto playback =
        std::make_shared<playback::CasePlayback>(place.read(), *identities, cache_, place.segments);
    std::list<Watched> gone;  // ends outside the lock: what it does in the background is waited for
    const std::lock_guard guard(mutex_);
    for (auto each = watched_.begin(); each != watched_.end();) {
      const auto at = each++;
      if (at->folder == folder && at->session.lock() == session) gone.splice(gone.end(), watched_, at);
    }
    watched_.push_front({session, session->person(), identities, folder, playback, clock_.now(), ledger});
    // What is known already stays: that it changed is found, and its copies go, at the next sweep.
    copied_.try_emplace(folder, Copied{ledger, is_closed(playback)});
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

std::vector<std::filesystem::path> PlaybackStore::changed() {
  std::map<std::filesystem::path, Copied> known;
  {
    const std::lock_guard guard(mutex_);
    known = copied_;
  }
  std::vector<std::filesystem::path> found;
  for (auto& [folder, copied] : known) {
    const FileStamp ledger = ledger_of(folder);
    if (ledger == copied.ledger) continue;
    if (!copied.is_closed && ledger != FileStamp{}) {
      const auto tail = archive::read_ledger_tail(folder);
      // While it is recorded it grows; once it is closed its copies are made anew, and watched from then on.
      if (!tail || !tail->closed) continue;
    }
    found.push_back(folder);
  }
  return found;
}

std::vector<std::filesystem::path> PlaybackStore::beyond_most_copied() {
  const std::lock_guard guard(mutex_);
  std::vector<std::filesystem::path> found;
  if (copied_.size() <= kMostCopied) return found;
  for (const auto& [folder, copied] : copied_) {
    const bool is_watched = std::ranges::any_of(
        watched_, [&name = folder](const Watched& watched) { return watched.folder == name; });
    if (!is_watched) found.push_back(folder);
  }
  return found;
}

void PlaybackStore::let_go_of_changed() {
  std::list<Watched> gone;
  std::vector<std::filesystem::path> forget;
  std::vector<std::filesystem::path> to_go = changed();
  if (to_go.empty()) to_go = beyond_most_copied();
  for (std::filesystem::path& folder : to_go) {
    const std::lock_guard guard(mutex_);
    copied_.erase(folder);
    for (auto each = watched_.begin(); each != watched_.end();) {
      const auto at = each++;
      if (at->folder != folder) continue;
      leaving_.push_back({at->playback, folder});
      gone.splice(gone.end(), watched_, at);
    }
    forget.push_back(std::move(folder));
  }
  gone.clear();  // what it does in the background is waited for
  {
    // Again until nobody is left who could make more.
    const std::lock_guard guard(mutex_);
    for (auto each = leaving_.begin(); each != leaving_.end();) {
      const bool has_left = each->playback.expired();
      forget.push_back(each->folder);
      each = has_left ? leaving_.erase(each) : std::next(each);
    }
  }
  for (const std::filesystem::path& folder : forget) playback::CasePlayback::forget_copies(*cache_, folder);
}

void PlaybackStore::each_second(void (PlaybackStore::*work)()) {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      if (clock_.wait_for(wake_, lock, kSweepEvery, [this] { return stopping_; })) return;
    }
    (this->*work)();
  }
}

}  // namespace kiroku::viewer
