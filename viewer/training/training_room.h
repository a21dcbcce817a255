// What all attempts at a server share: organs, results, and who trains now. Thread-safe.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "trainer/exclusion/exclusion_body.h"
#include "trainer/hand/hand_motion.h"
#include "trainer/results/training_database.h"

namespace kiroku::viewer {

struct TrainingOptions {
  std::filesystem::path database;
  std::size_t vertices = 4000;  // of an organ's mesh
  double damage_pa = 100e3;
  double most_s = 60;       // of an attempt
  std::size_t at_once = 1;  // attempts; each needs about a core
  std::map<trainer::ObjectKind, trainer::HandMotion> experts;
  /// Hears in one sentence of what failed inside; called from several threads.
  std::function<void(const std::string& sentence)> tell;
};

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

  /// The organ, made by who asks first while the others wait: some seconds.
  std::shared_ptr<const trainer::ExclusionBody> body(trainer::ObjectKind kind);

  /// A trainee's place; the room must outlive it.
  class Place {
   public:
    Place(TrainingRoom& room, std::string trainee) : room_(room), trainee_(std::move(trainee)) {}
    ~Place() { room_.leave(trainee_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

   private:
    TrainingRoom& room_;
    std::string trainee_;
  };
  /// Refusal 409 where the trainee trains already, 503 where all places are taken.
  std::unique_ptr<Place> enter(const std::string& trainee);

 private:
  struct Organ {
    std::mutex mutex;
    std::shared_ptr<const trainer::ExclusionBody> body;
  };

  void leave(const std::string& trainee);

  TrainingOptions options_;
  std::mutex database_mutex_;
  trainer::TrainingDatabase database_;
  std::array<Organ, 2> organs_;  // by ObjectKind
  std::mutex places_mutex_;
  std::set<std::string> training_;
};

}  // namespace kiroku::viewer
