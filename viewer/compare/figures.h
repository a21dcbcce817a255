// What the plan and the recording of each step come to, side by side. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "viewer/compare/case_record.h"
#include "viewer/compare/step_matching.h"

namespace kiroku::compare {

/// Arterial pressures (invasive or by cuff) that are told when they are passed, in mmHg.
struct PressureLimits {
  double systolic_low = 90, systolic_high = 160, mean_low = 65;
};

/// Means of one quantity: in the 30 s before the step, while it was done, and in the 30 s after; nothing
/// where no number was recorded.
struct VitalChange {
  std::string code, label, unit, device;  // device: where several send this quantity, else ""
  std::optional<double> before, during, after;
};

struct PressureEvent {
  std::int64_t time_ns = 0;
  std::string text;  // "mean pressure 62 mmHg, below 65", or an alarm in the monitor's words
  std::string code;
  std::optional<double> value_mmhg;
  bool is_alarm = false;
};

/// Whether pressures that have limits were measured while a step was done. "None passed a limit" says nothing
/// of a pressure that nobody measured.
struct PressureMeasured {
  bool judged = false;                    // a number in a unit that is known
  std::vector<std::string> unread_units;  // of numbers that were left out: as they were sent, "" for none
};

struct StepFigures {
  std::size_t step = 0;
  std::optional<std::size_t> done_as;           // 0: first of the steps that were done; nothing: not found
  std::optional<std::int64_t> pause_before_ns;  // since the step before ended; nothing where nobody said when
                                                // that was, and for the first
  std::int64_t pauses_within_ns = 0;
  std::vector<VitalChange> vitals;  // by code and device
  /// What was beyond a limit as it began, then what happened while it was done, in order.
  std::vector<PressureEvent> pressure;
  PressureMeasured measured;
};

inline constexpr std::int64_t kVitalWindowNs = 30'000'000'000;
/// A pressure by cuff counts for so long.
inline constexpr std::int64_t kOldestPressureNs = 600'000'000'000;

/// For each planned step, in the planned order.
std::vector<StepFigures> figures_of(std::span<const PlannedStep> steps, const StepMatching& matching,
                                    const CaseRecord& record, const PressureLimits& limits = {});

/// All that happened in [from_ns, to_ns): alarms about an arterial pressure, and numbers that passed a limit
/// (the first beyond it, after one that was not or at the beginning of the case).
std::vector<PressureEvent> pressure_events(const CaseRecord& record, std::int64_t from_ns, std::int64_t to_ns,
                                           const PressureLimits& limits = {});

}  // namespace kiroku::compare
