// Trainees, what they did and how they did it, in one SQLite file. Not thread-safe; other processes may use
// the same file and are waited for. Unlike a catalogue it cannot be made anew: what is damaged is refused and
// left alone.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "trainer/curriculum/learning.h"
#include "trainer/haptic_rate/experiment.h"

namespace kiroku::trainer {

struct Trainee {
  std::int64_t id = 0;
  std::string name;
  std::string group;       // of a study; may be empty
  bool simulated = false;  // no person: said wherever its results are shown
  std::string account;     // the user who trains so, besides administrators; may be empty
};

/// Every function throws kiroku::Error where the file cannot be used.
class TrainingDatabase {
 public:
  static constexpr std::int64_t kVersion = 9;

  /// Opens or makes the file; one of an older version gets what is new. kiroku::UsageError for one of a newer
  /// version, for another program's database and for what is no database.
  explicit TrainingDatabase(const std::filesystem::path& file);
  ~TrainingDatabase();
  TrainingDatabase(const TrainingDatabase&) = delete;
  TrainingDatabase& operator=(const TrainingDatabase&) = delete;

  /// kiroku::UsageError for a name that exists, is empty, longer than 100 bytes or has control characters.
  Trainee add_trainee(const std::string& name, const std::string& group, bool simulated,
                      const std::string& account = "");
  /// From now on this user trains so, and no other. kiroku::UsageError for a simulated trainee.
  void bind_to_user(const Trainee& trainee, const std::string& account);
  [[nodiscard]] std::vector<Trainee> trainees() const;  // by name
  /// kiroku::UsageError for one that is not there, with what to do.
  [[nodiscard]] Trainee trainee(const std::string& name) const;

  /// Keeps a session of the haptic-rate experiment, whole or not at all; its number.
  std::int64_t add_rate_session(const Trainee& subject, const RateSession& session, UtcTime began);
  /// All that are kept, in their order.
  [[nodiscard]] std::vector<RateSession> rate_sessions() const;

  /// Keeps an attempt of the trainee; `record.trainee`, its group and `simulated` are taken from there.
  void add_attempt(const Trainee& trainee, const ExclusionRecord& record, UtcTime began);
  /// The same for one that begins now: it is broken off until end_attempt() says otherwise, also where this
  /// program never gets there. Its number.
  std::int64_t begin_attempt(const Trainee& trainee, ExclusionRecord record, UtcTime began);
  /// Ending and score of a begun attempt; kiroku::UsageError where there is none of the number.
  void end_attempt(std::int64_t attempt, Ending ending, const ExclusionScore& score);
  /// Under what an attempt that was begun is made, once its mesh is there; kiroku::UsageError where there is
  /// none of the number.
  void keep_conditions(std::int64_t attempt, const AttemptConditions& conditions);
  /// The case that was made of an attempt; kiroku::UsageError where there is none of the number.
  void keep_case(std::int64_t attempt, const std::string& case_id);
  /// What was said of an attempt that is over and was not sealed yet, in place of what was said before.
  /// kiroku::UsageError where it is not sound (require_sound()), where the attempt is none of these results,
  /// was broken off or runs, or is sealed: what a case holds does not change any more.
  void keep_questionnaire(std::int64_t attempt, const Questionnaire& questionnaire);
  void keep_checklist(std::int64_t attempt, const Checklist& checklist);
  /// All that are kept, in their order.
  [[nodiscard]] std::vector<ExclusionRecord> attempts() const;

 private:
  void require_assessable(std::int64_t attempt) const;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::trainer
