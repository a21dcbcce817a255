// The book as bytes. Members are taken by structured bindings: with a new one this does not compile before
// it is handed over, too.
#include <concepts>
#include <type_traits>
#include <utility>

#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/state_codec.h"

namespace kiroku::recorder {
namespace {

constexpr std::uint64_t kVersion = 4;
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
  codec.all(is_there, moment);
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
  auto& [spellings, planned, is_time_unclear, planned_text, location, description, code, coding_system] =
      place;
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
  // Without planned_places, which stand at the end of what is kept: versions before had none.
  auto& [kind, moves, sender, told, happened, patient, replaces, numbers, replaced_numbers, appointment,
         placer, filler, is_over, places, planned, data, planned_places] = message;
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
    auto& [received, message, since, is_in_doubt, moved] = one;
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
      codec.one(is_in_doubt);
      members(codec, moved);
    }
    if (version > kVersionOfOneTime) members(codec, message.planned_places);
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

  template <typename KeyOf>
  static Messages read(StateReader& reader, std::uint64_t version, std::uint64_t arrivals,
                       const KeyOf& key_of) {
    Messages messages;
    for (std::int64_t left = reader.number_below(kMostKept + 1); left > 0; --left) {
      Kept one{Arrival{0, UtcTime{}}, {}, {}};
      kept(reader, one, version);
      bool is_known = one.received.number <= arrivals;
      for (const auto& [place, came] : one.since) is_known = is_known && came.number <= arrivals;
      std::string key = key_of(one.message);
      if (!is_known || !messages.emplace(std::move(key), std::move(one)).second) StateReader::refuse();
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
    // What was told late may have happened before the boot.
    writer.one(ProcedureMoment{at.utc + kLongestBefore, at.since_boot + kLongestBefore});
  }
  return writer.take();
}

ProcedureBook ProcedureBook::imported(ByteView bytes) {
  StateReader reader(bytes);
  std::uint64_t version = 0;
  reader.one(version);
  if (version > kVersion || version < kOlderVersion) StateReader::refuse();
  ProcedureBook book;
  reader.one(book.arrivals_);
  const auto read = [&](const auto& key_of) {
    return AsBytes::read(reader, version, book.arrivals_, key_of);
  };
  book.placed_ = read([](const auto& message) { return message.patient; });
  book.appointments_ = read(key_of_appointment);
  book.ended_ = read(key_of_ended);
  for (std::int64_t left = reader.number_below(kMostSenders + 1); left > 0; --left) {
    std::string sender;
    SenderClock shown{};
    reader.one(sender);
    AsBytes::clock(reader, shown);
    book.clocks_.insert_or_assign(std::move(sender), shown);
  }
  if (version > kOlderVersion) {
    book.merged_ = read([](const auto& message) { return message.replaces; });
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
      ProcedureMoment later{UtcTime{}};
      reader.all(place, later);
      const ProcedureMoment at{later.utc - kLongestBefore, later.since_boot - kLongestBefore};
      if (!book.changes_.emplace(std::move(place), at).second) StateReader::refuse();
    }
  }
  reader.require_end();
  return book;
}

}  // namespace kiroku::recorder
