#include "recorder/procedure/procedure_message.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <span>
#include <string_view>
#include <utility>

#include "base/ascii.h"
#include "base/bytes.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "recorder/vitals/hl7_observation.h"
#include "recorder/vitals/hl7_patient_part.h"
#include "recorder/vitals/hl7_time.h"
#include "recorder/vitals/sender_zone.h"

namespace kiroku::recorder {
namespace {

// Events of HL7 v2.5, chapter 3. Of those of somebody who goes away (A09, A32) PV1 says where they were. Who
// is on leave (A21, or back no more: A53) is nowhere in the hospital. Of all others but A08 it says nothing
// of now: of the pending ones (A05, A14 to A16) it says where the patient is to be, and of the rest (A31,
// A54, A60) it is what some system had on record.
constexpr std::array<std::string_view, 6> kLeaving{"A03", "A11", "A21", "A23", "A29", "A53"};
constexpr std::array<std::string_view, 2> kDeparting{"A09", "A32"};
/// Of both: an admission, a visit, a record or an arriving that is called off.
constexpr std::array<std::string_view, 4> kTakingBack{"A11", "A23", "A29", "A32"};
constexpr std::array<std::string_view, 12> kMoving{"A01", "A02", "A04", "A06", "A07", "A10",
                                                   "A12", "A13", "A17", "A22", "A33", "A52"};
/// They say where a stay is registered, as a clerk enters it, hours ahead or days later too: not where
/// somebody went, as A02 and A10 do.
constexpr std::array<std::string_view, 7> kRegistering{"A01", "A04", "A06", "A07", "A13", "A22", "A52"};
/// Whoever they move is there, whatever the number of the visit: A06 and A07 change it.
constexpr std::array<std::string_view, 3> kOfAnyVisit{"A06", "A07", "A10"};
/// Of these MRG-1 is what the patient was called before; of others it is the number of an account or a visit.
constexpr std::array<std::string_view, 8> kRenaming{"A18", "A30", "A34", "A36", "A39", "A40", "A46", "A47"};
constexpr std::array<std::string_view, 4> kCancelling{"S15", "S16", "S17", "S26"};
/// They state what becomes of single services and resources of an appointment.
constexpr std::array<std::string_view, 5> kUpdating{"S18", "S19", "S20", "S21", "S22"};
/// What they name is taken out.
constexpr std::array<std::string_view, 3> kTakingOut{"S20", "S21", "S22"};
/// Of a slot that is open for nobody.
constexpr std::array<std::string_view, 2> kBlocking{"S23", "S24"};

/// Behind the number of an account, which is no patient's.
constexpr std::string_view kOfAccount = "\naccount";
constexpr std::size_t kPlaceComponents = 3;  // point of care, room, bed

bool is_one_of(std::string_view event, std::span<const std::string_view> events) {
  return std::ranges::find(events, event) != events.end();
}

/// Whether a status (CE) says so in its code or its words, or in another system's: codes are each hospital's
/// own.
template <typename Says>
bool status_says(const Hl7Field& status, const Says& says) {
  constexpr std::array<std::size_t, 4> kTexts{1, 2, 4, 5};
  return std::ranges::any_of(
      kTexts, [&](std::size_t each) { return says(lower_case(status.component(each).text())); });
}

bool is_any_of(const std::string& word, std::span<const std::string_view> words) {
  return std::ranges::find(words, word) != words.end();
}
bool begins_with_any_of(const std::string& word, std::span<const std::string_view> beginnings) {
  return std::ranges::any_of(beginnings, [&](std::string_view each) { return word.starts_with(each); });
}

/// Whether the system that keeps the appointment calls it off (SCH-25, table 0278): many send S14 with that.
bool is_called_off(const Hl7Field& status) {
  return status_says(status, [](const std::string& word) {
    constexpr std::array<std::string_view, 10> kWords{
        "can", "canc", "dc", "deleted", "noshow", "no show", "no-show", "discontinued", "gelöscht", "中止"};
    constexpr std::array<std::string_view, 6> kBeginnings{"cancel", "storn",      "abgesagt",
                                                          "annul",  "キャンセル", "取消"};
    return is_any_of(word, kWords) || begins_with_any_of(word, kBeginnings);
  });
}

/// Whether it was kept, and is done with.
bool is_finished(const Hl7Field& status) {
  return status_says(status, [](const std::string& word) {
    constexpr std::array<std::string_view, 7> kWords{"finished", "done", "erledigt", "abgeschlossen",
                                                     "完了",     "終了", "実施済"};
    return word.starts_with("complete") || is_any_of(word, kWords);
  });
}

/// Whether it is to be kept: it says so, or says nothing. Of a waiting list, of a word or a code of the
/// hospital's own, nobody can tell.
bool is_booked(const Hl7Field& status) {
  bool says_nothing = true;
  const bool says_so = status_says(status, [&](const std::string& word) {
    constexpr std::array<std::string_view, 8> kWords{"pending", "active",   "admitted",    "ready",
                                                     "new",     "modified", "rescheduled", "確定"};
    constexpr std::array<std::string_view, 17> kBeginnings{
        "booked",  "confirmed", "scheduled",  "planned",     "started",    "overbook",
        "arrived", "checked",   "check-in",   "in progress", "inprogress", "gebucht",
        "geplant", "bestätigt", "terminiert", "予約",        "受付"};
    says_nothing = says_nothing && word.empty();
    return is_any_of(word, kWords) || begins_with_any_of(word, kBeginnings);
  });
  return says_so || says_nothing;
}

/// What a time may be: "no end" is the last second before it.
constexpr UtcTime kEndOfTimes{std::chrono::seconds(253'402'300'800)};
bool is_a_time(UtcTime time) { return time >= UtcTime{} && time < kEndOfTimes + std::chrono::days(1); }

/// Belongs to the whole appointment, though it stands behind a patient.
bool is_of_resources(std::string_view name) { return name == "RGS" || name.starts_with("AI"); }

/// How long is one of a unit in which an offset is stated (CE): those of ISO+ and UCUM, and words for them.
/// HL7 has an empty one mean seconds. Nothing for any other.
std::optional<std::chrono::seconds> length_of_unit(const std::string& unit) {
  using std::chrono::hours;
  using std::chrono::minutes;
  using std::chrono::seconds;
  struct Named {
    std::string_view name;
    seconds length;
  };
  constexpr std::array<Named, 19> kUnits{{{"", seconds(1)},
                                          {"s", seconds(1)},
                                          {"sec", seconds(1)},
                                          {"secs", seconds(1)},
                                          {"second", seconds(1)},
                                          {"seconds", seconds(1)},
                                          {"m", minutes(1)},
                                          {"min", minutes(1)},
                                          {"mins", minutes(1)},
                                          {"minute", minutes(1)},
                                          {"minutes", minutes(1)},
                                          {"h", hours(1)},
                                          {"hr", hours(1)},
                                          {"hrs", hours(1)},
                                          {"hour", hours(1)},
                                          {"hours", hours(1)},
                                          {"d", hours(24)},
                                          {"day", hours(24)},
                                          {"days", hours(24)}}};
  const std::string wanted = lower_case(unit);
  const auto* const found = std::ranges::find(kUnits, wanted, &Named::name);
  return found == kUnits.end() ? std::nullopt : std::optional(found->length);
}

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
  Reader(const Hl7Message& message, const AssumedZone& assumed_zone)
      : message_(message),
        stated_zone_(stated_zone(message)),
        assumed_zone_(zone_of(message, assumed_zone)),
        event_(event_of(message)) {
    constexpr std::size_t kShort = 14;
    const std::string sender = message.sender();
    out_.facility = message.header().field(4).component(1).text();
    if (!sender.empty()) out_.sender = crypto::to_hex(crypto::sha256(bytes_of(sender))).substr(0, kShort);
  }

  /// What concerns the patient of the `which`th PID, and what concerns all of them.
  ProcedureMessage read(std::size_t which) {
    const std::string type = message_.type();
    const bool is_appointment = type.starts_with("SIU");
    read_times();
    std::size_t patient = 0;
    for (const Hl7Segment& segment : message_.segments()) {
      if (segment.name() == "PID") ++patient;
      const bool is_common = patient == 0 || (is_appointment && is_of_resources(segment.name()));
      if (is_common || patient == which) read(segment);
    }
    plan_places();
    const std::string_view event = event_;
    using Kind = ProcedureMessage::Kind;
    if (is_appointment) {
      if (out_.appointment.empty() && out_.planned) {
        out_.appointment = out_.patient + "\n" + format_utc(*out_.planned);
      }
      if (is_one_of(event, kCancelling) || called_off_) {
        out_.kind = out_.appointment.empty() ? Kind::kNothing : Kind::kCancels;
      } else if (!out_.appointment.empty() && (!out_.patient.empty() || !is_one_of(event, kBlocking))) {
        // Whose it is a change need not say (PID is optional): whose it was, by its number.
        out_.kind = Kind::kAppointment;
      }
      finish_rooms();
    } else if (!out_.patient.empty()) {
      out_.moves = is_one_of(event, kMoving);
      out_.is_of_record = event == "A08";
      out_.registers = is_one_of(event, kRegistering);
      out_.corrects = event == "A08" || event == "A31";
      out_.cancels_move = event == "A12";
      out_.swaps_beds = event == "A17";
      out_.cancels_departing = event == "A33";
      out_.takes_back = is_one_of(event, kTakingBack);
      out_.is_of_any_visit = is_one_of(event, kOfAnyVisit);
      out_.kind = is_one_of(event, kLeaving)        ? Kind::kLeaves
                  : is_one_of(event, kDeparting)    ? Kind::kDeparts
                  : out_.moves || out_.is_of_record ? Kind::kPlaces
                                                    : Kind::kFacts;
      // Whoever was discharged is nowhere, whatever place their record names still. Whoever moves is not.
      if (out_.kind == Kind::kPlaces && out_.is_of_record && is_discharged()) {
        out_.kind = Kind::kDeparts;
        out_.places.clear();
        out_.discharged = discharged_.within ? discharged_.within->latest : discharged_.at;
      }
    } else {
      out_.leaves_unnamed = is_one_of(event, kLeaving) || is_one_of(event, kDeparting);
    }
    out_.books = event == "S12" || event == "S13";
    out_.rebooks = event == "S13";
    // What is told of somebody's record may name when they came.
    if (!out_.moves) out_.happened = out_.told;
    const bool is_renamed = is_one_of(event, kRenaming) && !out_.patient.empty();
    if (!is_renamed || out_.replaces == out_.patient) {
      out_.replaces.clear();
      out_.replaced_numbers.clear();
    }
    out_.data.origin = "hl7";
    return std::move(out_);
  }

 private:
  /// Some leave it to EVN-1.
  static std::string event_of(const Hl7Message& message) {
    const std::string type = message.type();
    const std::size_t end = type.find('^');
    std::string event = end == std::string::npos ? "" : type.substr(end + 1);
    for (const Hl7Segment& segment : message.segments()) {
      if (event.empty() && segment.name() == "EVN") event = segment.field(1).component(1).text();
    }
    return event;
  }

  /// PV1-45 of before it was told. What cannot be read says nothing, as some fill it with zeros; a day alone
  /// is over when it has passed.
  [[nodiscard]] bool is_discharged() const {
    if (discharged_.within) return out_.told && discharged_.within->latest <= *out_.told;
    return discharged_.at && (!out_.told || *discharged_.at <= *out_.told);
  }

  void read_times() {
    const auto time = [this](const Hl7Field& field) -> std::optional<UtcTime> {
      const auto read = parse_hl7_time(field.component(1).raw());
      if (!read || !read->is_instant() || read->utc(assumed_zone_) < UtcTime{}) return {};
      return read->utc(assumed_zone_);
    };
    const auto earlier = [](std::optional<UtcTime>& of, const std::optional<UtcTime>& other) {
      if (other && (!of || *other < *of)) of = other;
    };
    // What is told was not told after the message was sent, nor did it happen after it was told.
    out_.told = time(message_.header().field(7));
    std::optional<UtcTime> happened;
    for (const Hl7Segment& segment : message_.segments()) {
      if (segment.name() != "EVN") continue;
      earlier(out_.told, time(segment.field(2)));
      earlier(happened, time(segment.field(6)));
    }
    out_.happened = out_.told;
    earlier(out_.happened, happened);
  }

  [[nodiscard]] std::string first_subcomponent(const Hl7Field& field) const {
    return recorder::first_subcomponent(field, message_.separators());
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
    if (out_.places.size() > kMostPlaces) return;
    std::string joined, with_facility;
    for (std::size_t i = 1; i <= components; ++i) {
      const std::string part = first_subcomponent(field.component(i));
      if (!part.empty() && !field.component(i).empty()) out_.places.push_back(part);
      joined += (i == 1 ? "" : "^") + part;
    }
    // PL.4: two hospitals may have a room of one name.
    if (components == kPlaceComponents && !field.component(4).empty())
      with_facility = joined + "^" + first_subcomponent(field.component(4));
    while (joined.ends_with('^')) joined.pop_back();
    if (joined.empty()) return;
    if (!with_facility.empty()) out_.places.push_back(with_facility);
    out_.places.push_back(joined);
    if (out_.data.location.empty()) out_.data.location = joined;
  }

  /// A time that a message states of something planned: one of them, or nothing.
  struct Stated {
    std::optional<UtcTime> at;
    std::string text;
    bool is_unclear = false;              // it cannot be read
    std::optional<TimeSpan> within = {};  // a day alone, or another time without its minute
  };
  [[nodiscard]] Stated stated(const Hl7Field& field) const {
    Stated stated;
    auto time = parse_hl7_time(field.component(1).raw());
    if (!time) {
      stated.is_unclear = !field.component(1).empty();
      return stated;
    }
    const bool is_instant = time->is_instant();
    Hl7Time end = *time;
    end.local += length_of(time->precision);
    const TimeSpan within{time->utc(assumed_zone_), end.utc(assumed_zone_)};
    if (!is_a_time(within.earliest) || !is_a_time(within.latest)) {
      stated.is_unclear = true;
      return stated;
    }
    if (is_instant) {
      stated.at = within.earliest;
    } else {
      stated.within = within;
    }
    if (is_instant && !time->zone && stated_zone_) {
      time->zone = std::chrono::duration_cast<std::chrono::minutes>(assumed_zone_.at(time->local));
    }
    stated.text = iso_time(*time);
    return stated;
  }

  /// How long the time is that is stated so, at most.
  static std::chrono::hours length_of(Hl7Time::Precision precision) {
    using Precision = Hl7Time::Precision;
    using std::chrono::hours;
    return hours(precision == Precision::kYear    ? 366 * 24
                 : precision == Precision::kMonth ? 31 * 24
                 : precision == Precision::kDay   ? 24
                 : precision == Precision::kHour  ? 1
                                                  : 0);
  }

  void plan(const Hl7Field& field) { take_time(stated(field)); }
  /// The first one that says when stands, else the first one that says something.
  void take_time(const Stated& time) {
    if (out_.planned) return;
    if (time.at || (time.within && !out_.within)) {
      out_.data.planned = time.text;
      out_.planned = time.at;
      out_.within = time.within;
    }
    out_.is_time_unclear = !time.at && (out_.is_time_unclear || time.is_unclear || time.within);
  }

  struct Service {
    std::string description, code, coding_system;
    [[nodiscard]] bool empty() const { return description.empty() && code.empty(); }
  };
  /// A coded service or procedure.
  [[nodiscard]] static Service service(const Hl7Field& coded, const std::string& words) {
    return {words.empty() ? coded.component(2).text() : words, coded.component(1).text(),
            coded.component(3).text()};
  }
  /// The first one stands.
  void procedure(const Service& one) {
    ProcedureData& data = out_.data;
    if (!data.description.empty() || !data.code.empty()) return;
    data.description = one.description;
    data.code = one.code;
    data.coding_system = one.coding_system;
  }

  /// When a resource or a service is needed: a time of its own (AIS-4, AIL-6, AIG-8), or so long after the
  /// appointment begins (the two fields behind it: an amount and its unit).
  struct Needed {
    Stated time;
    Hl7Field offset, unit;
  };
  [[nodiscard]] Needed needed(const Hl7Segment& segment, std::size_t time) const {
    return {stated(segment.field(time)), segment.field(time + 1), segment.field(time + 2)};
  }
  /// Nothing where it says nothing.
  [[nodiscard]] std::optional<Stated> moment_of(const Needed& needed) const {
    const Stated& own = needed.time;
    if (own.at || own.is_unclear) return own;
    // A day alone says no more than the appointment does, or something else.
    if (own.within && !(out_.planned && out_.data.planned.starts_with(own.text)))
      return Stated{{}, own.text, true, own.within};
    if (needed.offset.component(1).empty()) return {};
    const std::optional<double> amount = parse_decimal(needed.offset.component(1).raw());
    if (amount && *amount == 0) return {};
    Stated stated;
    const std::string code = needed.unit.component(1).text(), words = needed.unit.component(2).text();
    std::optional<std::chrono::seconds> unit = length_of_unit(code.empty() ? words : code);
    if (!unit && !words.empty()) unit = length_of_unit(words);
    // Beyond a year it is none of an appointment's, and beyond what a time can hold.
    constexpr double kMostSeconds = 366.0 * 24 * 3600;
    const double seconds = amount && unit ? *amount * static_cast<double>(unit->count()) : kMostSeconds + 1;
    if (!out_.planned || std::abs(seconds) > kMostSeconds) {
      stated.is_unclear = true;
      return stated;
    }
    const UtcTime moved = *out_.planned + std::chrono::microseconds(std::llround(seconds * 1e6));
    if (moved < UtcTime{} || moved >= kEndOfTimes) {
      stated.is_unclear = true;
      return stated;
    }
    stated.at = moved;
    stated.text = format_utc(*stated.at).substr(0, 19) + "+00:00";
    return stated;
  }

  /// Services and places of one resource group (RGS) belong together.
  struct ServiceOfGroup {
    std::size_t group = 0;
    Service service;
    Needed needed;
  };
  struct PlaceOfGroup {
    std::size_t group = 0;
    PlannedPlace place;
    Needed needed;
  };

  /// Once all is read: what an appointment's offsets count from may stand behind them.
  void plan_places() {
    if (!services_.empty()) take_time(services_.front().needed.time);
    if (!places_.empty()) take_time(places_.front().needed.time);
    for (PlaceOfGroup& each : places_) {
      PlannedPlace& place = each.place;
      const auto its_service = std::ranges::find(services_, each.group, &ServiceOfGroup::group);
      std::optional<Stated> time = moment_of(each.needed);
      if (!time && its_service != services_.end()) time = moment_of(its_service->needed);
      if (!time) time = Stated{out_.planned, out_.data.planned, out_.is_time_unclear, out_.within};
      place.planned = time->at;
      place.within = time->within;
      place.is_time_unclear = time->is_unclear;
      place.planned_text = time->text;
      if (its_service != services_.end() && !its_service->service.empty()) {
        place.description = its_service->service.description;
        place.code = its_service->service.code;
        place.coding_system = its_service->service.coding_system;
      }
      out_.planned_places.push_back(std::move(place));
    }
  }
  /// Of AIL and AIG: `components` of the third field name the place.
  void planned_place(const Hl7Segment& segment, std::size_t components, std::size_t time) {
    for (const Hl7Field& one : segment.field(3).repetitions()) {
      const std::size_t before = out_.places.size();
      const std::string location = std::exchange(out_.data.location, "");
      add_place(one, components);
      PlannedPlace place;
      place.spellings.assign(out_.places.begin() + static_cast<std::ptrdiff_t>(before), out_.places.end());
      place.location = out_.data.location;
      if (!location.empty()) out_.data.location = location;
      if (!place.spellings.empty()) places_.push_back({group_, std::move(place), needed(segment, time)});
    }
  }

  [[nodiscard]] std::vector<std::string> spellings_of(const Hl7Field& field, std::size_t components) {
    const std::size_t before = out_.places.size();
    const std::string location = out_.data.location;
    add_place(field, components);
    const auto first = out_.places.begin() + static_cast<std::ptrdiff_t>(before);
    std::vector<std::string> spellings(first, out_.places.end());
    out_.places.erase(first, out_.places.end());
    out_.data.location = location;
    return spellings;
  }

  void take_place_out(const Hl7Segment& segment, std::size_t components) {
    for (const Hl7Field& one : segment.field(3).repetitions()) {
      for (std::string& place : spellings_of(one, components)) {
        is_group_without_place_ = false;
        out_.taken_out.push_back(std::move(place));
      }
    }
  }
  [[nodiscard]] bool is_added(const std::string& action) const {
    return action == "A" || (action.empty() && event_ == "S18");
  }
  /// A group that is taken out and does not say of which place.
  void end_group() {
    if (group_taken_out_ && is_group_without_place_) out_.are_rooms_unclear = true;
  }
  void finish_rooms() {
    end_group();
    out_.is_update = has_action_codes_ || is_one_of(event_, kUpdating);
    out_.adds_rooms = out_.is_update && !names_more_than_added_;
  }

  /// "" where it is empty.
  [[nodiscard]] std::string key_of(const Hl7Field& identifier) const {
    const std::string number = identifier.component(1).text();
    return number.empty() ? "" : number + "\n" + first_subcomponent(identifier.component(4));
  }

  void read_patient(const Hl7Segment& pid) {
    ProcedureData& data = out_.data;
    const Hl7Field chosen = chosen_identifier(pid.field(3), pid.field(2));
    data.patient_id = chosen.component(1).text();
    data.patient_id_issuer = first_subcomponent(chosen.component(4));
    out_.patient = key_of(chosen);
    // Some name whoever leaves by their account alone.
    out_.account = key_of(pid.field(18));
    if (out_.patient.empty() && !out_.account.empty()) out_.patient = out_.account + std::string(kOfAccount);
    add_numbers(out_.numbers, numbers_of(pid, message_.separators()));
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

  /// Of PV1. Whoever is at a temporary location (PV1-11: the operating room of an in-patient) keeps the
  /// assigned one (PV1-3), and is not there.
  void read_places(const Hl7Segment& visit) {
    const bool departs = is_one_of(event_, kDeparting), leaves = is_one_of(event_, kLeaving);
    const auto has_named = [&](std::size_t field) {
      const std::size_t before = out_.places.size();
      if (!visit.field(field).empty()) add_place(visit.field(field), kPlaceComponents);
      return out_.places.size() > before;
    };
    const bool is_elsewhere = has_named(11);
    const bool was_elsewhere = departs && has_named(43);  // the prior temporary one
    if (is_elsewhere && !departs && !leaves) out_.kept_bed = spellings_of(visit.field(3), kPlaceComponents);
    if (event_ == "A12") out_.prior = spellings_of(visit.field(6), kPlaceComponents);
    // Whoever departs is in none of them: some systems name the place that is left by PV1-11, others the one
    // where the patient goes. By PV1-43 alone they go back to where they are assigned.
    if (departs ? is_elsewhere || !was_elsewhere : leaves || !is_elsewhere)
      add_place(visit.field(3), kPlaceComponents);
    if (departs && !is_elsewhere && !was_elsewhere) add_place(visit.field(6), kPlaceComponents);
  }

  /// The namespace of an entity identifier (EI.2, EI.3): who gave the number.
  [[nodiscard]] Assigner assigner_of(const Hl7Field& identifier) const {
    return {first_subcomponent(identifier.component(2)), first_subcomponent(identifier.component(3))};
  }

  void read(const Hl7Segment& segment) {
    const std::string_view name = segment.name();
    // A change of an appointment names what is taken out of it, too (segment action code, table 0206).
    // Or says of it that it is called off (table 0278).
    const std::size_t status_field = name == "AIS" ? 10 : name == "AIL" ? 12 : name == "AIG" ? 14 : 0;
    const std::string action = is_of_resources(name) ? segment.field(2).text() : "";
    const bool is_called_off_alone = status_field > 0 && is_called_off(segment.field(status_field));
    const bool is_taken_out = action == "D" || is_called_off_alone ||
                              (action.empty() && status_field > 0 && is_one_of(event_, kTakingOut));
    if (is_of_resources(name)) out_.names_resources = true;
    if (name == "AIL" && !segment.field(3).empty()) out_.names_rooms = true;
    if (name == "RGS") {
      end_group();
      group_taken_out_ = is_taken_out;
      is_group_without_place_ = true;
      ++group_;
    }
    has_action_codes_ = has_action_codes_ || !action.empty();
    if (is_taken_out || (group_taken_out_ && is_of_resources(name))) {
      if (name == "AIL" || name == "AIG") take_place_out(segment, name == "AIL" ? kPlaceComponents : 2);
      return;
    }
    if (name == "AIL") names_more_than_added_ = names_more_than_added_ || !is_added(action);
    if (name == "PID") {
      read_patient(segment);
    } else if (name == "MRG") {
      const Hl7Field chosen = chosen_identifier(segment.field(1), segment.field(4));
      out_.replaces = key_of(chosen);
      take_numbers(out_.replaced_numbers, chosen, false, message_.separators());
      take_numbers(out_.replaced_numbers, segment.field(1), false, message_.separators());
      take_numbers(out_.replaced_numbers, segment.field(4), false, message_.separators());
    } else if (name == "PV1") {
      read_places(segment);
      add_staff("attending", segment.field(7));
      out_.data.visit = out_.visit = segment.field(19).component(1).text();
      discharged_ = stated(segment.field(45));
    } else if (name == "PR1") {
      procedure(service(segment.field(3), segment.field(4).text()));
      plan(segment.field(5));
      add_staff("surgeon", segment.field(11));
    } else if (name == "SCH") {
      out_.placer = segment.field(1).component(1).text();
      out_.filler = segment.field(2).component(1).text();
      out_.placer_by = assigner_of(segment.field(1));
      out_.filler_by = assigner_of(segment.field(2));
      out_.appointment = out_.filler.empty() ? out_.placer : out_.filler;
      plan(segment.field(11).component(4));
      called_off_ = is_called_off(segment.field(25));
      out_.is_over = is_finished(segment.field(25));
      out_.says_no_status = segment.field(25).empty();
      out_.is_status_unclear = !called_off_ && !out_.is_over && !is_booked(segment.field(25));
    } else if (name == "TQ1") {
      plan(segment.field(7));
    } else if (name == "AIS") {
      services_.push_back({group_, service(segment.field(3), ""), needed(segment, 4)});
      procedure(services_.back().service);
    } else if (name == "AIL") {
      planned_place(segment, kPlaceComponents, 6);
    } else if (name == "AIG") {
      planned_place(segment, 2, 8);
    } else if (name == "AIP") {
      const Hl7Field role = segment.field(4);
      const std::string words = role.component(2).text();
      add_staff(words.empty() ? role.component(1).text() : words, segment.field(3));
    }
  }

  const Hl7Message& message_;
  const std::optional<std::chrono::minutes> stated_zone_;
  const AssumedZone assumed_zone_;
  const std::string event_;
  bool called_off_ = false, group_taken_out_ = false;
  bool is_group_without_place_ = false, has_action_codes_ = false, names_more_than_added_ = false;
  Stated discharged_;  // PV1-45
  std::size_t group_ = 0;
  std::vector<ServiceOfGroup> services_;
  std::vector<PlaceOfGroup> places_;
  ProcedureMessage out_;
};

}  // namespace

bool is_of_procedures(const std::string& type) {
  // Some leave the event to EVN-1.
  return type == "ADT" || type.starts_with("ADT^") || type.starts_with("SIU^");
}

bool has_its_numbers(const ProcedureMessage& message) {
  const auto has = [](const std::vector<PatientNumber>& numbers, const std::string& key) {
    return key.empty() || std::ranges::any_of(numbers, [&](const PatientNumber& each) {
             const std::string named = each.number + "\n" + each.issuer;
             return key == named || (each.is_of_account && key == named + std::string(kOfAccount));
           });
  };
  return has(message.numbers, message.patient) && has(message.replaced_numbers, message.replaces);
}

std::optional<bool> same_number_of_appointment(const ProcedureMessage& a, const ProcedureMessage& b) {
  // Nothing where it is not known: each system counts its own.
  const auto by_one = [&](const Assigner& one, const Assigner& other) -> std::optional<bool> {
    if (!one.id.empty() && !other.id.empty()) return one.id == other.id;
    if (!one.name.empty() && !other.name.empty()) return same_but_for_case(one.name, other.name);
    return a.sender == b.sender ? std::optional(true) : std::nullopt;
  };
  // A filler's number is of one appointment; a placer's may be of a series.
  if (!a.filler.empty() && !b.filler.empty()) {
    if (a.filler != b.filler) return false;
    return by_one(a.filler_by, b.filler_by);
  }
  if (!a.placer.empty() && !b.placer.empty()) {
    if (a.placer != b.placer) return false;
    return by_one(a.placer_by, b.placer_by);
  }
  if (a.appointment != b.appointment) return false;
  return by_one(a.filler.empty() ? a.placer_by : a.filler_by, b.filler.empty() ? b.placer_by : b.filler_by);
}

std::vector<ProcedureMessage> read_procedure_messages(const Hl7Message& message,
                                                      const AssumedZone& assumed_zone) {
  const auto named =
      static_cast<std::size_t>(std::ranges::count(message.segments(), "PID", &Hl7Segment::name));
  const std::size_t patients = std::clamp<std::size_t>(named, 1, kMostPatients);
  std::vector<ProcedureMessage> all;
  for (std::size_t which = 1; which <= patients; ++which) {
    ProcedureMessage one = Reader(message, assumed_zone).read(which);
    if (std::ranges::find(all, one.patient, &ProcedureMessage::patient) == all.end())
      all.push_back(std::move(one));
  }
  return all;
}

}  // namespace kiroku::recorder
