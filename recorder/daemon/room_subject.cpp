#include <algorithm>
#include <exception>
#include <utility>

#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "recorder/daemon/kept_memory.h"
#include "recorder/daemon/kept_patient.h"
#include "recorder/daemon/room_state.h"

namespace kiroku::recorder {

namespace {

constexpr std::chrono::seconds kNoteInterval{30};  // between tries to write whom a case is about

}  // namespace

void Room::State::take_kept_patient(Resumption& resumed) const {
  KeptPatient kept = read_kept_patient(plan.memory.earlier);
  if (kept.case_id.empty() || kept.case_id != resumed.earlier.case_id) return;
  resumed.plan_patients = std::move(kept.plan_patients);
  // Whom another subject is about they do not say.
  if (!resumed.sealed_subject || kept.sealed_subject != hash_of(*resumed.sealed_subject)) return;
  resumed.patient_numbers = std::move(kept.numbers);
  if (!kept.about.empty()) resumed.about = data_of_subject(to_bytes(kept.about));
}

void Room::State::note_earlier_patient() {
  const KeptPatient kept = read_kept_patient(plan.memory.earlier);
  if (kept.about.empty()) return;
  case_subject.cut_off_before(data_of_subject(to_bytes(kept.about)), time.utc());
}

std::string Room::State::hash_of(const Bytes& sealed) { return crypto::to_hex(crypto::sha256(sealed)); }

void Room::State::keep_patient() {
  if (!plan.memory.keep) return;
  const std::lock_guard order(memory_mutex);
  KeptPatient kept;
  const std::optional<ProcedureData> about = case_subject.about();
  {
    const std::lock_guard guard(mutex);
    kept = {status.case_id, newest_subject ? hash_of(*newest_subject) : "", newest_numbers, plan_patients,
            ""};
  }
  if (about) kept.about = std::string(text_of(subject_json(*about)));
  plan.memory.keep(kept_bytes(kept));
}

void Room::State::forget_patient() {
  if (!plan.memory.keep) return;
  const std::lock_guard order(memory_mutex);
  // What was kept before the last time is there until it is written over.
  for (std::size_t file = 0; file < KeptMemory::kFiles; ++file) plan.memory.keep({});
}

std::optional<Bytes> Room::State::seal_subject(Request& asked) {
  GoesOn goes_on = GoesOn::kNo;
  if (asked.goes_on) {
    goes_on = asked.identity.sealed_subject ? GoesOn::kWithSubject
              : asked.is_subject_withheld   ? GoesOn::kSubjectWithheld
                                            : GoesOn::kWithoutSubject;
  }
  CaseSubject::Found found =
      case_subject.at_beginning(time.utc(), std::move(asked.subject), goes_on, std::move(asked.about));
  if (found.json) {
    asked.identity.sealed_subject = crypto::seal_bytes(*found.json, plan.session.event_recipients);
    asked.identity.patient_numbers = known_numbers(*found.json);
    asked.identity.search_words = search::words_of_subject(*found.json);
  }
  const std::lock_guard guard(mutex);
  status.subject = found.state;
  return std::move(found.json);
}

std::vector<PatientNumber> Room::State::known_numbers(const Bytes& subject) const {
  std::vector<PatientNumber> numbers = numbers_of_subject(subject);
  // A person may have given another patient.
  if (numbers.empty() || share_a_number(numbers, case_subject.numbers()))
    add_numbers(numbers, case_subject.numbers());
  return numbers;
}

std::vector<ProfileDecision> Room::State::decisions_for(const Request& asked,
                                                        const std::optional<Bytes>& subject) {
  std::vector<ProfileDecision> decisions;
  std::string rule;
  if (!asked.profiles.empty()) {
    for (const auto& [stream, profile] : asked.profiles)
      decisions.push_back({{stream}, profile, "recorder", "as the case ended with which this one goes on"});
  } else if (const auto choice = subject ? choose_profile(plan.profile_rules, *subject) : std::nullopt) {
    rule = choice->rule.name;
    decisions.push_back(
        {choice->rule.streams, choice->rule.profile, "rule " + choice->rule.name, choice->why});
    if (listener.note) listener.note("rule " + rule + " archives pictures as " + name_of(choice->rule));
  }
  std::erase_if(decisions, [this](const ProfileDecision& each) {
    return std::ranges::any_of(each.streams, [this](const std::string& name) {
      return std::ranges::none_of(plan.session.video, [&](const auto& one) { return one.name == name; });
    });
  });
  const std::lock_guard guard(mutex);
  status.profile_rule = rule;
  return decisions;
}

std::string Room::State::name_of(const ProfileRule& rule) { return std::string(profile_name(rule.profile)); }

void Room::State::tell_of_late_rule(Session& running, const Bytes& subject) {
  const auto choice = choose_profile(plan.profile_rules, subject);
  if (!choice) return;
  const SessionStatus now = running.status();
  const auto is_meant = [&](const std::string& name) {
    const auto& streams = choice->rule.streams;
    return streams.empty() || std::ranges::find(streams, name) != streams.end();
  };
  const bool differs = std::ranges::any_of(now.streams, [&](const StreamStatus& stream) {
    const std::string& profile = stream.profile_to_come.empty() ? stream.profile : stream.profile_to_come;
    return stream.is_video && is_meant(stream.name) && profile != name_of(choice->rule);
  });
  if (!differs) return;
  const std::string sentence = "the procedure became known while the case ran: rule " + choice->rule.name +
                               " would archive pictures as " + name_of(choice->rule) +
                               ", and they go on as they are";
  running.profile_unchanged(sentence + " (" + choice->why + ")");
  tell_problem(sentence + "; 'kiroku case profile " + name_of(choice->rule) + "' changes it");
}

void Room::State::state_missing_subject(Session& running) {
  const std::optional<std::string> why = case_subject.why_missing();
  if (!why) return;
  running.subject_missing(*why);
  tell_problem(*why);
}

void Room::State::give_late_subject(Session& running, const Bytes& subject) {
  {
    const std::lock_guard order(late_mutex);
    running.late_subject(subject);
    // The case after it has a patient of its own, whom the recorder may still look for.
    if (is_of_now(running)) {
      case_subject.given_while_running(subject);
      keep_late_subject(running, subject, {});
    }
  }
  tell_of_late_rule(running, subject);
}

void Room::State::look_for_late_subject(Session& running) {
  std::optional<Bytes> found;
  {
    const std::lock_guard order(late_mutex);
    if (not_noted && time.now() >= note_again) note_newest_subject();
    found = case_subject.late(time.now());
    if (!found) return;
    running.late_subject(*found, case_subject.numbers());
    keep_late_subject(running, *found, case_subject.numbers());
  }
  tell_of_late_rule(running, *found);
  if (listener.note) listener.note("procedure data came while the case ran");
}

void Room::State::look_for_contradiction(Session& running) {
  std::optional<std::string> how;
  {
    // Behind it a person may give another one.
    const std::lock_guard order(late_mutex);
    how = case_subject.contradicted(time.now());
    if (how) running.patient_differs(*how);
  }
  if (how) tell_problem(*how);
}

void Room::State::keep_late_subject(const Session& running, const Bytes& subject,
                                    const std::vector<PatientNumber>& further) {
  Bytes sealed = crypto::seal_bytes(subject, plan.session.event_recipients);
  if (plan.running && plan.session.key != nullptr) {
    not_noted = sign_newest_subject(running.case_id(), sealed, *plan.session.key);
    note_newest_subject();
  }
  {
    const std::lock_guard guard(mutex);
    if (session.get() != &running) return;
    status.subject = SubjectState::kLate;
    newest_subject = std::move(sealed);
    newest_numbers = numbers_of_subject(subject);
    add_numbers(newest_numbers, further);
  }
  keep_patient();
}

bool Room::State::is_of_now(const Session& running) const {
  const std::lock_guard guard(mutex);
  return session.get() == &running;
}

void Room::State::note_newest_subject() {
  try {
    plan.running->newest_subject(*not_noted);
    not_noted.reset();
    not_noted_why.clear();
  } catch (const std::exception& error) {
    note_again = time.now() + kNoteInterval;
    const std::string why = error.what();
    if (std::exchange(not_noted_why, why) != why)
      tell_problem("after a crash the operation would go on with the subject of before: " + why);
  }
}

}  // namespace kiroku::recorder
