// What verification found, in words. Pure functions.
#pragma once

#include <string>

#include "archive/verify/report.h"

namespace kiroku::apps {

/// For people: the verdict in words first, then device, time, streams, findings. Times in this machine's zone
/// and UTC. `device_trusted`: the case's device key was among the trusted ones.
std::string report_text(const archive::VerificationReport& report, const std::string& case_name,
                        bool device_trusted);

}  // namespace kiroku::apps
