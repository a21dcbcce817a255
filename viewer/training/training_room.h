// What all attempts at a server share: organs, results, and who trains now. Thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "trainer/exclusion/exclusion_body.h"
#include "trainer/hand/hand_motion.h"
#include "trainer/results/training_database.h"
#include "viewer/http/request.h"
#include "viewer/people/deed_pace.h"
#include "viewer/people/turns.h"
#include "viewer/training/attempt_sealer.h"

namespace kiroku::viewer {

struct TrainingOptions {
  std::filesystem::path database;
  std::size_t vertices = 4000;  // of an organ's mesh
  double damage_pa = 100e3;
  double friction = trainer::kFingertipFriction;
  double most_s = 60;                             // of an attempt
  double practice_s = trainer::kPracticeSeconds;  // of a session, before its test; 0: as one likes
  std::size_t at_once = 1;                        // attempts; each needs about a core
  Clock::Duration patience = kPatienceForPlaces;
  std::map<std::string, trainer::HandMotion> experts;  // by object
  /// Organs of patients, beside objects a and b; each with a name of its own.
  std::vector<std::shared_ptr<const trainer::ExclusionBody>> organs;
  /// The names of those that perhaps nobody can push aside (trainer::doubt_about()).
  std::set<std::string> doubted;
  /// Makes cases of attempts; null: none are made.
  std::shared_ptr<AttemptSealer> sealer;
  /// How fast one user's attempts may follow each other: each leaves a row that every look at progress reads.
  /// An attempt that is broken off at once is one, too.
  DeedPace::Limits pace{30, std::chrono::seconds(10)};
  const Clock* clock = &Clock::system();  // must outlive the room
  /// Hears in one sentence of what failed inside; called from several threads.
  std::function<void(const std::string& sentence)> tell;
};

/// Who has signed in.
struct TrainingUser {
  std::string name;
  bool supervises = false;  // administrators: train as everybody, add and see everybody
  bool may_record = false;  // may begin cases and verify them, and so seal what they trained
};
TrainingUser training_user(const Request& request);
/// Others train as the trainee that is bound to them.
bool may_train_as(const TrainingUser& user, const trainer::Trainee& trainee);

class TrainingRoom {
 public:
  /// What TrainingDatabase throws.
  explicit TrainingRoom(TrainingOptions options);

  [[nodiscard]] const TrainingOptions& options() const { return options_; }

  /// Calls `use` with the results while no other thread has them, and returns what it does.
  template <typename Use>
  auto with_results(const Use& use) {
    const std::lock_guard guard(database_mutex_);
    return use(database_);
  }

  /// "a", "b", "c", and the patients' organs.
  [[nodiscard]] std::vector<std::string> objects() const;
  /// Refusal 400 for a name that is none of objects().
  void require_object(const std::string& name) const;
  /// One of objects(). A and B are made by who asks first while the others wait: some seconds.
  std::shared_ptr<const trainer::ExclusionBody> body(const std::string& object);

  /// What an attempt that is over can be sealed from, until the trainee's next one is over.
  struct Sealable {
    std::int64_t attempt = 0;
    std::unique_ptr<AttemptFiles> files;
    trainer::HandMotion motion;
    std::string facts, summary;  // JSON
  };
  void keep_sealable(const std::string& trainee, Sealable sealable);
  /// Makes the case, which is kept with the results before anything is recorded into it. What failed can be
  /// tried again, and goes on with the case that was made then where that is whole: an attempt has one.
  /// Refusal 404 where the attempt is no more there to be sealed, 409 where it is sealed or being sealed, 403
  /// where the user may not.
  SealedAttempt seal(const TrainingUser& user, std::int64_t attempt);
  /// Keeps what was said of an attempt that is over, with the user's name, until it is sealed: its case holds
  /// what was said by then. Refusal 404 where there is no such attempt of a trainee that the user may train
  /// as, 403 for a checklist of a user who does not supervise, 409 while the attempt is being sealed;
  /// kiroku::UsageError as TrainingDatabase::keep_questionnaire().
  void keep_questionnaire(const TrainingUser& user, std::int64_t attempt, trainer::Questionnaire said);
  void keep_checklist(const TrainingUser& user, std::int64_t attempt, trainer::Checklist checklist);
  /// The certificate of an attempt that was sealed. Refusal 404 where it was not, 403 where the user may not.
  Bytes certificate(const TrainingUser& user, std::int64_t attempt, report::Language language);

  /// Refusal 429 where one user began so many attempts that the next one has to wait; else this one counts.
  void require_pace(const std::string& user);
  /// A trainee's place; the room must outlive it. Refusal 409 where the trainee trains already, also after
  /// TrainingOptions::patience, which it blocks; 503 where others have all places.
  std::unique_ptr<Turns::Turn> enter(const std::string& trainee);

 private:
  struct Made {
    std::mutex mutex;
    std::shared_ptr<const trainer::ExclusionBody> body;
  };

  /// What the attempt is sealed from, taken away until that is over.
  Sealable take_sealable(const TrainingUser& user, const std::string& trainee, std::int64_t attempt);
  /// The attempt, where its trainee is one whom the user may train as.
  trainer::ExclusionRecord require_own(const TrainingUser& user, std::int64_t attempt);
  /// Calls `keep` with the results while no case is being made of the attempt.
  void keep_unsealed(const TrainingUser& user, std::int64_t attempt,
                     const std::function<void(trainer::TrainingDatabase&)>& keep);
  /// The attempt, where the user may seal it.
  trainer::ExclusionRecord require_may_seal(const TrainingUser& user, std::int64_t attempt);

  TrainingOptions options_;
  std::mutex database_mutex_;
  trainer::TrainingDatabase database_;
  std::map<std::string, Made> made_;  // "a", "b" and "c"
  DeedPace pace_;
  Turns places_;
  std::mutex sealable_mutex_;
  std::map<std::string, Sealable> sealable_;  // by trainee
  std::set<std::int64_t> sealing_;            // attempts whose case is being made
};

}  // namespace kiroku::viewer
