// What 'kiroku-fleet verify' mends with: a key of the store that may put, copies, and the log of a home in
// which it states what it did.
#pragma once

#include <filesystem>
#include <string>

#include "apps/fleet/fleet_configuration.h"
#include "apps/kiroku/home.h"
#include "fleet/mender.h"

namespace kiroku::apps {

/// Not thread-safe.
class StoreMending {
 public:
  /// `configuration` has [mending], and must outlive the object. Reads the home's key, which may ask for a
  /// passphrase. Throws kiroku::Error.
  StoreMending(const FleetConfiguration& configuration, const std::filesystem::path& scratch);

  /// As Mender::mend(), stated in the home's log. `device` is the file with the keys of the case's appliance.
  fleet::Mending mend(const std::string& appliance, const std::string& case_id,
                      const std::filesystem::path& device, const fleet::FetchedCase& fetched);

 private:
  const Home home_;
  const crypto::SigningKey key_;
  fleet::Mender mender_;
};

}  // namespace kiroku::apps
