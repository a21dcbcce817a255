// Which appliances may report to the hospital, and what each said last, in the catalogue's database: rows
// that every server shares, so that killing any one of them loses nothing. Times are the database's own. Not
// thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "fleet/catalogue/postgres.h"
#include "fleet/reports/appliance_report.h"
#include "fleet/reports/fleet_authority.h"

namespace kiroku::fleet {

/// Asked for by an appliance, and not decided.
struct PendingEnrolment {
  std::string id, appliance, request_pem, nonce;
  UtcTime asked;
};

/// An appliance that was enrolled.
struct EnrolledAppliance {
  std::string name;
  UtcTime enrolled;
  std::string enrolled_by;
  UtcTime certificate_until;
  std::optional<UtcTime> revoked = {};
  std::optional<UtcTime> heard = {};  // when its newest report came; none: it never reported
  std::string report = {};            // that one, as to_json() writes it
  /// When it last showed by their runs that two report under this name: a run that had been followed by one
  /// of the next 16 came again, or the run changed eight times within a minute. A machine that starts anew
  /// has a run that was never there, and needs longer to start.
  std::optional<UtcTime> doubled = {};
  /// Since when somebody is known to use a certificate of this enrolment that another one had replaced: there
  /// are two, and only one of them is heard. Until the name is enrolled anew.
  std::optional<UtcTime> replaced_shown = {};
};

/// Why a report is not taken.
enum class ReportRefusal { kNotEnrolled, kRevoked, kOtherCertificate, kEnded, kTooManyCertificates };

class FleetReports {
 public:
  /// Takes the connection. Throws UsageError where the catalogue is not of this version.
  explicit FleetReports(Postgres database);

  /// Keeps a request for ten minutes. Throws UsageError where the name is enrolled, or where 64 wait already,
  /// four of them from `from`.
  void ask(const PendingEnrolment& request, const std::string& from);
  [[nodiscard]] std::vector<PendingEnrolment> pending();
  /// The certificate once it was issued, "" while it is not decided; nothing for what nobody asked for, or
  /// too long ago.
  [[nodiscard]] std::optional<std::string> certificate_for(const std::string& id);
  /// From now on the appliance may report with this certificate. Throws UsageError where the name is enrolled
  /// by now, or the request is over.
  void admit(const PendingEnrolment& request, const std::string& certificate_pem, const std::string& by);

  /// How long nobody may enter a code, after wrong ones: of all servers together.
  [[nodiscard]] std::chrono::seconds code_wait();
  void code_failed();
  void code_succeeded();

  /// Takes what `name` says of itself with this certificate. Nothing where it was taken. A certificate of
  /// this enrolment that was replaced is noted (EnrolledAppliance::replaced_shown) where it comes a second
  /// time, or five minutes after it was replaced; so it is by renew().
  std::optional<ReportRefusal> take(const std::string& name, const std::string& fingerprint,
                                    const ApplianceReport& report);
  /// Whether `name` may speak with this certificate. Nothing where it may.
  std::optional<ReportRefusal> refusal(const std::string& name, const std::string& fingerprint);
  /// The appliance may report with the new certificate, too, and with it alone once it did. Nothing where it
  /// was taken. kTooManyCertificates where a thousand of this enrolment have not ended.
  std::optional<ReportRefusal> renew(const std::string& name, const std::string& fingerprint,
                                     const CertificateFacts& renewed);
  /// No certificate of this name counts any more; false where none is enrolled.
  bool revoke(const std::string& name);

  [[nodiscard]] std::vector<EnrolledAppliance> appliances();
  /// Appliances that have cases in the catalogue and are not enrolled.
  [[nodiscard]] std::vector<std::string> not_enrolled();
  [[nodiscard]] UtcTime now();

 private:
  void keep_certificate(const std::string& name, const CertificateFacts& facts);
  std::optional<ReportRefusal> why_not(const std::string& name, const std::string& fingerprint);
  std::optional<ReportRefusal> why_not_noted(const std::string& name, const std::string& fingerprint);
  void note_replaced(const std::string& name, const std::string& fingerprint);
  void remove_old_requests();
  Postgres database_;
};

}  // namespace kiroku::fleet
