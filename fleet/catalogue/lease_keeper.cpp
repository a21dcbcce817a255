#include "fleet/catalogue/lease_keeper.h"

#include <memory>
#include <utility>

namespace kiroku::fleet {

LeaseKeeper::LeaseKeeper(const Lease& lease, const std::function<FleetCatalogue()>& open,
                         std::chrono::milliseconds every)
    : LeaseKeeper(
          // Most cases are verified before the first extension is due: those cost no connection.
          [&lease, &open, catalogue = std::make_shared<std::optional<FleetCatalogue>>()] {
            try {
              if (!*catalogue) catalogue->emplace(open());
              return (*catalogue)->extend(lease, kLease);
            } catch (...) {
              catalogue->reset();
              throw;
            }
          },
          kMostExtensions, every) {}

LeaseKeeper::LeaseKeeper(std::function<bool()> extend, int most_extensions, std::chrono::milliseconds every)
    : extend_(std::move(extend)),
      most_extensions_(most_extensions),
      every_(every),
      thread_([this] { keep(); }) {}

LeaseKeeper::~LeaseKeeper() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  end_.notify_one();
  thread_.join();
}

void LeaseKeeper::keep() {
  std::unique_lock lock(mutex_);
  for (int times = 0; times < most_extensions_; ++times) {
    if (end_.wait_for(lock, every_, [this] { return ended_; })) return;
    lock.unlock();
    bool is_ours = true;
    try {
      is_ours = extend_();
    } catch (const std::exception&) {
      // The worker itself tells of a database that is away, once it enters what it found.
      is_ours = true;
    }
    lock.lock();
    if (!is_ours) return;
  }
}

}  // namespace kiroku::fleet
