#include "apps/fleet/enrolling.h"

#include "base/error.h"

namespace kiroku::apps {

fleet::PendingEnrolment request_of_code(fleet::FleetReports& reports, const fleet::FleetAuthority& authority,
                                        const std::string& typed) {
  if (const std::chrono::seconds wait = reports.code_wait(); wait.count() > 0)
    throw UsageError("too many wrong codes were entered: try again in " + std::to_string(wait.count()) +
                     " s");
  const std::string code = fleet::parse_enrolment_code(typed);
  if (code.empty())
    throw UsageError(
        "a code has 16 letters and digits, as 'kiroku fleet enrol' shows it: K7QM-2XFA-9DTR-PHW4");
  for (fleet::PendingEnrolment& each : reports.pending()) {
    const std::string shown =
        fleet::enrolment_code(each.request_pem, authority.certificate_pem(), each.nonce);
    if (shown != code) continue;
    reports.code_succeeded();
    return std::move(each);
  }
  reports.code_failed();
  throw UsageError(
      "no appliance that waits shows this code: compare it with the appliance's, which shows it for ten "
      "minutes. "
      "If it is the same, somebody stands between the appliance and this server");
}

void admit_request(fleet::FleetReports& reports, const fleet::FleetAuthority& authority,
                   const fleet::PendingEnrolment& request, const FleetConfiguration& configuration,
                   const std::string& by) {
  const std::string certificate =
      authority.issue(request.request_pem, utc_now(), configuration.certificates_last);
  reports.admit(request, certificate, by);
}

}  // namespace kiroku::apps
