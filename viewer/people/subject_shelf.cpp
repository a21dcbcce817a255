#include "viewer/people/subject_shelf.h"

#include <algorithm>

#include "archive/format/case_layout.h"
#include "archive/format/pointing_stream.h"
#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "crypto/age_error.h"

namespace kiroku::viewer {
namespace {

using Stamps = std::map<std::filesystem::path, FileStamp>;

/// Of the files that patient, procedure and staff of an open case are read from, beside its ledger.
void add_stamps(const archive::CaseReader& recording, Stamps& stamps) {
  const std::filesystem::path& folder = recording.folder();
  if (const auto& subject = recording.opening().subject)
    stamps[folder / subject->file] = file_stamp(folder / subject->file);
  for (const archive::StreamInfo& stream : recording.opening().streams) {
    if (stream.kind != "events" || archive::is_pointing(stream)) continue;
    for (const archive::SegmentEntry& segment : recording.segments(stream.name, INT64_MIN, INT64_MAX))
      stamps[folder / segment.file.file] = file_stamp(folder / segment.file.file);
  }
}

ShelvedSubject read(const playback::CasePlace& place, const crypto::AgeIdentities& identities,
                    Stamps& stamps) {
  using State = ShelvedSubject::State;
  ShelvedSubject out;
  try {
    const playback::CaseMedia media(place.read(), identities, place.segments);
    add_stamps(media.recording(), stamps);
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
  Kept kept;
  {
    const std::lock_guard guard(mutex_);
    const auto found = kept_.find(folder);
    if (found == kept_.end()) return nullptr;
    kept = found->second;
  }
  const bool is_as_read =
      std::ranges::all_of(kept.files, [](const auto& file) { return file_stamp(file.first) == file.second; });
  return is_as_read ? kept.entry : nullptr;
}

SubjectShelf::Entry SubjectShelf::of(const playback::CasePlace& place) {
  const std::filesystem::path& folder = place.folder;
  if (Entry entry = known(folder)) return entry;
  Stamps stamps{{folder / archive::kLedgerFile, file_stamp(folder / archive::kLedgerFile)}};
  auto entry = std::make_shared<const ShelvedSubject>(read(place, *identities_, stamps));
  const std::lock_guard guard(mutex_);
  kept_[folder] = {std::move(stamps), entry};
  return entry;
}

}  // namespace kiroku::viewer
