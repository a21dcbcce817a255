// Enrolling an appliance by the code that it shows, from the terminal and from the page. Functions; of the
// thread that has `reports`.
#pragma once

#include <string>

#include "apps/fleet/fleet_configuration.h"
#include "fleet/catalogue/fleet_reports.h"
#include "fleet/reports/fleet_authority.h"

namespace kiroku::apps {

/// The request that shows this code. Throws kiroku::UsageError for what is no code, for one that no request
/// shows, which counts, and while too many wrong ones were entered.
fleet::PendingEnrolment request_of_code(fleet::FleetReports& reports, const fleet::FleetAuthority& authority,
                                        const std::string& typed);
/// Issues its certificate, with which the appliance reports from then on. Throws as FleetReports::admit().
void admit_request(fleet::FleetReports& reports, const fleet::FleetAuthority& authority,
                   const fleet::PendingEnrolment& request, const FleetConfiguration& configuration,
                   const std::string& by);

}  // namespace kiroku::apps
