// The time-stamping authorities of a home, ready to be asked.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "recorder/authority_contact.h"
#include "recorder/stamping_queue.h"
#include "timestamp/authority.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {

/// Owns the embedded authority beside the sources that ask it. One thread at a time.
class Authorities {
 public:
  /// Those of kiroku.toml, or only the `wanted` ones. Throws kiroku::UsageError for a name that is not
  /// configured, and where there is none at all; kiroku::Error where the embedded authority cannot be opened.
  /// With `without` that is told to it instead, and each time-stamp of this authority is missed.
  Authorities(const Home& home, const Configuration& configuration, const std::vector<std::string>& wanted,
              const TellWithout& without = {});
  [[nodiscard]] const std::vector<recorder::NamedAuthority>& named() const { return named_; }

 private:
  [[nodiscard]] std::shared_ptr<timestamp::StampSource> embedded_source(const Home& home,
                                                                        const TellWithout& without);

  std::unique_ptr<timestamp::Authority> embedded_;
  std::vector<recorder::NamedAuthority> named_;
};

/// What the authority answers to a question of its own, asked now: its time, and whose it is. Throws
/// kiroku::Error where it gives no answer.
timestamp::TokenJudgement ask_for_time(const recorder::NamedAuthority& authority,
                                       const timestamp::TrustStore& trust);

/// The home's queue of wanted time-stamps. Nothing, and a warning on standard error, where it cannot be used:
/// recording goes on without it.
std::unique_ptr<recorder::StampingQueue> open_stamping_queue(const Home& home);

}  // namespace kiroku::apps
