// Who sends vital signs to this machine: waits where monitors deliver HL7, and tells who they are. Nothing is
// kept and nothing acknowledged, so that a monitor sends it again, to the recorder. A function; one at a
// time.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <vector>

namespace kiroku::apps {

struct HeardMonitor {
  std::string address;               // where it connected from, without port
  std::string sender;                // MSH-3 and MSH-4: "MON/OR1"; "" where it sent nothing that is HL7
  std::uint64_t messages = 0;        // that could be read
  std::set<std::string> types;       // "ORU^R01"
  std::set<std::string> quantities;  // the names in OBX-3, no values: "HR"
  std::set<std::string> places;      // PV1-3: "SURG^OR1"
  std::string problem;               // why the latest that is not taken is not; "" where there was none
};
struct HeardMonitors {
  std::vector<HeardMonitor> monitors;  // in the order of their first message
  std::string listened_at;             // "mllp://0.0.0.0:2575", with the real port
};

/// `address` as for a stream of vital signs; whom it allows may be left out here. `tell` hears a sentence
/// once monitors can connect, and at each new one, from any thread; `enough` is asked again and again and
/// ends the wait. Throws kiroku::UsageError for an address that cannot be listened on.
HeardMonitors listen_for_monitors(const std::string& address, std::chrono::nanoseconds how_long,
                                  const std::function<void(const std::string& sentence)>& tell,
                                  const std::function<bool()>& enough);

/// What to put into kiroku.toml: "mllp://0.0.0.0:2575?allow=192.168.7.20&sender=MON/OR1". Of a sender of
/// several places it lacks `locations`, which only a person can choose.
std::string source_for(const HeardMonitor& monitor, const std::string& listened_at);

}  // namespace kiroku::apps
