// What verification found, in words. Pure functions.
#pragma once

#include <string>

#include "archive/verify/report.h"

namespace kiroku::apps {

/// For people: the verdict in words first, then device, time, streams, findings. Times in this machine's zone
/// and UTC. `device_trusted`: the case's device key was among the trusted ones. `log`: what the case was
/// compared with, as no_log_words() or a folder; "" of a log itself.
std::string report_text(const archive::VerificationReport& report, const std::string& case_name,
                        bool device_trusted, const std::string& log = "");
/// What nobody looked at where no appliance log was given.
std::string no_log_words();

}  // namespace kiroku::apps
