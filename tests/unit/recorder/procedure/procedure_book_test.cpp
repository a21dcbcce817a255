#include "recorder/procedure/procedure_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using Kind = ProcedureMessage::Kind;
using testing::HasSubstr;

const UtcTime kMorning = *parse_utc("2026-08-05T07:00:00Z");

ProcedureMessage placed(const std::string& patient, const std::vector<std::string>& places) {
  ProcedureMessage message;
  message.kind = Kind::kPlaces;
  message.patient = message.data.patient_id = patient;
  message.places = places;
  return message;
}

ProcedureMessage planned(const std::string& patient, const std::string& what, std::optional<UtcTime> time,
                         const std::string& place = "OR1") {
  ProcedureMessage message = placed(patient, {place});
  message.kind = Kind::kAppointment;
  message.appointment = what;
  message.planned = time;
  message.data.description = what;
  return message;
}

std::string found(const ProcedureBook& book, UtcTime at, const std::vector<std::string>& locations = {"OR1"},
                  std::chrono::nanoseconds window = 12h, const EndedSince& ended = {}) {
  const auto data = book.choose({locations, window}, at, ended).data;
  return data ? data->patient_id + " " + data->description : "nobody";
}

/// Whether a case about that patient has ended.
EndedSince recorded(const std::string& patient) {
  return [patient](const ProcedureData& data, UtcTime) { return data.patient_id == patient; };
}

/// As somebody else's record would be changed while another patient is in the room.
ProcedureMessage facts(const std::string& patient, Kind kind = Kind::kFacts) {
  ProcedureMessage message = placed(patient, {});
  message.kind = kind;
  return message;
}

Doubt doubt(const ProcedureBook& book, UtcTime at, const std::vector<std::string>& locations = {"OR1"}) {
  return book.choose({locations, 12h}, at).doubt;
}

/// By the sender's clock.
ProcedureMessage told_by(const std::string& sender, UtcTime at, ProcedureMessage message) {
  message.sender = sender;
  message.told = message.happened = at;
  return message;
}
ProcedureMessage moved(const std::string& patient, const std::string& place) {
  ProcedureMessage message = placed(patient, {place});
  message.moves = true;
  return message;
}
ProcedureMessage arrived(const std::string& patient, const std::vector<std::string>& places) {
  ProcedureMessage message = placed(patient, places);
  message.moves = true;
  return message;
}
ProcedureMessage leaving(const std::string& patient) {
  ProcedureMessage message = placed(patient, {});
  message.kind = Kind::kLeaves;
  return message;
}

std::vector<std::string> listed(const ProcedureBook& book, UtcTime at) {
  std::vector<std::string> out;
  for (const ProcedureData& data : book.list({{"OR1"}, 12h}, at))
    out.push_back(data.patient_id + " " + data.description);
  return out;
}

TEST(ProcedureBook, ThePatientWhoIsAloneInTheRoomIsTaken) {
  ProcedureBook book;
  EXPECT_EQ(found(book, kMorning), "nobody");
  book.take(moved("1", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning + 30min), "1 ");
  book.take(arrived("2", {"SURGERY", "or1", "SURGERY^or1"}), kMorning + 1h);
  book.take(moved("3", "OR2"), kMorning + 2h);
  EXPECT_EQ(found(book, kMorning + 3h), "nobody") << "nobody said that the first one has left";
  EXPECT_EQ(doubt(book, kMorning + 3h), Doubt::kSeveralThere);
  EXPECT_EQ(found(book, kMorning + 3h, {"OR2"}), "3 ");
  EXPECT_EQ(doubt(book, kMorning + 3h, {}), Doubt::kSeveralThere) << "every message is about the room";
  EXPECT_EQ(found(book, kMorning + 3h, {"OR9"}), "nobody");
  EXPECT_EQ(doubt(book, kMorning + 3h, {"OR9"}), Doubt::kNone);
  EXPECT_EQ(found(book, kMorning + 12h + 30min), "2 ") << "the first one came too long ago";
  EXPECT_EQ(found(book, kMorning + 20h), "nobody") << "too long ago";
}

// As a ward does it: transferred to the next place, discharged, or seen off from there.
TEST(ProcedureBook, WhoeverWasThereBeforeIsGoneOnceAMessageSaysSo) {
  ProcedureMessage departs = placed("1", {"OR1"});
  departs.kind = Kind::kDeparts;
  for (const ProcedureMessage& message : {moved("1", "PACU"), leaving("1"), departs}) {
    ProcedureBook book;
    book.take(moved("1", "OR1"), kMorning);
    book.take(moved("2", "OR1"), kMorning + 2h);
    EXPECT_EQ(doubt(book, kMorning + 3h), Doubt::kSeveralThere);
    book.take(message, kMorning + 4h);
    EXPECT_EQ(found(book, kMorning + 5h), "2 ");
    EXPECT_EQ(doubt(book, kMorning + 5h), Doubt::kNone);
  }
}

// The last one leaves; whoever came before was never seen off, and is hardly there.
TEST(ProcedureBook, WhoeverIsLeftWhenTheLastOneLeavesMayBeGone) {
  const std::vector<std::vector<std::string>> rooms{{"OR1"}, {"OR1", "THEATRE1"}, {}};
  for (const auto& locations : rooms) {
    for (const ProcedureMessage& message : {leaving("2"), moved("2", "PACU")}) {
      if (locations.empty() && message.kind != Kind::kLeaves) continue;  // each place is this room
      ProcedureBook book;
      book.take(moved("1", locations.size() == 2 ? "THEATRE1" : "OR1"), kMorning);
      book.take(moved("2", "OR1"), kMorning + 2h);
      book.take(message, kMorning + 3h);
      book.take(planned("3", "next", kMorning + 4h), kMorning + 3h);
      EXPECT_EQ(found(book, kMorning + 4h, locations), "nobody");
      EXPECT_EQ(doubt(book, kMorning + 4h, locations), Doubt::kMayBeGone);
      book.take(moved("1", "OR1"), kMorning + 4h);
      EXPECT_EQ(found(book, kMorning + 5h, locations), "1 ") << "came again";
      book.take(leaving("1"), kMorning + 5h);
      EXPECT_EQ(found(book, kMorning + 5h, locations), "3 next") << "all have left";
    }
  }
}

// It began without a patient. Whoever is there later need not be whom it is about.
TEST(ProcedureBook, WhoeverComesAfterSomebodyLeftIsNotTheRunningCasesPatient) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  book.take(moved("2", "OR1"), kMorning + 1h);
  const UtcTime begun = kMorning + 2h;
  EXPECT_EQ(doubt(book, begun), Doubt::kSeveralThere);
  book.take(leaving("1"), kMorning + 3h);
  EXPECT_EQ(doubt(book, begun), Doubt::kLeftMeanwhile) << "the first one was there";
  EXPECT_EQ(found(book, kMorning + 3h), "2 ") << "of a case that begins now";
  book.take(leaving("2"), kMorning + 4h);
  book.take(moved("3", "OR1"), kMorning + 5h);
  EXPECT_EQ(doubt(book, begun), Doubt::kLeftMeanwhile);
  EXPECT_EQ(found(book, kMorning + 5h), "3 ");
}

// Whatever one book does from here on, the other does, too.
TEST(ProcedureBook, BytesHoldAllOfIt) {
  ProcedureBook book;
  ProcedureMessage first = placed("1", {"OR1", "SURGERY^OR1"});
  first.moves = true;
  first.data.patient = {"山田", "太郎", "Yamada^Tarou=山田^太郎"};
  first.data.staff = {{"surgeon", "s7", {"Right", "Anna", "Right^Anna"}}};
  first.data.birth_date = "1980-01-15";
  book.take(first, {kMorning, 5h});
  book.take(planned("1", "lobectomy", kMorning + 2h), {kMorning + 1min, 5h + 1min});
  book.take(planned("2", "hernia", {}), {kMorning + 2min, 5h + 2min});
  ProcedureMessage merged = facts("9");
  merged.replaces = "8";
  book.take(merged, {kMorning + 2min, 5h + 2min});
  book.take(moved("7", "OR7"), {kMorning + 2min, 5h + 2min});
  book.take(leaving("7"), {kMorning + 2min, 5h + 2min});
  book.take(told_by("HIS", kMorning, moved("6", "OR6")), {kMorning + 2min, 5h + 2min});
  book.take(told_by("HIS", kMorning - 5min, leaving("6")), {kMorning + 2min, 5h + 2min});
  EXPECT_EQ(book.ended_late(), 1U);
  ProcedureBook other = ProcedureBook::imported(book.exported());
  const ProcedureRule rule{{"or1"}, 12h};
  const ProcedureMoment later{kMorning - 3h, 6h};  // by a wall clock that was set back
  EXPECT_EQ(other.list(rule, later), book.list(rule, later));
  EXPECT_EQ(other.find(rule, later), book.find(rule, later));
  EXPECT_EQ(other.find(rule, later).value().staff, first.data.staff);
  EXPECT_EQ(other.exported(), book.exported());
  // Who only has other facts stated comes before whoever came since.
  for (ProcedureBook* each : {&book, &other}) {
    each->take(moved("3", "OR1"), {kMorning + 3min, 5h + 3min});
    each->take(placed("1", {"OR1"}), {kMorning + 4min, 5h + 4min});
    EXPECT_EQ(each->choose(rule, {kMorning + 1h, 6h}).doubt, Doubt::kSeveralThere);
    each->take(leaving("3"), {kMorning + 5min, 5h + 5min});
    each->take(moved("8", "OR8"), {kMorning + 5min, 5h + 5min});
  }
  const ProcedureMoment then{kMorning + 1h, 6h};
  EXPECT_EQ(other.choose(rule, then).doubt, Doubt::kMayBeGone);
  EXPECT_EQ(other.choose({{"OR6"}, 12h}, then).doubt, Doubt::kToldLate);
  EXPECT_EQ(other.find({{"OR8"}, 12h}, then).value().patient_id, "9");
  EXPECT_EQ(other.exported(), book.exported());
  EXPECT_EQ(ProcedureBook::imported(ProcedureBook().exported()).size(), 0U);
}

PlannedPlace place_at(const std::string& place, std::optional<UtcTime> time, const std::string& what = "") {
  PlannedPlace planned;
  planned.spellings = {place};
  planned.planned = time;
  planned.location = place;
  planned.description = what;
  return planned;
}

// One appointment in two rooms, in this one only in four hours.
TEST(ProcedureBook, AnAppointmentInSeveralPlacesGoesByTheTimeOfThisOne) {
  ProcedureBook book;
  ProcedureMessage anna = planned("anna", "both", kMorning);
  anna.places = {"OR2", "OR1"};
  anna.planned_places = {place_at("OR2", kMorning, "biopsy"), place_at("or1", kMorning + 4h, "resection")};
  book.take(anna, kMorning - 1h);
  book.take(planned("berta", "hernia", kMorning + 10min), kMorning - 1h);
  EXPECT_EQ(found(book, kMorning), "berta hernia");
  EXPECT_EQ(found(book, kMorning, {"OR2"}), "anna biopsy");
  EXPECT_EQ(found(book, kMorning + 4h, {"OR1"}, 12h, recorded("berta")), "anna resection");
  EXPECT_EQ(book.choose({{"OR1"}, 12h}, kMorning + 4h, recorded("berta")).data->location, "or1");
  EXPECT_EQ(found(ProcedureBook::imported(book.exported()), kMorning), "berta hernia") << "after an upgrade";
  EXPECT_EQ(ProcedureBook::imported(book.exported()).exported(), book.exported());
  // Whoever is in the room has the operation of this room.
  book.take(moved("anna", "OR1"), kMorning + 3h);
  EXPECT_EQ(found(book, kMorning + 4h), "anna resection");
  EXPECT_THAT(listed(book, kMorning + 4h), testing::UnorderedElementsAre("anna resection", "berta hernia"));
}

TEST(ProcedureBook, ATimeOfThisRoomThatCannotBeReadLeavesItToAPerson) {
  ProcedureBook book;
  ProcedureMessage anna = planned("anna", "a", kMorning);
  anna.planned_places = {place_at("OR1", {})};
  anna.planned_places.front().is_time_unclear = true;
  book.take(anna, kMorning - 1h);
  book.take(planned("berta", "b", kMorning + 10min), kMorning - 1h);
  EXPECT_EQ(found(book, kMorning + 10min), "nobody");
  EXPECT_EQ(doubt(book, kMorning + 10min), Doubt::kTimeUnclear);
  EXPECT_NE(words_of(Doubt::kTimeUnclear), "");
  EXPECT_EQ(doubt(book, kMorning + 10min, {"OR2"}), Doubt::kNone);
  book.take(moved("berta", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning + 10min), "berta b") << "who is there is known";
}

TEST(ProcedureBook, KnowsWhenARoomChangedLast) {
  const auto changed = [](const ProcedureBook& book, const std::vector<std::string>& locations = {"or1"}) {
    const auto at = book.changed({locations, 12h});
    return at ? format_utc(at->utc).substr(11, 5) : "never";
  };
  ProcedureBook book;
  EXPECT_EQ(changed(book), "never");
  book.take(arrived("1", {"SURGERY", "OR1", "SURGERY^OR1"}), kMorning);
  EXPECT_EQ(changed(book), "07:00");
  EXPECT_EQ(changed(book, {"OR2"}), "never");
  EXPECT_EQ(changed(book, {}), "07:00") << "every message is about the room";
  book.take(placed("1", {"SURGERY", "OR1", "SURGERY^OR1"}), kMorning + 10min);
  book.take(facts("1"), kMorning + 20min);
  book.take(planned("2", "next", kMorning + 3h), kMorning + 25min);
  EXPECT_EQ(changed(book), "07:00") << "other facts of whoever is there, and plans";
  book.take(leaving("1"), kMorning + 30min);
  EXPECT_EQ(changed(book), "07:30");
  book.take(moved("2", "OR1"), kMorning + 40min);
  EXPECT_EQ(changed(book), "07:40");
  EXPECT_EQ(changed(ProcedureBook::imported(book.exported())), "07:40") << "after an upgrade";
  book.take(moved("2", "OR1"), kMorning + 45min);
  EXPECT_EQ(changed(book), "07:40") << "announced once more where they are";
  book.take(moved("2", "PACU"), kMorning + 50min);
  EXPECT_EQ(changed(book), "07:50");
  // Whom nobody placed here, as after a start that forgot everything.
  ProcedureMessage stranger = leaving("9");
  stranger.places = {"OR1"};
  book.take(stranger, kMorning + 1h);
  EXPECT_EQ(changed(book), "08:00");
  ProcedureMessage over = planned("3", "done", kMorning);
  over.is_over = true;
  book.take(over, kMorning + 70min);
  EXPECT_EQ(changed(book), "08:10") << "the operation is over";
  book.take(moved("4", "OR1"), kMorning + 80min);
  over.appointment = "written up later";
  book.take(over, kMorning + 90min);
  EXPECT_EQ(changed(book), "08:20") << "somebody else is there since";
}

TEST(ProcedureBook, ALeavingThatIsToldLateCountsFromWhenItHappened) {
  ProcedureBook book;
  book.take(told_by("A", kMorning, moved("1", "OR1")), kMorning);
  book.take(told_by("A", kMorning + 1h, moved("2", "OR2")), kMorning + 1h);
  ProcedureMessage left = leaving("1");
  left.places = {"OR1"};
  book.take(told_by("A", kMorning + 50min, left), kMorning + 2h);
  EXPECT_EQ(format_utc(book.changed({{"OR1"}, 12h})->utc).substr(11, 5), "07:50");
}

// Of the versions before, which an upgrade hands over: one knew no times of single places, and of no change
// of a room; the one before ended with the senders' clocks, and knew no doubt.
TEST(ProcedureBook, BytesOfTheVersionsBeforeAreRead) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  Bytes bytes = book.exported();
  constexpr std::size_t kCount = 8;  // bytes
  constexpr std::size_t kChanges = kCount + 2 * (kCount + 16) + 3;
  // Behind the patient stand empty lists, of appointments, of who left, of clocks, of mergers and of who
  // passed; then the changes, and what was lost and recorded. Of the patient stand there four texts of who
  // gave a number, a flag, and an empty list of ways.
  constexpr std::size_t kBehind = 5 * kCount + kChanges + 3 * kCount, kWays = 4 * kCount + 1 + kCount;
  // At the end stand claims, of the patient, who is as long as above, and of no appointment. Of the patient
  // stand there an empty list of a kept bed, no account, and a flag.
  constexpr std::size_t kBed = 2 * kCount, kPatients = kCount;
  const std::size_t one = (bytes.size() - 3 * kCount - kPatients - (kBehind - kCount) - 2 * kCount) / 2;
  const auto claim = static_cast<std::ptrdiff_t>(one + 2 * kCount);
  bytes.erase(bytes.end() - kCount - 1, bytes.end() - kCount);
  bytes.erase(bytes.end() - claim - kBehind, bytes.end() - claim + 1 - kBehind);
  bytes.at(0) = std::byte{9};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  bytes.resize(bytes.size() - one - 2 * kCount + 1);
  bytes.erase(bytes.end() - kBehind - kBed, bytes.end() - kBehind);
  bytes.at(0) = std::byte{8};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  bytes.erase(bytes.end() - kBehind - kWays, bytes.end() - kBehind);
  bytes.at(0) = std::byte{7};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  // Nothing was recorded.
  bytes.resize(bytes.size() - kCount);
  bytes.at(0) = std::byte{6};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  // Nothing was lost, of two kinds; and of each patient stand there: three flags, two times, three texts,
  // a doubt, and empty lists of places and of visits.
  bytes.resize(bytes.size() - 2 * kCount);
  constexpr std::size_t kLater = 3 + 2 * 17 + 3 * kCount + 2 * kCount + kCount;
  bytes.erase(bytes.end() - kChanges - 5 * kCount - kLater, bytes.end() - kChanges - 5 * kCount);
  bytes.at(0) = std::byte{4};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  // Two changes, of "or1" and of all places: each a text and a moment.
  bytes.resize(bytes.size() - kCount - 2 * (kCount + 16) - 3);
  // And of each patient an empty list of places.
  bytes.erase(bytes.end() - 6 * kCount, bytes.end() - 5 * kCount);
  bytes.at(0) = std::byte{3};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  // Nobody was merged, or has passed; before these lie empty lists of appointments, of who left, and of
  // clocks.
  bytes.resize(bytes.size() - 2 * kCount);
  // And of each patient a doubt, and when an event moved them: a flag, another flag, and a moment.
  bytes.erase(bytes.end() - 3 * kCount - 18, bytes.end() - 3 * kCount);
  bytes.at(0) = std::byte{2};
  EXPECT_EQ(found(ProcedureBook::imported(bytes), kMorning), "1 ");
  bytes.at(0) = std::byte{3};
  EXPECT_THROW(ProcedureBook::imported(bytes), Error);
}

TEST(ProcedureBook, NothingIsTakenOfBytesThatAreNoBook) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  book.take(planned("1", "lobectomy", kMorning + 2h), kMorning);
  const Bytes whole = book.exported();
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(ProcedureBook::imported(ByteView(whole).first(size)), Error) << size;
  Bytes longer = whole;
  longer.push_back(std::byte{0});
  EXPECT_THROW(ProcedureBook::imported(longer), Error);
  // A byte that is another one is refused, or is another book: none reads beyond the bytes.
  std::size_t refused = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const unsigned changed : {0x01U, 0x80U, 0xFFU}) {
      Bytes damaged = whole;
      damaged[at] ^= static_cast<std::byte>(changed);
      try {
        const ProcedureBook read = ProcedureBook::imported(damaged);
        (void)read.list({{}, 12h}, kMorning);
        if (read.not_kept() > 0) ++refused;  // of what it belongs to, which is told
      } catch (const Error&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, whole.size());
}

// The clock of the machine is set while it waits: back by NTP, or on, from where its battery had left it.
TEST(ProcedureBook, AClockThatIsSetBackLeavesTheLastPatientTheLast) {
  for (const std::chrono::hours wrong : {9h, 30h, -400 * 24h}) {
    ProcedureBook book;
    book.take(moved("1", "OR1"), {kMorning + wrong, 100h});
    book.take(planned("2", "second", {}), {kMorning + wrong, 100h});
    const ProcedureMessage corrected = placed("1", {"OR1"});
    const auto found_at = [&](std::chrono::hours after) {
      const auto data = book.find({{"OR1"}, 12h}, {kMorning + after, 100h + after});
      return data ? data->patient_id + " " + data->description + data->chosen : "nobody";
    };
    const auto doubt_at = [&](std::chrono::hours after) {
      return book.choose({{"OR1"}, 12h}, {kMorning + after, 100h + after}).doubt;
    };
    EXPECT_THAT(found_at(1h), testing::StartsWith("1 "))
        << "who came before the clock was set is there still";
    EXPECT_THAT(found_at(1h), HasSubstr(format_utc(kMorning))) << "and came when it shows now";
    book.take(moved("2", "OR1"), {kMorning + 1h, 101h});
    EXPECT_EQ(doubt_at(2h), Doubt::kSeveralThere) << wrong.count();
    book.take(corrected, {kMorning + 2h, 102h});
    EXPECT_THAT(book.list({{"OR1"}, 12h}, {kMorning + 3h, 103h}), testing::SizeIs(2));
    EXPECT_EQ(found_at(20h), "nobody") << "too long ago";
    ProcedureBook other = ProcedureBook::imported(book.exported());
    other.take(leaving("2"), {kMorning + 3h, 103h});
    EXPECT_EQ(other.choose({{"OR1"}, 12h}, {kMorning + 4h, 104h}).doubt, Doubt::kMayBeGone)
        << "the other one came last, and a correction brings nobody back";
    ProcedureMessage merged = facts("2");
    merged.replaces = "1";
    book.take(merged, {kMorning + 3h, 103h});
    EXPECT_THAT(found_at(4h), testing::StartsWith("2 second")) << "they are one";
    book.take(placed("9", {"OR2"}), {kMorning + 100h, 200h});
    EXPECT_EQ(book.size(), 1U) << "what is old is forgotten all the same";
  }
}

TEST(ProcedureBook, WhoMovesOnOrLeavesIsNotInTheRoomAnyMore) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  book.take(moved("2", "OR1"), kMorning + 1min);
  book.take(moved("2", "ICU"), kMorning + 2min);
  EXPECT_THAT(listed(book, kMorning + 3min), testing::ElementsAre("1 "));
  EXPECT_EQ(doubt(book, kMorning + 3min), Doubt::kMayBeGone);
  ProcedureMessage gone = placed("1", {});
  gone.kind = Kind::kLeaves;
  book.take(gone, kMorning + 4min);
  EXPECT_EQ(found(book, kMorning + 5min), "nobody");
  EXPECT_EQ(doubt(book, kMorning + 5min), Doubt::kNone);
}

TEST(ProcedureBook, OtherFactsOfAPatientDoNotMoveThem) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  ProcedureMessage update = placed("1", {});
  update.data.sex = "F";
  book.take(update, kMorning + 1h);
  const auto data = book.find({{"OR1"}, 12h}, kMorning + 2h);
  ASSERT_TRUE(data);
  EXPECT_EQ(data->sex, "F");
}

TEST(ProcedureBook, NobodyComesIntoARoomByWhatIsSaidOfTheirRecord) {
  ProcedureBook book;
  ProcedureMessage arrived = placed("1", {});
  arrived.moves = true;
  book.take(arrived, kMorning);
  EXPECT_EQ(found(book, kMorning + 1h, {}), "1 ") << "every message is about this room, and says no place";
  book.take(facts("2"), kMorning + 1h);
  book.take(facts("3", Kind::kPlaces), kMorning + 1h);
  EXPECT_EQ(found(book, kMorning + 2h, {}), "1 ");
  EXPECT_EQ(book.list({{}, 12h}, kMorning + 2h).size(), 1U);
  // Who is to come to the room tomorrow is not there.
  ProcedureMessage pending = placed("4", {"OR1"});
  pending.kind = Kind::kFacts;
  book.take(pending, kMorning + 1h);
  EXPECT_EQ(found(book, kMorning + 2h), "nobody");
}

TEST(ProcedureBook, WhoeverIsThereAlreadyIsNotPlacedAnewByTheSamePlace) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  book.take(moved("2", "OR1"), kMorning + 1h);
  ProcedureMessage corrected = placed("1", {"OR1"});
  corrected.data.sex = "F";
  book.take(corrected, kMorning + 2h);
  EXPECT_EQ(doubt(book, kMorning + 3h), Doubt::kSeveralThere);
  EXPECT_THAT(book.list({{"OR1"}, 12h}, kMorning + 3h).front().sex, "F");
  ProcedureMessage back = placed("1", {"OR1"});
  back.moves = true;
  ProcedureBook other = book;
  other.take(leaving("2"), kMorning + 4h);
  EXPECT_EQ(doubt(other, kMorning + 5h), Doubt::kMayBeGone)
      << "a correction of the record of who was there before";
  book.take(back, kMorning + 4h);
  EXPECT_EQ(doubt(book, kMorning + 5h), Doubt::kSeveralThere);
  book.take(leaving("2"), kMorning + 5h);
  EXPECT_EQ(found(book, kMorning + 5h), "1 ");
}

// Many systems send nothing but A08.
TEST(ProcedureBook, APatientWhoComesAgainIsThereAgainUnlessSomebodyElseCame) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  book.take(placed("1", {"OR1"}), kMorning + 26h);
  EXPECT_EQ(found(book, kMorning + 27h), "1 ");
  book.take(moved("2", "OR1"), kMorning + 28h);
  book.take(placed("1", {"WARD-7", "OR1"}), kMorning + 29h);
  EXPECT_EQ(doubt(book, kMorning + 30h), Doubt::kSeveralThere);
  book.take(leaving("2"), kMorning + 30h);
  EXPECT_EQ(doubt(book, kMorning + 31h), Doubt::kMayBeGone)
      << "a bed that changed brings nobody into another room";
}

TEST(ProcedureBook, APatientWhoseNumberIsMergedIsOnePatient) {
  ProcedureBook book;
  book.take(moved("old", "OR1"), kMorning);
  book.take(planned("old", "first", kMorning + 1h), kMorning);
  ProcedureMessage merged = facts("new");
  merged.replaces = "old";
  book.take(merged, kMorning + 1h);
  EXPECT_EQ(found(book, kMorning + 2h), "new first");
  EXPECT_EQ(book.size(), 2U);
  ProcedureMessage gone = placed("new", {});
  gone.kind = Kind::kLeaves;
  book.take(gone, kMorning + 3h);
  EXPECT_EQ(found(book, kMorning + 4h), "nobody")
      << "whoever left is not in the room by an earlier number, nor is their appointment still to come";
  EXPECT_EQ(doubt(book, kMorning + 4h), Doubt::kNone);
}

TEST(ProcedureBook, OfAnAppointmentOfTwoPatientsNeitherIsTaken) {
  ProcedureBook book;
  const ProcedureRule rule{{"OR1"}, 12h};
  book.take_all({planned("1", "A", kMorning), planned("2", "A", kMorning)}, kMorning - 1h);
  EXPECT_EQ(found(book, kMorning), "nobody");
  EXPECT_EQ(doubt(book, kMorning), Doubt::kTwoPlanned);
  EXPECT_EQ(book.list(rule, kMorning).size(), 2U) << "a person chooses";
  // Changed, it is one patient's.
  book.take(planned("2", "A", kMorning), kMorning);
  EXPECT_EQ(found(book, kMorning), "2 A");
  ProcedureMessage cancelled = planned("2", "A", {});
  cancelled.kind = Kind::kCancels;
  book.take(cancelled, kMorning);
  EXPECT_EQ(book.size(), 0U);
}

TEST(ProcedureBook, ListsAllThatCouldBeMeant) {
  ProcedureBook book;
  EXPECT_THAT(listed(book, kMorning), testing::IsEmpty());
  book.take(planned("1", "first", kMorning), kMorning - 10h);
  book.take(planned("1", "again", kMorning + 5h), kMorning - 10h);
  book.take(planned("2", "second", kMorning + 3h), kMorning - 10h);
  book.take(planned("3", "elsewhere", kMorning + 1h, "OR2"), kMorning - 10h);
  book.take(planned("4", "next week", kMorning + 170h), kMorning - 10h);
  book.take(moved("1", "OR1"), kMorning);
  EXPECT_THAT(listed(book, kMorning + 1h), testing::UnorderedElementsAre("1 first", "2 second"))
      << "whoever is in the room stands there once, with the nearest of their appointments";
}

TEST(ProcedureList, HasEachProcedureOnceInTheOrderOfItsTime) {
  ProcedureData early, late, unplanned;
  early.patient_id = "1";
  early.planned = "2026-08-05T08:00:00Z";
  late.patient_id = "2";
  late.planned = "2026-08-05T09:00:00Z";
  unplanned.patient_id = "3";
  std::vector<ProcedureData> all{late};
  ProcedureData twice = late;
  twice.chosen = "by another way";
  add_unknown(all, {twice, early, unplanned});
  order_by_plan(all, 500);
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(all[0].patient_id + all[1].patient_id + all[2].patient_id, "312");
  order_by_plan(all, 2);
  EXPECT_EQ(all.size(), 2U);
}

TEST(ProcedureList, AKeyStandsForWhatAProcedureSays) {
  ProcedureData data;
  data.patient_id = "1";
  const std::string key = key_of(data);
  EXPECT_EQ(key.size(), 32U);
  data.chosen = "the same, found in another way";
  EXPECT_EQ(key_of(data), key);
  data.description = "another";
  EXPECT_NE(key_of(data), key);
}

TEST(ProcedureBook, TheNearestAppointmentIsTakenAndSaysOfHowMany) {
  ProcedureBook book;
  book.take(planned("1", "first", kMorning), kMorning - 10h);
  book.take(planned("2", "second", kMorning + 3h), kMorning - 10h);
  book.take(planned("3", "elsewhere", kMorning + 1h, "OR2"), kMorning - 10h);
  EXPECT_EQ(found(book, kMorning + 1h), "1 first");
  EXPECT_EQ(found(book, kMorning + 2h, {"OR1"}, 12h, recorded("1")), "2 second");
  EXPECT_EQ(found(book, kMorning + 16h), "nobody");
  EXPECT_THAT(book.find({{"OR1"}, 12h}, kMorning)->chosen, HasSubstr("of 2 within 720 minutes"));
  // Moved, then cancelled.
  book.take(planned("2", "second", kMorning + 9h), kMorning);
  EXPECT_EQ(found(book, kMorning + 3h), "1 first");
  ProcedureMessage cancelled = planned("1", "first", {});
  cancelled.kind = Kind::kCancels;
  book.take(cancelled, kMorning);
  EXPECT_EQ(found(book, kMorning + 8h), "2 second");
  EXPECT_EQ(book.size(), 2U);
}

TEST(ProcedureBook, WhatIsPlannedMoreThanAnHourAheadIsNotTakenByItself) {
  ProcedureBook book;
  const ProcedureRule rule{{"OR1"}, 12h};
  book.take(planned("1", "long ago", kMorning - 9h), kMorning - 10h);
  book.take(planned("2", "afternoon", kMorning + 6h), kMorning - 10h);
  EXPECT_EQ(found(book, kMorning), "nobody") << "nor is whoever was planned longer ago than that";
  EXPECT_EQ(doubt(book, kMorning), Doubt::kTooEarly);
  EXPECT_EQ(book.list(rule, kMorning).size(), 2U) << "a person chooses";
  EXPECT_EQ(found(book, kMorning + 5h), "2 afternoon");
  EXPECT_EQ(doubt(book, kMorning + 5h), Doubt::kNone);
  book.take(moved("2", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning), "2 afternoon") << "who is there is there";
  EXPECT_EQ(doubt(book, kMorning), Doubt::kNone);
}

// More nanoseconds from now than can be counted.
TEST(ProcedureBook, WhatHasNoEndIsPlannedForNoTimeThatIsNear) {
  ProcedureBook book;
  book.take(planned("1", "no end", *parse_utc("9999-12-31T23:59:59Z")), kMorning);
  EXPECT_EQ(doubt(book, kMorning), Doubt::kNone);
  EXPECT_THAT(listed(book, kMorning), testing::IsEmpty());
  book.take(planned("2", "second", kMorning), kMorning);
  EXPECT_THAT(book.find({{"OR1"}, 12h}, kMorning)->chosen, HasSubstr("of 1 within"));
}

TEST(ProcedureBook, AFinishedAppointmentIsNotTaken) {
  ProcedureBook book;
  ProcedureMessage done = planned("1", "first", kMorning);
  done.is_over = true;
  book.take(done, kMorning);
  book.take(planned("2", "second", kMorning + 2h), kMorning);
  EXPECT_EQ(found(book, kMorning + 1h), "2 second");
  EXPECT_EQ(book.list({{"OR1"}, 12h}, kMorning + 1h).size(), 2U);
}

ProcedureMessage numbered(ProcedureMessage message, const std::string& placer, const std::string& filler) {
  message.placer = placer;
  message.filler = filler;
  message.appointment = filler.empty() ? placer : filler;
  return message;
}

TEST(ProcedureBook, AnAppointmentIsKnownByEitherOfItsNumbers) {
  const auto cancelled = [](const std::string& placer, const std::string& filler) {
    ProcedureMessage message = planned("1", "", {});
    message.kind = Kind::kCancels;
    return numbered(message, placer, filler);
  };
  const auto left_of = [&](const std::string& placer, const std::string& filler,
                           const ProcedureMessage& gone) {
    ProcedureBook book;
    book.take(numbered(planned("1", "A", kMorning), placer, filler), kMorning);
    book.take(gone, kMorning);
    return book.size();
  };
  EXPECT_EQ(left_of("P1", "", cancelled("P1", "F9")), 0U);
  EXPECT_EQ(left_of("P1", "F9", cancelled("P1", "")), 0U);
  EXPECT_EQ(left_of("P1", "F9", cancelled("", "F9")), 0U);
  EXPECT_EQ(left_of("P1", "F9", cancelled("P1", "F8")), 1U) << "another one of a series";
  EXPECT_EQ(left_of("5", "F9", cancelled("P1", "5")), 1U) << "another system's number";
  ProcedureBook book;
  book.take(numbered(planned("1", "A", kMorning), "P1", "F9"), kMorning);
  book.take(numbered(planned("1", "A", kMorning + 1h), "P1", ""), kMorning);
  book.take(cancelled("", "F9"), kMorning);
  EXPECT_EQ(book.size(), 0U) << "a change that names one number leaves it the other";
}

// An interface engine drains its queue, or replays it. The sender's clock is its own: here it is years
// behind.
TEST(ProcedureBook, AMessageThatComesLateTellsOfBefore) {
  const UtcTime theirs = kMorning - 30'000h;
  ProcedureBook book;
  book.take(told_by("HIS", theirs, moved("present", "OR1")), kMorning);
  book.take(told_by("HIS", theirs - 10h, moved("before", "OR1")), kMorning + 1min);
  EXPECT_EQ(doubt(book, kMorning + 2min), Doubt::kSeveralThere) << "nobody said that they left";
  EXPECT_EQ(book.list({{"OR1"}, 12h}, kMorning).size(), 2U);
  EXPECT_THAT(book.list({{"OR1"}, 12h}, kMorning).front().chosen, HasSubstr(format_utc(kMorning - 10h)))
      << "came so long before the other";
  EXPECT_EQ(book.list({{"OR1"}, 12h}, kMorning + 3h).size(), 1U) << "and is not within the window any more";
  EXPECT_EQ(found(book, kMorning + 3h), "present ");
  book.take(told_by("HIS", theirs - 9h - 30min, leaving("before")), kMorning + 1min);
  EXPECT_EQ(found(book, kMorning + 2min), "present ") << "left before, too";
  book.take(told_by("HIS", theirs - 9h, moved("between", "OR1")), kMorning + 2min);
  EXPECT_EQ(doubt(book, kMorning + 3min), Doubt::kSeveralThere);
  book.take(told_by("HIS", theirs + 1min, leaving("present")), kMorning + 3min);
  EXPECT_THAT(listed(book, kMorning + 2h), testing::ElementsAre("between "));
  EXPECT_EQ(doubt(book, kMorning + 2h), Doubt::kMayBeGone) << "who left came later";
  // What is told of the same patient, too.
  book.take(told_by("HIS", theirs - 1h, moved("present", "OR1")), kMorning + 4min);
  EXPECT_THAT(listed(book, kMorning + 2h), testing::ElementsAre("between ")) << "who left came before";
  book.take(told_by("HIS", theirs + 5min, leaving("between")), kMorning + 5min);
  EXPECT_EQ(doubt(book, kMorning + 6min), Doubt::kNone);
  book.take(told_by("HIS", theirs + 10min, moved("present", "OR1")), kMorning + 10min);
  book.take(told_by("HIS", theirs, moved("present", "ICU")), kMorning + 11min);
  EXPECT_EQ(found(book, kMorning + 12min), "present ") << "came from there";
  book.take(told_by("ORIS", theirs - 50h, moved("other", "OR1")), kMorning + 13min);
  book.take(told_by("HIS", theirs + 15min, leaving("present")), kMorning + 14min);
  EXPECT_EQ(found(book, kMorning + 14min), "other ") << "another sender has another clock";
}

// It was dropped in silence: of two messages in the wrong order the one that was told later counted.
TEST(ProcedureBook, ALeavingThatComesLateLeavesItInDoubt) {
  ProcedureMessage departs = placed("1", {"OR1"}), elsewhere = departs;
  departs.kind = elsewhere.kind = Kind::kDeparts;
  elsewhere.places = {"OR2"};
  const auto after = [](const ProcedureMessage& message) {
    ProcedureBook book;
    book.take(told_by("HIS", kMorning, moved("1", "OR1")), kMorning);
    book.take(told_by("HIS", kMorning + 1h, placed("1", {"OR1"})), kMorning + 1h);  // another fact
    book.take(told_by("HIS", kMorning + 30min, message), kMorning + 61min);
    EXPECT_EQ(book.ended_late(), book.choose({{"OR1"}, 12h}, kMorning + 2h).data ? 0U : 1U);
    return book;
  };
  for (const ProcedureMessage& message : {leaving("1"), departs, moved("1", "PACU")}) {
    ProcedureBook book = after(message);
    EXPECT_EQ(found(book, kMorning + 2h), "nobody");
    EXPECT_EQ(doubt(book, kMorning + 2h), Doubt::kToldLate);
    EXPECT_THAT(listed(book, kMorning + 2h), testing::ElementsAre("1 ")) << "a person chooses";
    book.take(told_by("HIS", kMorning + 2h, placed("1", {"OR1"})), kMorning + 2h);
    EXPECT_EQ(doubt(book, kMorning + 2h), Doubt::kToldLate) << "of their record alone";
    book.take(told_by("HIS", kMorning + 3h, moved("1", "OR1")), kMorning + 3h);
    EXPECT_EQ(found(book, kMorning + 3h), "1 ") << "came";
  }
  EXPECT_EQ(found(after(elsewhere), kMorning + 2h), "1 ");
  EXPECT_EQ(found(after(placed("1", {"PACU"})), kMorning + 2h), "1 ") << "moves nobody";
  EXPECT_EQ(found(after(leaving("2")), kMorning + 2h), "1 ") << "a stranger";
}

TEST(ProcedureBook, ACancellingThatComesLateLeavesItInDoubt) {
  ProcedureMessage cancelled = planned("1", "A", {}), over = planned("1", "A", kMorning);
  cancelled.kind = Kind::kCancels;
  over.is_over = true;
  for (const ProcedureMessage& message : {cancelled, over}) {
    ProcedureBook book;
    book.take(told_by("PLAN", kMorning + 10min, planned("1", "A", kMorning)), kMorning);
    book.take(told_by("PLAN", kMorning, message), kMorning);
    EXPECT_EQ(doubt(book, kMorning), Doubt::kToldLate);
    EXPECT_EQ(book.ended_late(), 1U);
    EXPECT_THAT(listed(book, kMorning), testing::ElementsAre("1 A"));
    book.take(moved("1", "OR1"), kMorning);
    EXPECT_EQ(found(book, kMorning), "1 ") << "who is there is there, and their procedure is not known";
    book.take(told_by("PLAN", kMorning + 20min, planned("1", "A", kMorning)), kMorning);
    EXPECT_EQ(found(book, kMorning), "1 A") << "booked anew";
  }
}

TEST(ProcedureBook, WhatComesLateAfterAStartIsToldOfBefore) {
  ProcedureBook before;
  before.take(told_by("HIS", kMorning, moved("present", "OR1")), {kMorning, 1h});
  before.take(told_by("HIS", kMorning - 10h, moved("before", "OR1")), {kMorning, 1h});
  before.take(told_by("HIS", kMorning, leaving("left")), {kMorning, 1h});
  ProcedureMessage cancelled = numbered(planned("1", "", {}), "P1", "");
  cancelled.kind = Kind::kCancels;
  before.take(told_by("HIS", kMorning, cancelled), {kMorning, 1h});
  ProcedureBook book = ProcedureBook::imported(before.exported());
  EXPECT_EQ(book.exported(), before.exported());
  const ProcedureMoment now{kMorning + 1min, 1h + 1min};
  book.take(told_by("HIS", kMorning - 9h, moved("third", "OR1")), now);
  book.take(told_by("HIS", kMorning - 9h, moved("left", "OR1")), now);
  book.take(told_by("HIS", kMorning - 9h, numbered(planned("1", "", kMorning), "P1", "F1")), now);
  EXPECT_EQ(book.size(), 3U);
  EXPECT_EQ(book.choose({{"OR1"}, 12h}, now).doubt, Doubt::kSeveralThere);
  for (const std::string gone : {"before", "third"})
    book.take(told_by("HIS", kMorning - 8h, leaving(gone)), now);
  EXPECT_EQ(book.find({{"OR1"}, 12h}, now).value().patient_id, "present");
}

TEST(ProcedureBook, TimesOfOneMinuteAreOfOneMoment) {
  ProcedureBook book;
  book.take(told_by("HIS", kMorning + 50s, moved("1", "OR1")), kMorning);
  book.take(told_by("HIS", kMorning, moved("2", "OR1")), kMorning + 5s);
  book.take(told_by("HIS", kMorning + 2min, leaving("2")), kMorning + 2min);
  EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kMayBeGone)
      << "the second one came later: its minute alone was stated";
}

TEST(ProcedureBook, ASenderWhoseClockIsSetBackIsBelievedAfterAnHour) {
  ProcedureBook book;
  book.take(told_by("HIS", kMorning + 24h, moved("1", "OR1")), kMorning);
  book.take(told_by("HIS", kMorning + 30min, moved("2", "OR1")), kMorning + 30min);
  ProcedureBook other = book;
  other.take(leaving("1"), kMorning + 31min);
  EXPECT_TRUE(other.list({{"OR1"}, 12h}, kMorning + 31min).empty()) << "the other one came a day before";
  book.take(told_by("HIS", kMorning + 2h, moved("3", "OR1")), kMorning + 2h);
  book.take(told_by("HIS", kMorning + 3h, leaving("1")), kMorning + 3h);
  EXPECT_EQ(found(book, kMorning + 3h), "3 ") << "what it says of who came before counts, too";
  book.take(told_by("HIS", kMorning + 4h, leaving("3")), kMorning + 4h);
  EXPECT_EQ(found(book, kMorning + 4h), "nobody");
}

TEST(ProcedureBook, ABookingThatComesLateRevivesNothing) {
  ProcedureBook book;
  ProcedureMessage cancelled = planned("1", "A", {});
  cancelled.kind = Kind::kCancels;
  book.take(told_by("PLAN", kMorning + 10min, cancelled), kMorning);
  book.take(told_by("PLAN", kMorning, planned("1", "A", kMorning)), kMorning);
  EXPECT_EQ(found(book, kMorning), "nobody");
  book.take(told_by("PLAN", kMorning + 20min, planned("1", "A", kMorning)), kMorning);
  EXPECT_EQ(found(book, kMorning), "1 A") << "booked anew";
  book.take(told_by("PLAN", kMorning + 15min, planned("1", "A", kMorning + 9h)), kMorning);
  EXPECT_EQ(found(book, kMorning), "1 A") << "moved before that";
}

// The patient is seen off by whoever tracks patients, and the record of their admission goes on.
TEST(ProcedureBook, WhoDepartsFromTheRoomIsNotInItAnyMore) {
  const auto departs = [](const std::vector<std::string>& places) {
    ProcedureMessage message = placed("1", places);
    message.kind = Kind::kDeparts;
    return message;
  };
  const auto after = [](const ProcedureMessage& message) {
    ProcedureBook book;
    book.take(arrived("1", {"SURGERY", "OR1", "SURGERY^OR1", "WARD"}), kMorning);
    book.take(message, kMorning);
    return found(book, kMorning + 1h);
  };
  EXPECT_EQ(after(departs({"SURGERY", "OR1", "SURGERY^OR1"})), "nobody");
  EXPECT_EQ(after(departs({"or1"})), "nobody");
  EXPECT_EQ(after(departs({"WARD"})), "nobody") << "the one place is where they were";
  EXPECT_EQ(after(departs({})), "nobody");
  EXPECT_EQ(after(departs({"SURGERY", "OR2", "SURGERY^OR2"})), "1 ") << "seen off there late";
  EXPECT_EQ(after(departs({"XRAY"})), "1 ");
}

ProcedureMessage with_numbers(ProcedureMessage message, const std::vector<PatientNumber>& numbers,
                              const std::string& born = "1950-01-01") {
  message.numbers = numbers;
  message.patient = numbers.front().number + "\n" + numbers.front().issuer;
  message.data.patient_id = numbers.front().number;
  message.data.birth_date = born;
  return message;
}

TEST(ProcedureBook, WhoLeavesByAnotherFormOfTheNumberIsGone) {
  const PatientNumber known{"0077", "H", "", "MR"};
  const auto after = [&](const ProcedureMessage& message) {
    ProcedureBook book;
    book.take(with_numbers(moved("", "OR1"), {known}), kMorning);
    book.take(message, kMorning + 1min);
    return found(book, kMorning + 1h) + (book.strangers_left() == 0 ? "" : ", told");
  };
  const std::vector<std::vector<PatientNumber>> forms{{{"0077", "", "", "MR"}},
                                                      {{"0077", "H", "1.2.3", ""}},
                                                      {{"77", "H", "", "PI"}},
                                                      {{"V900", "H", "", "AN", true}, {"77", "h", "", ""}}};
  for (const auto& numbers : forms) {
    EXPECT_EQ(after(with_numbers(leaving(""), numbers)), "nobody") << numbers.front().number;
    EXPECT_EQ(after(with_numbers(leaving(""), numbers, "")), "nobody") << "and no day of birth";
    EXPECT_EQ(after(with_numbers(moved("", "ICU"), numbers)), "nobody") << "moved elsewhere";
  }
  EXPECT_EQ(after(with_numbers(leaving(""), {{"77", "CLINIC", "", "MR"}})), "0077 , told");
  EXPECT_EQ(after(with_numbers(leaving(""), {{"77", "", "", "SS"}})), "0077 , told") << "another kind";
  EXPECT_EQ(after(with_numbers(leaving(""), {{"77", "H", "", "AN", true}})), "0077 , told") << "an account";
  EXPECT_EQ(after(with_numbers(leaving(""), {{"77", "H", "", "MR"}}, "1980-02-02")), "0077 , told");
}

TEST(ProcedureBook, OfTwoWhoMayBeMeantNeitherLeavesByHalfANumber) {
  ProcedureBook book;
  book.take(with_numbers(moved("", "OR1"), {{"77", "H", "", ""}}, ""), kMorning);
  book.take(with_numbers(moved("", "OR2"), {{"77", "CLINIC", "", ""}}, "1980"), kMorning);
  book.take(with_numbers(leaving(""), {{"77", "", "", ""}}, ""), kMorning);
  EXPECT_EQ(book.size(), 2U);
  EXPECT_EQ(book.strangers_left(), 1U);
  book.take(with_numbers(leaving(""), {{"77", "", "", ""}}, "1980-05-05"), kMorning);
  EXPECT_EQ(found(book, kMorning, {"OR1"}), "77 ");
  EXPECT_EQ(found(book, kMorning, {"OR2"}), "nobody") << "born as this one";
}

// Newborn, of one day and on their mother's account.
TEST(ProcedureBook, TwinsAreTwo) {
  ProcedureBook book;
  const PatientNumber account{"V9", "H", "", "AN", true};
  using testing::ElementsAre;
  const auto there = [&] { return listed(book, kMorning + 1h); };
  book.take(with_numbers(moved("", "OR1"), {{"1", "H", "", "MR"}, account}), kMorning);
  book.take(with_numbers(moved("", "OR1"), {{"2", "H", "", "MR"}, account}), kMorning + 1min);
  EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kSeveralThere);
  book.take(with_numbers(leaving(""), {account}), kMorning + 2min);
  EXPECT_THAT(there(), ElementsAre("1 ", "2 ")) << "nobody knows which of them";
  book.take(with_numbers(leaving(""), {{"2", "H", "", "MR"}, account}), kMorning + 2min);
  EXPECT_THAT(there(), ElementsAre("1 "));
  book.take(with_numbers(moved("", "OR2"), {{"3", "H", "", "MR"}, {"1", "", "", "SS"}}), kMorning + 3min);
  EXPECT_THAT(there(), ElementsAre("1 "));
  book.take(with_numbers(leaving(""), {account}), kMorning + 4min);
  EXPECT_THAT(there(), testing::IsEmpty()) << "by an account alone";
}

ProcedureMessage merging(const PatientNumber& now, const PatientNumber& before, const std::string& born) {
  ProcedureMessage message = with_numbers(facts(""), {now}, born);
  message.replaces = before.number + "\n" + before.issuer;
  message.replaced_numbers = {before};
  return message;
}

const PatientNumber kNow{"4711", "H", "", "MR"}, kBefore{"0815", "H", "", "MR"};

// Under the earlier number, or another form of it, they had not left.
TEST(ProcedureBook, WhoComesLateIsKnownByAnyNumber) {
  const auto after = [](const ProcedureMessage& late, bool merged) {
    ProcedureBook book;
    if (merged) book.take(told_by("HIS", kMorning - 1h, merging(kNow, kBefore, "1950-01-01")), kMorning);
    book.take(told_by("HIS", kMorning + 1h, with_numbers(leaving(""), {kNow})), kMorning);
    book.take(told_by("HIS", kMorning, late), kMorning + 1min);
    return book;
  };
  for (const PatientNumber& number : {kBefore, PatientNumber{"815", "", "", "MR"}, kNow}) {
    const ProcedureBook book = after(with_numbers(moved("", "OR1"), {number}), true);
    EXPECT_EQ(found(book, kMorning + 1h), "nobody") << number.number;
    EXPECT_EQ(book.size(), 0U) << number.number;
  }
  const PatientNumber other_form{"4711", "", "", "MR"};
  EXPECT_EQ(after(with_numbers(moved("", "OR1"), {other_form}), false).size(), 0U);
  // Half a number may be another patient's, who is there then, or the one who left.
  const ProcedureBook perhaps = after(with_numbers(moved("", "OR1"), {other_form}, ""), false);
  EXPECT_EQ(found(perhaps, kMorning + 1h), "nobody");
  EXPECT_EQ(doubt(perhaps, kMorning + 1h), Doubt::kToldLate);
  const PatientNumber another{"4712", "H", "", "MR"};
  EXPECT_EQ(found(after(with_numbers(moved("", "OR1"), {another}), true), kMorning + 1h), "4712 ");
}

TEST(ProcedureBook, WhoeverWasMergedBeforeTheyCameGoesByTheLaterNumber) {
  ProcedureBook book;
  book.take(merging(kNow, kBefore, "1950-01-01"), kMorning);
  book.take(with_numbers(moved("", "OR1"), {kBefore}), kMorning);
  EXPECT_EQ(found(book, kMorning), "4711 ");
  const PatientNumber last{"9", "H", "", "MR"};
  book.take(merging(last, kNow, "1950-01-01"), kMorning + 1min);
  EXPECT_EQ(found(book, kMorning + 1min), "9 ");
  book.take(with_numbers(leaving(""), {kBefore}), kMorning + 2min);
  EXPECT_EQ(book.size(), 0U);
  // And the other way round.
  book.take(merging(kBefore, last, "1950-01-01"), kMorning + 3min);
  book.take(with_numbers(moved("", "OR1"), {kNow}), kMorning + 4min);
  EXPECT_EQ(found(book, kMorning + 5min), "0815 ");
}

// Whose record it is must be sure before it goes by another number.
TEST(ProcedureBook, NobodyIsRenamedByHalfANumber) {
  ProcedureBook book;
  book.take(with_numbers(moved("", "OR1"), {kBefore}), kMorning);
  book.take(merging(kNow, {"815", "", "", ""}, ""), kMorning + 1min);
  EXPECT_EQ(found(book, kMorning + 1h), "0815 ");
  book.take(merging(kNow, {"815", "", "", ""}, "1950-01-01"), kMorning + 1min);
  EXPECT_EQ(found(book, kMorning + 1h), "4711 ");
}

// One patient who went on under another number; whoever they had come after may be gone all the same.
TEST(ProcedureBook, AMergerLeavesNobodyBehind) {
  ProcedureBook book;
  book.take(moved("0", "OR1"), kMorning);
  book.take(moved("old", "OR1"), kMorning + 1min);
  book.take(moved("new", "ICU"), kMorning + 2min);
  ProcedureMessage merged = facts("new");
  merged.replaces = "old";
  book.take(merged, kMorning + 3min);
  EXPECT_THAT(listed(book, kMorning + 4min), testing::ElementsAre("0 "));
  EXPECT_EQ(doubt(book, kMorning + 4min), Doubt::kMayBeGone);
}

TEST(ProcedureBook, TimesThatCannotBeAreTakenAll) {
  ProcedureBook book;
  book.take(told_by("HIS", *parse_utc("9999-12-31T23:59:59Z"), moved("1", "OR1")), kMorning);
  book.take(told_by("HIS", *parse_utc("1850-01-01T00:00:00Z"), moved("2", "OR1")), kMorning);
  EXPECT_EQ(found(book, kMorning), "1 ");
}

TEST(ProcedureBook, WhoeverWasMergedLeavesByEitherNumber) {
  ProcedureBook book;
  book.take(with_numbers(moved("", "OR1"), {{"0815", "H", "", "MR"}}), kMorning);
  ProcedureMessage merged = with_numbers(facts(""), {{"4711", "H", "", "MR"}});
  merged.replaces = "815\n";
  merged.replaced_numbers = {{"815", "", "", "MR"}};
  book.take(merged, kMorning);
  EXPECT_EQ(found(book, kMorning), "4711 ");
  book.take(with_numbers(leaving(""), {{"0815", "H", "", "MR"}}), kMorning);
  EXPECT_EQ(found(book, kMorning), "nobody");
}

TEST(ProcedureBook, OfTwoPatientsWhoAreEquallyNearNeitherIsTaken) {
  ProcedureBook book;
  book.take(planned("1", "A", kMorning), kMorning - 1h);
  book.take(planned("2", "B", kMorning), kMorning - 1h);
  const ProcedureRule rule{{"OR1"}, 12h};
  EXPECT_EQ(found(book, kMorning + 10min), "nobody");
  EXPECT_EQ(doubt(book, kMorning), Doubt::kTwoPlanned);
  EXPECT_EQ(book.list(rule, kMorning).size(), 2U) << "a person chooses";
  book.take(moved("2", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning + 10min), "2 B") << "somebody placed one of them in the room";
  EXPECT_EQ(doubt(book, kMorning), Doubt::kNone);
}

TEST(ProcedureList, OnePatientIsTheSameNumberOfOneIssuer) {
  const auto patient = [](const std::string& number, const std::string& issuer, const std::string& born) {
    ProcedureData data;
    data.patient_id = number;
    data.patient_id_issuer = issuer;
    data.birth_date = born;
    return data;
  };
  const ProcedureData one = patient("4711", "HOSPITAL", "1980-01-15");
  EXPECT_TRUE(may_be_same_patient(one, patient("4711", "", "")));
  EXPECT_TRUE(may_be_same_patient(one, patient("4711", "HOSPITAL", "1980")));
  EXPECT_FALSE(may_be_same_patient(one, patient("4711", "CLINIC", "1980-01-15")));
  EXPECT_FALSE(may_be_same_patient(one, patient("4711", "", "1952-03-02")));
  EXPECT_FALSE(may_be_same_patient(one, patient("4712", "HOSPITAL", "1980-01-15")));
  ProcedureData father = patient("", "", "1950"), son = patient("", "", "1980");
  father.patient.as_sent = son.patient.as_sent = "SATO^TARO";
  EXPECT_TRUE(may_be_same_patient(son, son));
  EXPECT_FALSE(may_be_same_patient(father, son));
  EXPECT_FALSE(may_be_same_patient(ProcedureData{}, ProcedureData{})) << "two emergencies";
  std::vector<ProcedureData> list{one};
  add_unknown(list, {patient("4711", "CLINIC", "")});
  EXPECT_EQ(list.size(), 2U) << "both can be chosen";
}

TEST(ProcedureBook, AnAppointmentCompletesThePatientInTheRoom) {
  ProcedureBook book;
  book.take(planned("1", "first", kMorning), kMorning - 10h);
  book.take(planned("2", "second", kMorning + 3h), kMorning - 10h);
  book.take(moved("2", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning), "2 second") << "who is there, though another was planned";
  book.take(leaving("2"), kMorning);
  book.take(moved("7", "OR1"), kMorning + 1min);
  EXPECT_EQ(found(book, kMorning + 1min), "7 ") << "an emergency: nobody else's appointment";
}

ProcedureMessage with_kind(ProcedureMessage message, Kind kind) {
  message.kind = kind;
  return message;
}
/// S12 or S13.
ProcedureMessage booked(ProcedureMessage message) {
  message.books = true;
  return message;
}
/// A08.
ProcedureMessage corrected(const std::string& patient, const std::string& place) {
  ProcedureMessage message = placed(patient, {place});
  message.is_of_record = true;
  return message;
}
ProcedureMessage of_visit(const std::string& visit, ProcedureMessage message) {
  message.visit = message.data.visit = visit;
  return message;
}

// They came, were operated on, and left: their appointment was the nearest one still.
TEST(ProcedureBook, WhoeverLeftIsNotTakenByPlan) {
  for (const ProcedureMessage& message :
       {leaving("1"), moved("1", "PACU"), with_kind(placed("1", {"OR1"}), Kind::kDeparts)}) {
    ProcedureBook book;
    book.take(booked(planned("1", "first", kMorning)), kMorning - 20h);
    book.take(booked(planned("2", "second", kMorning + 90min)), kMorning - 20h);
    book.take(moved("1", "WARD"), kMorning - 2h);
    book.take(moved("1", "OR1"), kMorning);
    EXPECT_EQ(found(book, kMorning + 5min), "1 first");
    book.take(message, kMorning + 35min);
    EXPECT_EQ(found(book, kMorning + 40min), "2 second");
    EXPECT_EQ(found(ProcedureBook::imported(book.exported()), kMorning + 40min), "2 second");
    // Its record goes on being changed; that is no booking.
    book.take(planned("1", "first", kMorning), kMorning + 41min);
    EXPECT_EQ(found(book, kMorning + 42min), "2 second");
    book.take(booked(planned("1", "again", kMorning + 50min)), kMorning + 45min);
    EXPECT_EQ(found(book, kMorning + 50min), "1 again") << "booked since";
  }
}

// As hospitals send it: booked the week before, admitted to a ward, moved, corrected, discharged; by one
// system or by two.
TEST(ProcedureBook, AnOrdinaryDayNeedsNoQuestion) {
  enum class Sends { kAll, kAppointments, kAppointmentsAndDischarges };
  for (const Sends sends : {Sends::kAll, Sends::kAppointments, Sends::kAppointmentsAndDischarges}) {
    ProcedureBook book;
    book.watch({{"OR1"}, 12h});
    const std::vector<std::string> patients{"1", "2", "3"};
    for (std::size_t i = 0; i < patients.size(); ++i) {
      const std::string& who = patients[i];
      const UtcTime begin = kMorning + std::chrono::hours(2 * i);
      book.take(told_by("PLAN", begin - 150h, booked(planned(who, "op " + who, begin))), kMorning - 60h);
      if (sends == Sends::kAppointments) continue;
      // The clinic of the day before, closed in the evening.
      ProcedureMessage closed = of_visit("C" + who, leaving(who));
      closed.places = {"CLINIC"};
      book.take(told_by("HIS", kMorning - 30h, of_visit("C" + who, moved(who, "CLINIC"))), kMorning - 30h);
      book.take(told_by("HIS", kMorning - 13h, closed), kMorning - 13h);
      book.take(told_by("HIS", kMorning - 2h, of_visit("I" + who, moved(who, "WARD"))), kMorning - 2h);
    }
    for (std::size_t i = 0; i < patients.size(); ++i) {
      const std::string& who = patients[i];
      const UtcTime begin = kMorning + std::chrono::hours(2 * i) + 5min;
      ProcedureMessage left = of_visit("I" + who, leaving(who));
      left.places = {"WARD"};
      if (sends == Sends::kAll)
        book.take(told_by("HIS", begin - 10min, of_visit("I" + who, moved(who, "OR1"))), begin - 10min);
      // Of whom nobody says that they left, it is known that they were recorded.
      const EndedSince ended = [&](const ProcedureData& data, UtcTime) {
        return sends == Sends::kAppointments && data.patient_id < who;
      };
      EXPECT_EQ(found(book, begin, {"OR1"}, 12h, ended), who + " op " + who) << static_cast<int>(sends);
      if (sends == Sends::kAll) {
        book.take(told_by("HIS", begin + 5min, of_visit("I" + who, corrected(who, "OR1"))), begin + 5min);
        EXPECT_EQ(found(book, begin + 6min), who + " op " + who) << "paused, and carried on";
        book.take(told_by("HIS", begin + 70min, of_visit("I" + who, moved(who, "PACU"))), begin + 70min);
        book.take(told_by("HIS", begin + 80min, of_visit("I" + who, corrected(who, "OR1"))), begin + 80min);
      }
      book.take(
          told_by("PLAN", begin + 75min, planned(who, "op " + who, kMorning + std::chrono::hours(2 * i))),
          begin + 75min);
      if (sends != Sends::kAppointments) book.take(told_by("HIS", begin + 90min, left), begin + 90min);
      if (sends != Sends::kAppointments)
        book.take(told_by("HIS", begin + 92min, of_visit("I" + who, corrected(who, "WARD"))), begin + 92min);
    }
    EXPECT_EQ(book.not_kept(), 0U);
  }
}

// A system of the wards, one that plans, and one of the operating rooms, each with its own clock and numbers.
TEST(ProcedureBook, AnOrdinaryDayOfThreeSystemsNeedsNoQuestion) {
  ProcedureBook book;
  book.watch({{"OR1"}, 12h});
  const std::vector<std::string> patients{"1", "2", "3", "4"};
  const auto tell = [&book](const std::string& sender, UtcTime at, ProcedureMessage message) {
    const auto fast = sender == "OR" ? 7min : sender == "PLAN" ? -4min : 0min;
    book.take(told_by(sender, at + fast, std::move(message)), at);
  };
  const auto in_ward = [](const std::string& who, ProcedureMessage message) {
    return of_visit("V" + who, std::move(message));
  };
  const auto in_theatre = [](const std::string& who, ProcedureMessage message) {
    return of_visit("C" + who, std::move(message));
  };
  const auto begin_of = [](std::size_t i) { return kMorning + std::chrono::hours(3 * i); };
  for (std::size_t i = 0; i < patients.size(); ++i) {
    const std::string& who = patients[i];
    tell("PLAN", kMorning - 40h, booked(planned(who, "op " + who, begin_of(i))));  // S12
    tell("HIS", kMorning - 16h, in_ward(who, moved(who, "ADMISSION")));            // A01
    tell("HIS", kMorning - 15h, in_ward(who, corrected(who, "ADMISSION")));        // A08
    tell("HIS", kMorning - 14h, in_ward(who, moved(who, "WARD")));                 // A02
  }
  for (std::size_t i = 0; i < patients.size(); ++i) {
    const std::string& who = patients[i];
    const UtcTime begin = begin_of(i);
    ProcedureMessage arrives = in_theatre(who, moved(who, "OR1")),
                     recovers = in_theatre(who, moved(who, "PACU"));
    arrives.is_of_any_visit = recovers.is_of_any_visit = true;
    tell("PLAN", begin - 50min, planned(who, "op " + who, {}));  // S14: checked in
    EXPECT_EQ(found(book, begin - 20min), who + " op " + who) << "by plan";
    tell("HIS", begin - 10min, in_ward(who, moved(who, "OR1")));  // A02
    tell("OR", begin - 5min, arrives);                            // A10
    EXPECT_EQ(found(book, begin), who + " op " + who);
    tell("HIS", begin + 5min, in_ward(who, corrected(who, "OR1")));  // A08
    tell("OR", begin + 10min, in_theatre(who, corrected(who, "OR1")));
    EXPECT_EQ(found(book, begin + 15min), who + " op " + who);
    tell("PLAN", begin + 20min, planned(who, "op " + who, begin));  // S14
    if (i % 2 == 0) tell("OR", begin + 70min, recovers);            // A10
    tell("HIS", begin + 75min, in_ward(who, moved(who, i % 2 == 0 ? "PACU" : "WARD")));
    tell("OR", begin + 80min, in_theatre(who, corrected(who, "OR1")));  // A08, with the old place
    tell("HIS", begin + 85min, in_ward(who, moved(who, "WARD")));
    ProcedureMessage left = in_ward(who, leaving(who));  // A03
    left.places = {"WARD"};
    tell("HIS", begin + 100min, left);
    EXPECT_EQ(book.choose({{"OR1"}, 12h}, begin + 110min).data, std::nullopt) << who;
  }
  EXPECT_EQ(book.ended_late(), 0U);
  EXPECT_EQ(book.strangers_left(), 0U);
}

TEST(ProcedureBook, WhatIsPlannedLaterForSomebodyWhoLeftIsForAPersonToChoose) {
  ProcedureBook book;
  book.take(booked(planned("1", "first", kMorning)), kMorning - 20h);
  book.take(booked(planned("1", "second", kMorning + 3h)), kMorning - 20h);
  book.take(booked(planned("1", "tomorrow", kMorning + 24h)), kMorning - 20h);
  book.take(booked(planned("2", "other", kMorning + 4h)), kMorning - 20h);
  book.take(moved("1", "OR1"), kMorning);
  book.take(leaving("1"), kMorning + 1h);
  EXPECT_EQ(doubt(book, kMorning + 3h), Doubt::kLeftAlready);
  EXPECT_NE(words_of(Doubt::kLeftAlready), "");
  EXPECT_EQ(found(book, kMorning + 4h), "2 other");
  EXPECT_EQ(found(book, kMorning + 24h), "1 tomorrow") << "longer ago than the window";
  book.take(moved("1", "OR1"), kMorning + 3h);
  EXPECT_EQ(found(book, kMorning + 3h), "1 second");
}

// It went faster than it was planned.
TEST(ProcedureBook, WhoeverLeftBeforeTheirPlannedTimeIsDoneAllTheSame) {
  ProcedureBook book;
  book.take(booked(planned("1", "first", kMorning + 1h)), kMorning - 20h);
  book.take(booked(planned("2", "second", kMorning + 90min)), kMorning - 20h);
  book.take(moved("1", "OR1"), kMorning);
  book.take(moved("1", "PACU"), kMorning + 50min);
  const EndedSince ended = [](const ProcedureData& data, UtcTime since) {
    return data.patient_id == "1" && since <= kMorning + 45min;
  };
  EXPECT_EQ(found(book, kMorning + 55min, {"OR1"}, 12h, ended), "2 second");
}

// They were moved to the room by mistake, and brought back, before they are operated on.
TEST(ProcedureBook, WhoeverWasInTheRoomByMistakeIsStillPlanned) {
  ProcedureBook book;
  book.take(booked(planned("p", "first", kMorning)), kMorning - 20h);
  book.take(booked(planned("q", "second", kMorning + 50min)), kMorning - 20h);
  book.take(moved("p", "HOLDING"), kMorning - 1h);
  book.take(moved("p", "OR1"), kMorning - 40min);
  ProcedureBook cancelled = book;
  book.take(moved("p", "HOLDING"), kMorning - 35min);
  EXPECT_EQ(found(book, kMorning), "nobody") << "nobody tells a mistake from a short operation";
  EXPECT_EQ(doubt(book, kMorning), Doubt::kLeftAlready);
  ProcedureMessage back = moved("p", "HOLDING");
  back.cancels_move = true;
  cancelled.take(back, kMorning - 35min);
  const ProcedureBook read = ProcedureBook::imported(cancelled.exported());
  EXPECT_EQ(found(read, kMorning), "p first") << "the move was cancelled";
  cancelled.take(corrected("p", "OR1"), kMorning - 30min);
  EXPECT_EQ(found(cancelled, kMorning), "p first");
  EXPECT_THAT(cancelled.find({{"OR1"}, 12h}, kMorning)->chosen, HasSubstr("the appointment"))
      << "a correction of the record brings nobody back";
  // Nor where a record had taken them away before.
  ProcedureBook recorded;
  recorded.take(moved("p", "OR1"), kMorning - 1h);
  recorded.take(corrected("p", "HOLDING"), kMorning - 50min);
  recorded.take(moved("p", "OR1"), kMorning - 40min);
  recorded.take(back, kMorning - 35min);
  recorded.take(corrected("p", "OR1"), kMorning - 30min);
  EXPECT_EQ(found(recorded, kMorning), "nobody");
  // Whoever was operated on before is done all the same.
  ProcedureBook again;
  again.take(booked(planned("p", "first", kMorning)), kMorning - 20h);
  again.take(booked(planned("q", "second", kMorning + 3h)), kMorning - 20h);
  again.take(moved("p", "OR1"), kMorning);
  again.take(moved("p", "PACU"), kMorning + 1h);
  again.take(moved("p", "OR1"), kMorning + 70min);
  back.places = {"PACU"};
  again.take(back, kMorning + 75min);
  EXPECT_EQ(found(again, kMorning + 2h + 5min), "q second");
}

// They were in the clinic the day before, or are admitted anew on the day itself.
TEST(ProcedureBook, WhoeverLeftElsewhereBeforeIsPlannedStill) {
  ProcedureBook book;
  book.take(booked(planned("1", "first", kMorning)), kMorning - 60h);
  book.take(of_visit("V1", moved("1", "CLINIC")), kMorning - 22h);
  book.take(of_visit("V1", leaving("1")), kMorning - 20h);
  EXPECT_EQ(found(book, kMorning), "1 first");
  ProcedureBook again = book;
  again.take(of_visit("V1", moved("1", "CLINIC")), kMorning - 3h);
  again.take(of_visit("V1", leaving("1")), kMorning - 2h);
  EXPECT_EQ(doubt(again, kMorning), Doubt::kLeftAlready) << "two hours before";
  ProcedureBook other = again;
  again.take(of_visit("V2", moved("1", "WARD")), kMorning - 1h);
  EXPECT_EQ(found(again, kMorning), "1 first");
  other.take(of_visit("V2", planned("1", "first", kMorning)), kMorning - 1h);
  EXPECT_EQ(found(other, kMorning), "1 first") << "the appointment is of another visit";
}

TEST(ProcedureBook, TellsWhatItKnowsOfAWorklistsStep) {
  const ProcedureRule rule{{"OR1"}, 12h};
  ProcedureData step;
  step.patient_id = "1";
  step.birth_date = "1950-01-01";
  const auto stands = [&](const ProcedureBook& book, UtcTime at) {
    return book.standing(rule, step, kMorning, at);
  };
  const PatientNumber number{"1", "H", "", "MR"};
  ProcedureBook book;
  EXPECT_EQ(stands(book, kMorning), Standing::kOpen);
  book.take(with_numbers(moved("", "WARD"), {number}), kMorning - 1h);
  EXPECT_EQ(stands(book, kMorning), Standing::kOpen);
  book.take(with_numbers(moved("", "OR1"), {number}), kMorning);
  ProcedureBook gone = book;
  gone.take(with_numbers(leaving(""), {number}), kMorning + 1h);
  EXPECT_EQ(stands(gone, kMorning + 2h), Standing::kDone);
  ProcedureBook unsure = book;
  unsure.take(with_numbers(leaving(""), {number}, ""), kMorning + 1h);
  EXPECT_EQ(stands(unsure, kMorning + 2h), Standing::kDone) << "their birth is known from before";
  gone.take(with_numbers(booked(planned("", "again", kMorning + 2h)), {number}), kMorning + 90min);
  EXPECT_EQ(stands(gone, kMorning + 2h), Standing::kOpen);
  ProcedureBook by_mistake;
  by_mistake.take(with_numbers(moved("", "OR1"), {number}), kMorning - 40min);
  ProcedureMessage back = with_numbers(moved("", "HOLDING"), {number});
  ProcedureBook never_there = by_mistake;
  by_mistake.take(back, kMorning - 35min);
  EXPECT_EQ(stands(by_mistake, kMorning), Standing::kDoubtful);
  back.cancels_move = true;
  never_there.take(back, kMorning - 35min);
  EXPECT_EQ(stands(never_there, kMorning), Standing::kOpen);
  ProcedureBook cancelled;
  cancelled.take(with_numbers(planned("", "A", kMorning), {number}), kMorning - 2h);
  ProcedureMessage call_off = with_numbers(with_kind(planned("", "A", {}), Kind::kCancels), {number});
  call_off.places.clear();
  cancelled.take(call_off, kMorning - 1h);
  EXPECT_EQ(stands(cancelled, kMorning), Standing::kDoubtful) << "the list may not know it yet";
  EXPECT_EQ(stands(ProcedureBook::imported(cancelled.exported()), kMorning), Standing::kDoubtful);
  cancelled.take(with_numbers(planned("", "B", kMorning), {number}), kMorning - 1h);
  EXPECT_EQ(stands(cancelled, kMorning), Standing::kOpen) << "booked anew";
  ProcedureBook over;
  ProcedureMessage done = with_numbers(planned("", "A", kMorning), {number});
  done.is_over = true;
  over.take(done, kMorning + 1h);
  EXPECT_EQ(stands(over, kMorning + 1h), Standing::kDone);
}

// Systems correct the record of whoever was discharged, and leave its place as it was.
TEST(ProcedureBook, ACorrectionBringsNobodyBackWhoLeft) {
  for (const ProcedureMessage& message :
       {leaving("1"), moved("1", "WARD"), with_kind(placed("1", {"OR1"}), Kind::kDeparts)}) {
    ProcedureBook book;
    book.take(moved("1", "OR1"), kMorning);
    book.take(message, kMorning + 40min);
    book.take(booked(planned("2", "second", kMorning + 70min)), kMorning + 41min);
    book.take(corrected("1", "OR1"), kMorning + 50min);
    EXPECT_EQ(found(book, kMorning + 1h), "2 second");
    book.take(facts("1"), kMorning + 51min);
    ProcedureBook other = ProcedureBook::imported(book.exported());
    other.take(corrected("1", "OR1"), kMorning + 55min);
    EXPECT_EQ(found(other, kMorning + 1h), "2 second") << "after an upgrade";
    other.take(moved("1", "OR1"), kMorning + 58min);
    EXPECT_EQ(found(other, kMorning + 1h), "1 ") << "came again";
    other.take(corrected("1", "OR1"), kMorning + 59min);
    EXPECT_EQ(found(other, kMorning + 1h), "1 ");
  }
  // Nor do they bring anybody else, or of another stay: an event does.
  ProcedureBook book;
  for (const std::string place : {"OR1", "PACU", "OR1"}) book.take(corrected("1", place), kMorning);
  EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kRecordAlone);
  ProcedureBook stays;
  stays.take(of_visit("V1", moved("1", "OR1")), kMorning - 10h);
  stays.take(of_visit("V1", leaving("1")), kMorning - 9h);
  stays.take(of_visit("V2", corrected("1", "OR1")), kMorning);
  EXPECT_EQ(doubt(stays, kMorning), Doubt::kRecordAlone);
  EXPECT_THAT(listed(stays, kMorning), testing::ElementsAre("1 "));
}

ProcedureMessage on_a_day(ProcedureMessage message, UtcTime from, UtcTime to) {
  message.planned.reset();
  message.is_time_unclear = true;
  message.within = TimeSpan{from, to};
  return message;
}

TEST(ProcedureBook, AnAppointmentByDayAloneIsNotPlannedForWhenItsMessageCame) {
  const auto on = [](std::chrono::hours days) {
    return on_a_day(planned("2", "day alone", {}), kMorning - 7h + days, kMorning + 17h + days);
  };
  ProcedureBook book;
  book.take(on(7 * 24h), kMorning);
  EXPECT_EQ(found(book, kMorning), "nobody");
  EXPECT_EQ(doubt(book, kMorning), Doubt::kNone) << "next week";
  EXPECT_THAT(listed(book, kMorning), testing::IsEmpty());
  book.take(planned("1", "first", kMorning - 10min), kMorning);
  EXPECT_EQ(found(book, kMorning), "1 first");
  book.take(placed("9", {"OR9"}), kMorning + 6 * 24h);
  EXPECT_EQ(doubt(book, kMorning + 7 * 24h), Doubt::kTimeUnclear) << "kept until then";
  EXPECT_THAT(listed(book, kMorning + 7 * 24h), testing::ElementsAre("2 day alone"));
  ProcedureBook today;
  today.take(on(0h), kMorning - 1h);
  today.take(planned("1", "first", kMorning), kMorning - 1h);
  EXPECT_EQ(doubt(today, kMorning), Doubt::kTimeUnclear);
  EXPECT_EQ(doubt(ProcedureBook::imported(today.exported()), kMorning), Doubt::kTimeUnclear);
  EXPECT_EQ(found(today, kMorning - 8h), "nobody");
  today.take(moved("2", "OR1"), kMorning);
  EXPECT_EQ(found(today, kMorning), "2 day alone") << "who is there has one today";
  ProcedureBook tomorrow;
  tomorrow.take(on(24h), kMorning);
  tomorrow.take(planned("1", "first", kMorning + 8h), kMorning);
  EXPECT_EQ(found(tomorrow, kMorning + 8h), "1 first") << "nearer than any time of tomorrow";
}

TEST(ProcedureBook, WhoeverLeftSinceIsDoneWhoseTimeIsUnclear) {
  const ProcedureMessage day = on_a_day(planned("p", "first", {}), kMorning - 7h, kMorning + 17h);
  ProcedureMessage words = planned("p", "first", {});
  words.is_time_unclear = true;
  for (const ProcedureMessage& first : {day, words, planned("p", "first", {})}) {
    ProcedureBook book;
    book.take(booked(first), kMorning - 8h);
    book.take(booked(planned("q", "second", kMorning + 3h + 30min)), kMorning - 8h);
    ProcedureBook before = book;
    book.take(moved("p", "OR1"), kMorning);
    book.take(moved("p", "PACU"), kMorning + 2h);
    const EndedSince ended = [](const ProcedureData& data, UtcTime) { return data.patient_id == "p"; };
    const auto found_then = [&](const ProcedureBook& in) {
      return found(in, kMorning + 3h + 30min, {"OR1"}, 12h, ended);
    };
    EXPECT_EQ(found_then(book), "q second");
    EXPECT_EQ(doubt(book, kMorning + 3h + 30min), Doubt::kTimeUnclear) << "no case of theirs: a mistake";
    ProcedureBook twice = book;
    twice.take(booked(planned("p", "another", kMorning + 6h)), kMorning - 8h);
    EXPECT_NE(found_then(twice), "q second") << "it may have been the other one";
    book.take(booked(first), kMorning + 3h);
    EXPECT_NE(found_then(book), "q second") << "booked since";
    if (!first.within) continue;
    // Of the day before, or elsewhere, it says nothing.
    before.take(moved("p", "OR1"), kMorning - 7h - 30min);
    before.take(moved("p", "WARD"), kMorning - 7h - 15min);
    before.take(moved("p", "LAB"), kMorning);
    EXPECT_EQ(doubt(before, kMorning + 3h + 30min), Doubt::kTimeUnclear);
  }
}

TEST(ProcedureBook, AMergerWithARecordTakesNobodyOutOfTheRoom) {
  ProcedureBook book;
  book.take(planned("next", "second", kMorning + 30min), kMorning - 2h);
  book.take(moved("123", "OR1"), kMorning);
  ProcedureMessage record = corrected("456", "W7");
  book.take(record, kMorning + 1min);
  ProcedureMessage merger = facts("456");
  merger.replaces = "123";
  book.take(merger, kMorning + 2min);
  EXPECT_EQ(found(book, kMorning + 3min), "456 ");
}

// "Checked in."
TEST(ProcedureBook, AChangeThatStatesNoTimeLeavesTheTimesAsTheyWere) {
  ProcedureBook book;
  ProcedureMessage first = booked(planned("p", "first", kMorning + 1h));
  first.data.planned = "10:00";
  first.planned_places = {place_at("OR1", kMorning), place_at("OR2", kMorning + 2h)};
  first.planned_places.front().planned_text = "09:00";
  first.places = {"OR1", "OR2"};
  book.take(first, kMorning - 20h);
  book.take(booked(planned("q", "second", kMorning + 3h)), kMorning - 20h);
  ProcedureMessage checked_in = planned("p", "first", {});
  checked_in.planned_places = {place_at("OR1", {})};
  book.take(checked_in, kMorning - 1h);
  EXPECT_EQ(found(book, kMorning), "p first");
  EXPECT_EQ(book.find({{"OR1"}, 12h}, kMorning).value_or(ProcedureData()).planned, "09:00");
  EXPECT_EQ(found(book, kMorning + 3h, {"OR1"}, 12h, recorded("p")), "q second");
  // Nor of rooms, but for a ward.
  ProcedureMessage in_ward = planned("p", "first", {});
  in_ward.places = {"WARD"};
  book.take(in_ward, kMorning - 50min);
  EXPECT_EQ(found(book, kMorning), "p first");
  book.take(moved("p", "OR1"), kMorning);
  book.take(moved("p", "PACU"), kMorning + 1h);
  book.take(checked_in, kMorning + 1h);
  EXPECT_EQ(found(book, kMorning + 90min), "nobody") << "more than an hour ahead";
  EXPECT_EQ(doubt(book, kMorning + 90min), Doubt::kTooEarly) << "it is no new booking";
  // One that is booked anew without a time has none.
  book.take(booked(checked_in), kMorning + 2h);
  EXPECT_EQ(doubt(book, kMorning + 3h), Doubt::kTimeUnclear);
}

TEST(ProcedureBook, AnAppointmentWhoseTimeCannotBeReadMayBeMeantAtAnyTime) {
  ProcedureMessage unclear = planned("2", "in words", {});
  unclear.is_time_unclear = true;
  ProcedureBook book;
  book.take(unclear, kMorning - 20h);
  book.take(planned("1", "first", kMorning), kMorning - 20h);
  EXPECT_EQ(doubt(book, kMorning), Doubt::kTimeUnclear);
  EXPECT_EQ(doubt(book, kMorning, {"OR2"}), Doubt::kNone);
  unclear.is_over = true;
  book.take(unclear, kMorning);
  EXPECT_EQ(found(book, kMorning), "1 first");
  ProcedureBook without;
  without.take(planned("2", "no time", {}), kMorning);
  EXPECT_EQ(doubt(without, kMorning + 1h), Doubt::kTimeUnclear);
  EXPECT_EQ(doubt(without, kMorning + 13h), Doubt::kNone);
}

// A hospital sends all of its outpatients.
TEST(ProcedureBook, WhoeverIsInAWatchedRoomIsKeptBeforeOthers) {
  ProcedureBook book;
  book.watch({{"OR1"}, 12h});
  const auto fill = [&book](const std::string& place) {
    for (std::size_t i = 0; i <= ProcedureBook::kMostKept; ++i) {
      const std::string number = place + std::to_string(i);
      book.take(moved(number, place), kMorning + 2min);
      book.take(planned(number, number, kMorning + 1h, place), kMorning + 2min);
      book.take(leaving(place + "-" + number), kMorning + 2min);
    }
  };
  book.take(planned("1", "first", kMorning + 5h), kMorning);
  book.take(planned("1", "elsewhere", kMorning + 5h, "XRAY"), kMorning);
  book.take(moved("3", "OR1"), kMorning);
  book.take(leaving("3"), kMorning);
  book.take(moved("1", "OR1"), kMorning);
  book.take(planned("2", "second", kMorning + 3min), kMorning);
  fill("CLINIC");
  EXPECT_EQ(found(book, kMorning + 3min), "1 first");
  EXPECT_EQ(book.not_kept(), 0U);
  book.take(corrected("3", "OR1"), kMorning + 3min);
  EXPECT_EQ(found(book, kMorning + 3min), "1 first") << "who left is known still";
  book.take(leaving("1"), kMorning + 4min);
  EXPECT_EQ(found(book, kMorning + 5min), "2 second");
}

TEST(ProcedureBook, WhereMoreIsToldOfARoomThanIsKeptNobodyIsTaken) {
  ProcedureBook book;
  book.watch({{"OR1"}, 12h});
  for (std::size_t i = 0; i <= ProcedureBook::kMostKept; ++i)
    book.take(planned(std::to_string(i), "A" + std::to_string(i), kMorning + std::chrono::minutes(i)),
              kMorning);
  EXPECT_EQ(book.not_kept(), 1U);
  const UtcTime last = kMorning + std::chrono::minutes(ProcedureBook::kMostKept);
  EXPECT_EQ(doubt(book, last), Doubt::kNotKept);
  EXPECT_EQ(doubt(ProcedureBook::imported(book.exported()), last), Doubt::kNotKept);
  const EndedSince all = [](const ProcedureData&, UtcTime) { return true; };
  EXPECT_EQ(found(book, last - 13h, {"OR1"}, 12h, all), "1220 A1220") << "it would not count yet";
  EXPECT_EQ(found(book, kMorning), "0 A0") << "what is next was booked first";
  book.take(moved("x", "OR1"), last);
  EXPECT_EQ(found(book, last), "x ") << "who is there is there";
}

// Many are booked for a year ahead: one day of which something is not known is no reason to doubt the others.
TEST(ProcedureBook, WhatIsNotKeptIsInDoubtOnItsOwnDayAlone) {
  ProcedureBook book;
  book.watch({{"OR1"}, 12h});
  for (std::size_t i = 0; i <= ProcedureBook::kMostKept; ++i)
    book.take(planned("p", "A" + std::to_string(i), kMorning + 24h), kMorning);
  book.take(planned("q", "far", kMorning + 10 * 24h), kMorning);
  book.take(planned("r", "next", kMorning + 5 * 24h), kMorning);
  EXPECT_EQ(book.not_kept(), 3U);
  for (const ProcedureBook& each : {book, ProcedureBook::imported(book.exported())}) {
    EXPECT_EQ(doubt(each, kMorning + 5 * 24h), Doubt::kNotKept);
    EXPECT_EQ(doubt(each, kMorning + 7 * 24h), Doubt::kNone) << "between two days";
    EXPECT_EQ(doubt(each, kMorning + 10 * 24h), Doubt::kNotKept);
  }
}

// Whoever sends messages plans for as many days of one room as they like.
TEST(ProcedureBook, AnotherRoomIsInDoubtHoweverManyDaysOfOneAreNotKept) {
  ProcedureBook book;
  book.watch({{"OR1"}, 12h});
  book.watch({{"OR2"}, 12h});
  for (std::size_t i = 0; i < ProcedureBook::kMostKept; ++i)
    book.take(planned("p", "A" + std::to_string(i), kMorning + 24h), kMorning);
  for (int day = 2; day < 1100; ++day)
    book.take(planned("p", "far" + std::to_string(day), kMorning + day * 24h), kMorning);
  EXPECT_EQ(doubt(book, kMorning + 3000 * 24h, {"OR2"}), Doubt::kNone);
  book.take(planned("q", "next", kMorning + 3000 * 24h, "OR2"), kMorning);
  for (const ProcedureBook& each : {book, ProcedureBook::imported(book.exported())})
    EXPECT_EQ(doubt(each, kMorning + 3000 * 24h, {"OR2"}), Doubt::kNotKept);
  EXPECT_EQ(doubt(book, kMorning + 3000 * 24h, {"OR3"}), Doubt::kNone);
}

// Nor are rooms, where each is one of too many: then all are in doubt.
TEST(ProcedureBook, OfMorePlacesThanAreKeptAnyMayBeMeant) {
  ProcedureBook book;
  for (std::size_t i = 0; i < ProcedureBook::kMostKept; ++i)
    book.take(planned("p", "A" + std::to_string(i), kMorning, "OR1"), kMorning);
  for (std::size_t i = 0; i < ProcedureBook::kMostKept; ++i)
    book.take(planned("p", "B" + std::to_string(i), kMorning + 1h, "W" + std::to_string(i)), kMorning);
  book.take(planned("q", "next", kMorning + 2h, "OR2"), kMorning);
  EXPECT_EQ(doubt(book, kMorning + 2h, {"OR2"}), Doubt::kNotKept);
  EXPECT_EQ(doubt(ProcedureBook::imported(book.exported()), kMorning + 2h, {"OR2"}), Doubt::kNotKept);
}

TEST(ProcedureBook, APatientOfManyPlacesTakesNoMoreRoomThanAnother) {
  ProcedureBook book;
  book.watch({{"OR1"}, 12h});
  book.take(booked(planned("p", "first", kMorning)), kMorning - 1h);
  book.take(booked(planned("q", "second", kMorning + 3h)), kMorning - 1h);
  book.take(moved("p", "OR1"), kMorning);
  for (int i = 0; i < 1000; ++i)
    book.take(moved("p", "W" + std::to_string(i)), kMorning + 1h + std::chrono::seconds(i));
  EXPECT_EQ(found(book, kMorning + 2h + 55min), "q second") << "it is known still that they were there";
  book.take(leaving("p"), kMorning + 2h + 56min);
  EXPECT_EQ(found(book, kMorning + 2h + 57min), "q second");
  ProcedureBook only;
  only.watch({{"OR1"}, 12h});
  only.take(moved("p", "W1"), kMorning);
  const std::size_t of_one = only.exported().size();
  for (int i = 0; i < 5000; ++i) {
    ProcedureMessage message = moved("p", "W" + std::to_string(i));
    message.sender = "S" + std::to_string(i);
    message.visit = "V" + std::to_string(i);
    message.is_of_any_visit = true;
    only.take(message, kMorning + std::chrono::seconds(i));
  }
  // What is known of places themselves is bounded by their number.
  EXPECT_LT(only.exported().size(), of_one + 600'000);
  // Where all of them are watched rooms, what is planned in those that are forgotten is in doubt.
  std::vector<std::string> rooms;
  for (int i = 0; i < 200; ++i) rooms.push_back("OR" + std::to_string(i));
  ProcedureBook hostile;
  hostile.watch({rooms, 12h});
  hostile.take(booked(planned("p", "first", kMorning + 1h, "OR0")), kMorning - 1h);
  for (const std::string& room : rooms) hostile.take(moved("p", room), kMorning);
  hostile.take(moved("p", "WARD"), kMorning + 30min);
  EXPECT_EQ(found(hostile, kMorning + 1h, {"OR0"}), "nobody");
  EXPECT_EQ(doubt(hostile, kMorning + 1h, {"OR0"}), Doubt::kNotKept);
}

// A12 says that they never were there.
TEST(ProcedureBook, WhoeverWasBroughtByMistakePutsNobodyElseInDoubt) {
  ProcedureBook book;
  book.take(moved("q", "OR1"), kMorning);
  book.take(moved("p", "HOLDING"), kMorning);
  book.take(moved("p", "OR1"), kMorning + 10min);
  EXPECT_EQ(doubt(book, kMorning + 11min), Doubt::kSeveralThere);
  ProcedureMessage back = moved("p", "HOLDING");
  back.cancels_move = true;
  book.take(back, kMorning + 12min);
  EXPECT_EQ(found(book, kMorning + 13min), "q ");
  EXPECT_EQ(doubt(book, kMorning + 13min), Doubt::kNone);
}

// By A02 instead of A12, after they were to begin: nobody was operated on in five minutes, unless a case says
// so.
TEST(ProcedureBook, WhoeverWasInTheRoomShortlyAndNotRecordedMayStillBePlanned) {
  for (const auto there : {5min, 15min}) {
    ProcedureBook book;
    book.take(booked(planned("p", "first", kMorning)), kMorning - 20h);
    book.take(booked(planned("q", "second", kMorning + 45min)), kMorning - 20h);
    book.take(moved("p", "OR1"), kMorning + 5min);
    book.take(moved("p", "HOLDING"), kMorning + 5min + there);
    const EndedSince ended = [](const ProcedureData& data, UtcTime) { return data.patient_id == "p"; };
    EXPECT_EQ(found(book, kMorning + 35min, {"OR1"}, 12h, ended), "q second");
    EXPECT_EQ(found(book, kMorning + 35min), "q second") << "it is nearer";
    for (const ProcedureBook& each : {book, ProcedureBook::imported(book.exported())}) {
      EXPECT_EQ(found(each, kMorning + 21min), there == 5min ? "nobody" : "q second");
      EXPECT_EQ(doubt(each, kMorning + 21min), there == 5min ? Doubt::kLeftAlready : Doubt::kNone);
    }
  }
}

TEST(ProcedureBook, AnotherVisitTakesNobodyOutOfTheRoom) {
  const auto after = [](ProcedureMessage message) {
    ProcedureBook book;
    book.take(booked(planned("2", "second", kMorning + 80min)), kMorning - 1h);
    book.take(of_visit("V2", moved("1", "OR1")), kMorning);
    if (message.kind != Kind::kDeparts) message.places = {"CLINIC"};
    book.take(of_visit("V1", std::move(message)), kMorning + 55min);
    return book;
  };
  EXPECT_EQ(doubt(after(leaving("1")), kMorning + 1h), Doubt::kOtherVisit);
  EXPECT_EQ(found(after(corrected("1", "CLINIC")), kMorning + 1h), "1 ") << "a record says nothing of now";
  ProcedureMessage discharged = with_kind(placed("1", {}), Kind::kDeparts);
  discharged.is_of_record = true;
  EXPECT_EQ(found(after(discharged), kMorning + 1h), "1 ");
  ProcedureBook book = after(moved("1", "CLINIC"));
  EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kOtherVisit);
  EXPECT_EQ(doubt(ProcedureBook::imported(book.exported()), kMorning + 1h), Doubt::kOtherVisit);
  EXPECT_EQ(found(book, kMorning + 1h, {"CLINIC"}), "1 ") << "who came there";
  ProcedureBook arrived = book, left = book;
  arrived.take(of_visit("V2", moved("1", "OR1")), kMorning + 1h);
  EXPECT_EQ(found(arrived, kMorning + 1h), "1 ");
  ProcedureMessage gone = of_visit("V2", leaving("1"));
  gone.places = {"OR1"};
  left.take(gone, kMorning + 1h);
  EXPECT_EQ(found(left, kMorning + 1h), "2 second");
  book.take(moved("1", "PACU"), kMorning + 1h);
  EXPECT_EQ(found(book, kMorning + 1h), "2 second") << "who is moved whatever the visit is nowhere else";
  // The number of the visit changes with its kind (A06), and they are where it says.
  ProcedureMessage admitted = moved("1", "WARD");
  admitted.is_of_any_visit = true;
  EXPECT_EQ(found(after(admitted), kMorning + 1h), "2 second");
}

ProcedureMessage from(const std::string& sender, ProcedureMessage message) {
  message.sender = sender;
  return message;
}

// The system of the operating rooms numbers visits in its own way.
TEST(ProcedureBook, TwoSystemsNumberOneVisitEach) {
  ProcedureBook book;
  book.take(booked(planned("2", "second", kMorning + 80min)), kMorning - 1h);
  book.take(from("HIS", of_visit("V1", moved("1", "OR1"))), kMorning);
  ProcedureMessage arrived = from("OR", of_visit("C77", moved("1", "OR1")));
  book.take(arrived, kMorning + 1min);
  EXPECT_EQ(found(book, kMorning + 5min), "1 ");
  ProcedureBook left = ProcedureBook::imported(book.exported()), other = left;
  book.take(from("HIS", of_visit("V1", moved("1", "WARD"))), kMorning + 50min);
  EXPECT_EQ(found(book, kMorning + 1h), "2 second");
  left.take(from("HIS", of_visit("V1", leaving("1"))), kMorning + 50min);
  left.take(from("OR", of_visit("C77", corrected("1", "OR1"))), kMorning + 55min);
  EXPECT_EQ(found(left, kMorning + 1h), "2 second") << "a correction brings nobody back";
  ProcedureMessage closed = from("CLINIC", of_visit("V0", leaving("1")));
  closed.places = {"CLINIC"};
  other.take(closed, kMorning + 50min);
  EXPECT_EQ(doubt(other, kMorning + 1h), Doubt::kOtherVisit) << "neither number";
}

TEST(ProcedureBook, WhoeverComesToOnePlaceForTwoVisitsIsThereOnce) {
  ProcedureBook book;
  book.take(booked(planned("2", "second", kMorning + 80min)), kMorning - 1h);
  book.take(from("HIS", of_visit("V1", moved("1", "WARD"))), kMorning - 1h);
  book.take(from("OR", of_visit("C77", moved("1", "OR1"))), kMorning - 5min);
  EXPECT_EQ(found(book, kMorning), "1 ");
  book.take(from("HIS", of_visit("V1", moved("1", "OR1"))), kMorning);
  EXPECT_EQ(found(book, kMorning), "1 ");
  EXPECT_EQ(book.size(), 2U);
  for (const std::string sender : {"HIS", "OR"}) {
    ProcedureBook left = book;
    left.take(from(sender, of_visit(sender == "OR" ? "C77" : "V1", moved("1", "PACU"))), kMorning + 50min);
    EXPECT_EQ(found(left, kMorning + 1h), "2 second") << sender;
  }
  // By an event of every visit, too, and a stale record brings nobody back.
  ProcedureMessage in_any = moved("1", "PACU");
  in_any.is_of_any_visit = true;
  ProcedureBook left = book;
  left.take(booked(planned("1", "first", kMorning)), kMorning - 20h);
  left.take(from("OR", in_any), kMorning + 50min);
  EXPECT_EQ(left.size(), 3U);
  left.take(from("OR", corrected("1", "OR1")), kMorning + 55min);
  EXPECT_EQ(found(left, kMorning + 1h), "2 second");
}

TEST(ProcedureBook, WhoeverWasSetAsideByAnotherVisitMovesOnByTheirOwn) {
  ProcedureBook book;
  book.take(booked(planned("2", "second", kMorning + 80min)), kMorning - 1h);
  book.take(of_visit("V1", moved("1", "OR1")), kMorning);
  book.take(of_visit("V2", moved("1", "LAB")), kMorning + 10min);
  book.take(of_visit("V3", moved("1", "XRAY")), kMorning + 20min);
  ProcedureMessage over = of_visit("V3", leaving("1"));
  over.places = {"XRAY"};
  book.take(over, kMorning + 30min);
  EXPECT_EQ(doubt(book, kMorning + 31min), Doubt::kOtherVisit);
  book.take(of_visit("V1", moved("1", "PACU")), kMorning + 50min);
  EXPECT_EQ(found(book, kMorning + 1h), "2 second");
}

// The visit that set them aside may be over long after they left by their own.
TEST(ProcedureBook, ADischargeOfAnotherVisitBringsNobodyBackIntoTheRoom) {
  ProcedureBook book;
  book.take(booked(planned("2", "second", kMorning + 2h)), kMorning - 1h);
  book.take(of_visit("V1", moved("1", "OR1")), kMorning);
  book.take(of_visit("R5", moved("1", "PACU")), kMorning + 1h);
  ProcedureMessage over = of_visit("R5", leaving("1"));
  over.places = {"PACU"};
  book.take(over, kMorning + 100min);
  EXPECT_EQ(doubt(book, kMorning + 2h), Doubt::kOtherVisit);
  book.take(of_visit("V1", moved("1", "OR1")), kMorning + 2h);
  EXPECT_EQ(found(book, kMorning + 2h), "1 ");
}

// A bed that is kept is one place of both visits, and the room is of the first alone.
TEST(ProcedureBook, WhoeverIsThereOnceHasLeftWhereTheOtherVisitHadThem) {
  ProcedureBook book;
  book.take(booked(planned("1", "first", kMorning)), kMorning - 20h);
  book.take(booked(planned("2", "second", kMorning + 2h)), kMorning - 20h);
  const auto with_bed = [](ProcedureMessage message) {
    message.places.emplace_back("WARD^1^2");
    return message;
  };
  book.take(from("HIS", of_visit("V1", with_bed(moved("1", "OR1")))), kMorning);
  book.take(from("LAB", of_visit("L9", moved("1", "LAB"))), kMorning + 30min);
  book.take(from("OR", of_visit("C77", with_bed(moved("1", "PACU")))), kMorning + 70min);
  EXPECT_EQ(found(book, kMorning + 100min), "2 second");
}

// An outpatient's visit is closed days later, or never.
TEST(ProcedureBook, WhoeverComesForANewVisitIsThere) {
  ProcedureBook book;
  book.take(booked(planned("1", "first", kMorning)), kMorning - 20h);
  book.take(of_visit("V1", moved("1", "CLINIC")), kMorning - 20h);
  book.take(of_visit("V2", moved("1", "WARD")), kMorning - 2h);
  book.take(of_visit("V2", moved("1", "OR1")), kMorning - 5min);
  EXPECT_EQ(found(book, kMorning), "1 first");
  ProcedureMessage closed = of_visit("V1", leaving("1"));
  closed.places = {"CLINIC"};
  book.take(closed, kMorning);
  EXPECT_EQ(found(book, kMorning + 1min), "1 first") << "that visit was known, and was elsewhere";
}

ProcedureMessage person(ProcedureMessage message, const std::string& name, const std::string& born,
                        const std::string& facility = "H1") {
  message.patient = "123\n";
  message.data.patient_id = "123";
  message.numbers = {{"123", "", "", "MR"}};
  message.data.patient = {name, "X", name + "^X"};
  message.data.birth_date = born;
  message.facility = facility;
  message.sender = facility;
  return message;
}

// Two hospitals, or one by mistake, gave one number to two people.
TEST(ProcedureBook, OneNumberOfTwoPeopleSeesNobodyOff) {
  for (const std::string facility : {"H1", "H2"}) {
    for (const Kind kind : {Kind::kLeaves, Kind::kFacts, Kind::kPlaces}) {
      ProcedureBook book;
      book.take(person(moved("", "OR1"), "Right", "1980-01-01"), kMorning);
      book.take(booked(planned("q", "next", kMorning + 80min)), kMorning);
      ProcedureMessage other = person(with_kind(placed("", {"CLINIC"}), kind), "Zed", "1950-05-05", facility);
      other.moves = kind == Kind::kPlaces;
      book.take(other, kMorning + 55min);
      EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kOneNumber);
      EXPECT_EQ(book.list({{"OR1"}, 12h}, kMorning + 1h).front().patient.family, "Right");
      book.take(person(moved("", "OR1"), "Right", "1980-01-01"), kMorning + 1h);
      EXPECT_EQ(book.find({{"OR1"}, 12h}, kMorning + 1h).value().patient.family, "Right");
      book.take(person(leaving(""), "Right", "1980-01-01"), kMorning + 1h);
      EXPECT_EQ(found(book, kMorning + 1h), "q next");
    }
  }
  // Without a name or a birth, the number alone is the sender's own.
  ProcedureBook book;
  book.take(person(moved("", "OR1"), "Right", "1980-01-01"), kMorning);
  ProcedureMessage stranger = person(leaving(""), "", "", "H2");
  stranger.data.patient = {};
  book.take(stranger, kMorning);
  EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kOneNumber);
  ProcedureMessage scheduler = person(leaving(""), "Right", "1980-01-01", "PLAN");
  book.take(scheduler, kMorning);
  EXPECT_EQ(book.size(), 0U) << "name and birth agree";
}

// An emergency comes without a name.
TEST(ProcedureBook, ACorrectedNameIsNoOtherPatient) {
  ProcedureBook book;
  ProcedureMessage unknown = person(moved("", "OR1"), "Unknown", "1900-01-01");
  ProcedureMessage named = person(corrected("", "OR1"), "Right", "1980-01-01");
  for (ProcedureMessage* each : {&unknown, &named}) {
    each->patient = "123\nH";
    each->data.patient_id_issuer = each->numbers.front().issuer = "H";
  }
  book.take(unknown, kMorning);
  book.take(named, kMorning + 10min);
  EXPECT_EQ(book.find({{"OR1"}, 12h}, kMorning + 1h).value().patient.family, "Right");
  ProcedureMessage married = person(corrected("", "OR1"), "Wright", "1980-01-01");
  married.patient = named.patient;
  book.take(married, kMorning + 20min);
  EXPECT_EQ(book.find({{"OR1"}, 12h}, kMorning + 1h).value().patient.family, "Wright");
}

// As its record says once the name is known, though it names another place or none.
TEST(ProcedureBook, AnEmergencyWhoseNameBecomesKnownIsOnePatient) {
  const auto of = [](ProcedureMessage message) {
    message.patient = "123\nH";
    message.data.patient_id_issuer = message.numbers.front().issuer = "H";
    return message;
  };
  const ProcedureMessage unknown = of(person(moved("", "OR1"), "Unknown", "1900-01-01"));
  ProcedureMessage update = facts("");
  update.corrects = true;
  for (const ProcedureMessage& record : {update, corrected("", "ER")}) {
    ProcedureBook book;
    book.take(of(person(moved("", "ER"), "Unknown", "1900-01-01")), kMorning - 1h);
    book.take(unknown, kMorning);
    book.take(of(person(record, "Right", "1980-01-01")), kMorning + 10min);
    EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kNone);
    EXPECT_EQ(book.find({{"OR1"}, 12h}, kMorning + 1h).value_or(ProcedureData()).patient.family, "Right");
    EXPECT_EQ(book.size(), 1U);
    book.take(of(person(leaving(""), "Right", "1980-01-01")), kMorning + 1h);
    EXPECT_EQ(book.size(), 0U);
  }
  // Somebody else's record under a mistyped number (A28), an event, or another system's record, is none.
  ProcedureBook mistyped;
  mistyped.take(unknown, kMorning);
  mistyped.take(of(person(facts(""), "Zed", "1950-05-05")), kMorning + 10min);
  EXPECT_EQ(doubt(mistyped, kMorning + 1h), Doubt::kOneNumber);
  for (ProcedureMessage other : {moved("", "ER"), leaving(""), facts("")}) {
    ProcedureBook book;
    book.take(unknown, kMorning);
    const std::string facility = other.kind == Kind::kFacts ? "H2" : "H1";
    book.take(of(person(other, "Zed", "1950-05-05", facility)), kMorning + 10min);
    EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kOneNumber);
  }
}

/// A01, A04, A06, A13.
ProcedureMessage registered(const std::string& patient, const std::string& place) {
  ProcedureMessage message = moved(patient, place);
  message.registers = true;
  return message;
}
ProcedureMessage filled(const std::string& sender, const std::string& number, ProcedureMessage message,
                        const std::string& by = "") {
  message = numbered(std::move(message), "", number);
  message.filler_by.name = by;
  message.sender = sender;
  return message;
}

// Each system counts its appointments from one on.
TEST(ProcedureBook, TwoSystemsMayUseOneNumberForTwoAppointments) {
  const auto after = [](const ProcedureMessage& other, const std::string& by = "") {
    ProcedureBook book;
    book.take(filled("HIS", "1001", booked(planned("a", "first", kMorning)), by), kMorning - 2h);
    book.take(filled("HIS", "1002", booked(planned("b", "second", kMorning + 50min)), by), kMorning - 2h);
    book.take(other, kMorning - 1h);
    return ProcedureBook::imported(book.exported());
  };
  const ProcedureMessage elsewhere = booked(planned("c", "other", kMorning + 30min, "ENDO2"));
  const ProcedureMessage cancelled = with_kind(planned("c", "", {}, "ENDO2"), Kind::kCancels);
  for (const ProcedureMessage& message : {elsewhere, cancelled}) {
    EXPECT_EQ(found(after(filled("ENDO", "1001", message)), kMorning), "a first");
    EXPECT_EQ(found(after(filled("ENDO", "1001", message, "ENDO"), "HIS"), kMorning), "a first");
    EXPECT_EQ(found(after(filled("HIS", "1001", message, "ENDO"), "HIS"), kMorning), "a first")
        << "both come through one engine";
    // The number is the same, and the patient is not.
    EXPECT_EQ(doubt(after(filled("HIS", "1001", message)), kMorning), Doubt::kOneAppointment);
    EXPECT_EQ(doubt(after(filled("ENDO", "1001", message, "his"), "HIS"), kMorning), Doubt::kOneAppointment);
    // Or the patient is, and nobody knows whose number it is.
    ProcedureMessage same = message;
    same.patient = same.data.patient_id = "a";
    EXPECT_EQ(doubt(after(filled("ENDO", "1001", same)), kMorning), Doubt::kOneAppointment);
    EXPECT_EQ(doubt(after(filled("ENDO", "1001", same), "HIS"), kMorning), Doubt::kOneAppointment);
    EXPECT_EQ(found(after(filled("ENDO", "1001", same, "ENDO"), "HIS"), kMorning), "a first");
    EXPECT_EQ(found(after(filled("HIS", "1001", same), "HIS"), kMorning), "b second")
        << "of one sender it is that one";
  }
  // By the number alone.
  ProcedureMessage unnamed = cancelled;
  unnamed.patient.clear();
  unnamed.data.patient_id.clear();
  EXPECT_EQ(found(after(filled("HIS", "1001", unnamed)), kMorning), "b second");
  EXPECT_EQ(doubt(after(filled("ENDO", "1001", unnamed)), kMorning), Doubt::kOneAppointment);
  // What another system says likewise is in no doubt.
  EXPECT_EQ(found(after(filled("ENDO", "1001", planned("a", "first", kMorning))), kMorning), "a first");
  ProcedureBook book = after(filled("ENDO", "1001", [&] {
    ProcedureMessage same = elsewhere;
    same.patient = same.data.patient_id = "a";
    return same;
  }()));
  book.take(filled("ENDO", "1001", with_kind(planned("a", "", {}, "ENDO2"), Kind::kCancels)),
            kMorning - 30min);
  EXPECT_EQ(doubt(book, kMorning), Doubt::kOneAppointment);
  book.take(filled("HIS", "1001", planned("a", "first", kMorning)), kMorning - 20min);
  EXPECT_EQ(found(book, kMorning), "a first") << "its own system says so again";
}

// Of two that came through one engine the one goes on being changed.
TEST(ProcedureBook, AnotherAppointmentOfTheNumberIsNotTakenForASeriesOfPatients) {
  ProcedureBook book;
  book.take(filled("HIS", "1001", booked(planned("a", "first", kMorning))), kMorning - 2h);
  book.take(filled("HIS", "1001", booked(planned("c", "other", kMorning + 30min, "ENDO2"))), kMorning - 1h);
  book.take(filled("HIS", "1001", planned("c", "other", kMorning + 40min, "ENDO2")), kMorning - 1h);
  book.take(filled("HIS", "1002", booked(planned("b", "second", kMorning + 50min))), kMorning - 1h);
  EXPECT_EQ(doubt(book, kMorning), Doubt::kOneAppointment);
  EXPECT_EQ(book.size(), 3U);
}

TEST(ProcedureBook, ACorrectionTakesNobodyOutOfTheRoom) {
  const auto after = [](const ProcedureMessage& arrives, const ProcedureMessage& record) {
    ProcedureBook book;
    book.take(booked(planned("b", "second", kMorning + 30min)), kMorning - 1h);
    book.take(arrives, kMorning - 10min);
    book.take(record, kMorning - 2min);
    return ProcedureBook::imported(book.exported());
  };
  for (const std::string sender : {"ORSYS", "HIS"}) {
    const ProcedureMessage record = told_by("HIS", kMorning - 2min, corrected("a", "W4"));
    const ProcedureMessage arrives = told_by(sender, kMorning - 10min, moved("a", "OR1"));
    for (const std::string visit : {"", "V77"}) {
      ProcedureBook book = after(of_visit(visit, arrives), of_visit(visit, record));
      EXPECT_EQ(doubt(book, kMorning), Doubt::kRecordElsewhere);
      EXPECT_THAT(listed(book, kMorning), testing::Contains("a "));
      book.take(told_by("HIS", kMorning, moved("a", "OR1")), kMorning);
      EXPECT_EQ(found(book, kMorning), "a ");
      book.take(told_by("HIS", kMorning + 1min, moved("a", "W4")), kMorning + 1min);
      EXPECT_EQ(found(book, kMorning + 1min), "b second");
    }
  }
  // The ward that the operating rooms' system took them from is no news.
  ProcedureBook book;
  book.take(told_by("HIS", kMorning - 2h, moved("a", "W4")), kMorning - 2h);
  book.take(told_by("ORSYS", kMorning - 10min, moved("a", "OR1")), kMorning - 10min);
  book.take(told_by("HIS", kMorning - 2min, corrected("a", "W4")), kMorning - 2min);
  EXPECT_EQ(found(book, kMorning), "a ");
}

TEST(ProcedureBook, ACorrectionBringsNobodyAgainstThePlan) {
  for (const bool is_known : {false, true}) {
    ProcedureBook book;
    if (is_known) book.take(moved("a", "WARD"), kMorning - 5h);
    book.take(corrected("a", "OR1"), kMorning - 30min);
    EXPECT_EQ(doubt(book, kMorning), Doubt::kRecordAlone);
    EXPECT_THAT(listed(book, kMorning), testing::ElementsAre("a "));
    book.take(booked(planned("a", "tomorrow", kMorning + 24h)), kMorning - 50h);
    book.take(booked(planned("b", "now", kMorning)), kMorning - 50h);
    EXPECT_EQ(found(book, kMorning), "b now");
    EXPECT_EQ(found(ProcedureBook::imported(book.exported()), kMorning), "b now");
    book.take(moved("b", "OR1"), kMorning);
    EXPECT_EQ(doubt(book, kMorning), Doubt::kSeveralThere);
    book.take(moved("a", "OR1"), kMorning);
    book.take(moved("b", "OR2"), kMorning);
    EXPECT_EQ(found(book, kMorning), "a ") << "an event brings them";
  }
}

TEST(ProcedureBook, WhoeverWasOnlyRegisteredInTheRoomIsNotTakenAgainstThePlan) {
  const auto with = [](std::optional<UtcTime> own, std::optional<UtcTime> other,
                       const ProcedureMessage& arrives = registered("a", "OR1")) {
    ProcedureBook book;
    if (own) book.take(booked(planned("a", "own", own)), kMorning - 50h);
    if (other) book.take(booked(planned("b", "other", other)), kMorning - 50h);
    book.take(arrives, kMorning - 30min);
    return ProcedureBook::imported(book.exported());
  };
  EXPECT_EQ(found(with({}, {}), kMorning), "a ") << "nobody else is known";
  EXPECT_EQ(found(with(kMorning, {}), kMorning), "a own");
  EXPECT_EQ(found(with(kMorning, kMorning + 50min), kMorning), "a own");
  EXPECT_EQ(found(with(kMorning, kMorning), kMorning), "a own") << "both are planned, one is registered";
  EXPECT_EQ(found(with({}, kMorning + 2h), kMorning), "a ") << "the other one is later";
  for (const auto& own : {std::optional<UtcTime>(), std::optional(kMorning + 6h),
                          std::optional(kMorning + 24h), std::optional(kMorning + 47min)})
    EXPECT_EQ(doubt(with(own, kMorning), kMorning), Doubt::kOnlyRegistered);
  EXPECT_EQ(doubt(with(kMorning - 5min, kMorning - 70min), kMorning), Doubt::kOnlyRegistered) << "it is late";
  EXPECT_EQ(found(with(kMorning + 6h, kMorning, moved("a", "OR1")), kMorning), "a own") << "came there";
  ProcedureBook book = with(kMorning - 5min, kMorning - 70min);
  EXPECT_EQ(found(book, kMorning, {"OR1"}, 12h, recorded("b")), "a own");
  book.take(leaving("b"), kMorning - 1min);
  EXPECT_EQ(found(book, kMorning), "a own");
  book.take(moved("a", "OR1"), kMorning);
  book.take(registered("a", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning), "a own");
  // Where every message is about this room.
  EXPECT_EQ(doubt(with(kMorning + 6h, kMorning), kMorning, {}), Doubt::kOnlyRegistered);
  EXPECT_EQ(doubt(with(kMorning + 6h, kMorning,
                       [] {
                         ProcedureMessage message = registered("a", "");
                         message.places.clear();
                         return message;
                       }()),
                  kMorning, {}),
            Doubt::kOnlyRegistered);
}

TEST(ProcedureBook, WhereTheRoomRunsLateAPersonChooses) {
  ProcedureBook book;
  book.take(booked(planned("b", "first", kMorning - 70min)), kMorning - 5h);
  for (const auto next : {-5min, 10min}) {
    book.take(booked(planned("c", "second", kMorning + next)), kMorning - 5h);
    EXPECT_EQ(doubt(book, kMorning), Doubt::kEarlierOpen);
    EXPECT_EQ(found(book, kMorning - 50min), "b first") << "the nearest one is the first";
    EXPECT_EQ(found(book, kMorning, {"OR1"}, 12h, recorded("b")), "c second");
  }
  ProcedureBook gone = book, called_off = book, over = book, in_ward = book;
  gone.take(moved("b", "OR1"), kMorning - 70min);
  gone.take(moved("b", "PACU"), kMorning - 5min);
  EXPECT_EQ(found(gone, kMorning), "c second");
  called_off.take(with_kind(planned("b", "first", {}), Kind::kCancels), kMorning - 5min);
  EXPECT_EQ(found(called_off, kMorning), "c second");
  ProcedureMessage done = planned("b", "first", kMorning - 70min);
  done.is_over = true;
  over.take(done, kMorning - 5min);
  EXPECT_EQ(found(over, kMorning), "c second");
  EXPECT_EQ(doubt(over, kMorning - 10min), Doubt::kLeftMeanwhile)
      << "of a case that began before it was over";
  // Whoever departs from their ward is on the way.
  in_ward.take(moved("b", "WARD"), kMorning - 3h);
  in_ward.take(with_kind(placed("b", {"WARD"}), Kind::kDeparts), kMorning - 5min);
  EXPECT_EQ(doubt(in_ward, kMorning), Doubt::kEarlierOpen);
  book.take(moved("c", "OR1"), kMorning);
  EXPECT_EQ(found(book, kMorning), "c second") << "who is there is there";
  ProcedureBook twice;
  twice.take(booked(planned("b", "first", kMorning - 70min)), kMorning - 5h);
  twice.take(booked(planned("b", "second", kMorning)), kMorning - 5h);
  EXPECT_EQ(found(twice, kMorning), "b second") << "one patient's";
}

TEST(ProcedureBook, AnAppointmentIsInTheRoomsThatItNames) {
  ProcedureBook book;
  ProcedureMessage a = booked(planned("a", "first", kMorning, "OR1"));
  a.planned_places = {place_at("OR2", {})};
  a.places = {"OR1", "OR2"};
  book.take(booked(planned("b", "second", kMorning + 5min)), kMorning - 1h);
  ProcedureBook other = book;
  a.names_rooms = true;
  book.take(a, kMorning - 1h);
  EXPECT_EQ(found(book, kMorning), "b second");
  EXPECT_EQ(found(book, kMorning, {"OR2"}), "a first");
  EXPECT_EQ(found(ProcedureBook::imported(book.exported()), kMorning), "b second");
  // A resource is a room where one has its name, else a machine.
  a.names_rooms = false;
  ProcedureBook machine = other;
  machine.take(a, kMorning - 1h);
  EXPECT_EQ(found(machine, kMorning), "a first");
  other.watch({{"OR2"}, 12h});
  other.take(a, kMorning - 1h);
  EXPECT_EQ(found(other, kMorning), "b second");
  // What is said of a time alone leaves its room.
  a.names_rooms = true;
  ProcedureMessage later = planned("a", "first", kMorning + 3min, "OR1");
  book.take(later, kMorning - 30min);
  EXPECT_EQ(found(book, kMorning + 3min, {"OR2"}), "a first");
  EXPECT_EQ(found(book, kMorning), "b second");
}

TEST(ProcedureBook, AnAppointmentWhoseStatusIsNotKnownIsForAPersonToChoose) {
  ProcedureBook book;
  ProcedureMessage waiting = booked(planned("a", "first", kMorning));
  waiting.is_status_unclear = true;
  book.take(waiting, kMorning - 1h);
  book.take(booked(planned("b", "second", kMorning + 6min)), kMorning - 1h);
  EXPECT_EQ(doubt(book, kMorning), Doubt::kStatusUnclear);
  EXPECT_EQ(doubt(ProcedureBook::imported(book.exported()), kMorning), Doubt::kStatusUnclear);
  book.take(booked(planned("a", "first", kMorning)), kMorning - 1h);
  EXPECT_EQ(found(book, kMorning), "a first");
}

// SIU^S14 with SCH-25 empty changes what it names, and says nothing of the status.
TEST(ProcedureBook, AChangeThatSaysNoStatusTakesNothingOffAWaitingList) {
  ProcedureMessage waiting = booked(planned("a", "first", kMorning));
  waiting.is_status_unclear = true;
  ProcedureBook book;
  book.take(waiting, kMorning - 1h);
  book.take(booked(planned("b", "second", kMorning + 6min)), kMorning - 1h);
  ProcedureMessage change = planned("a", "first", kMorning);
  change.books = false;
  change.says_no_status = true;
  ProcedureBook silent = book;
  silent.take(change, kMorning - 30min);
  EXPECT_EQ(doubt(silent, kMorning), Doubt::kStatusUnclear);
  EXPECT_EQ(doubt(ProcedureBook::imported(silent.exported()), kMorning), Doubt::kStatusUnclear);
  silent.take(change, kMorning - 20min);
  EXPECT_EQ(doubt(silent, kMorning), Doubt::kStatusUnclear) << "nor does a second one";
  // A booking without a status is one, and so is a change that says so.
  ProcedureBook anew = book;
  ProcedureMessage booking = booked(planned("a", "first", kMorning));
  booking.says_no_status = true;
  anew.take(booking, kMorning - 30min);
  EXPECT_EQ(found(anew, kMorning), "a first");
  change.says_no_status = false;
  book.take(change, kMorning - 30min);
  EXPECT_EQ(found(book, kMorning), "a first");
}

// Its clock may be wrong, or it comes late.
TEST(ProcedureBook, AnEventFromBeforeAnotherSystemSawThemOffBringsNobodyBack) {
  for (const bool is_discharged : {false, true}) {
    ProcedureBook book;
    book.take(booked(planned("b", "second", kMorning)), kMorning - 3h);
    book.take(told_by("HIS", kMorning - 100min, moved("a", "OR1")), kMorning - 100min);
    const ProcedureMessage gone = is_discharged ? leaving("a") : moved("a", "PACU");
    book.take(told_by("HIS", kMorning - 10min, gone), kMorning - 10min);
    ProcedureBook again = book;
    book.take(told_by("ORSYS", kMorning - 99min, moved("a", "OR1")), kMorning - 1min);
    EXPECT_EQ(doubt(book, kMorning), Doubt::kToldLate);
    again.take(told_by("ORSYS", kMorning - 5min, moved("a", "OR1")), kMorning - 1min);
    EXPECT_EQ(found(again, kMorning), "a ") << "came again";
  }
}

TEST(ProcedureBook, ANewbornWhoIsLeftIsForAPersonToChoose) {
  const auto with = [](const std::string& born) {
    ProcedureBook book;
    ProcedureMessage child = moved("child", "OR1");
    child.data.birth_date = born;
    book.take(moved("mother", "OR1"), kMorning - 60min);
    book.take(child, kMorning - 40min);
    book.take(moved("mother", "WARD"), kMorning - 10min);
    return book;
  };
  EXPECT_EQ(doubt(with("2026-08-05"), kMorning), Doubt::kNewborn);
  EXPECT_EQ(doubt(with("2026-08-04"), kMorning), Doubt::kNewborn);
  for (const std::string born : {"2026-07-05", "2026-08", "", "5.8.2026"})
    EXPECT_EQ(found(with(born), kMorning), "child ") << born;
  ProcedureBook alone;
  ProcedureMessage child = moved("child", "OR1");
  child.data.birth_date = "2026-08-04";
  alone.take(child, kMorning - 40min);
  EXPECT_EQ(found(alone, kMorning), "child ");
}

TEST(ProcedureBook, AnotherNameWithHalfANumberSeesNobodyOff) {
  const auto after = [](const std::string& name, const std::string& issuer, const std::string& born = "") {
    ProcedureBook book;
    book.take(booked(planned("b", "second", kMorning + 30min)), kMorning - 1h);
    ProcedureMessage a = with_numbers(moved("", "OR1"), {{"4711", issuer, "", ""}}, "1970-01-01");
    a.data.patient_id_issuer = issuer;
    a.data.patient = {"TANAKA", "HANAKO", "TANAKA^HANAKO"};
    a.sender = "HIS";
    ProcedureMessage left = with_numbers(leaving(""), {{"4711", "", "", ""}}, born);
    if (!name.empty()) left.data.patient = {name, "X", name + "^X"};
    left.sender = "LAB";
    book.take(a, kMorning - 10min);
    book.take(left, kMorning - 2min);
    return book;
  };
  for (const std::string issuer : {"HOSP", ""}) {
    EXPECT_EQ(doubt(after("SUZUKI", issuer), kMorning), Doubt::kOneNumber) << issuer;
    EXPECT_EQ(found(after("", issuer), kMorning), "b second") << "the number alone";
    EXPECT_EQ(found(after("SUZUKI", issuer, "1970-01-01"), kMorning), "b second") << "born on that day";
  }
}

TEST(ProcedureBook, SomebodyWhoIsNotNamedMayHaveLeftTheRoom) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  ProcedureMessage unnamed = placed("", {"OR1"});
  unnamed.kind = Kind::kNothing;
  unnamed.leaves_unnamed = true;
  book.take(unnamed, kMorning + 1h);
  EXPECT_EQ(doubt(book, kMorning + 1h), Doubt::kNobodyNamed);
  EXPECT_EQ(book.strangers_left(), 1U);
}

// One that was planned beyond the year 10000 took all of them away at a start.
TEST(ProcedureBook, ATimeThatNoneCanBeCostsItselfAlone) {
  ProcedureBook book;
  book.take(moved("1", "OR1"), kMorning);
  ProcedureMessage beyond = planned("2", "no end", *parse_utc("9999-12-31T23:59:00Z") + 300 * 24h, "OR2");
  book.take(beyond, kMorning);
  const ProcedureBook read = ProcedureBook::imported(book.exported());
  EXPECT_EQ(found(read, kMorning + 1h), "1 ");
  EXPECT_EQ(read.not_kept(), 1U);
  EXPECT_EQ(doubt(read, kMorning + 1h, {"OR2"}), Doubt::kNotKept);
  EXPECT_EQ(ProcedureBook::imported(read.exported()).exported(), read.exported());
}

/// As its hospital's systems send them, in the minutes after seven.
class ProcedureDay : public testing::Test {
 protected:
  static std::string time(int minute) {
    std::string text = format_utc(kMorning + std::chrono::minutes(minute)).substr(0, 19);
    std::erase_if(text, [](char each) { return each == '-' || each == ':' || each == 'T'; });
    return text + "+0000";
  }
  static std::string pid(const std::string& patient, const std::string& account = "") {
    const std::string name = patient == "TEMP" ? "Unknown||" : "N" + patient + "^X||19600101";
    return "PID|1||" + patient + "^^^H^MR||" + name + "|||||||||||" + account + "\r";
  }
  void take(int minute, const std::string& type, const std::string& segments) {
    const std::string sender = type.starts_with("SIU") ? "PLAN" : "HIS";
    const Hl7Parse parsed =
        parse_hl7_message("MSH|^~\\&|" + sender + "|H|||" + time(minute) + "||" + type + "|" +
                          std::to_string(++number_) + "|P|2.5\rEVN||" + time(minute) + "\r" + segments);
    ASSERT_TRUE(parsed.message) << parsed.problem;
    book.take_all(read_procedure_messages(*parsed.message, AssumedZone(0min)), kMorning + minute * 1min);
    book = ProcedureBook::imported(book.exported());
    book.watch({{"OR1"}, 12h});
  }
  /// PV1-3, and what is known beside it.
  void adt(int minute, const std::string& event, const std::string& patient, const std::string& place,
           const std::string& temporary = "", const std::string& prior = "", const std::string& account = "",
           const std::string& visit = "") {
    take(minute, "ADT^" + event,
         pid(patient, account) + "PV1|1|I|" + place + "|||" + prior + "|||||" + temporary + "||||||||" +
             visit + "\r");
  }
  void siu(int minute, const std::string& event, const std::string& number, const std::string& patient,
           const std::string& planned, const std::string& resources, const std::string& status = "") {
    take(minute, "SIU^" + event,
         "SCH|" + number + "|" + number + "|||||||||^^^" + planned + "||||||||||||||" + status + "\r" +
             (patient.empty() ? "" : pid(patient)) + resources);
  }
  /// P1 for seven, and P2 45 minutes later.
  void plan_both() {
    siu(-600, "S12", "A", "P1", time(0), kRoom);
    siu(-599, "S12", "B", "P2", time(45), kRoom);
  }
  /// P1 is on the table without having been planned.
  void bring(const std::string& patient = "P1") {
    siu(-599, "S12", "B", "P2", time(45), kRoom);
    adt(-20, "A10", patient, "ER^1", "SURG^OR1");
  }
  [[nodiscard]] std::string taken(const EndedSince& ended = {}, int minute = 5) const {
    const ProcedureChoice choice = book.choose({{"OR1"}, 12h}, kMorning + minute * 1min, ended);
    if (choice.data) return choice.data->patient_id;
    return choice.doubt == Doubt::kNone ? "nobody" : std::string(words_of(choice.doubt));
  }
  void start_anew() {
    book = ProcedureBook();
    book.watch({{"OR1"}, 12h});
  }

  static constexpr const char* kRoom = "RGS|1\rAIL|1||SURG^OR1\r";
  ProcedureBook book;

 private:
  int number_ = 0;
};

// A case runs since five minutes after seven about whom messages named.
TEST_F(ProcedureDay, WhatContradictsARunningCaseIsAnObjection) {
  const ProcedureMoment begun = kMorning + 5min;
  const auto begin = [&] { return book.choose({{"OR1"}, 12h}, begun); };
  const auto against = [&](const ProcedureChoice& choice) {
    EXPECT_EQ(choice.data.value_or(ProcedureData()).patient_id, "P1");
    return book.objection({{"OR1"}, 12h}, choice, begun);
  };
  // By plan alone.
  plan_both();
  ProcedureChoice choice = begin();
  EXPECT_EQ(against(choice), Objection::kNone);
  adt(10, "A02", "P2", "SURG^OR1");
  EXPECT_EQ(against(choice), Objection::kAnotherThere) << "though planned for later";
  start_anew();
  plan_both();
  siu(10, "S15", "A", "P1", time(0), kRoom, "Cancelled");
  EXPECT_EQ(against(choice), Objection::kTakenBack);
  for (const char* event : {"S12", "S14"}) {
    start_anew();
    plan_both();
    siu(10, event, "A", "P3", time(50), kRoom);
    EXPECT_EQ(against(choice), Objection::kTakenBack) << event << ": the slot is somebody else's";
  }
  start_anew();
  plan_both();
  siu(10, "S13", "A", "P1", time(300), kRoom);
  EXPECT_EQ(against(choice), Objection::kTakenBack) << "put off";
  start_anew();
  plan_both();
  adt(8, "A02", "P1", "SURG^OR1", "", "WARD^1");
  EXPECT_EQ(against(choice), Objection::kNone) << "they came";
  adt(10, "A12", "P1", "WARD^1", "", "SURG^OR1");
  EXPECT_EQ(against(choice), Objection::kTakenBack) << "they never came";
  // By an event.
  const auto brought = [&] {
    start_anew();
    bring();
    choice = begin();
    EXPECT_EQ(against(choice), Objection::kNone);
  };
  brought();
  adt(10, "A12", "P1", "ER^1", "", "SURG^OR1");
  EXPECT_EQ(against(choice), Objection::kTakenBack);
  brought();
  adt(10, "A11", "P1", "SURG^OR1");
  EXPECT_EQ(against(choice), Objection::kTakenBack);
  brought();
  adt(10, "A02", "P3", "SURG^OR1");
  EXPECT_EQ(against(choice), Objection::kSeveralThere);
  brought();
  take(10, "ADT^A08", "PID|1||P1^^^H^MR||Other^Olaf||19600101\rPV1|1|I|SURG^OR1\r");
  EXPECT_EQ(against(choice), Objection::kOtherIdentity);
  brought();
  take(10, "ADT^A40", pid("P9") + "MRG|P1^^^H^MR\r");
  EXPECT_EQ(against(choice), Objection::kOtherIdentity);
  // Nobody left it between: they were there before, were brought again by mistake, and that is taken back.
  start_anew();
  adt(-200, "A02", "P1", "SURG^OR1");
  adt(-100, "A02", "P1", "PACU^1");
  adt(-10, "A02", "P1", "SURG^OR1");
  choice = begin();
  adt(10, "A12", "P1", "PACU^1", "", "SURG^OR1");
  EXPECT_EQ(against(choice), Objection::kTakenBack);
}

TEST_F(ProcedureDay, WhatAnOrdinaryOperationBringsIsNoObjection) {
  const ProcedureMoment begun = kMorning + 5min;
  const auto against = [&](const ProcedureChoice& choice) {
    EXPECT_EQ(choice.data.value_or(ProcedureData()).patient_id, "P1");
    return book.objection({{"OR1"}, 12h}, choice, begun);
  };
  plan_both();
  const ProcedureChoice by_plan = book.choose({{"OR1"}, 12h}, begun);
  siu(6, "S14", "A", "P1", time(20), kRoom);
  EXPECT_EQ(against(by_plan), Objection::kNone) << "a little later";
  adt(7, "A04", "P2", "SURG^OR1");
  EXPECT_EQ(against(by_plan), Objection::kNone) << "the next one is registered";
  adt(8, "A02", "P1", "SURG^OR1", "", "WARD^1");
  take(9, "ADT^A08", "PID|1||P1^^^H^MR||NP1^X Y||19600101\rPV1|1|I|WARD^1\r");
  adt(9, "A08", "P3", "WARD^2");
  EXPECT_EQ(against(by_plan), Objection::kNone);
  siu(40, "S14", "A", "P1", time(0), kRoom, "Complete");
  EXPECT_EQ(against(by_plan), Objection::kOver);
  siu(41, "S17", "A", "P1", time(0), kRoom);
  for (const char* const leaves : {"A02", "A03", "A09"}) {
    start_anew();
    bring();
    const ProcedureChoice by_event = book.choose({{"OR1"}, 12h}, begun);
    siu(30, "S12", "C", "P4", time(120), kRoom);
    EXPECT_EQ(against(by_event), Objection::kNone);
    adt(60, leaves, "P1", std::string(leaves) == "A02" ? "PACU^1" : "SURG^OR1");
    EXPECT_EQ(against(by_event), Objection::kOver) << leaves;
    adt(70, "A02", "P2", "SURG^OR1");
    EXPECT_EQ(against(by_event), Objection::kAnotherThere) << "and the case runs still";
  }
}

TEST_F(ProcedureDay, AChangeOfAnotherResourceLeavesTheRoom) {
  struct Change {
    const char *event, *resources;
  };
  for (const Change& change : std::vector<Change>{{"S14", "AIP|1|U|77^Sato||SURGEON\r"},
                                                  {"S14", "AIP|1||77^Sato||SURGEON\r"},
                                                  {"S14", "AIS|1|U|LAP^Hernia^L\r"},
                                                  {"S18", "AIG|1|A|CARM^C-arm\r"},
                                                  {"S18", "AIL|2||PACU^1\r"},
                                                  {"S14", "AIL|2|A|PACU^1\r"},
                                                  {"S14", "AIL|2|D|PACU^1\rAIP|1|U|77^Sato\r"},
                                                  {"S20", "AIP|1|D|77^Sato||SURGEON\r"}}) {
    start_anew();
    plan_both();
    siu(-60, change.event, "A", "P1", time(0), std::string("RGS|1\r") + change.resources);
    EXPECT_EQ(taken(), "P1") << change.event << change.resources;
  }
  for (const char* const moves : {"AIL|1|D|SURG^OR1\rAIL|1|A|SURG^OR2\r", "AIL|1||SURG^OR2\r"}) {
    start_anew();
    plan_both();
    siu(-60, "S14", "A", "P1", time(0), std::string("RGS|1\r") + moves);
    EXPECT_EQ(taken(), "P2") << moves;
  }
  // In place of this room, or beside it.
  for (const char* const resources : {"RGS|1|U\rAIL|1|U|SURG^OR2\r", "RGS|1|D\r"}) {
    start_anew();
    plan_both();
    siu(-60, "S14", "A", "P1", time(0), resources);
    EXPECT_EQ(taken(), words_of(Doubt::kRoomUnclear)) << resources;
    siu(-50, "S14", "A", "P1", time(0), "");
    EXPECT_EQ(taken(), words_of(Doubt::kRoomUnclear)) << "says nothing of it";
    siu(-40, "S14", "A", "P1", time(0), kRoom);
    EXPECT_EQ(taken(), "P1");
  }
}

TEST_F(ProcedureDay, AnotherTimeLeavesTheRoom) {
  plan_both();
  siu(-60, "S13", "A", "P1", time(10), "");
  EXPECT_EQ(taken(), "P1");
  siu(-50, "S13", "A", "P1", time(120), "");
  EXPECT_EQ(taken(), "P2");
}

TEST_F(ProcedureDay, AChangeThatNamesNobodyIsOfWhomItWasFor) {
  siu(-600, "S12", "A", "P1", time(0), kRoom);
  siu(-599, "S12", "C", "P3", time(120), kRoom);
  siu(-60, "S13", "A", "", time(120), kRoom);
  siu(-59, "S13", "C", "", time(0), kRoom);
  EXPECT_EQ(taken(), "P3");
  siu(-58, "S14", "C", "", time(0), "", "Complete");
  EXPECT_EQ(taken({}, 90), "P1") << "hers is over";
  // Of an appointment that is not known nobody can tell.
  siu(-57, "S13", "Z", "", time(100), kRoom);
  EXPECT_EQ(taken({}, 90), words_of(Doubt::kUnnamed));
  EXPECT_EQ(book.list({{"OR1"}, 12h}, kMorning + 90min).size(), 2U);
  siu(-56, "S14", "Z", "P4", time(100), kRoom);
  EXPECT_EQ(taken({}, 95), "P4");
  siu(-55, "S23", "Y", "", time(94), kRoom);
  EXPECT_EQ(taken({}, 95), "P4") << "a blocked slot is nobody's";
  // Another name by that number.
  take(-54, "SIU^S14", "SCH|Z|Z|||||||||^^^" + time(100) + "\rPID|1||||Other^Olga\r");
  EXPECT_NE(taken({}, 95), "P4");
}

TEST_F(ProcedureDay, AMergerLeavesWhoeverIsOnTheTableThere) {
  bring("TEMP");
  adt(-10, "A01", "P1", "ICU^3");
  take(-8, "ADT^A40", pid("P1") + "MRG|TEMP^^^H^MR\r");
  EXPECT_EQ(taken(), words_of(Doubt::kRegisteredElsewhere));
  adt(-7, "A10", "P1", "ER^1", "SURG^OR1");
  EXPECT_EQ(taken(), "P1");
  // Registered there before: they were brought since.
  start_anew();
  adt(-100, "A01", "P1", "ICU^3");
  bring("TEMP");
  take(-8, "ADT^A40", pid("P1") + "MRG|TEMP^^^H^MR\r");
  EXPECT_EQ(taken(), "P1");
}

TEST_F(ProcedureDay, NoRegistrationTakesAnybodyOutOfTheRoom) {
  for (const char* const event : {"A01", "A04", "A06", "A07", "A13", "A22", "A33", "A52"}) {
    start_anew();
    bring();
    adt(-10, event, "P1", "ICU^3");
    EXPECT_EQ(taken(), words_of(Doubt::kRegisteredElsewhere)) << event;
    adt(-9, "A02", "P1", "ICU^3");
    EXPECT_EQ(taken(), "P2") << "went there";
  }
  // Registered there alone, they are where they are registered last.
  start_anew();
  siu(-599, "S12", "B", "P2", time(45), kRoom);
  adt(-20, "A04", "P1", "SURG^OR1");
  adt(-10, "A01", "P1", "ICU^3");
  EXPECT_EQ(taken(), "P2");
}

TEST_F(ProcedureDay, ABedThatIsKeptIsNotWhereTheyAre) {
  bring();
  adt(-300, "A01", "P9", "WARD^2");
  take(-5, "ADT^A17", pid("P1") + "PV1|1|I|WARD^2\r" + pid("P9") + "PV1|1|I|ER^1\r");
  EXPECT_EQ(taken(), words_of(Doubt::kRegisteredElsewhere));
  start_anew();
  siu(-599, "S12", "B", "P2", time(45), kRoom);
  adt(-30, "A02", "P1", "SURG^OR1");
  take(-5, "ADT^A17", pid("P1") + "PV1|1|I|SURG^OR2\r" + pid("P9") + "PV1|1|I|WARD^2\r");
  EXPECT_EQ(taken(), "P2") << "went to the other room";
  for (const bool states_which : {false, true}) {
    start_anew();
    bring();
    adt(-5, "A12", "P1", "WARD^0", "", states_which ? "WARD^1" : "");
    EXPECT_EQ(taken(), words_of(Doubt::kRegisteredElsewhere)) << "another move is cancelled";
    adt(-4, "A12", "P1", "WARD^0", "", "SURG^OR1");
    EXPECT_EQ(taken(), "P2") << "that move is cancelled";
  }
}

TEST_F(ProcedureDay, ADischargeOfAnotherStayTakesNobodyOutOfTheRoom) {
  for (const char* const event : {"A03", "A11", "A23"}) {
    start_anew();
    siu(-599, "S12", "B", "P2", time(45), kRoom);
    adt(-20, "A02", "P1", "SURG^OR1", "", "", "ACC2", "V2");
    adt(-5, event, "P1", "CLINIC^1", "", "", "ACC1");
    EXPECT_EQ(taken(), words_of(Doubt::kOtherVisit)) << event;
    adt(-4, event, "P1", "", "", "", "ACC1");
    EXPECT_EQ(taken(), words_of(Doubt::kOtherVisit)) << "of another account";
    adt(-3, event, "P1", "CLINIC^1", "", "", "ACC1", "V2");
    EXPECT_EQ(taken(), "P2") << "of this visit";
  }
  start_anew();
  bring();
  adt(-5, "A03", "P1", "ER^1");
  EXPECT_EQ(taken(), "P2") << "from the bed that is kept";
  start_anew();
  siu(-599, "S12", "B", "P2", time(45), kRoom);
  adt(-20, "A02", "P1", "SURG^OR1");
  take(-5, "ADT^A08", pid("P1") + "PV1|1|I|SURG^OR1" + std::string(42, '|') + time(-400) + "\r");
  EXPECT_EQ(taken(), words_of(Doubt::kOtherVisit)) << "discharged before they came";
}

TEST_F(ProcedureDay, ARecordOfSomebodyUnplannedStopsThePlan) {
  siu(-599, "S12", "B", "P2", time(45), kRoom);
  adt(-10, "A08", "P1", "SURG^OR1");
  EXPECT_EQ(taken(), words_of(Doubt::kRecordAgainstPlan));
  adt(-9, "A08", "P2", "SURG^OR1");
  siu(-8, "S12", "D", "P1", time(300), kRoom);
  EXPECT_EQ(taken(), "P2") << "she is planned for later";
}

// However the book loses sight of somebody, the next one is not taken.
TEST_F(ProcedureDay, WhoeverWasInTheRoomClaimsItUntilAMessageSaysThatThisIsOver) {
  const auto lose_sight = [&] {
    start_anew();
    bring("TEMP");
    adt(-10, "A02", "P1", "ICU^3");
    take(-8, "ADT^A40", pid("P1") + "MRG|TEMP^^^H^MR\r");
    EXPECT_EQ(taken(), words_of(Doubt::kNotSeenOff));
  };
  lose_sight();
  EXPECT_EQ(taken(recorded("P1")), "P2") << "recorded here";
  EXPECT_EQ(taken(recorded("P9")), words_of(Doubt::kNotSeenOff));
  adt(-7, "A01", "P1", "ICU^3");
  adt(-7, "A08", "P1", "ICU^3");
  adt(-7, "A03", "P1", "CLINIC^3");
  EXPECT_NE(taken(), "P2");
  lose_sight();
  adt(-6, "A02", "P2", "SURG^OR1");
  EXPECT_EQ(taken(), words_of(Doubt::kNotSeenOff)) << "P2 came, and P1 was not seen off";
  adt(-5, "A02", "P1", "ICU^3");
  EXPECT_EQ(taken(), "P2");
  lose_sight();
  adt(-6, "A09", "P1", "", "SURG^OR1");
  EXPECT_EQ(taken(), "P2");
  lose_sight();
  siu(-6, "S12", "E", "P2", time(13 * 60), kRoom);
  EXPECT_EQ(taken({}, 13 * 60), "P2") << "too long ago";
}

TEST_F(ProcedureDay, WhoeverWasPlannedClaimsTheRoomUntilAMessageSaysThatThisIsOver) {
  // The room by PV1; then PV1 says where the patient is.
  const auto lose_sight = [&] {
    start_anew();
    siu(-600, "S12", "A", "P1", time(0), "PV1|1|I|SURG^OR1\r");
    siu(-599, "S12", "B", "P2", time(45), kRoom);
    siu(-60, "S14", "A", "P1", time(0), "PV1|1|I|WARD^1\r");
    EXPECT_EQ(taken(), words_of(Doubt::kNotSeenOff));
  };
  lose_sight();
  EXPECT_EQ(taken(recorded("P1")), "P2") << "recorded here";
  siu(-50, "S14", "A", "P1", time(0), "AIP|1|U|77^Sato\r");
  EXPECT_EQ(taken(), words_of(Doubt::kNotSeenOff)) << "says nothing of it";
  siu(-40, "S13", "A", "P1", time(120), "PV1|1|I|WARD^1\r");
  EXPECT_EQ(taken(), "P2") << "at another time";
  EXPECT_EQ(taken({}, 125), words_of(Doubt::kNotSeenOff)) << "which has come";
  struct End {
    const char *event, *resources, *status;
  };
  for (const End& end : std::vector<End>{{"S15", "", ""},
                                         {"S14", "", "Complete"},
                                         {"S14", "AIL|1||SURG^OR2\r", ""},
                                         {"S14", "AIL|1|D|SURG^OR1\r", ""}}) {
    lose_sight();
    siu(-50, end.event, "A", "P1", time(0), end.resources, end.status);
    EXPECT_NE(taken(), words_of(Doubt::kNotSeenOff)) << end.event << end.resources;
    EXPECT_NE(taken(), "P1");
  }
  lose_sight();
  adt(-6, "A10", "P2", "WARD^2", "SURG^OR1");
  EXPECT_EQ(taken(), "P2") << "an event brought them";
}

TEST(ProcedureBook, ForgetsWhatIsOldAndTheOldestOfTooMany) {
  ProcedureBook book;
  for (std::size_t i = 0; i < ProcedureBook::kMostKept + 10; ++i) {
    book.take(placed(std::to_string(i), {"OR1"}), kMorning + std::chrono::seconds(i));
  }
  EXPECT_EQ(book.size(), ProcedureBook::kMostKept);
  book.take(placed("last", {"OR1"}), kMorning + 100h);
  EXPECT_EQ(book.size(), 1U);
}

// A technician adds a spelling, and the recorder starts anew.
TEST(ProcedureBook, KnowsWhatWasRecordedByAnySpellingOfTheRoom) {
  ProcedureBook book;
  ProcedureData done;
  done.patient_id = "4711";
  book.note_recorded({{"OR1", "Theatre 1"}, 12h}, done, kMorning);
  EXPECT_THAT(book.recorded({{"SURG^OR1", "or1"}, 12h}, kMorning), testing::SizeIs(1));
  EXPECT_THAT(book.recorded({{"theatre 1"}, 12h}, kMorning), testing::SizeIs(1));
  EXPECT_THAT(book.recorded({{"OR2"}, 12h}, kMorning), testing::IsEmpty());
  EXPECT_THAT(book.recorded({{}, 12h}, kMorning), testing::IsEmpty()) << "that is all rooms together";
}

}  // namespace
}  // namespace kiroku::recorder
