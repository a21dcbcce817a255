// The book as bytes. Members are taken by structured bindings: with a new one this does not compile before
// it is handed over, too.
#include <algorithm>
#include <concepts>
#include <type_traits>
#include <utility>

#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/state_codec.h"

namespace kiroku::recorder {
namespace {

constexpr std::uint64_t kVersion = 10;
/// Which knows not who left as they never came.
constexpr std::uint64_t kVersionOfOneLeaving = 9;
/// Which knows of no claims, accounts and kept beds.
constexpr std::uint64_t kVersionWithoutClaims = 8;
/// Which knows not who gave an appointment's number, nor what says that somebody is at a place.
constexpr std::uint64_t kVersionOfOneNumber = 7;
/// Which knows nothing of what was recorded.
constexpr std::uint64_t kVersionWithoutRecorded = 6;
/// Which knows no move that was cancelled, of each visit one number, and of all that was lost of a place when
/// it counted first and last.
constexpr std::uint64_t kVersionBefore = 5;
/// Which knows one doubt alone, no visits, and nothing of where somebody was before.
constexpr std::uint64_t kVersionOfOneDoubt = 4;
/// Which knows nothing of the times of single places, and of when somebody came to a room or left it.
constexpr std::uint64_t kVersionOfOneTime = 3;
/// Which knows nothing of doubts, of mergers and of whoever was in a room before, either. Both are read once,
/// by the upgrade.
constexpr std::uint64_t kOlderVersion = 2;

template <typename T, typename Wanted>
concept Is = std::same_as<std::remove_const_t<T>, Wanted>;

template <typename Codec, Is<std::vector<std::string>> Texts>
void members(Codec& codec, Texts& texts) {
  if constexpr (Codec::kReads) {
    for (std::size_t left = codec.length(); left > 0; --left) codec.one(texts.emplace_back());
  } else {
    codec.one(static_cast<std::uint64_t>(texts.size()));
    for (const std::string& text : texts) codec.one(text);
  }
}

template <typename Codec, Is<std::map<std::string, std::string>> Texts>
void members(Codec& codec, Texts& texts) {
  if constexpr (Codec::kReads) {
    for (std::size_t left = codec.length(); left > 0; --left) {
      std::string key, text;
      codec.all(key, text);
      if (!texts.emplace(std::move(key), std::move(text)).second) StateReader::refuse();
    }
  } else {
    codec.one(static_cast<std::uint64_t>(texts.size()));
    for (const auto& [key, text] : texts) codec.all(key, text);
  }
}

template <typename Codec, Is<PersonName> Name>
void members(Codec& codec, Name& name) {
  auto& [family, given, as_sent] = name;
  codec.all(family, given, as_sent);
}

template <typename Codec, Is<StaffMember> Member>
void members(Codec& codec, Member& member) {
  auto& [role, id, name] = member;
  codec.all(role, id);
  members(codec, name);
}

template <typename Codec, Is<ProcedureData> Data>
void members(Codec& codec, Data& data) {
  auto& [patient_id, patient_id_issuer, patient, birth_date, sex, visit, description, code, coding_system,
         procedure_id, accession, study_uid, planned, location, staff, origin, chosen, numbers] = data;
  // Without numbers, which are those of the message.
  codec.all(patient_id, patient_id_issuer, birth_date, sex, visit, description, code, coding_system,
            procedure_id, accession, study_uid, planned, location, origin, chosen);
  members(codec, patient);
  if constexpr (Codec::kReads) {
    for (std::size_t left = codec.length(); left > 0; --left) members(codec, staff.emplace_back());
  } else {
    codec.one(static_cast<std::uint64_t>(staff.size()));
    for (const StaffMember& each : staff) members(codec, each);
  }
}

template <typename Codec, Is<std::optional<UtcTime>> Time>
void members(Codec& codec, Time& time) {
  // With a moment's bounds.
  ProcedureMoment moment{time.value_or(UtcTime{}), Clock::Duration::zero()};
  bool is_there = time.has_value();
  codec.one(is_there);
  codec.within_bounds(moment);
  if constexpr (Codec::kReads) time = is_there ? std::optional(moment.utc) : std::nullopt;
}

template <typename Codec, Is<std::vector<PatientNumber>> Numbers>
void members(Codec& codec, Numbers& numbers) {
  const auto one = [&codec](auto& each) {
    auto& [number, issuer, issuer_id, type, is_of_account] = each;
    codec.all(number, issuer, issuer_id, type, is_of_account);
  };
  if constexpr (Codec::kReads) {
    for (std::size_t left = codec.length(); left > 0; --left) one(numbers.emplace_back());
  } else {
    codec.one(static_cast<std::uint64_t>(numbers.size()));
    for (const PatientNumber& each : numbers) one(each);
  }
}

template <typename Codec, Is<PlannedPlace> Place>
void members(Codec& codec, Place& place) {
  // Without `within`, which stands at the end of what is kept: versions before had none.
  auto& [spellings, planned, is_time_unclear, planned_text, location, description, code, coding_system,
         within] = place;
  members(codec, spellings);
  members(codec, planned);
  codec.all(is_time_unclear, planned_text, location, description, code, coding_system);
}

template <typename Codec, Is<std::vector<PlannedPlace>> Places>
void members(Codec& codec, Places& places) {
  if constexpr (Codec::kReads) {
    for (std::size_t left = codec.length(); left > 0; --left) members(codec, places.emplace_back());
  } else {
    codec.one(static_cast<std::uint64_t>(places.size()));
    for (const PlannedPlace& each : places) members(codec, each);
  }
}

template <typename Codec, Is<ProcedureMessage> Message>
void members(Codec& codec, Message& message) {
  // Without planned_places and what follows, which stand at the end of what is kept (later_members()).
  auto& [kind, moves, sender, told, happened, patient, replaces, numbers, replaced_numbers, appointment,
         placer, filler, is_over, places, planned, data, planned_places, is_time_unclear, within, facility,
         visit, is_of_any_visit, cancels_move, is_of_record, books, corrects, names_resources, leaves_unnamed,
         registers, placer_by, filler_by, names_rooms, is_status_unclear, says_no_status, kept_bed, account,
         prior, discharged, swaps_beds, cancels_departing, rebooks, is_update, adds_rooms, taken_out,
         are_rooms_unclear, takes_back] = message;
  if constexpr (Codec::kReads) {
    kind = static_cast<ProcedureMessage::Kind>(
        codec.number_below(static_cast<std::uint64_t>(ProcedureMessage::Kind::kNothing) + 1));
  } else {
    codec.one(static_cast<std::uint64_t>(kind));
  }
  codec.all(moves, sender, patient, replaces, appointment, placer, filler, is_over);
  members(codec, told);
  members(codec, happened);
  members(codec, numbers);
  members(codec, replaced_numbers);
  members(codec, places);
  members(codec, planned);
  members(codec, data);
}

template <typename Codec, Is<std::optional<TimeSpan>> Span>
void members(Codec& codec, Span& span) {
  std::optional<UtcTime> earliest, latest;
  if constexpr (!Codec::kReads) {
    if (span) earliest = span->earliest;
    if (span) latest = span->latest;
  }
  members(codec, earliest);
  members(codec, latest);
  if constexpr (Codec::kReads) {
    span.reset();
    if (earliest && latest) span = TimeSpan{*earliest, *latest};
  }
}

/// Without what an event says of itself alone.
template <typename Codec, Is<ProcedureMessage> Message>
void later_members(Codec& codec, Message& message) {
  codec.all(message.is_time_unclear, message.facility, message.visit, message.is_of_record);
  members(codec, message.within);
  for (auto& place : message.planned_places) members(codec, place.within);
}

}  // namespace

struct ProcedureBook::AsBytes {
  template <typename Codec, Is<Arrival> Came>
  static void arrival(Codec& codec, Came& came) {
    auto& [number, at, sender, happened] = came;
    // What was told late may have come before the boot.
    ProcedureMoment later{at.utc + kLongestBefore, at.since_boot + kLongestBefore};
    codec.all(number, later, sender);
    members(codec, happened);
    if constexpr (Codec::kReads) at = {later.utc - kLongestBefore, later.since_boot - kLongestBefore};
  }

  template <typename Codec, Is<Kept> One>
  static void kept(Codec& codec, One& one, std::uint64_t version) {
    auto& [received, message, since, doubt, moved, gone, booked, apart, visits, ways] = one;
    arrival(codec, received);
    members(codec, message);
    if constexpr (Codec::kReads) {
      for (std::size_t left = codec.length(); left > 0; --left) {
        std::string place;
        Arrival came{0, UtcTime{}};
        codec.one(place);
        arrival(codec, came);
        if (!since.emplace(std::move(place), came).second) StateReader::refuse();
      }
    } else {
      codec.one(static_cast<std::uint64_t>(since.size()));
      for (const auto& [place, came] : since) {
        codec.one(place);
        arrival(codec, came);
      }
    }
    if (version > kOlderVersion) {
      bool is_in_doubt = doubt != Doubt::kNone;
      codec.one(is_in_doubt);
      if constexpr (Codec::kReads) doubt = is_in_doubt ? Doubt::kToldLate : Doubt::kNone;
      members(codec, moved);
    }
    if (version > kVersionOfOneTime) members(codec, message.planned_places);
    if (version > kVersionOfOneDoubt) later_kept(codec, one, version);
    if (version > kVersionBefore) {
      members(codec, visits);
    } else if constexpr (Codec::kReads) {
      const bool is_of_appointment = message.kind == ProcedureMessage::Kind::kAppointment ||
                                     message.kind == ProcedureMessage::Kind::kCancels;
      if (!is_of_appointment) one.note_visit(message);
    }
    if (version > kVersionOfOneNumber) newest_kept(codec, one);
    if (version > kVersionWithoutClaims) {
      members(codec, message.kept_bed);
      codec.one(message.account);
    }
    if (version > kVersionOfOneLeaving) codec.one(message.takes_back);
  }

  template <typename Codec, Is<Kept> One>
  static void newest_kept(Codec& codec, One& one) {
    auto& message = one.message;
    codec.all(message.placer_by.name, message.placer_by.id, message.filler_by.name, message.filler_by.id,
              message.names_rooms);
    if constexpr (Codec::kReads) {
      for (std::size_t left = codec.length(); left > 0; --left) {
        std::string place;
        codec.one(place);
        const auto way = static_cast<Way>(codec.number_below(static_cast<std::uint64_t>(Way::kMoved)));
        if (!one.ways.emplace(std::move(place), way).second) StateReader::refuse();
      }
    } else {
      codec.one(static_cast<std::uint64_t>(one.ways.size()));
      for (const auto& [place, way] : one.ways) {
        codec.one(place);
        codec.one(static_cast<std::uint64_t>(way));
      }
    }
  }

  template <typename Codec, Is<Kept> One>
  static void later_kept(Codec& codec, One& one, std::uint64_t version) {
    later_members(codec, one.message);
    codec.one(one.apart);
    bool is_booked = one.booked.has_value();
    codec.one(is_booked);
    if constexpr (Codec::kReads) {
      one.doubt =
          static_cast<Doubt>(codec.number_below(static_cast<std::uint64_t>(Doubt::kRecordedHere) + 1));
      if (is_booked) arrival(codec, one.booked.emplace(Arrival{0, UtcTime{}}));
      for (std::size_t left = codec.length(); left > 0; --left) {
        std::string place;
        Went went{Arrival{0, UtcTime{}}};
        codec.all(place, went.is_event);
        if (version > kVersionBefore) codec.one(went.is_cancelled);
        arrival(codec, went.when);
        if (!one.gone.emplace(std::move(place), went).second) StateReader::refuse();
      }
    } else {
      codec.one(static_cast<std::uint64_t>(one.doubt));
      if (is_booked) arrival(codec, *one.booked);
      codec.one(static_cast<std::uint64_t>(one.gone.size()));
      for (const auto& [place, went] : one.gone) {
        codec.all(place, went.is_event, went.is_cancelled);
        arrival(codec, went.when);
      }
    }
  }

  /// What was told late may have happened before the boot.
  static void write(StateWriter& writer, const ProcedureMoment& at) {
    writer.one(ProcedureMoment{at.utc + kLongestBefore, at.since_boot + kLongestBefore});
  }
  static ProcedureMoment read(StateReader& reader) {
    ProcedureMoment later{UtcTime{}};
    reader.one(later);
    return {later.utc - kLongestBefore, later.since_boot - kLongestBefore};
  }

  static void write(StateWriter& writer, const LostPlaces& places) {
    writer.one(static_cast<std::uint64_t>(places.size()));
    for (const auto& [place, lost] : places) {
      writer.one(place);
      write(writer, lost.first);
      write(writer, lost.last);
    }
  }
  static void read(StateReader& reader, LostPlaces& places, std::uint64_t version) {
    for (std::int64_t left = reader.number_below(kMostKept + 1); left > 0; --left) {
      std::string place;
      reader.one(place);
      const ProcedureMoment first = read(reader), last = read(reader);
      // All of a place was one before.
      if (version <= kVersionBefore) place = key_of_lost(place, first);
      if (!places.emplace(std::move(place), Lost{first, last}).second) StateReader::refuse();
    }
  }

  template <typename Codec, Is<Passed> One>
  static void passed(Codec& codec, One& one) {
    auto& [came, went] = one;
    arrival(codec, came);
    arrival(codec, went);
  }

  template <typename Codec, Is<SenderClock> Shown>
  static void clock(Codec& codec, Shown& shown) {
    auto& [newest, behind_since] = shown;
    // With a moment's bounds.
    ProcedureMoment moment{newest, behind_since.value_or(Clock::Duration::zero())};
    bool is_behind = behind_since.has_value();
    codec.all(is_behind, moment);
    if constexpr (Codec::kReads) {
      newest = moment.utc;
      behind_since = is_behind ? std::optional(moment.since_boot) : std::nullopt;
    }
  }

  static void write(StateWriter& writer, const Messages& messages) {
    writer.one(static_cast<std::uint64_t>(messages.size()));
    for (const auto& [key, one] : messages) kept(writer, one, kVersion);
  }

  /// What has a time that none can be is forgotten, alone.
  template <typename KeyOf>
  static Messages read(StateReader& reader, std::uint64_t version, std::uint64_t arrivals,
                       const KeyOf& key_of, std::vector<Kept>& lost) {
    Messages messages;
    for (std::int64_t left = reader.number_below(kMostKept + 1); left > 0; --left) {
      Kept one{Arrival{0, UtcTime{}}, {}, {}};
      kept(reader, one, version);
      const auto is_of_book = [&](const Arrival& each) { return each.number <= arrivals; };
      bool is_known = is_of_book(one.received) && (!one.booked || is_of_book(*one.booked));
      for (const auto& [place, came] : one.since) is_known = is_known && is_of_book(came);
      for (const auto& [place, went] : one.gone) is_known = is_known && is_of_book(went.when);
      std::string key = key_of(one);
      if (!is_known || messages.contains(key)) StateReader::refuse();
      if (reader.was_beyond_bounds()) {
        lost.push_back(std::move(one));
      } else {
        messages.emplace(std::move(key), std::move(one));
      }
    }
    return messages;
  }
};

Bytes ProcedureBook::exported() const {
  StateWriter writer;
  writer.one(kVersion);
  writer.one(arrivals_);
  AsBytes::write(writer, placed_);
  AsBytes::write(writer, appointments_);
  AsBytes::write(writer, ended_);
  writer.one(static_cast<std::uint64_t>(clocks_.size()));
  for (const auto& [sender, shown] : clocks_) {
    writer.one(sender);
    AsBytes::clock(writer, shown);
  }
  AsBytes::write(writer, merged_);
  writer.one(static_cast<std::uint64_t>(passed_.size()));
  for (const auto& [place, one] : passed_) {
    writer.one(place);
    AsBytes::passed(writer, one);
  }
  writer.one(static_cast<std::uint64_t>(changes_.size()));
  for (const auto& [place, at] : changes_) {
    writer.one(place);
    AsBytes::write(writer, at);
  }
  AsBytes::write(writer, lost_placed_);
  AsBytes::write(writer, lost_planned_);
  writer.one(static_cast<std::uint64_t>(recorded_.size()));
  for (const auto& [room, data, at] : recorded_) {
    writer.one(room);
    members(writer, data);
    members(writer, data.numbers);
    AsBytes::write(writer, at);
  }
  AsBytes::write(writer, claims_);
  AsBytes::write(writer, planned_claims_);
  return writer.take();
}

ProcedureBook ProcedureBook::imported(ByteView bytes) {
  StateReader reader(bytes);
  std::uint64_t version = 0;
  reader.one(version);
  if (version > kVersion || version < kOlderVersion) StateReader::refuse();
  ProcedureBook book;
  reader.one(book.arrivals_);
  std::vector<Kept> lost_placed, lost_planned;
  const auto read = [&](const auto& key_of, std::vector<Kept>& lost) {
    return AsBytes::read(reader, version, book.arrivals_, key_of, lost);
  };
  book.placed_ = read(key_of_placed, lost_placed);
  book.appointments_ = read([](const Kept& kept) { return key_of_appointment(kept.message); }, lost_planned);
  book.ended_ = read([](const Kept& kept) { return key_of_ended(kept.message); }, lost_planned);
  for (std::int64_t left = reader.number_below(kMostSenders + 1); left > 0; --left) {
    std::string sender;
    SenderClock shown{};
    reader.one(sender);
    AsBytes::clock(reader, shown);
    book.clocks_.insert_or_assign(std::move(sender), shown);
  }
  if (version > kOlderVersion) {
    book.merged_ = read([](const Kept& kept) { return kept.message.replaces; }, lost_planned);
    for (std::int64_t left = reader.number_below(kMostKept + 1); left > 0; --left) {
      std::string place;
      Passed one{Arrival{0, UtcTime{}}, Arrival{0, UtcTime{}}};
      reader.one(place);
      AsBytes::passed(reader, one);
      const bool is_known = one.came.number <= book.arrivals_ && one.went.number <= book.arrivals_;
      if (!is_known || !book.passed_.emplace(std::move(place), one).second) StateReader::refuse();
    }
  }
  if (version > kVersionOfOneTime) {
    for (std::int64_t left = reader.number_below(kMostKept + 1); left > 0; --left) {
      std::string place;
      reader.one(place);
      const ProcedureMoment at = AsBytes::read(reader);
      if (!book.changes_.emplace(std::move(place), at).second) StateReader::refuse();
    }
  }
  if (version > kVersionOfOneDoubt) {
    AsBytes::read(reader, book.lost_placed_, version);
    AsBytes::read(reader, book.lost_planned_, version);
  }
  if (version > kVersionWithoutRecorded) {
    for (std::int64_t left = reader.number_below(kMostKept + 1); left > 0; --left) {
      Recorded one{{}, {}, UtcTime{}};
      reader.one(one.room);
      members(reader, one.data);
      members(reader, one.data.numbers);
      one.at = AsBytes::read(reader);
      book.recorded_.push_back(std::move(one));
    }
  }
  if (version > kVersionWithoutClaims) {
    std::vector<Kept> lost_claims, lost_planned_claims;
    book.claims_ = read(key_of_placed, lost_claims);
    book.planned_claims_ =
        read([](const Kept& kept) { return key_of_appointment(kept.message); }, lost_planned_claims);
    // Most are of what is lost already.
    const auto add = [](std::vector<Kept>& lost, std::vector<Kept>& claims) {
      for (Kept& claim : claims) {
        const bool is_known = std::ranges::any_of(
            lost, [&](const Kept& each) { return each.message.patient == claim.message.patient; });
        if (!is_known) lost.push_back(std::move(claim));
      }
    };
    add(lost_placed, lost_claims);
    add(lost_planned, lost_planned_claims);
  } else {
    book.claim();
  }
  reader.require_end();
  for (const Kept& each : lost_placed) book.lose(book.lost_placed_, each, each.received.at, each.received.at);
  for (const Kept& each : lost_planned) {
    const ProcedureMoment& at = each.received.at;
    book.lose(book.lost_planned_, each, at, {at.utc + kLongestWindow, at.since_boot + kLongestWindow});
  }
  return book;
}

}  // namespace kiroku::recorder
