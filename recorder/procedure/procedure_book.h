// Which patient is in which room, and what is planned there, after all messages so far. Kept in memory alone:
// nothing of it may lie on a disk in the clear. An object belongs to one thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
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
/// wall clock showed then: NTP may set it back between two of them. Planned times are the hospital's.
class ProcedureBook {
 public:
  static constexpr std::size_t kMostKept = 2000;           // of each kind; the oldest go
  static constexpr std::chrono::hours kLongestWindow{72};  // and what is older than that

  void take(ProcedureMessage message, ProcedureMoment received);
  /// All that one message says, of each of its patients: an appointment is of these from then on.
  void take_all(std::vector<ProcedureMessage> messages, ProcedureMoment received);

  /// For a case that begins at `at`. If a message within the window placed a patient in the room, it is that
  /// patient (the last one placed), completed by their appointment; else the appointment planned nearest to
  /// `at` (one without a time counts as planned when its message came), and nobody where those of two
  /// patients are equally near.
  [[nodiscard]] std::optional<ProcedureData> find(const ProcedureRule& rule, ProcedureMoment at) const;

  /// Whether find() gives nothing for that reason.
  [[nodiscard]] bool is_doubtful(const ProcedureRule& rule, ProcedureMoment at) const {
    return choose(rule, at).is_doubtful;
  }

  /// All that find() chooses from: patients placed in the room, each completed by their appointment nearest
  /// to `at`, and appointments of others, within the window.
  [[nodiscard]] std::vector<ProcedureData> list(const ProcedureRule& rule, ProcedureMoment at) const;

  [[nodiscard]] std::size_t size() const { return placed_.size() + appointments_.size(); }

  /// All of it, for a recorder that starts anew on the running machine, whose times since the boot it holds.
  [[nodiscard]] Bytes exported() const;
  /// What exported() gave. Throws kiroku::Error for anything else, and for what another version wrote.
  static ProcedureBook imported(ByteView bytes);

 private:
  struct AsBytes;  // procedure_book_state.cpp
  struct Arrival {
    std::uint64_t number = 0;  // in the order of messages; what one message says arrives at once
    ProcedureMoment at;
  };
  struct Kept {
    Arrival received;
    ProcedureMessage message;
    /// Of a patient who is placed: when they came to each of the message's places.
    std::map<std::string, Arrival> since = {};
  };
  /// When the patient came to the rule's room; nothing where they are not there.
  static std::optional<Arrival> came(const ProcedureRule& rule, const Kept& kept);
  struct Choice {
    std::optional<ProcedureData> data;
    bool is_doubtful = false;
  };
  [[nodiscard]] Choice choose(const ProcedureRule& rule, const ProcedureMoment& at) const;
  using Messages = std::map<std::string, Kept>;
  static std::string key_of_appointment(const ProcedureMessage& message) {
    return message.appointment + "\n" + message.patient;
  }
  static void forget_old(Messages& messages, const ProcedureMoment& now);
  /// When the appointment is planned by the clock of `at`.
  static UtcTime planned(const Kept& kept, const ProcedureMoment& at) {
    return kept.message.planned.value_or(at.by_this_clock(kept.received.at));
  }
  void rename(const ProcedureMessage& message);
  void place(ProcedureMessage message, const Arrival& received);
  [[nodiscard]] bool somebody_else_came(const std::string& patient, const std::string& place,
                                        const Arrival& since) const;
  void cancel(const std::string& appointment);

  std::uint64_t arrivals_ = 0;
  Messages placed_;        // by patient
  Messages appointments_;  // by appointment and patient
};

}  // namespace kiroku::recorder
