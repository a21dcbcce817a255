// All rooms of all appliances as somebody looks at them: what each appliance said last, how long ago, and
// what of it needs a person, first what cannot wait. What was not heard of lately is never told as if it were
// so now. Plain values; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/utc_time.h"
#include "fleet/catalogue/fleet_reports.h"

namespace kiroku::fleet {

/// After so long without a report an appliance is not heard of: three reports that did not come, and some
/// time on the way.
inline constexpr std::chrono::seconds kHeardFor{20};

/// What needs a person, gravest first. Names as the page has them: concern_name().
enum class Concern {
  // Something is not recorded, or nobody knows.
  kEndedByError,  // an error ended the room's case
  kNotResumed,    // a case was cut off and is not carried on
  kNotHeard,      // the appliance stopped reporting
  kNoRecorder,    // the appliance reports, and no recorder answers there
  kUnreadable,    // its newest report cannot be read by this program
  kSilent,        // a source of a room that records, or records ahead, delivers nothing
  kDiskShort,     // less than eight hours are left, or little space where they are not known
  kDiskUnknown,   // its recorder cannot look at the archive's disk: what is recorded may not reach it
  kTwoOfOneName,  // two report under this name: one is a copy
  // To be looked at today.
  kLost,             // frames of the running case were lost
  kWithoutBox,       // something is decoded beside the device key
  kNoAuthority,      // none of the authorities that a recording room asks answers
  kHardwareSilent,   // its device's key in hardware does not sign: cases that it records are unproven
  kNotShared,        // rooms were to share an authority's time-stamps, and a room asks for its own
  kClockOff,         // its clock differs from the database's by more than five seconds
  kClockFree,        // its clock is not synchronised
  kShippingStuck,    // something has waited for the store for longer than ten minutes, or cannot be shipped
  kShippingUnknown,  // what waits for the store could not be found out
  kCertificateEnds,  // its certificate ends within a week
  kProblem,          // its recorder tells of a problem
  kNeverHeard,       // it was enrolled and never reported
};
std::string_view concern_name(Concern concern);  // "ended-by-error"
/// Whether a person is needed now, rather than today.
constexpr bool is_urgent(Concern concern) { return concern <= Concern::kTwoOfOneName; }

/// One room, or an appliance of which no room is known.
struct BoardRow {
  std::string appliance;
  std::optional<RoomReport> room = {};
  /// Gravest first. Of an appliance that is not heard of, nothing but that is told, and whether two have its
  /// name, which the server saw: what it said before may not be so any more.
  std::vector<Concern> concerns = {};
  bool is_heard = false;
  std::optional<UtcTime> heard = {};            // its newest report
  std::optional<UtcTime> recording_since = {};  // by the database's clock, where it records
  std::optional<ApplianceReport> report = {};
  std::int64_t clock_ahead_us = 0;  // of the database's clock when the report came
  UtcTime certificate_until;
};

/// Rows in the order in which a person should look at them. Revoked appliances are left out.
std::vector<BoardRow> board_of(const std::vector<EnrolledAppliance>& appliances, UtcTime now);

/// As the API and 'kiroku-fleet rooms --json' tell it.
nlohmann::ordered_json board_json(const std::vector<BoardRow>& rows,
                                  const std::vector<std::string>& not_enrolled, UtcTime now);

}  // namespace kiroku::fleet
