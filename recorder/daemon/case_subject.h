// Whom the case of a room is about: somebody says so, or the room's procedure data do, also while it runs.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "base/clock.h"
#include "base/utc_time.h"
#include "recorder/procedure/procedure_source.h"

namespace kiroku::recorder {

/// Where the subject of a case came from: nowhere, from who started it, from the room's procedure data, from
/// them while it ran, or from the case that it carries on.
enum class SubjectState { kNone, kGiven, kFound, kLate, kCarriedOver };
std::string_view subject_state_name(SubjectState state);

/// Whether a case goes on with an operation that another case began, and with that one's subject: where it
/// had none, or where it had one that nothing proves to be this one's, it does not.
enum class GoesOn { kNo, kWithSubject, kWithoutSubject, kSubjectWithheld };

/// The subject of one case after the other. Nothing that goes wrong with procedure data ends a recording, or
/// keeps one from beginning: it is told. One thread uses it; given_while_running() is called from any.
class CaseSubject {
 public:
  /// `source` null: nothing is looked for.
  CaseSubject(std::shared_ptr<ProcedureSource> source, std::function<void(const std::string&)> tell)
      : source_(std::move(source)), tell_(std::move(tell)) {}

  struct Found {
    std::optional<Bytes> json;  // as Session takes it
    SubjectState state = SubjectState::kNone;
  };
  /// Of a case that begins at `now`: what a person gave, else what is known of the procedure.
  /// Where the case goes on with an operation nothing is looked up: what is planned, or who came, around now
  /// may be the next patient.
  /// `about` is whom the operation was about, where another process began it and that is known.
  Found at_beginning(UtcTime now, std::optional<Bytes> given, GoesOn goes_on,
                     std::optional<ProcedureData> about = {});
  /// Why the case that begins has no subject though there are ways to one, or there was one; where it is
  /// looked for, they are asked to hurry.
  [[nodiscard]] std::optional<std::string> why_missing() const;
  /// To be called again and again while the case runs: a subject that became known, once. Looks each second.
  std::optional<Bytes> late(Clock::Time now);
  /// By which messages name the patient who was found last; none: nobody was, or none says so.
  [[nodiscard]] const std::vector<PatientNumber>& numbers() const { return numbers_; }
  /// A person gave one: nothing is looked for any more.
  void given_while_running(const Bytes& subject) {
    looked_for_ = false;
    is_found_ = false;
    is_about(data_of_subject(subject));
  }
  /// Whom the case is about, as far as this process knows.
  [[nodiscard]] std::optional<ProcedureData> about() const;
  /// To be called again and again while the case runs: a sentence without anything of a patient, each once,
  /// where messages or the worklist speak now against the patient whom they named for this case, who was
  /// found and not given: somebody else is in the room, what brought or planned the patient was taken back,
  /// or they go by another number or name. Whoever is only planned for later is the next one. Looks each ten
  /// seconds.
  std::optional<std::string> contradicted(Clock::Time now);
  /// An earlier process recorded a case about that patient, which was cut off with it.
  void cut_off_before(const ProcedureData& about, UtcTime now) {
    if (source_ && names_somebody(about)) source_->cut_off(about, now);
  }
  /// A person or a rule ended the case: what it was about is not taken for a later one by itself.
  void ended(UtcTime now);

 private:
  /// Takes whom procedure data name, if they name one.
  std::optional<Bytes> look();
  /// What speaks against whom they named.
  [[nodiscard]] Objection objection();
  static bool names_somebody(const ProcedureData& data) {
    return !data.patient_id.empty() || !data.patient.empty();
  }
  void is_about(std::optional<ProcedureData> data) {
    const std::lock_guard guard(about_mutex_);
    about_ = std::move(data);
  }
  std::vector<PatientNumber> numbers_;
  ProcedureChoice taken_;           // who was found
  std::set<Objection> objections_;  // that were told of
  bool is_over_ = false;            // as messages say: what they say of the patient since is of later

  const std::shared_ptr<ProcedureSource> source_;
  const std::function<void(const std::string&)> tell_;
  UtcTime begun_at_{};
  Clock::Time next_look_{};
  std::atomic<bool> looked_for_ = false;  // nobody gave one, none was known
  std::atomic<bool> is_found_ = false;    // nobody gave the one that there is
  Clock::Time next_comparison_{};
  GoesOn goes_on_ = GoesOn::kNo;
  bool is_given_ = false;
  mutable std::mutex about_mutex_;
  std::optional<ProcedureData> about_;  // guarded by it: as far as this process knows
};

}  // namespace kiroku::recorder
