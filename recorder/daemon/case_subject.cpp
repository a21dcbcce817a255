#include "recorder/daemon/case_subject.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kLookInterval{1};

}  // namespace

std::string_view subject_state_name(SubjectState state) {
  switch (state) {
    case SubjectState::kNone:
      return "none";
    case SubjectState::kGiven:
      return "given";
    case SubjectState::kFound:
      return "found";
    case SubjectState::kLate:
      return "late";
    case SubjectState::kCarriedOver:
      return "carried-over";
  }
  return "";
}

CaseSubject::Found CaseSubject::at_beginning(UtcTime now, std::optional<Bytes> given, bool carried_over) {
  begun_at_ = now;
  Found found{std::move(given)};
  if (found.json) found.state = SubjectState::kGiven;
  if (carried_over) found.state = SubjectState::kCarriedOver;
  looked_for_ = false;
  if (found.json || carried_over || !source_) return found;
  found.json = find();
  if (found.json) found.state = SubjectState::kFound;
  looked_for_ = !found.json;
  return found;
}

std::optional<std::string> CaseSubject::why_missing() const {
  if (!looked_for_) return {};
  source_->hurry();
  std::string why = "the case begins without procedure data";
  if (source_->is_doubtful(begun_at_)) why += std::string("; ") + kTwoPatients;
  if (source_->is_too_early(begun_at_)) why += std::string("; ") + kTooEarly;
  for (const ProcedureWay& way : source_->ways()) why += "; " + way.name + ": " + way.state;
  return why;
}

std::optional<Bytes> CaseSubject::late(Clock::Time now) {
  if (!looked_for_ || now < next_look_) return {};
  next_look_ = now + kLookInterval;
  std::optional<Bytes> found = find();
  // A person may have given one meanwhile.
  if (!found || !looked_for_.exchange(false)) return {};
  return found;
}

std::optional<Bytes> CaseSubject::find() const {
  try {
    if (const auto found = source_->find(begun_at_)) return subject_json(*found);
  } catch (const std::exception& error) {
    tell_(std::string("procedure data cannot be looked up: ") + error.what());
  }
  return {};
}

}  // namespace kiroku::recorder
