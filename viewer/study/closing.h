// The end of a reading: what the answers are is frozen before anybody opens the key.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "archive/storage/file_system.h"
#include "base/bytes.h"
#include "base/check.h"
#include "crypto/hash.h"
#include "viewer/study/answers.h"
#include "viewer/study/study.h"

namespace kiroku::study {

/// How far a reader is.
struct Progress {
  std::size_t answered = 0, showings = 0;
  [[nodiscard]] bool is_done() const { return answered == showings; }
};
/// Of all readers. Throws as read_answers().
std::vector<Progress> progress_of(const std::filesystem::path& folder, const StudyOnDisk& study);

/// One program at a time shows films or closes. kiroku::UsageError where another one does.
std::unique_ptr<archive::WritableFile> hold_study(archive::FileSystem& files,
                                                  const std::filesystem::path& folder);

bool is_closed(const std::filesystem::path& folder);

/// Writes sealed.json: the hashes of study.json, key.age and every reader's answers, and how far each reader
/// was. Returns its own hash. kiroku::UsageError where it is closed already; kiroku::IoError.
crypto::Sha256Digest close_study(archive::FileSystem& files, const std::filesystem::path& folder,
                                 const StudyOnDisk& study, UtcTime utc);

struct Closing {
  UtcTime utc;
  crypto::Sha256Digest sha256{};   // of sealed.json
  std::vector<Progress> progress;  // by the answers
};
/// What sealed.json says, and a check for each file that it names, for how far it says that readers were, and
/// for the films. kiroku::UsageError for a study that is not closed, and a sealed.json that is none.
/// Whoever can write the folder can exchange a file at any time: `key` and `answers` are of the bytes that
/// were compared with their hashes. Where a check differs they are not to be used, and may not be there.
struct ClosedStudy {
  Closing closing;
  std::vector<Check> checks;
  Bytes key;                           // as sealed
  std::vector<NewestAnswers> answers;  // of each reader
};
ClosedStudy check_closed(const std::filesystem::path& folder, const StudyOnDisk& study);

/// Whether the films are those that the study was made with. Throws nothing: what cannot be read differs.
std::vector<Check> check_films(const std::filesystem::path& folder, const Study& study);

}  // namespace kiroku::study
