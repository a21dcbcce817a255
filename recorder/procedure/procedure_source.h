// Where a room learns about the procedure that is done in it, other than from a person. Every function may be
// called from any thread.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "recorder/procedure/procedure_data.h"

namespace kiroku::recorder {

/// How one way to procedure data is; sentences hold nothing of a patient.
struct ProcedureWay {
  std::string name;  // "hl7", "worklist"
  bool well = true;
  std::string state;  // "waits for messages at 0.0.0.0:2576; 12 taken"
};

class ProcedureSource {
 public:
  virtual ~ProcedureSource() = default;
  /// What is known now for a case that began at `at`, or why nothing is taken although somebody may be meant.
  /// Returns at once: whatever takes time is done ahead, or meanwhile.
  [[nodiscard]] virtual ProcedureChoice choose(UtcTime at) const = 0;
  [[nodiscard]] std::optional<ProcedureData> find(UtcTime at) const { return choose(at).data; }
  [[nodiscard]] Doubt doubt(UtcTime at) const { return choose(at).doubt; }
  /// What speaks now against what choose() gave for a case that began at `at` and runs still. Whoever is
  /// planned behind it does not. Returns at once.
  [[nodiscard]] virtual Objection objection(const ProcedureChoice& /*taken*/, UtcTime /*at*/) const {
    return Objection::kNone;
  }
  /// Everything that could be meant at `at`, from which a person chooses: in the order of the planned times,
  /// what has none first; at most kMostListed. Returns at once.
  [[nodiscard]] virtual std::vector<ProcedureData> list(UtcTime at) const = 0;
  static constexpr std::size_t kMostListed = 500;
  /// Whether something of list() was only said once, by a message, and not listed by who can be asked again.
  [[nodiscard]] virtual bool knows_by_messages(UtcTime /*at*/) const { return false; }
  /// When, since the machine's boot (Clock::since_boot()), somebody came to the room last, left it, or was
  /// done with there, as far as is known: what was recorded before is of somebody else. Nothing where nothing
  /// says so. Returns at once.
  [[nodiscard]] virtual std::optional<Clock::Duration> changed_at() const { return {}; }
  /// A person or a rule ended the case about it at `at`. What is planned so is taken for another case only if
  /// that one begins within kGoesOnWithin: after a pause it goes on. Later, within the rule's window, a
  /// person chooses it again.
  virtual void ended(const ProcedureData& /*data*/, UtcTime /*at*/) {}
  /// A case about it was cut off at `at` by the end of an earlier process. It is taken for recorded likewise,
  /// and its operation may go on: whoever is planned behind it is not taken in its place.
  virtual void cut_off(const ProcedureData& /*data*/, UtcTime /*at*/) {}
  static constexpr std::chrono::minutes kGoesOnWithin{10};
  /// A case waits for it: what is asked for now and then is asked for now.
  virtual void hurry() {}
  [[nodiscard]] virtual std::vector<ProcedureWay> ways() const = 0;
};

}  // namespace kiroku::recorder
