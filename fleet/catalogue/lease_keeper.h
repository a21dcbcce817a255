// A lease that lasts as long as the work: extended again and again by a thread of its own, so that what a
// killed worker held is free soon, however long a case takes.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "fleet/catalogue/fleet_catalogue.h"

namespace kiroku::fleet {

/// How long a lease lasts that nobody extends.
inline constexpr std::chrono::seconds kLease{60};
/// Several tries within it.
inline constexpr std::chrono::milliseconds kExtendEvery{15'000};
/// No case takes longer than twelve hours: a worker that hangs does not keep one for ever.
inline constexpr int kMostExtensions = 12 * 60 * 4;

/// Extends a lease until it is destroyed. A database that is away is asked again: the lease may then end, and
/// FleetCatalogue::enter tells whether another took it.
class LeaseKeeper {
 public:
  /// `open` connects to the catalogue, by the thread; it must outlive the object, as `lease` must.
  LeaseKeeper(const Lease& lease, const std::function<FleetCatalogue()>& open,
              std::chrono::milliseconds every = kExtendEvery);
  /// What `extend` extends, by the thread: false where it is this worker's no longer. What it throws is not
  /// told, and it is asked again.
  LeaseKeeper(std::function<bool()> extend, int most_extensions,
              std::chrono::milliseconds every = kExtendEvery);
  ~LeaseKeeper();
  LeaseKeeper(const LeaseKeeper&) = delete;
  LeaseKeeper& operator=(const LeaseKeeper&) = delete;

 private:
  void keep();

  const std::function<bool()> extend_;
  const int most_extensions_;
  const std::chrono::milliseconds every_;
  std::mutex mutex_;
  std::condition_variable end_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace kiroku::fleet
