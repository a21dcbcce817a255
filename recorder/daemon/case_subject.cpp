#include "recorder/daemon/case_subject.h"

#include <utility>

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kLookInterval{1};
constexpr std::chrono::seconds kComparisonInterval{10};

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

CaseSubject::Found CaseSubject::at_beginning(UtcTime now, std::optional<Bytes> given, GoesOn goes_on,
                                             std::optional<ProcedureData> about) {
  begun_at_ = now;
  Found found{std::move(given)};
  if (found.json) found.state = SubjectState::kGiven;
  if (goes_on == GoesOn::kWithSubject) found.state = SubjectState::kCarriedOver;
  looked_for_ = false;
  goes_on_ = goes_on;
  is_given_ = found.json.has_value();
  numbers_.clear();
  if (found.json) {
    is_about(data_of_subject(*found.json));
  } else if (goes_on != GoesOn::kWithSubject) {
    is_about({});
  } else if (about) {
    is_about(std::move(about));
  }
  is_found_ = false;
  if (found.json || goes_on != GoesOn::kNo || !source_) return found;
  if (const auto known = find()) {
    found.json = subject_json(*known);
    numbers_ = known->numbers;
    is_about(known);
    is_found_ = true;
    found.state = SubjectState::kFound;
  }
  looked_for_ = !found.json;
  return found;
}

std::optional<std::string> CaseSubject::why_missing() const {
  if (goes_on_ == GoesOn::kSubjectWithheld && !is_given_) {
    return "the case goes on after one whose subject it is not given, as nothing proves that it is about the "
           "same patient; none is looked up, which could be the next one: a person must say whom it is about";
  }
  if (goes_on_ == GoesOn::kWithoutSubject && !is_given_ && source_) {
    return "the case goes on with an operation of which no subject is known; none is looked up, which could "
           "be the next patient: a person must say whom it is about";
  }
  if (!looked_for_) return {};
  source_->hurry();
  std::string why = "the case begins without procedure data";
  if (const Doubt doubt = source_->doubt(begun_at_); doubt != Doubt::kNone)
    why += "; " + std::string(words_of(doubt));
  for (const ProcedureWay& way : source_->ways()) why += "; " + way.name + ": " + way.state;
  return why;
}

std::optional<Bytes> CaseSubject::late(Clock::Time now) {
  if (!looked_for_ || now < next_look_) return {};
  next_look_ = now + kLookInterval;
  const std::optional<ProcedureData> found = find();
  if (!found) return {};
  // A person may have given one meanwhile.
  if (!looked_for_.exchange(false)) return {};
  numbers_ = found->numbers;
  is_about(found);
  is_found_ = true;
  return subject_json(*found);
}

std::optional<ProcedureData> CaseSubject::about() const {
  const std::lock_guard guard(about_mutex_);
  return about_;
}

std::optional<std::string> CaseSubject::contradicted(Clock::Time now) {
  if (!is_found_ || now < next_comparison_) return {};
  next_comparison_ = now + kComparisonInterval;
  const std::optional<ProcedureData> named = find(), known = about();
  if (!named || !known || may_be_same_patient(*known, *named)) return {};
  // Lists drop what has begun, and the next one stands there alone.
  constexpr std::size_t kToMinutes = 16;
  const std::string planned = known->planned.substr(0, kToMinutes);
  if (!planned.empty() && named->planned.substr(0, kToMinutes) > planned) return {};
  // A person may have given one meanwhile.
  if (!is_found_.exchange(false)) return {};
  return "messages or the worklist name another patient for this room now than the one whom they named for "
         "this case: see whether the case has the right patient, or the next one has come";
}

void CaseSubject::ended(UtcTime now) {
  std::optional<ProcedureData> about;
  {
    const std::lock_guard guard(about_mutex_);
    about = std::exchange(about_, std::nullopt);
  }
  if (source_ && about && names_somebody(*about)) source_->ended(*about, now);
}

std::optional<ProcedureData> CaseSubject::find() const {
  try {
    return source_->find(begun_at_);
  } catch (const std::exception& error) {
    tell_(std::string("procedure data cannot be looked up: ") + error.what());
  }
  return {};
}

}  // namespace kiroku::recorder
