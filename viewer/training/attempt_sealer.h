// Making a case of an attempt after it was made: what the room of a trainer asks of who has a home. The
// viewer's libraries record nothing by themselves.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "trainer/exclusion/live_attempt.h"
#include "viewer/report/language.h"

namespace kiroku::viewer {

/// What is kept of one attempt while it runs. One thread at a time; goes with its files.
class AttemptFiles {
 public:
  virtual ~AttemptFiles() = default;
  /// Each picture, as the page shows it. Never throws: what cannot be kept is told when it is to be sealed.
  virtual void see(const trainer::ExclusionView& view, ByteView jpeg) = 0;
};

struct SealedAttempt {
  std::string case_id;
  std::string verdict;  // of its verification, "intact"
};

/// Thread-safe.
class AttemptSealer {
 public:
  virtual ~AttemptSealer() = default;
  /// Throws kiroku::Error where the home has no room for an attempt beside what a recorder may need.
  virtual void require_room() = 0;
  /// Files for an attempt that begins, whose number is no other's. kiroku::Error.
  virtual std::unique_ptr<AttemptFiles> keep(std::int64_t attempt) = 0;
  /// Records what was kept into a new case with `facts` in its sealed subject, and verifies it; the files lie
  /// beside the home's cases from then on. `begun` hears of the new case before anything is recorded into it,
  /// so that whatever fails later the case is known; if it throws, the case ends there.
  ///
  /// `earlier` is the case of a try that failed, empty for the first. Where that holds the whole attempt it
  /// is the attempt's case, and only what comes after recording is done again; where it does not, the new
  /// case names it. kiroku::Error where the home cannot be recorded into, or the files not be moved.
  virtual SealedAttempt seal(AttemptFiles& files, const trainer::HandMotion& motion,
                             const nlohmann::ordered_json& facts, const std::string& summary,
                             const std::string& earlier,
                             const std::function<void(const std::string& case_id)>& begun) = 0;
  /// The report of its verification, made anew, as a PDF for `user`.
  virtual Bytes certificate(const std::string& case_id, const std::string& user,
                            report::Language language) = 0;
};

}  // namespace kiroku::viewer
