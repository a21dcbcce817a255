#include "fleet/catalogue/room_board.h"

#include <algorithm>
#include <chrono>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_or_null.h"

namespace kiroku::fleet {
namespace {

using nlohmann::ordered_json;
using namespace std::chrono_literals;

constexpr double kScarceHours = 8;
constexpr std::chrono::microseconds kClockMayDiffer = 5s;
constexpr std::int64_t kMayWait_s = 600;
constexpr std::chrono::days kCertificateEndsSoon{7};
constexpr std::chrono::hours kDoubledFor{1};
constexpr std::string_view kRecording = "recording";

/// Free space that is scarce where the hours are not known: one camera of 4 Mbit/s in each room fills it in
/// kScarceHours.
constexpr std::uint64_t kScarceBytes = 16'000'000'000;

bool is_short(const DiskReport& disk, std::size_t rooms) {
  if (disk.hours_left) return *disk.hours_left < kScarceHours;
  return disk.free_bytes < kScarceBytes * std::max<std::size_t>(1, rooms);
}

/// Runs may be no more than a person's test, and are told for an hour. A certificate that was replaced and is
/// used is told until the name is enrolled anew: the one that is heard may be the copy.
bool is_of_two(const EnrolledAppliance& one, UtcTime now) {
  return one.replaced_shown || (one.doubled && now - *one.doubled < kDoubledFor);
}

/// Of an appliance that is heard of, whichever room, beside whether two have its name.
std::vector<Concern> concerns_of_appliance(const BoardRow& row, const EnrolledAppliance& one, UtcTime now) {
  std::vector<Concern> all;
  const auto add = [&](bool is_so, Concern what) {
    if (is_so) all.push_back(what);
  };
  const ApplianceReport& report = *row.report;
  add(!report.recorder, Concern::kNoRecorder);
  if (report.recorder) {
    const ApplianceReport::Recorder& recorder = *report.recorder;
    add(recorder.disk && is_short(*recorder.disk, recorder.rooms.size()), Concern::kDiskShort);
    add(!recorder.disk, Concern::kDiskUnknown);
    add(!recorder.clock.synchronised, Concern::kClockFree);
    add(!recorder.authorities.empty() &&
            std::ranges::all_of(recorder.authorities,
                                [](const AuthorityReport& each) { return each.failures > 0; }),
        Concern::kNoAuthority);
    add(recorder.is_hardware_silent, Concern::kHardwareSilent);
    add(std::ranges::any_of(recorder.authorities, &AuthorityReport::is_unshared), Concern::kNotShared);
  }
  add(std::chrono::abs(std::chrono::microseconds(row.clock_ahead_us)) > kClockMayDiffer, Concern::kClockOff);
  add(report.has_store && !report.shipping, Concern::kShippingUnknown);
  if (const auto& shipping = report.shipping)
    add(shipping->problems > 0 || shipping->waiting_s.value_or(0) > kMayWait_s, Concern::kShippingStuck);
  add(one.certificate_until - now < kCertificateEndsSoon, Concern::kCertificateEnds);
  return all;
}

void add_concerns_of_room(const RoomReport& room, std::vector<Concern>& all) {
  const auto add = [&](bool is_so, Concern what) {
    if (is_so) all.push_back(what);
  };
  add(room.ended_by_error, Concern::kEndedByError);
  add(room.not_resumed, Concern::kNotResumed);
  add(!room.silent.empty(), Concern::kSilent);
  add(room.state == kRecording && room.lost > 0, Concern::kLost);
  add(room.without_box, Concern::kWithoutBox);
  add(room.has_problem, Concern::kProblem);
}

/// Rows of one appliance.
std::vector<BoardRow> rows_of(const EnrolledAppliance& one, UtcTime now) {
  BoardRow row;
  row.appliance = one.name;
  row.heard = one.heard;
  row.certificate_until = one.certificate_until;
  // The server saw that by itself, so that it holds of an appliance that is not heard of, too.
  if (is_of_two(one, now)) row.concerns.push_back(Concern::kTwoOfOneName);
  if (!one.heard) {
    row.concerns.push_back(Concern::kNeverHeard);
    return {row};
  }
  // A database whose clock was set back has reports of the future: whoever still reports has a newer one.
  row.is_heard = std::chrono::abs(now - *one.heard) <= kHeardFor;
  try {
    row.report = parse_report(one.report);
  } catch (const UsageError&) {
    row.concerns.push_back(row.is_heard ? Concern::kUnreadable : Concern::kNotHeard);
    std::ranges::sort(row.concerns);
    return {row};
  }
  row.clock_ahead_us = (row.report->now - *one.heard).count();
  const std::vector<Concern> told =
      row.is_heard ? concerns_of_appliance(row, one, now) : std::vector{Concern::kNotHeard};
  row.concerns.insert(row.concerns.end(), told.begin(), told.end());
  std::vector<BoardRow> rows;
  if (row.report->recorder) {
    for (const RoomReport& room : row.report->recorder->rooms) {
      BoardRow& each = rows.emplace_back(row);
      each.room = room;
      if (room.state == kRecording)
        each.recording_since = *one.heard - std::chrono::seconds(room.recording_s);
      if (row.is_heard) add_concerns_of_room(room, each.concerns);
    }
  }
  if (rows.empty()) rows.push_back(row);
  for (BoardRow& each : rows) std::ranges::sort(each.concerns);
  return rows;
}

/// Urgent ones, then those to be looked at, then rooms that record, then the rest.
int rank_of(const BoardRow& row) {
  if (!row.concerns.empty() && is_urgent(row.concerns.front())) return 0;
  if (!row.concerns.empty()) return 1;
  return row.room && row.room->state == kRecording ? 2 : 3;
}

ordered_json room_json(const RoomReport& room, const BoardRow& row) {
  return {{"room", room.room},       {"state", room.state},
          {"case", room.case_id},    {"recording_since", or_null(row.recording_since)},
          {"streams", room.streams}, {"silent", room.silent},
          {"lost", room.lost},       {"missed", room.missed}};
}

ordered_json recorder_json(const ApplianceReport::Recorder& recorder) {
  ordered_json authorities = ordered_json::array();
  for (const AuthorityReport& each : recorder.authorities)
    authorities.push_back({{"name", each.name},
                           {"failures", each.failures},
                           {"token_s", or_null(each.token_s)},
                           {"not_shared", each.is_unshared}});
  ordered_json disk = nullptr;
  if (recorder.disk)
    disk = {{"free_bytes", recorder.disk->free_bytes},
            {"total_bytes", recorder.disk->total_bytes},
            {"hours_left", or_null(recorder.disk->hours_left)}};
  return {{"up_s", recorder.up_s},
          {"disk", std::move(disk)},
          {"clock", {{"synchronised", recorder.clock.synchronised}, {"error_ns", recorder.clock.error_ns}}},
          {"authorities", std::move(authorities)}};
}

ordered_json row_json(const BoardRow& row) {
  ordered_json concerns = ordered_json::array();
  for (const Concern each : row.concerns) concerns.push_back(concern_name(each));
  ordered_json out{{"appliance", row.appliance},
                   {"is_heard", row.is_heard},
                   {"heard", or_null(row.heard)},
                   {"concerns", std::move(concerns)},
                   {"urgent", !row.concerns.empty() && is_urgent(row.concerns.front())},
                   {"room", nullptr},
                   {"recorder", nullptr},
                   {"clock_ahead_ms", nullptr},
                   {"has_store", nullptr},
                   {"shipping", nullptr},
                   {"program", nullptr},
                   {"certificate_until", format_utc(row.certificate_until)}};
  if (row.room) out["room"] = room_json(*row.room, row);
  if (!row.report) return out;
  if (row.report->recorder) out["recorder"] = recorder_json(*row.report->recorder);
  out["clock_ahead_ms"] = row.clock_ahead_us / 1000;
  out["has_store"] = row.report->has_store;
  if (const auto& shipping = row.report->shipping) {
    out["shipping"] = {{"waiting", shipping->waiting},
                       {"waiting_bytes", shipping->waiting_bytes},
                       {"waiting_s", or_null(shipping->waiting_s)},
                       {"holds", shipping->holds},
                       {"problems", shipping->problems}};
  }
  out["program"] = row.report->program;
  return out;
}

}  // namespace

std::string_view concern_name(Concern concern) {
  switch (concern) {
    case Concern::kEndedByError:
      return "ended-by-error";
    case Concern::kNotResumed:
      return "not-resumed";
    case Concern::kNotHeard:
      return "not-heard";
    case Concern::kNoRecorder:
      return "no-recorder";
    case Concern::kUnreadable:
      return "unreadable";
    case Concern::kSilent:
      return "silent";
    case Concern::kDiskShort:
      return "disk-short";
    case Concern::kDiskUnknown:
      return "disk-unknown";
    case Concern::kTwoOfOneName:
      return "two-of-one-name";
    case Concern::kLost:
      return "lost";
    case Concern::kWithoutBox:
      return "without-box";
    case Concern::kNoAuthority:
      return "no-authority";
    case Concern::kHardwareSilent:
      return "hardware-silent";
    case Concern::kNotShared:
      return "not-shared";
    case Concern::kClockOff:
      return "clock-off";
    case Concern::kClockFree:
      return "clock-free";
    case Concern::kShippingStuck:
      return "shipping-stuck";
    case Concern::kShippingUnknown:
      return "shipping-unknown";
    case Concern::kCertificateEnds:
      return "certificate-ends";
    case Concern::kProblem:
      return "problem";
    case Concern::kNeverHeard:
      return "never-heard";
  }
  return "";
}

std::vector<BoardRow> board_of(const std::vector<EnrolledAppliance>& appliances, UtcTime now) {
  std::vector<BoardRow> board;
  for (const EnrolledAppliance& each : appliances) {
    if (each.revoked) continue;
    for (BoardRow& row : rows_of(each, now)) board.push_back(std::move(row));
  }
  // Within the same the order stays: by appliance, and as its own recorder names its rooms.
  std::ranges::stable_sort(board, {}, [](const BoardRow& row) {
    return std::pair(rank_of(row), row.concerns.empty() ? 0 : static_cast<int>(row.concerns.front()));
  });
  return board;
}

ordered_json board_json(const std::vector<BoardRow>& rows, const std::vector<std::string>& not_enrolled,
                        UtcTime now) {
  ordered_json all = ordered_json::array();
  for (const BoardRow& each : rows) all.push_back(row_json(each));
  return {{"now", format_utc(now)}, {"rooms", std::move(all)}, {"not_enrolled", not_enrolled}};
}

}  // namespace kiroku::fleet
