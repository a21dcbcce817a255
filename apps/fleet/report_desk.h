// Where appliances report, and ask to be enrolled: the routes of kiroku-fleet serve that appliances call, on
// an address of their own, over TLS with certificates of the fleet's own authority.
//
//   POST /enrol      {"request"}: of anybody. 202 {"id", "nonce", "authority"}
//   GET  /enrol/ID   202 while nobody has entered the code, 200 {"certificate"} once somebody did, 404 after
//                    ten minutes
//   POST /report     a report (fleet/reports/appliance_report.h), of whoever has a certificate that counts
//   POST /renew      {"request"}: likewise. 200 {"certificate"}
//   POST /stamp      a checkpoint's hash for the round of an authority (fleet/reports/stamp_messages.h)
//   GET  /stamp/AUTHORITY/TICKET   what became of it, of the appliance that gave it
//
// Who reports is what the certificate says, never the report. Errors are {"error": sentence}.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "apps/fleet/fleet_configuration.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {

class ReportDesk {
 public:
  /// Listens on `listen` ("0.0.0.0:8444") until it is destroyed. Tokens of rounds are judged under `trust`;
  /// `tell` hears, from any thread, of rounds that have none. `configuration` and `trust` must outlive it.
  /// Throws kiroku::Error where it cannot listen, kiroku::UsageError, fleet::DatabaseError.
  ReportDesk(const FleetConfiguration& configuration, const std::string& listen,
             const timestamp::TrustStore& trust, std::function<void(const std::string&)> tell);
  ~ReportDesk();
  ReportDesk(const ReportDesk&) = delete;
  ReportDesk& operator=(const ReportDesk&) = delete;

  [[nodiscard]] std::string url() const;  // "https://127.0.0.1:8444"

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::apps
