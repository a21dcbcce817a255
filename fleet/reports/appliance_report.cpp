#include "fleet/reports/appliance_report.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "base/json_or_null.h"
#include "base/printable.h"

namespace kiroku::fleet {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kMostRooms = 64, kMostStreams = 64, kMostAuthorities = 32, kRunDigits = 32;
constexpr std::size_t kLongestVersion = 32;
/// A hundred years: no appliance records, waits or runs for longer.
constexpr std::int64_t kLongestAge_s = 100LL * 366 * 24 * 3600;
constexpr std::int64_t kMostCount = 1'000'000'000'000'000;  // exact in every reader of JSON
constexpr std::int64_t kNanoseconds = 1'000'000'000;
constexpr std::int64_t kSilent_ms = 3'000, kSilentVitals_ms = 10'000;

[[noreturn]] void refuse(const std::string& what) {
  throw UsageError("this is no report of an appliance: " + what);
}

/// Of an object that must have the field.
const json& field(const json& of, const char* name) {
  if (!of.is_object()) refuse(std::string("where '") + name + "' should stand, there is no object");
  const auto found = of.find(name);
  if (found == of.end()) refuse(std::string("it has no '") + name + "'");
  return *found;
}

std::int64_t count_of(const json& of, const char* name, std::int64_t most = kMostCount) {
  const json& value = field(of, name);
  if (!value.is_number_integer() || value < 0 || value > most)
    refuse(std::string("'") + name + "' is no whole number from 0 to " + std::to_string(most));
  return value.get<std::int64_t>();
}

std::uint64_t size_of(const json& of, const char* name) {
  return static_cast<std::uint64_t>(count_of(of, name));
}

std::int64_t age_of(const json& of, const char* name) { return count_of(of, name, kLongestAge_s); }

std::optional<std::int64_t> age_or_null(const json& of, const char* name) {
  if (field(of, name).is_null()) return {};
  return age_of(of, name);
}

bool flag_of(const json& of, const char* name) {
  const json& value = field(of, name);
  if (!value.is_boolean()) refuse(std::string("'") + name + "' is neither true nor false");
  return value.get<bool>();
}

std::string text_of_field(const json& of, const char* name) {
  const json& value = field(of, name);
  if (!value.is_string()) refuse(std::string("'") + name + "' is no text");
  return value.get<std::string>();
}

std::string short_name(const json& value, const char* what) {
  if (!value.is_string() || !archive::is_short_name(value.get_ref<const std::string&>()))
    refuse(std::string("'") + what + "' is no name of 1 to 32 small letters, digits and hyphens");
  return value.get<std::string>();
}

const json& list_of(const json& of, const char* name, std::size_t most) {
  const json& value = field(of, name);
  if (!value.is_array() || value.size() > most)
    refuse(std::string("'") + name + "' is no list of at most " + std::to_string(most));
  return value;
}

RoomReport parse_room(const json& of) {
  RoomReport room;
  room.room = short_name(field(of, "room"), "room");
  room.state = short_name(field(of, "state"), "state");
  room.case_id = text_of_field(of, "case");
  if (!room.case_id.empty() && !archive::is_case_id(room.case_id))
    refuse("'case' is no identifier of a case");
  room.recording_s = age_of(of, "recording_s");
  room.streams = size_of(of, "streams");
  for (const json& each : list_of(of, "silent", kMostStreams))
    room.silent.push_back(short_name(each, "silent"));
  room.lost = size_of(of, "lost");
  room.missed = size_of(of, "missed");
  room.has_problem = flag_of(of, "problem");
  room.not_resumed = flag_of(of, "not_resumed");
  room.ended_by_error = flag_of(of, "ended_by_error");
  room.without_box = flag_of(of, "without_box");
  return room;
}

/// One of no bytes is none that anybody could look at: json_of() says why.
std::optional<DiskReport> parse_disk(const json& of) {
  if (of.is_null()) return {};
  DiskReport disk{size_of(of, "free_bytes"), size_of(of, "total_bytes")};
  const json& hours = field(of, "hours_left");
  constexpr double kMostHours = 1e9;
  if (!hours.is_null() &&
      (!hours.is_number() || !(hours.get<double>() >= 0 && hours.get<double>() <= kMostHours)))
    refuse("'hours_left' is no number of hours");
  if (disk.total_bytes == 0) return {};
  if (!hours.is_null()) disk.hours_left = hours.get<double>();
  return disk;
}

ApplianceReport::Recorder parse_recorder(const json& of) {
  ApplianceReport::Recorder recorder;
  recorder.up_s = age_of(of, "up_s");
  for (const json& each : list_of(of, "rooms", kMostRooms)) {
    RoomReport room = parse_room(each);
    const bool is_twice =
        std::ranges::any_of(recorder.rooms, [&](const RoomReport& other) { return other.room == room.room; });
    if (is_twice) refuse("room " + room.room + " stands in it twice");
    recorder.rooms.push_back(std::move(room));
  }
  for (const json& each : list_of(of, "authorities", kMostAuthorities)) {
    AuthorityReport one{short_name(field(each, "name"), "name"), size_of(each, "failures"),
                        age_or_null(each, "token_s")};
    // Appliances of before say nothing of it.
    if (each.contains("not_shared")) one.is_unshared = flag_of(each, "not_shared");
    recorder.authorities.push_back(std::move(one));
  }
  recorder.disk = parse_disk(field(of, "disk"));
  const json& clock = field(of, "clock");
  recorder.clock = {flag_of(clock, "synchronised"), count_of(clock, "error_ns")};
  // Appliances of before say nothing of it.
  if (of.contains("hardware_silent")) recorder.is_hardware_silent = flag_of(of, "hardware_silent");
  return recorder;
}

ordered_json json_of(const RoomReport& room) {
  return {{"room", room.room},
          {"state", room.state},
          {"case", room.case_id},
          {"recording_s", room.recording_s},
          {"streams", room.streams},
          {"silent", room.silent},
          {"lost", room.lost},
          {"missed", room.missed},
          {"problem", room.has_problem},
          {"not_resumed", room.not_resumed},
          {"ended_by_error", room.ended_by_error},
          {"without_box", room.without_box}};
}

/// Where nobody could look at it, as appliances said it that had no word for that: readers of before would
/// refuse the whole report without a disk, and take this one for full.
ordered_json json_of(const std::optional<DiskReport>& disk) {
  if (!disk) return {{"free_bytes", 0}, {"total_bytes", 0}, {"hours_left", 0}};
  return {{"free_bytes", disk->free_bytes},
          {"total_bytes", disk->total_bytes},
          {"hours_left", or_null(disk->hours_left)}};
}

ordered_json json_of(const ApplianceReport::Recorder& recorder) {
  ordered_json rooms = ordered_json::array(), authorities = ordered_json::array();
  for (const RoomReport& each : recorder.rooms) rooms.push_back(json_of(each));
  for (const AuthorityReport& each : recorder.authorities)
    authorities.push_back({{"name", each.name},
                           {"failures", each.failures},
                           {"token_s", or_null(each.token_s)},
                           {"not_shared", each.is_unshared}});
  return {{"up_s", recorder.up_s},
          {"rooms", std::move(rooms)},
          {"authorities", std::move(authorities)},
          {"disk", json_of(recorder.disk)},
          {"clock", {{"synchronised", recorder.clock.synchronised}, {"error_ns", recorder.clock.error_ns}}},
          {"hardware_silent", recorder.is_hardware_silent}};
}

std::int64_t bounded(std::int64_t value, std::int64_t most = kMostCount) {
  return std::clamp<std::int64_t>(value, 0, most);
}

RoomReport room_report(const json& of) {
  RoomReport room;
  room.room = of.value("room", "");
  room.state = of.value("state", "");
  room.case_id = of.value("case", "");
  room.recording_s =
      room.state == "recording" ? bounded(of.value("elapsed_ns", std::int64_t{0}) / kNanoseconds) : 0;
  for (const json& stream : of.at("streams")) {
    ++room.streams;
    room.lost += stream.value("dropped", std::uint64_t{0});
    room.without_box = room.without_box || stream.value("unboxed", false);
    // As the recorder's own page has it: monitors speak once a few seconds, and what has just begun is still
    // being opened.
    const std::int64_t age_ms = stream.value("age_ms", std::int64_t{0});
    const std::int64_t silent_ms = stream.value("kind", "") == "vitals" ? kSilentVitals_ms : kSilent_ms;
    const bool is_silent = (!stream.value("live", false) && age_ms >= kSilent_ms) || age_ms >= silent_ms;
    // A room that records ahead holds its sources, too.
    const bool is_held = room.state == "recording" || room.state == "standby";
    if (is_held && is_silent) room.silent.push_back(stream.value("name", ""));
  }
  room.missed = of.value("missed", std::uint64_t{0});
  room.has_problem = !of.value("problem", "").empty();
  room.not_resumed = of.value("not_resumed", false);
  room.ended_by_error = of.value("ended_by_error", false);
  return room;
}

void add_authorities(const json& of, UtcTime now, std::vector<AuthorityReport>& all) {
  for (const json& each : of) {
    AuthorityReport one{each.value("name", ""), each.value("failures", std::uint64_t{0})};
    one.is_unshared = !each.value("not_shared", "").empty();
    const json& last = each.at("last_token");
    if (const auto time = last.is_string() ? parse_utc(last.get<std::string>()) : std::nullopt)
      one.token_s =
          bounded(std::chrono::duration_cast<std::chrono::seconds>(now - *time).count(), kLongestAge_s);
    const auto known = std::ranges::find(all, one.name, &AuthorityReport::name);
    if (known == all.end()) {
      all.push_back(one);
      continue;
    }
    // Of several rooms that ask one authority, the newest token and the most failures; one that does not
    // share is told.
    known->is_unshared = known->is_unshared || one.is_unshared;
    known->failures = std::max(known->failures, one.failures);
    if (one.token_s) known->token_s = std::min(known->token_s.value_or(*one.token_s), *one.token_s);
  }
}

}  // namespace

ApplianceReport::Recorder recorder_report(const json& status, UtcTime now) {
  ApplianceReport::Recorder out;
  out.up_s = bounded(status.value("uptime_s", std::int64_t{0}), kLongestAge_s);
  for (const json& room : status.at("rooms")) {
    out.rooms.push_back(room_report(room));
    if (out.rooms.back().state == "recording") add_authorities(room.at("authorities"), now, out.authorities);
  }
  const json& disk = status.at("disk");
  if (disk.is_object()) {
    out.disk =
        DiskReport{disk.value("free_bytes", std::uint64_t{0}), disk.value("total_bytes", std::uint64_t{0})};
    if (disk.at("hours_left").is_number()) out.disk->hours_left = disk["hours_left"].get<double>();
  }
  const json& clock = status.at("clock");
  out.clock = {clock.value("synchronised", false), bounded(clock.value("error_ns", std::int64_t{0}))};
  out.is_hardware_silent = !status.value("hardware_silent", "").empty();
  return out;
}

std::string to_json(const ApplianceReport& report) {
  ordered_json out{{"format", 1},
                   {"program", report.program},
                   {"run", report.run},
                   {"number", report.number},
                   {"now", format_utc(report.now)},
                   {"recorder", nullptr},
                   {"has_store", report.has_store},
                   {"shipping", nullptr}};
  if (report.recorder) out["recorder"] = json_of(*report.recorder);
  if (const auto& shipping = report.shipping) {
    out["shipping"] = {{"waiting", shipping->waiting},
                       {"waiting_bytes", shipping->waiting_bytes},
                       {"waiting_s", or_null(shipping->waiting_s)},
                       {"holds", shipping->holds},
                       {"problems", shipping->problems}};
  }
  return out.dump();
}

ApplianceReport parse_report(std::string_view text) {
  if (text.size() > kLargestReport)
    refuse("it has more than " + std::to_string(kLargestReport >> 10U) + " KiB");
  const json of = parse_foreign_json(text);
  if (!of.is_object()) refuse("it is no JSON object");
  if (count_of(of, "format") != 1) refuse("it is of a later format; bring kiroku-fleet up to date");
  ApplianceReport report;
  report.program = text_of_field(of, "program");
  const bool is_version =
      report.program.size() <= kLongestVersion && std::ranges::all_of(report.program, [](char c) {
        return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || c == '.' || c == '-' || c == '+' ||
               c == '~';
      });
  if (!is_version) refuse("'program' is no version");
  report.run = text_of_field(of, "run");
  if (report.run.size() != kRunDigits ||
      report.run.find_first_not_of("0123456789abcdef") != std::string::npos)
    refuse("'run' has not 32 hexadecimal digits");
  report.number = size_of(of, "number");
  const std::optional<UtcTime> now = parse_utc(text_of_field(of, "now"));
  if (!now) refuse("'now' is no time");
  report.now = *now;
  if (!field(of, "recorder").is_null()) report.recorder = parse_recorder(of["recorder"]);
  report.has_store = flag_of(of, "has_store");
  if (const json& shipping = field(of, "shipping"); !shipping.is_null()) {
    report.shipping = {size_of(shipping, "waiting"), size_of(shipping, "waiting_bytes"),
                       age_or_null(shipping, "waiting_s"), size_of(shipping, "holds"),
                       size_of(shipping, "problems")};
  }
  return report;
}

}  // namespace kiroku::fleet
