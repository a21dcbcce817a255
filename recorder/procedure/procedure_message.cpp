#include "recorder/procedure/procedure_message.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "recorder/vitals/hl7_time.h"

namespace kiroku::recorder {
namespace {

constexpr std::array<std::string_view, 4> kLeaving{"A03", "A11", "A23", "A29"};
constexpr std::array<std::string_view, 4> kCancelling{"S15", "S16", "S17", "S26"};

/// "2026-08-05T09:15:00+02:00", as precise as it was stated, the zone only where one was.
std::string iso_time(const Hl7Time& time) {
  constexpr std::size_t kToSeconds = 19, kToMinutes = 16, kToDay = 10;
  const bool with_seconds = time.precision >= Hl7Time::Precision::kSecond;
  std::string text = format_utc(time.local)
                         .substr(0, !time.is_instant() ? kToDay : (with_seconds ? kToSeconds : kToMinutes));
  if (time.is_instant() && time.zone) {
    const std::string zone = format_hl7_zone(*time.zone);
    text += zone.substr(0, 3) + ":" + zone.substr(3);
  }
  return text;
}

/// Reads one message, segment by segment.
class Reader {
 public:
  Reader(const Hl7Message& message, std::chrono::minutes assumed_zone)
      : message_(message), assumed_zone_(assumed_zone) {}

  ProcedureMessage read() {
    for (const Hl7Segment& segment : message_.segments()) read(segment);
    const std::string type = message_.type();
    const std::string_view event = std::string_view(type).substr(std::min(type.size(), type.find('^') + 1));
    const auto is_one_of = [&event](const auto& events) {
      return std::find(events.begin(), events.end(), event) != events.end();
    };
    using Kind = ProcedureMessage::Kind;
    if (type.starts_with("SIU")) {
      if (out_.appointment.empty() && out_.planned) {
        out_.appointment = out_.patient + "\n" + format_utc(*out_.planned);
      }
      if (is_one_of(kCancelling)) {
        out_.kind = out_.appointment.empty() ? Kind::kNothing : Kind::kCancels;
      } else if (!out_.patient.empty() && !out_.appointment.empty()) {
        out_.kind = Kind::kAppointment;
      }
    } else if (!out_.patient.empty()) {
      out_.kind = is_one_of(kLeaving) ? Kind::kLeaves : Kind::kPlaces;
    }
    out_.data.origin = "hl7";
    return std::move(out_);
  }

 private:
  [[nodiscard]] std::string first_subcomponent(const Hl7Field& field) const {
    const Hl7Separators& separators = message_.separators();
    return Hl7Field(field.raw().substr(0, field.raw().find(separators.subcomponent)), separators).text();
  }

  /// XPN from component 1, XCN from component 2.
  [[nodiscard]] PersonName name(const Hl7Field& field, std::size_t first) const {
    PersonName name;
    if (field.component(first).empty()) return name;
    name.family = first_subcomponent(field.component(first));
    name.given = field.component(first + 1).text();
    if (const std::string more = field.component(first + 2).text(); !more.empty()) {
      name.given += (name.given.empty() ? "" : " ") + more;
    }
    name.as_sent = field.text();
    return name;
  }

  void add_staff(const std::string& role, const Hl7Field& field) {
    for (const Hl7Field& one : field.repetitions()) {
      StaffMember member{role, one.component(1).text(), name(one, 2)};
      if (!member.id.empty() || !member.name.empty()) out_.data.staff.push_back(std::move(member));
    }
  }

  void add_place(const Hl7Field& field, std::size_t components) {
    std::string joined;
    for (std::size_t i = 1; i <= components; ++i) {
      const std::string part = first_subcomponent(field.component(i));
      if (!part.empty() && !field.component(i).empty()) out_.places.push_back(part);
      joined += (i == 1 ? "" : "^") + part;
    }
    while (joined.ends_with('^')) joined.pop_back();
    if (joined.empty()) return;
    out_.places.push_back(joined);
    if (out_.data.location.empty()) out_.data.location = joined;
  }

  void plan(const Hl7Field& field) {
    const auto time = parse_hl7_time(field.component(1).raw());
    if (!time || out_.planned) return;
    out_.data.planned = iso_time(*time);
    if (time->is_instant()) out_.planned = time->utc(assumed_zone_);
  }

  /// A coded service or procedure; the first one stands.
  void procedure(const Hl7Field& coded, const std::string& words) {
    ProcedureData& data = out_.data;
    if (!data.description.empty() || !data.code.empty()) return;
    data.code = coded.component(1).text();
    data.description = words.empty() ? coded.component(2).text() : words;
    data.coding_system = coded.component(3).text();
  }

  void read_patient(const Hl7Segment& pid) {
    ProcedureData& data = out_.data;
    // The medical record number where one is said to be that, else the first identifier; PID-2 before v2.3.
    const std::vector<Hl7Field> identifiers = pid.field(3).repetitions();
    const auto record_number = std::find_if(identifiers.begin(), identifiers.end(), [](const Hl7Field& one) {
      return one.component(5).text() == "MR" && !one.component(1).empty();
    });
    Hl7Field chosen = pid.field(2);
    if (record_number != identifiers.end()) {
      chosen = *record_number;
    } else if (!pid.field(3).component(1).empty()) {
      chosen = identifiers.front();
    }
    data.patient_id = chosen.component(1).text();
    data.patient_id_issuer = first_subcomponent(chosen.component(4));
    if (!data.patient_id.empty()) out_.patient = data.patient_id + "\n" + data.patient_id_issuer;
    data.patient = name(pid.field(5), 1);
    if (const auto born = parse_hl7_time(pid.field(7).component(1).raw())) {
      constexpr std::size_t kYear = 4, kMonth = 7, kDay = 10;
      const bool whole = born->precision >= Hl7Time::Precision::kDay;
      const bool month = born->precision == Hl7Time::Precision::kMonth;
      data.birth_date = format_utc(born->local).substr(0, whole ? kDay : (month ? kMonth : kYear));
    } else {
      data.birth_date = pid.field(7).text();
    }
    data.sex = pid.field(8).component(1).text();
  }

  void read(const Hl7Segment& segment) {
    const std::string_view name = segment.name();
    if (name == "PID") {
      read_patient(segment);
    } else if (name == "PV1") {
      add_place(segment.field(11), 3);  // temporary location first: the operating room of an in-patient
      add_place(segment.field(3), 3);
      add_staff("attending", segment.field(7));
      out_.data.visit = segment.field(19).component(1).text();
    } else if (name == "PR1") {
      procedure(segment.field(3), segment.field(4).text());
      plan(segment.field(5));
      add_staff("surgeon", segment.field(11));
    } else if (name == "SCH") {
      const std::string filler = segment.field(2).component(1).text();
      out_.appointment = filler.empty() ? segment.field(1).component(1).text() : filler;
      plan(segment.field(11).component(4));
    } else if (name == "TQ1") {
      plan(segment.field(7));
    } else if (name == "AIS") {
      procedure(segment.field(3), "");
      plan(segment.field(4));
    } else if (name == "AIL") {
      add_place(segment.field(3), 3);
    } else if (name == "AIG") {
      add_place(segment.field(3), 2);
    } else if (name == "AIP") {
      const Hl7Field role = segment.field(4);
      const std::string words = role.component(2).text();
      add_staff(words.empty() ? role.component(1).text() : words, segment.field(3));
    }
  }

  const Hl7Message& message_;
  std::chrono::minutes assumed_zone_;
  ProcedureMessage out_;
};

}  // namespace

bool is_of_procedures(const std::string& type) {
  return type.starts_with("ADT^") || type.starts_with("SIU^");
}

ProcedureMessage read_procedure_message(const Hl7Message& message, std::chrono::minutes assumed_zone) {
  return Reader(message, assumed_zone).read();
}

}  // namespace kiroku::recorder
