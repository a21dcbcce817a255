// Where checkpoints of all appliances are stamped together: rounds of each authority of fleet.toml, and what
// an appliance hears of them. Thread-safe.
//
// Of an appliance it learns SHA-256 hashes of notes, and random numbers. It judges each token before it
// hands it out, so that a broken authority costs appliances no time; they judge it again, and believe
// nothing of this.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "apps/configuration/authority_configuration.h"
#include "base/clock.h"
#include "fleet/reports/request_budget.h"
#include "fleet/reports/stamp_messages.h"
#include "fleet/reports/stamp_rounds.h"
#include "recorder/authority_contact.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {

class StampDesk {
 public:
  struct Options {
    std::vector<AuthorityConfiguration> authorities;
    std::chrono::nanoseconds round = std::chrono::seconds(60);
    const timestamp::TrustStore* trust = nullptr;
    std::function<void(const std::string&)> tell{};  // of any thread: rounds that have no token
    const Clock* clock = &Clock::system();
    /// Reaches an authority; may be replaced.
    std::function<std::shared_ptr<timestamp::StampSource>(const AuthorityConfiguration&)> reach{};
  };
  /// What `options` points to must outlive it.
  explicit StampDesk(Options options);

  /// Counts a request of whoever has the certificate with this fingerprint, whatever is asked. Throws
  /// DeskRefusal (429) for one too many.
  void count(const std::string& fingerprint);
  /// POST /stamp and GET /stamp/AUTHORITY/TICKET: status and JSON. Throw DeskRefusal.
  struct Answer {
    int status;
    std::string json;
  };
  Answer enter(const std::string& appliance, const fleet::StampRequest& request);
  [[nodiscard]] Answer fetch(const std::string& appliance, const fleet::StampQuestion& question) const;

 private:
  struct Collected {
    std::unique_ptr<recorder::AuthorityContact> contact;
    std::unique_ptr<fleet::StampRounds> rounds;  // uses the contact
  };
  [[nodiscard]] const Collected& of(const std::string& authority) const;
  /// A token of the authority over this hash, judged. Throws kiroku::Error, also where the authority is to be
  /// left alone.
  static Bytes stamp(recorder::AuthorityContact& contact, const Clock& clock, crypto::HashAlgorithm algorithm,
                     ByteView imprint);

  const Options options_;
  fleet::RequestBudget budget_;
  std::map<std::string, Collected> authorities_;
};

}  // namespace kiroku::apps
