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
  looked_for_ = true;
  found.json = look();
  if (found.json) found.state = SubjectState::kFound;
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
  try {
    if (const Doubt doubt = source_->doubt(begun_at_); doubt != Doubt::kNone)
      why += "; " + std::string(words_of(doubt));
  } catch (const std::exception& error) {
    why += std::string("; procedure data cannot be looked up: ") + error.what();
  }
  for (const ProcedureWay& way : source_->ways()) why += "; " + way.name + ": " + way.state;
  return why;
}

std::optional<Bytes> CaseSubject::late(Clock::Time now) {
  if (!looked_for_ || now < next_look_) return {};
  next_look_ = now + kLookInterval;
  return look();
}

std::optional<ProcedureData> CaseSubject::about() const {
  const std::lock_guard guard(about_mutex_);
  return about_;
}

std::optional<std::string> CaseSubject::contradicted(Clock::Time now) {
  if (!is_found_ || now < next_comparison_) return {};
  next_comparison_ = now + kComparisonInterval;
  const Objection against = objection();
  // A person may have given one meanwhile.
  if (against == Objection::kNone || !is_found_ || !objections_.insert(against).second) return {};
  return std::string(words_of(against));
}

Objection CaseSubject::objection() {
  ProcedureChoice named;
  try {
    const Objection told = source_->objection(taken_, begun_at_);
    is_over_ = is_over_ || told == Objection::kOver;
    const bool is_of_who_is_there = told == Objection::kAnotherThere || told == Objection::kSeveralThere;
    if (is_of_who_is_there || (!is_over_ && told != Objection::kNone)) return told;
    named = source_->choose(begun_at_);
  } catch (const std::exception& error) {
    tell_(std::string("procedure data cannot be looked up: ") + error.what());
  }
  const ProcedureData& known = *taken_.data;
  if (!named.data || may_be_same_patient(known, *named.data)) return Objection::kNone;
  // Lists drop what has begun, and the next one stands there alone.
  constexpr std::size_t kToMinutes = 16;
  const std::string planned = known.planned.substr(0, kToMinutes);
  const bool is_next = !planned.empty() && named.data->planned.substr(0, kToMinutes) > planned;
  return is_next || is_over_ ? Objection::kNone : Objection::kAnotherThere;
}

void CaseSubject::ended(UtcTime now) {
  std::optional<ProcedureData> about;
  {
    const std::lock_guard guard(about_mutex_);
    about = std::exchange(about_, std::nullopt);
  }
  if (source_ && about && names_somebody(*about)) source_->ended(*about, now);
}

std::optional<Bytes> CaseSubject::look() {
  ProcedureChoice found;
  try {
    found = source_->choose(begun_at_);
  } catch (const std::exception& error) {
    tell_(std::string("procedure data cannot be looked up: ") + error.what());
  }
  if (!found.data) return {};
  // A person may have given one meanwhile.
  if (!looked_for_.exchange(false)) return {};
  numbers_ = found.data->numbers;
  taken_ = found;
  objections_.clear();
  is_over_ = false;
  is_about(found.data);
  is_found_ = true;
  return subject_json(*found.data);
}

}  // namespace kiroku::recorder
