#include "fleet/catalogue/lease_keeper.h"

namespace kiroku::fleet {

LeaseKeeper::LeaseKeeper(const Lease& lease, const std::function<FleetCatalogue()>& open,
                         std::chrono::milliseconds every)
    : lease_(lease), open_(open), every_(every), thread_([this] { keep(); }) {}

LeaseKeeper::~LeaseKeeper() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  end_.notify_one();
  thread_.join();
}

void LeaseKeeper::keep() {
  // Most cases are verified before the first extension is due: those cost no connection.
  std::optional<FleetCatalogue> catalogue;
  std::unique_lock lock(mutex_);
  for (int times = 0; times < kMostExtensions; ++times) {
    if (end_.wait_for(lock, every_, [this] { return ended_; })) return;
    lock.unlock();
    const bool is_ours = extend(catalogue);
    lock.lock();
    if (!is_ours) return;
  }
}

bool LeaseKeeper::extend(std::optional<FleetCatalogue>& catalogue) const {
  try {
    if (!catalogue) catalogue.emplace(open_());
    return catalogue->extend(lease_, kLease);
  } catch (const std::exception&) {
    // The worker itself tells of a database that is away, once it enters its verdict.
    catalogue.reset();
    return true;
  }
}

}  // namespace kiroku::fleet
