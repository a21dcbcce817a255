#include "viewer/compare/case_record.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <variant>

#include <nlohmann/json.hpp>

#include "archive/format/pointing_stream.h"
#include "archive/reading/committed_events.h"
#include "base/ascii.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "media/recorded_lines.h"
#include "media/vital_codes.h"
#include "media/vital_line.h"

namespace kiroku::compare {
namespace {

/// Of an event that the ledger commits to, if it is a mark.
void take_event(const nlohmann::json& event, std::vector<Mark>& marks) {
  if (event.at("kind") != "mark") return;
  marks.push_back({event.at("time_ns").get<std::int64_t>(), event.at("text").get<std::string>()});
}

void take_vital(const media::VitalLine& line, const std::string& stream, CaseRecord& record) {
  if (const auto* const sample = std::get_if<media::VitalSample>(&line)) {
    if (!sample->value || sample->code == media::kFlashCode) return;
    // A mean, or a limit that was passed, rests on what somebody stands for.
    if (sample->quality != media::VitalQuality::kGood) {
      ++(sample->quality == media::VitalQuality::kInvalid ? record.left_out.invalid
                                                          : record.left_out.questionable);
      return;
    }
    std::string device = sample->source.empty() ? stream : sample->source;
    const auto known_series = record.vitals.find({sample->code, device});
    // A mean over 120 mmHg and 16 kPa would be none.
    if (known_series != record.vitals.end() && known_series->second.unit != sample->unit)
      device += " in " + (sample->unit.empty() ? "no stated unit" : sample->unit);
    VitalSeries& series = record.vitals[{sample->code, device}];
    if (series.numbers.empty()) {
      const media::VitalCode* const known = media::find_vital_code(sample->code);
      series.label = known != nullptr ? std::string(known->label) : sample->code;
      series.unit = sample->unit;
    }
    series.numbers.push_back({sample->time_ns, *sample->value});
  } else if (const auto* const alarm = std::get_if<media::DeviceAlarm>(&line)) {
    if (alarm->phase != "start") return;
    if (alarm->quality != media::VitalQuality::kGood) {
      ++record.left_out.alarms;
    } else {
      record.alarms.push_back({alarm->time_ns, alarm->about, alarm->text, alarm->priority});
    }
  }
}

}  // namespace

std::optional<double> mmhg_of(double value, std::string_view unit) {
  // UCUM tells case apart; monitors and those who write files by hand do not.
  struct Unit {
    std::string_view name;
    double mmhg;
  };
  constexpr double kOfKilopascal = 7.50062, kOfCentimetreOfWater = 0.735559;
  constexpr std::array<Unit, 8> kUnits{{{"mm[hg]", 1},
                                        {"mmhg", 1},
                                        {"torr", 1},
                                        {"kpa", kOfKilopascal},
                                        {"hpa", kOfKilopascal / 10},
                                        {"pa", kOfKilopascal / 1000},
                                        {"cm[h2o]", kOfCentimetreOfWater},
                                        {"cmh2o", kOfCentimetreOfWater}}};
  const auto* const known = std::ranges::find(kUnits, lower_case(unit), &Unit::name);
  if (known == kUnits.end()) return {};
  return value * known->mmhg;
}

CaseRecord read_case_record(const archive::CaseReader& recording, const crypto::AgeIdentities& identities) {
  CaseRecord record;
  archive::CommittedEvents committed(recording);
  for (const archive::StreamInfo& stream : recording.opening().streams) {
    const auto each_line = [&](const auto& take) {
      media::for_each_recorded_line(recording, identities, stream.name, INT64_MIN, INT64_MAX, take);
    };
    if (archive::is_pointing(stream)) continue;
    if (stream.kind == "events") {
      each_line([&](std::string_view line) {
        const std::optional<std::string> event = committed.take(line);
        if (!event) return;  // it is no event of the case
        try {
          take_event(parse_foreign_json(*event), record.marks);
        } catch (const nlohmann::json::exception&) {
          throw Error("an event of the stream '" + stream.name +
                      "' has another form than this program knows: use a newer one");
        }
      });
    } else if (stream.kind == "vitals") {
      each_line([&](std::string_view line) {
        const media::VitalLineParse parse = media::parse_vital_line_of_any_kind(line);
        if (!parse.line)
          throw Error("a line of the stream '" + stream.name + "' is no vital sign: " + parse.problem);
        take_vital(*parse.line, stream.name, record);
      });
    }
  }
  record.events_lacking = committed.lacking();
  const auto time_of = [](const auto& entry) { return entry.time_ns; };
  std::ranges::stable_sort(record.marks, {}, time_of);
  std::ranges::stable_sort(record.alarms, {}, time_of);
  std::map<std::string, int> devices;
  for (auto& [key, series] : record.vitals) {
    std::ranges::stable_sort(series.numbers, {}, time_of);
    ++devices[key.code];
  }
  for (auto& [key, series] : record.vitals) {
    if (devices[key.code] > 1) series.told_device = key.device;
  }
  return record;
}

}  // namespace kiroku::compare
