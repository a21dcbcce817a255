// What a session has read of sealed subjects: patients, procedures, staff. In memory alone, and no longer
// than the session is unlocked (Session::subjects()). Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/age_recipient.h"
#include "viewer/http/file_stamp.h"
#include "viewer/playback/case_place.h"
#include "viewer/playback/case_subject.h"

namespace kiroku::viewer {

/// What is known of a case's subject. Immutable.
struct ShelvedSubject {
  enum class State {
    kNone,      // nothing was sealed
    kShown,     // `subjects`
    kNotYours,  // the identities open none of it
    kProblem,   // `problem` says why it cannot be read
  };
  State state = State::kNone;
  std::vector<playback::CaseSubject> subjects;
  std::string problem;  // a sentence without anything of the content
  /// Whether one of the subjects has this text (in lower case: base/ascii.h).
  [[nodiscard]] bool has(const std::string& word) const;
};

/// "none", "shown", "not-yours", "problem".
std::string_view subject_state_name(ShelvedSubject::State state);

class SubjectShelf {
 public:
  using Entry = std::shared_ptr<const ShelvedSubject>;

  explicit SubjectShelf(std::shared_ptr<const crypto::AgeIdentities> identities)
      : identities_(std::move(identities)) {}
  ~SubjectShelf();
  SubjectShelf(const SubjectShelf&) = delete;
  SubjectShelf& operator=(const SubjectShelf&) = delete;

  /// Of the case at this place; read anew where a file that it was read from has changed since: the ledger,
  /// the subject file, segments of events (viewer/http/file_stamp.h). Two who ask
  /// at once may both read it. Throws nothing but std::bad_alloc.
  [[nodiscard]] Entry of(const playback::CasePlace& place);
  /// The same where it is known already; null where it must be read first.
  [[nodiscard]] Entry known(const std::filesystem::path& folder) const;

 private:
  struct Kept {
    std::map<std::filesystem::path, FileStamp> files;  // before they were read
    Entry entry;
  };
  const std::shared_ptr<const crypto::AgeIdentities> identities_;
  mutable std::mutex mutex_;
  std::map<std::filesystem::path, Kept> kept_;  // by the case's folder
};

}  // namespace kiroku::viewer
