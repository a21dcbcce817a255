// Attempts on the page as cases of a home, sealed after they were made. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>

#include "apps/kiroku/home.h"
#include "viewer/http/disk_room.h"
#include "viewer/training/attempt_sealer.h"

namespace kiroku::apps {

/// `home` must outlive it. What is kept of attempts that nobody seals lies in `training-files` of the home
/// and goes with the server; of those that were sealed, in `training/CASE`. An attempt neither begins nor is
/// sealed where less than `left` bytes of the home's disk are free. Throws kiroku::Error where the home
/// has no room for that.
std::shared_ptr<viewer::AttemptSealer> make_page_sealer(const Home& home,
                                                        std::uint64_t left = viewer::kLeftToRecorder);

}  // namespace kiroku::apps
