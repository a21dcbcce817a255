#include "viewer/server/subject_shelf.h"

#include <algorithm>

#include "archive/case_layout.h"
#include "archive/case_reader.h"
#include "base/error.h"
#include "crypto/age_error.h"

namespace kiroku::viewer {
namespace {

std::uintmax_t ledger_bytes_of(const std::filesystem::path& folder) {
  std::error_code failed;
  const std::uintmax_t bytes = std::filesystem::file_size(folder / archive::kLedgerFile, failed);
  return failed ? 0 : bytes;
}

ShelvedSubject read(const std::filesystem::path& folder, const crypto::AgeIdentities& identities) {
  using State = ShelvedSubject::State;
  ShelvedSubject out;
  try {
    const playback::CaseMedia media(archive::CaseReader::open(folder), identities);
    out.subjects = playback::subjects_of(media);
    out.state = out.subjects.empty() ? State::kNone : State::kShown;
  } catch (const crypto::AgeError& error) {
    out.state =
        error.failure() == crypto::AgeFailure::kNoMatch ? State::kNotYours : ShelvedSubject::State::kProblem;
    out.problem = error.what();
  } catch (const Error& error) {
    out.state = State::kProblem;
    out.problem = error.what();
  }
  return out;
}

}  // namespace

std::string_view subject_state_name(ShelvedSubject::State state) {
  switch (state) {
    case ShelvedSubject::State::kNone:
      return "none";
    case ShelvedSubject::State::kShown:
      return "shown";
    case ShelvedSubject::State::kNotYours:
      return "not-yours";
    case ShelvedSubject::State::kProblem:
      break;
  }
  return "problem";
}

bool ShelvedSubject::has(const std::string& word) const {
  return std::ranges::any_of(subjects, [&](const playback::CaseSubject& subject) {
    return subject.searchable.find(word) != std::string::npos;
  });
}

SubjectShelf::~SubjectShelf() = default;

SubjectShelf::Entry SubjectShelf::known(const std::filesystem::path& folder) const {
  const std::uintmax_t bytes = ledger_bytes_of(folder);
  const std::lock_guard guard(mutex_);
  const auto found = kept_.find(folder.filename().string());
  return found != kept_.end() && found->second.ledger_bytes == bytes ? found->second.entry : nullptr;
}

SubjectShelf::Entry SubjectShelf::of(const std::filesystem::path& folder) {
  if (Entry entry = known(folder)) return entry;
  const std::uintmax_t bytes = ledger_bytes_of(folder);
  auto entry = std::make_shared<const ShelvedSubject>(read(folder, *identities_));
  const std::lock_guard guard(mutex_);
  kept_[folder.filename().string()] = {bytes, entry};
  return entry;
}

}  // namespace kiroku::viewer
