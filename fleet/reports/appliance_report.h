// What an appliance says of itself to its hospital, every few seconds: rooms, disks, clock, authorities, what
// is not shipped. Names, numbers and states alone: no patient's data, and no free text, into which some could
// get. Times are ages, so that a clock that lies moves nothing but its own offset. Plain values; functions
// are thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/utc_time.h"

namespace kiroku::fleet {

inline constexpr std::size_t kLargestReport = 64U << 10;

struct RoomReport {
  std::string room;                      // a short name (archive::is_short_name)
  std::string state;                     // as the recorder names it: "recording", "standby", "idle"
  std::string case_id;                   // that it records, or recorded last; "" for none
  std::int64_t recording_s = 0;          // for how long it has recorded this case
  std::uint64_t streams = 0;             // of the case
  std::vector<std::string> silent = {};  // streams whose source delivers nothing; short names
  std::uint64_t lost = 0;                // frames and samples of the case that were lost
  std::uint64_t missed = 0;              // time-stamps of the case that did not come
  bool has_problem = false;              // the recorder tells of one; which, its own page says
  bool not_resumed = false;              // a case was cut off and is not carried on
  bool ended_by_error = false;           // an error ended the case
  bool without_box = false;              // something is decoded beside the device key
};

struct AuthorityReport {
  std::string name;                          // a short name
  std::uint64_t failures = 0;                // in a row
  std::optional<std::int64_t> token_s = {};  // how old its latest token is; none: none yet
  /// Rooms were to share its latest token, and a room had to ask for one of its own.
  bool is_unshared = false;
};

struct DiskReport {
  std::uint64_t free_bytes = 0, total_bytes = 0;
  std::optional<double> hours_left = {};  // if every room records; none: not known
};

struct ClockReport {
  bool synchronised = false;
  std::int64_t error_ns = 0;  // how far off it may be by its own account
};

/// What the store does not have yet.
struct ShippingReported {
  std::uint64_t waiting = 0, waiting_bytes = 0;  // objects
  std::optional<std::int64_t> waiting_s = {};    // for how long the oldest has waited
  std::uint64_t holds = 0, problems = 0;         // legal holds that are not confirmed; what cannot be shipped
};

struct ApplianceReport {
  std::string program;  // the version of what reports: "0.1.0"
  /// Of the machine as it runs now, 32 hexadecimal digits: by it two that report under one name are known.
  /// Then which report of its process this is.
  std::string run;
  std::uint64_t number = 0;
  UtcTime now;  // the appliance's own clock
  /// Nothing where no recorder answers: then it has no rooms, disk and clock.
  struct Recorder {
    std::int64_t up_s = 0;
    std::vector<RoomReport> rooms;
    std::vector<AuthorityReport> authorities;
    std::optional<DiskReport> disk;  // none: nobody could look at it
    ClockReport clock;
    bool is_hardware_silent = false;  // the device's key in hardware does not sign
  };
  std::optional<Recorder> recorder = {};
  /// Whether it has a store to ship to; what waits, unless that could not be found out.
  bool has_store = false;
  std::optional<ShippingReported> shipping = {};
};

/// Out of what a recorder answers to "status" (recorder/daemon/control_server.h). `since` is how old the text
/// times in it are measured from: the appliance's clock of now.
ApplianceReport::Recorder recorder_report(const nlohmann::json& status, UtcTime now);

std::string to_json(const ApplianceReport& report);
/// Throws kiroku::UsageError, which says what is wrong, for anything that to_json() cannot have written: also
/// for names with other characters than small letters, digits and hyphens, negative ages, and more rooms than
/// 64. Fields that it does not know are passed over.
ApplianceReport parse_report(std::string_view json);

}  // namespace kiroku::fleet
