// What of stored cases lies here while people look at them: ledgers, and the checkpoints and time-stamps that
// lie beside. Segments stay in the store. Thread-safe.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "archive/reading/case_reader.h"
#include "archive/reading/sealed_source.h"
#include "base/clock.h"
#include "fleet/store_connections.h"
#include "fleet/stored_segments.h"

namespace kiroku::fleet {

class CaseShelf {
 public:
  /// How many cases at most; of more, what nobody asked for longest goes.
  static constexpr std::size_t kMostCases = 64;

  /// `folder` belongs to the shelf alone. `clock` and `store` must outlive it and what it gives.
  CaseShelf(std::filesystem::path folder, StoreConnections& store, const Clock& clock = Clock::system());
  /// Waits for what is being fetched, a file each at most.
  ~CaseShelf();
  CaseShelf(const CaseShelf&) = delete;
  CaseShelf& operator=(const CaseShelf&) = delete;

  struct Place {
    /// Ends with <appliance>/<case>: a case's folder without segments.
    std::filesystem::path folder;
    std::shared_ptr<const archive::SealedSource> segments;
    std::shared_ptr<const archive::CaseReader> ledger;  // parsed; null where that cannot be
    enum class Proofs { kComing, kThere, kMissing } proofs = Proofs::kComing;
    std::string problem;  // why they are missing
  };
  /// The case as the store has it now, or had it some seconds ago; checkpoints and tokens begin to be
  /// fetched. Nothing where the store has no ledger of it. Throws StoreError, kiroku::Error, kiroku::IoError.
  std::optional<Place> find(const std::string& appliance, const std::string& case_id);
  [[nodiscard]] const RangeCache& ranges() const { return cache_; }

 private:
  struct Kept;
  using Name = std::pair<std::string, std::string>;

  std::shared_ptr<Kept> slot_of(const Name& name);
  bool bring_ledger(Kept& kept, const Name& name);
  static void read_ledger(Kept& kept);
  static void bring_subject(Kept& kept);
  void bring_proofs(Kept& kept, const Name& name, const archive::CaseReader* ledger);

  const std::filesystem::path folder_;
  StoreConnections& store_;
  const Clock& clock_;
  RangeCache cache_;
  FetchingAhead ahead_;  // behind the cache, which it fills
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;  // guards the three below, not what they refer to
  std::uint64_t made_ = 0;
  std::map<Name, std::shared_ptr<Kept>> cases_;
  std::list<Name> in_order_;  // what was asked for last in front
};

}  // namespace kiroku::fleet
