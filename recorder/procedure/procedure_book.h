// Which patient is in which room, and what is planned there, after all messages so far. Kept in memory alone:
// nothing of it may lie on a disk in the clear. An object belongs to one thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/bytes.h"
#include "base/clock.h"
#include "recorder/procedure/procedure_message.h"

namespace kiroku::recorder {

/// What of all messages concerns one room.
struct ProcedureRule {
  /// As ProcedureMessage::places has them, upper and lower case alike; none: every message is about this
  /// room.
  std::vector<std::string> locations;
  std::chrono::nanoseconds window =
      std::chrono::hours(12);  // what is further from the case's beginning is not used
};

/// Whether a case about that patient was ended in the rule's room at `since` or later. Null: none was.
using EndedSince = std::function<bool(const ProcedureData& data, UtcTime since)>;

/// A moment by two clocks. The wall clock may be set between two of them; the other one (CLOCK_BOOTTIME) says
/// how far apart they are.
struct ProcedureMoment {
  /// Where nobody sets the clock, as in most tests.
  ProcedureMoment(UtcTime time)  // NOLINT(google-explicit-constructor)
      : utc(time), since_boot(time.time_since_epoch()) {}
  ProcedureMoment(UtcTime time, Clock::Duration boot) : utc(time), since_boot(boot) {}

  /// What the wall clock that shows `utc` now would have shown at `other`.
  [[nodiscard]] UtcTime by_this_clock(const ProcedureMoment& other) const {
    return utc + std::chrono::duration_cast<UtcTime::duration>(other.since_boot - since_boot);
  }

  UtcTime utc;
  Clock::Duration since_boot;
};

/// Who is in a room goes by the order in which messages came and by how long ago that was, never by what the
/// wall clock showed then: NTP may set it back between two of them. Planned times are the hospital's. What
/// one sender tells goes by that sender's own times: a message that comes late tells of before. A wrong
/// patient is worse than none: what leaves two possible is said to.
///
/// procedure_book.cpp takes messages; beside it are who and what is one and the same (_sameness), what was
/// before what (_order), where patients are (_places), what is planned (_appointments), what is kept no
/// longer
/// (_forgetting), who may still be there though nothing else of the book says so (_claims), whom a case is
/// about (_choice), what speaks against that while it runs (_objection), and all of it as bytes (_state).
class ProcedureBook {
 public:
  /// Of each kind. Of more the oldest go, of appointments those planned furthest from now; those that concern
  /// no watched room before others.
  static constexpr std::size_t kMostKept = 2000;
  static constexpr std::chrono::hours kLongestWindow{72};  // and what is older than that
  /// Two times of a sender that are less apart are of one moment: some state minutes alone, and their clock
  /// may be corrected.
  static constexpr std::chrono::minutes kSameMoment{1};
  /// A sender who for so long told of nothing but what was before has set its clock back.
  static constexpr std::chrono::hours kLongestBehind{1};
  static constexpr std::size_t kMostSenders = 64;
  /// Of one patient so many places where they were before are kept; of more those of no watched room, and the
  /// oldest, go.
  static constexpr std::size_t kMostPlacesBefore = 64;
  /// Whoever was in a room for less, and was not recorded there, may have been brought by mistake.
  static constexpr std::chrono::minutes kShortest{10};

  /// Whoever is in a place of this rule is kept before others, with what is planned for them. Where something
  /// that concerns one is forgotten all the same, choose() takes nobody while it would count.
  void watch(const ProcedureRule& rule) { rules_.push_back(rule); }

  void take(ProcedureMessage message, ProcedureMoment received);
  /// All that one message says, of each of its patients: an appointment is of these from then on.
  void take_all(std::vector<ProcedureMessage> messages, ProcedureMoment received);

  /// For a case that begins at `at`. If messages within the window placed one patient in the room, it is that
  /// patient, completed by their appointment; if nobody is there, the appointment planned nearest to `at`
  /// that is not over, and of nobody who left since it was booked (standing()). Nobody wherever it is not
  /// sure whom they mean: then it says why. Whoever was there earlier counts until a message says that they
  /// went. Whoever left before they were planned was operated on if a case about them has ended.
  [[nodiscard]] ProcedureChoice choose(const ProcedureRule& rule, const ProcedureMoment& at,
                                       const EndedSince& ended = {}) const;
  [[nodiscard]] std::optional<ProcedureData> find(const ProcedureRule& rule,
                                                  const ProcedureMoment& at) const {
    return choose(rule, at).data;
  }

  /// What messages say by now against what choose() gave for a case that began at `begun` and runs still.
  /// Whoever leaves as patients do, or is done with, is no objection, nor is whoever is planned behind them,
  /// as long as no event brings them.
  [[nodiscard]] Objection objection(const ProcedureRule& rule, const ProcedureChoice& taken,
                                    const ProcedureMoment& begun) const;

  /// What messages say of a procedure that something else plans in the rule's room, as a worklist does.
  [[nodiscard]] Standing standing(const ProcedureRule& rule, const ProcedureData& data,
                                  std::optional<UtcTime> planned, const ProcedureMoment& at,
                                  const EndedSince& ended = {}) const;

  /// All that find() chooses from: patients placed in the room, each completed by their appointment nearest
  /// to `at`, and appointments of others, within the window.
  [[nodiscard]] std::vector<ProcedureData> list(const ProcedureRule& rule, ProcedureMoment at) const;

  /// A case about that procedure has ended in the rule's room.
  void note_recorded(const ProcedureRule& rule, const ProcedureData& data, const ProcedureMoment& at);
  /// Those, and when by the clock of `at`, in the order in which they were noted.
  [[nodiscard]] std::vector<std::pair<ProcedureData, UtcTime>> recorded(const ProcedureRule& rule,
                                                                        const ProcedureMoment& at) const;

  /// When somebody came to the rule's room last, left it, or was done with there, as far as messages say:
  /// what was in the room before that is of somebody else. Whoever is told late counts from when it happened.
  [[nodiscard]] std::optional<ProcedureMoment> changed(const ProcedureRule& rule) const;

  /// So many left by numbers of whom nothing was known.
  [[nodiscard]] std::uint64_t strangers_left() const { return strangers_left_; }
  /// So many messages came after later ones of the same patient, or appointment, and said that they left, or
  /// are planned no more. Nobody can tell what is so now: choose() does not take them any more.
  [[nodiscard]] std::uint64_t ended_late() const { return ended_late_; }

  /// So many that concern a watched room were forgotten, as there were too many, or cannot be read by
  /// imported().
  [[nodiscard]] std::uint64_t not_kept() const { return not_kept_; }

  [[nodiscard]] std::size_t size() const { return placed_.size() + appointments_.size(); }

  /// All of it, for a recorder that starts anew on the running machine, whose times since the boot it holds.
  [[nodiscard]] Bytes exported() const;
  /// What exported() gave. Throws kiroku::Error for anything else, and for what another version wrote. What
  /// has a time that none can be costs itself alone (not_kept()).
  static ProcedureBook imported(ByteView bytes);

 private:
  struct AsBytes;  // procedure_book_state.cpp
  enum class Likeness { kNone, kPerhaps, kSure };
  struct Arrival {
    std::uint64_t number = 0;  // in the order of messages; what one message says arrives at once
    ProcedureMoment at;
    std::string sender = {};  // and by its clock:
    std::optional<UtcTime> happened = {};
  };
  /// From a place where somebody was.
  struct Went {
    Arrival when;
    bool is_event = false;      // of the patient: not by a record that names another place now
    bool is_cancelled = false;  // they never were there: they were moved by mistake
  };
  /// What says that a patient is at a place: a record alone, which brings nobody there and takes nobody away
  /// (A08); where their stay was registered; or that they went there.
  enum class Way { kRecord, kRegistered, kMoved };
  static Way way_of(const ProcedureMessage& message) {
    return !message.moves ? Way::kRecord : message.registers ? Way::kRegistered : Way::kMoved;
  }
  struct Kept {
    Arrival received;
    ProcedureMessage message;
    /// Of a patient who is placed: when they came to each of the message's places.
    std::map<std::string, Arrival> since = {};
    Doubt doubt = Doubt::kNone;  // a message that is not followed says otherwise
    /// By the sender's clock: when an event last said that they went where they are.
    std::optional<UtcTime> moved = {};
    /// Of a patient who is placed or has left: the places where they were before. Those where they are again
    /// are in `since`, too.
    std::map<std::string, Went> gone = {};
    /// Of an appointment: when it was booked, or moved to another time.
    std::optional<Arrival> booked = {};
    /// Of a patient who is placed, where another visit has placed them elsewhere since: behind their number.
    std::string apart = {};
    /// The last number that each sender gave to the visit for which the patient is where they are.
    std::map<std::string, std::string> visits = {};
    /// Of `since` those where they are not by Way::kMoved; "" where no place was named.
    std::map<std::string, Way> ways = {};
    [[nodiscard]] Way way_to(const std::string& place) const;
    void note_way(const std::string& place, Way way);
    void note_visit(const ProcedureMessage& message);
    [[nodiscard]] bool has_visit(const std::string& visit) const;
    /// Both are stated, and differ.
    [[nodiscard]] bool is_of_another_visit(const ProcedureMessage& message) const;
  };
  /// Whoever left, as far as an appointment of theirs goes.
  struct Left {
    Arrival when;
    bool is_from_here = false;  // from the rule's room
    bool is_sure = false;       // it is that patient
    const Kept* of = nullptr;
    std::optional<Arrival> from_here = {};  // when that patient left the room last
  };
  /// The last time that the patient whom the message names left the room, or the hospital.
  [[nodiscard]] std::optional<Left> left(const ProcedureRule& rule, const ProcedureMessage& message) const;
  /// Of an appointment in the rule's room that is planned for `planned`.
  [[nodiscard]] Standing standing(const ProcedureRule& rule, const Kept& kept, UtcTime planned,
                                  const ProcedureMoment& at, const EndedSince& ended) const;
  /// Of what is planned for somebody who left since it was booked.
  [[nodiscard]] Standing standing(const ProcedureRule& rule, const Left& left,
                                  const ProcedureMessage& message, UtcTime planned, const ProcedureMoment& at,
                                  const EndedSince& ended) const;
  /// Whether that patient was in the rule's room too shortly for an operation, when they left it last, and no
  /// case about them has ended.
  [[nodiscard]] bool was_short(const ProcedureRule& rule, const Left& left, const ProcedureMessage& message,
                               const ProcedureMoment& at, const EndedSince& ended) const;
  /// Of a time that is a day alone, or unclear otherwise: whether its patient left the room since then, a
  /// case about them has ended there, and nothing else is planned for them.
  [[nodiscard]] bool has_left_since(const ProcedureRule& rule, const Kept& kept,
                                    const std::optional<TimeSpan>& within, const ProcedureMoment& at,
                                    const EndedSince& ended) const;
  /// Those who left, and who may be the one whom the message names: no more then, as they are back.
  std::map<std::string, Went> take_back(const ProcedureMessage& message);
  [[nodiscard]] Likeness has_left(const ProcedureMessage& message) const;
  /// One number may be of two patients: the one of whom less is known goes by another key from then on.
  void tell_apart(ProcedureMessage& message, const Arrival& received);
  /// When the patient came to the rule's room; nothing where they are not there.
  static std::optional<Arrival> came(const ProcedureRule& rule, const Kept& kept);
  /// The surest of what says that whoever is in the rule's room is there.
  static Way way_into(const ProcedureRule& rule, const Kept& kept);
  /// Whether somebody else is planned there now, and whoever is there is not, or was to come later.
  [[nodiscard]] bool is_against_plan(const ProcedureRule& rule, const Kept& here, const ProcedureMoment& at,
                                     const EndedSince& ended) const;
  /// Whether something is planned for them, wherever that is.
  [[nodiscard]] bool is_planned(const Kept& kept) const;
  /// Since when a case that ended is of the stay for which they are here; they came at `since`.
  static UtcTime stay_of(const ProcedureRule& rule, const Kept& here, UtcTime since,
                         const ProcedureMoment& at);
  /// Whether whoever is there is newborn, and somebody left since they came: their mother, it may be.
  [[nodiscard]] bool may_be_left_behind(const ProcedureRule& rule, const Kept& here, std::uint64_t since,
                                        const ProcedureMoment& at) const;
  /// Whether what is planned for `planned` may be what goes on now: it was not recorded, nor did its patient
  /// leave the room, or the hospital.
  [[nodiscard]] bool keeps_waiting(const ProcedureRule& rule, const Kept& kept, UtcTime planned,
                                   const ProcedureMoment& at, const EndedSince& ended) const;
  /// Of a case that began at `at`: what is over since then was not over.
  static bool is_over(const Kept& kept, const ProcedureMoment& at) {
    return kept.message.is_over && at.by_this_clock(kept.received.at) <= at.utc;
  }
  /// Whether an appointment is one in the rule's room. Where it names rooms as such, PV1 says nothing of
  /// them.
  [[nodiscard]] bool concerns(const ProcedureRule& rule, const ProcedureMessage& message) const;
  [[nodiscard]] bool names_rooms(const ProcedureMessage& message) const;
  [[nodiscard]] std::vector<std::string> rooms_of(const ProcedureMessage& message) const;
  /// Of those who were at a place and are there no more, the last one to come, and the last one to go.
  struct Passed {
    Arrival came, went;
  };
  void pass(const std::string& place, const Arrival& came, const Arrival& went);
  void note_change(const std::string& place, const Arrival& when);
  /// That an operation is over says something of a place where nobody else is known to have come since.
  void note_end(const ProcedureMessage& over, const Arrival& when);
  [[nodiscard]] bool is_there_another(const std::string& patient, const std::string& place) const;
  /// All places of one who is gone.
  void pass(const Kept& gone, const Arrival& went);
  /// Whether whoever went may have been the one, instead of whoever is there now.
  [[nodiscard]] Doubt doubt_of_passed(const ProcedureRule& rule, std::optional<std::uint64_t> here,
                                      const ProcedureMoment& at) const;
  using Messages = std::map<std::string, Kept>;
  static std::string key_of_appointment(const ProcedureMessage& message) {
    const Assigner& by = message.filler.empty() ? message.placer_by : message.filler_by;
    return message.appointment + "\n" + message.patient + "\n" + message.sender + "\n" + by.name + "\n" +
           by.id;
  }
  static std::string key_of_placed(const Kept& kept) { return kept.message.patient + kept.apart; }
  static std::string key_of_ended(const ProcedureMessage& message) {
    return message.kind == ProcedureMessage::Kind::kCancels ? "\n" + key_of_appointment(message)
                                                            : message.patient;
  }
  /// So long ago, at most, comes what is told late: it is forgotten at once then.
  static constexpr std::chrono::hours kLongestBefore = 2 * kLongestWindow;
  /// Where something was that is not kept, and when it counted, at first and at last.
  struct Lost {
    ProcedureMoment first, last;
  };
  using LostPlaces = std::map<std::string, Lost>;      // by place, in lower case, and the day of `first`
  static constexpr std::string_view kAnyPlace = "\n";  // of these; no message names such a place
  static void widen(Lost& lost, const Lost& by);
  /// For one more: where two are of one place these become one, else one is of any place from then on.
  static void make_room(LostPlaces& places);
  static std::string key_of_lost(const std::string& place, const ProcedureMoment& first);
  static std::string place_of_lost(const std::string& key);
  void lose(LostPlaces& places, const Kept& kept, const ProcedureMoment& first, const ProcedureMoment& last);
  /// One of `messages`, which are placed_, appointments_, ended_ or merged_, was forgotten.
  void lose(const Messages& messages, const Kept& kept, const ProcedureMoment& now);
  [[nodiscard]] bool is_lost(const LostPlaces& places, const ProcedureRule& rule,
                             const ProcedureMoment& at) const;
  [[nodiscard]] bool is_watched(const std::string& place) const;
  [[nodiscard]] bool is_watched(const Kept& kept) const;
  void bound(Kept& kept, const ProcedureMoment& now);
  void forget_old(Messages& messages, const ProcedureMoment& now);
  void forget_passed(const ProcedureMoment& now);
  /// When the appointment is planned by the clock of `at`.
  static UtcTime planned(const Kept& kept, const ProcedureMoment& at) {
    return kept.message.planned.value_or(at.by_this_clock(kept.received.at));
  }
  /// The last of the times that it states, of whatever place.
  static UtcTime planned_last(const Kept& kept, const ProcedureMoment& at);
  /// How near to `at` an appointment may be planned whose time is unclear; nothing where it is not near.
  static std::optional<UtcTime::duration> nearest_unclear(const ProcedureRule& rule, const Kept& kept,
                                                          const ProcedureMoment& at);
  /// When it is planned in the rule's room: of several times there, the nearest to `at`.
  struct PlannedHere {
    UtcTime time;
    const PlannedPlace* place = nullptr;  // null: it states nothing of this room alone
    bool is_unclear = false;              // it states a time that cannot be read, or no hour
    std::optional<TimeSpan> within = {};  // of that one
    bool is_absent = false;               // it states no time at all
  };
  static PlannedHere planned_here(const ProcedureRule& rule, const Kept& kept, const ProcedureMoment& at);
  /// What it says of the procedure there.
  static ProcedureData data_of(const Kept& kept, const PlannedHere& here);
  template <typename Use>  // void(Arrival&)
  void with_each_arrival(const Use& use);
  void watch_clock(const ProcedureMessage& message, const ProcedureMoment& received);
  /// As one that comes now, or as one before what its sender told of later things.
  Arrival arrival_of(const ProcedureMessage& message, const ProcedureMoment& received);
  /// Whether two messages name one patient, by other forms of a number or by other numbers. One number is of
  /// two where both birth and name differ, but where `one` is the record that corrects `other`; without an
  /// issuer it is one of who sends it (MSH-4).
  static Likeness likeness(const ProcedureMessage& one, const ProcedureMessage& other);
  /// Whether two messages are of one appointment. Where one number is of two patients, or nobody knows who
  /// gave it, it may be.
  static Likeness same_appointment(const ProcedureMessage& one, const ProcedureMessage& other);
  /// Whether the same sender told later things of the same patient, or appointment, already.
  [[nodiscard]] Likeness lateness(const ProcedureMessage& message) const;
  /// What a message that comes late says of somebody's leaving is not followed; whom it is about is in doubt.
  void doubt(const ProcedureMessage& message, const Arrival& received);
  /// Those who are placed and may be whom it names: by the same number; else by one of their numbers, if
  /// birth or name agree, or if nobody else may be meant.
  [[nodiscard]] std::vector<std::string> known_as(const ProcedureMessage& message, bool surely) const;
  /// Whoever was merged goes by the later number.
  void resolve(ProcedureMessage& message) const;
  void rename(ProcedureMessage& message, const Arrival& received);
  void leave(ProcedureMessage message, const Arrival& received);
  void place(ProcedureMessage message, const Arrival& received, bool is_in_doubt);
  /// Whom it is about: of several visits of a patient that one.
  Messages::iterator of_visit(const ProcedureMessage& message);
  /// Whoever came to one place for two visits is there once: two systems number one visit each.
  void join_visits(Messages::iterator arrived, const Arrival& received);
  /// Where only `other` had the patient they are no more.
  void leave_behind(const Kept& other, const Arrival& received, Kept& kept);
  /// Another visit places the patient elsewhere: they may be there, or here.
  void set_aside(Messages::iterator known, const Arrival& received);
  /// The places that they left by it.
  std::map<std::string, Went> drop_set_aside(const std::string& patient, const Arrival& received);
  /// Of the places that a record names those that an event took the patient from. Whether any is left.
  static bool leave_out_gone(ProcedureMessage& message, const Kept& kept);
  /// A record takes nobody away from where an event said that they are: adds those places, which it lacks.
  /// Whether it names none of them.
  static bool keep_places(ProcedureMessage& message, const Kept& kept);
  /// Whether an event that names another place takes the patient from where another one brought them: not
  /// where it says where a stay is registered, nor where it is about the bed that is kept for them.
  static bool takes_away(const Kept& kept, const ProcedureMessage& message);
  /// Whether whoever leaves by it may be of another stay than the one for which they are where they are.
  static bool may_leave_another_stay(const Kept& kept, const ProcedureMessage& message);
  /// Whoever is in a room, or planned there, keeps a claim on it until a message about them says that this is
  /// over, whatever else takes them out of the book.
  void claim();
  void end_claims(const ProcedureMessage& message);
  void end_claims_of_patient(const ProcedureMessage& message);
  void end_claims_of_appointment(const ProcedureMessage& message);
  void give_claims(const ProcedureMessage& before, const ProcedureMessage& message);
  [[nodiscard]] bool is_in_room(const ProcedureRule& rule, const Kept& claim) const;
  /// Whether somebody else than `chosen` has a claim on the rule's room. Null: anybody. Appointments count
  /// where nobody came by an event, up to `planned_until`.
  [[nodiscard]] bool is_claimed(const ProcedureRule& rule, const ProcedureMessage* chosen,
                                std::optional<UtcTime> planned_until, const ProcedureMoment& at,
                                const EndedSince& ended) const;
  /// Whether an event came to be told after another system's that took the patient from there, though by its
  /// own clock it was before.
  static bool is_before_leaving(const ProcedureMessage& message, const Kept& kept);
  [[nodiscard]] bool somebody_else_came(const std::string& patient, const std::string& place,
                                        const Arrival& since) const;
  void keep_plan(ProcedureMessage& message, const ProcedureMessage& before) const;
  void keep_rooms(ProcedureMessage& message, const ProcedureMessage& before) const;
  void name_patients(std::vector<ProcedureMessage>& messages);
  struct TakenOut {
    std::optional<Arrival> booked;  // where the change leaves it at its time
    bool is_doubtful = false;       // there is another one of the number
  };
  TakenOut take_out_appointment(std::vector<ProcedureMessage>& by);
  void keep_appointment(ProcedureMessage message, const Arrival& received, const TakenOut& before);
  void keep_cancelled(ProcedureMessage message, const Arrival& received);
  void leave_unnamed(const ProcedureMessage& message);

  struct SenderClock {
    UtcTime newest;                                    // told
    std::optional<Clock::Duration> behind_since = {};  // since boot
  };
  std::uint64_t arrivals_ = 0, strangers_left_ = 0, ended_late_ = 0, not_kept_ = 0;
  std::vector<ProcedureRule> rules_;
  std::map<std::string, SenderClock> clocks_;  // by sender
  Messages placed_;                            // by patient
  Messages appointments_;                      // by appointment and patient
  Messages ended_;   // who left, by patient; what was cancelled, by "\n", appointment and patient
  Messages merged_;  // by what the patient was called before
  /// By the key of what is, or was, in placed_ and appointments_. Of patients `since` is what they claim.
  Messages claims_, planned_claims_;
  std::map<std::string, Passed> passed_;            // by place, in lower case; "" of all places together
  std::map<std::string, ProcedureMoment> changes_;  // likewise
  LostPlaces lost_placed_, lost_planned_;
  struct Recorded {
    std::string room;  // its locations
    ProcedureData data;
    ProcedureMoment at;
  };
  std::vector<Recorded> recorded_;  // the oldest first
};

}  // namespace kiroku::recorder
