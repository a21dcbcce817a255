// Carrying a case on that was cut off by a crash or a power cut, in a room whose rules ask for it
// (docs/how-to/operations.md, "After a crash the operation goes on"): whether, as which case, and with what
// of the earlier one. One thread, at the recorder's start, before any room records.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/upkeep/recovery.h"
#include "archive/verify/carried_on.h"
#include "base/bytes.h"
#include "recorder/daemon/running_note.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/procedure/procedure_data.h"
#include "recorder/vitals/patient_number.h"

namespace kiroku::recorder {

/// The clocks of the machine. Monotonic: CLOCK_MONOTONIC. Since boot: CLOCK_BOOTTIME, which goes on while the
/// machine is suspended.
struct MachineTime {
  UtcTime utc;
  std::chrono::nanoseconds monotonic{0};
  std::chrono::nanoseconds since_boot{0};
  bool is_synchronised = true;  // the wall clock, as the kernel says
};
MachineTime machine_time();

/// By stream of pictures.
using Profiles = std::map<std::string, Profile>;

/// A room's new case, and what it takes over.
struct Resumption {
  std::string case_id;  // that the earlier case announces
  archive::CarriedOn earlier;
  /// Whom the operation was about in the end: as it became known while the earlier case ran, else the earlier
  /// case's subject file, as it is.
  std::optional<Bytes> sealed_subject;
  bool is_subject_withheld = false;  // it had one, which is not as this device sealed it
  std::optional<crypto::Sha256Digest> plan;
  Profiles profiles;                     // in which its streams of pictures ended
  std::string reason;                    // why the operation's first case was begun
  std::chrono::nanoseconds recorded{0};  // by the operation's earlier cases
  std::chrono::nanoseconds within{0};    // it is tried for so long
  /// By the room, of what the earlier process kept in memory: as CaseIdentity has them.
  std::vector<PatientNumber> patient_numbers = {};
  std::vector<std::string> plan_patients = {};
  std::optional<ProcedureData> about = {};
};

/// How long ago a case was cut off; nothing where no clock can tell, and `why` says which way it was known or
/// why not. In one boot the monotonic clock decides, and time in suspension since the case was begun counts.
/// After another boot only the wall clock can: it is not believed where the cut would lie after the boot, as
/// with a clock that was set back or lost its battery.
struct TimeSinceCut {
  std::optional<std::chrono::nanoseconds> elapsed;
  std::string why;
  /// The machine was suspended in this boot, and nobody knows when: all of it may lie after the cut.
  bool is_bound = false;
};
/// What is known of when the case was begun, if that was in this boot.
struct KnownOpening {
  std::optional<std::chrono::nanoseconds> logged;  // the monotonic clock when the appliance log heard of it
  std::optional<std::chrono::nanoseconds> suspended;  // RunningCase::suspended
};
TimeSinceCut time_since(const archive::CutOffCase& cut, const MachineTime& now, const std::string& boot_id,
                        const KnownOpening& opening);

struct ResumeRule {
  std::string room;
  std::chrono::nanoseconds within{0};
  std::chrono::nanoseconds longest{0};  // of the operation's cases together
  std::shared_ptr<RunningNote> note;
};

/// The sealed subject of a case, as it is; nothing where it has none, or where the file is not as the ledger
/// states it, which `tell` is told.
std::optional<Bytes> sealed_subject_of(const std::filesystem::path& folder, const archive::OpenEntry& open,
                                       const std::function<void(const std::string& sentence)>& tell);

/// In which form each stream of pictures of a case was archived last; nothing of one that holds no segment,
/// or where the ledger cannot be read.
Profiles last_profiles_of(const std::filesystem::path& folder);

class ResumptionPlanner {
 public:
  /// Cases shorter than this, one after the other, are those of a recorder that dies as soon as it records.
  static constexpr std::chrono::seconds kShortCase{60};
  static constexpr int kMostShortCases = 3;

  struct Context {
    std::filesystem::path archive;
    std::string boot_id;  // of the machine as it runs now
    std::function<MachineTime()> now = machine_time;
    std::function<void(const std::string& room, const std::string& sentence)> tell;
  };
  ResumptionPlanner(Context context, std::vector<ResumeRule> rules);

  /// For RecoveryOptions::carry_on.
  std::string carry_on(const archive::CutOffCase& cut);
  /// After recovery: what the room shall begin with. Each refusal is told; so is a case that was ended less
  /// than ResumeRule::within ago by a shutdown, or by an error, while its operation went on.
  std::optional<Resumption> of(const std::string& room);

 private:
  struct Facts;
  [[nodiscard]] static std::optional<Facts> facts_of(const std::filesystem::path& folder);
  /// The newest case of the room's operation, and what the room's note says of it.
  [[nodiscard]] std::optional<RunningCase> newest_of(const ResumeRule& rule) const;
  [[nodiscard]] std::optional<std::chrono::nanoseconds> logged_opening(const std::string& case_id) const;
  /// Why the case is not carried on; "" where it is.
  [[nodiscard]] std::string refusal(const ResumeRule& rule, const RunningCase& running,
                                    const archive::CutOffCase& cut, const Facts& facts) const;
  [[nodiscard]] TimeSinceCut since(const RunningCase& running, const archive::CutOffCase& cut) const;
  /// Of a case whose newest subject the room's note may have.
  [[nodiscard]] std::optional<Bytes> newest_subject_of(const std::string& room, const RunningCase& running,
                                                       const Facts& facts) const;
  [[nodiscard]] std::string refusal_by_history(const ResumeRule& rule, const Facts& newest,
                                               std::chrono::nanoseconds& recorded) const;
  void tell_of_end(const ResumeRule& rule, const RunningCase& running, const Facts& facts) const;
  void tell(const std::string& room, const std::string& sentence) const;

  const Context context_;
  const std::vector<ResumeRule> rules_;
  std::map<std::string, std::string> decided_;  // earlier case: "" or later case
};

}  // namespace kiroku::recorder
