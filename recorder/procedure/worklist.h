// A hospital's list of planned procedures: DICOM modality worklist (PS3.4 annex K), asked for by C-FIND.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "recorder/procedure/procedure_data.h"
#include "recorder/procedure/procedure_source.h"

namespace kiroku::recorder {

struct WorklistOptions {
  std::string host;
  std::uint16_t port = 104;
  std::string called_ae = "ANY-SCP";  // the worklist's application entity title: 1 to 16 characters
  std::string calling_ae = "KIROKU";  // this recorder's
  std::string station_ae;             // Scheduled Station AE Title (0040,0001); "": of any station
  std::string modality;               // (0008,0060), "ES" of endoscopy; "": any
  std::chrono::seconds timeout{5};    // to connect, for the association, and for each answer
  std::chrono::nanoseconds window =
      std::chrono::hours(12);  // planned further from a case's beginning: not used
  std::chrono::nanoseconds refresh = std::chrono::minutes(1);
};

/// One scheduled procedure step.
struct WorklistItem {
  /// By this machine's time zone, or the one that the item states; absent: it cannot be read, or is not
  /// stated.
  std::optional<UtcTime> planned;
  ProcedureData data;
  /// It says more of a patient and a procedure than is kept, so that `data` is empty. It keeps its place: no
  /// other step is taken for it.
  bool is_left_out = false;
  std::optional<TimeSpan> within = {};  // all that it says of when it is planned, where `planned` is absent
};

inline constexpr std::size_t kMostWorklistItems = 500;  // of one answer

struct WorklistAnswer {
  std::vector<WorklistItem> items;
  /// Listed although other stations or another modality were stated than were asked for, or none: not among
  /// the items. Not every worklist compares what it is asked for.
  std::size_t not_asked_for = 0;
  /// There were more than kMostWorklistItems: the rest was not read.
  bool is_cut = false;
  std::string problem;  // one sentence, without anything of a patient; "": asked and answered
};

/// Asks for the steps of the days within the window around `now`, in a box (worklist_box.h): where there is
/// none, it cannot be asked. Blocks for a few timeouts at most, a minute where they are short, and no longer
/// once `*cancelled` is true; it may be null. Thread-safe.
WorklistAnswer ask_worklist(const WorklistOptions& options, UtcTime now,
                            const std::atomic<bool>* cancelled = nullptr);

/// What a person should know of steps that were left out, without anything of a patient; "" where none was.
std::string left_out_of(const WorklistAnswer& answer);

/// Of the answer to a question asked at `asked`, the step planned nearest to `at` and within the window.
/// Nothing if none is, where that one is left out or more than kFurthestAhead ahead, where steps of two
/// patients are equally near, where one whose time cannot be read may be as near, and of an answer that was
/// cut: nobody can tell then whose it is. Steps that are done with, by `standing`, are passed over.
std::optional<ProcedureData> nearest_step(const WorklistAnswer& answer, UtcTime asked, UtcTime at,
                                          std::chrono::nanoseconds window, const StandingOf& standing = {});
/// Why it is nothing: one of these, or `standing` leaves that step in doubt.
Doubt doubt_of(const WorklistAnswer& answer, UtcTime at, std::chrono::nanoseconds window,
               const StandingOf& standing = {});

/// Asks again and again, from a thread of its own; after failures at longer intervals, up to five minutes.
/// Every function may be called from any thread.
class Worklist {
 public:
  using Tell = std::function<void(const std::string& sentence)>;
  /// `tell` hears when the worklist cannot be asked, and when it can again.
  Worklist(WorklistOptions options, Tell tell, const Clock& clock = Clock::system());
  /// A question that is under way is given up.
  ~Worklist();
  Worklist(const Worklist&) = delete;
  Worklist& operator=(const Worklist&) = delete;

  /// Of the last answer the step planned nearest to `at`. Nothing once the answer is older than
  /// kMostRefreshes of its options and no newer one came: steps may be called off or moved meanwhile.
  [[nodiscard]] std::optional<ProcedureData> find(UtcTime at, const StandingOf& standing = {}) const;
  static constexpr int kMostRefreshes = 3;
  /// Why it gives nothing although it lists somebody.
  [[nodiscard]] Doubt doubt(UtcTime at, const StandingOf& standing = {}) const;
  /// All steps of that answer planned within the window around `at`, while it is not older than the window: a
  /// person chooses, to whom way() and `chosen` say how old it is.
  [[nodiscard]] std::vector<ProcedureData> list(UtcTime at) const;
  /// Asks now, unless it did so within the last seconds.
  void hurry();
  [[nodiscard]] ProcedureWay way() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
