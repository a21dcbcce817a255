// What the page of a blinded reading asks and is answered. Whoever asks names a reader's code; what a film is
// of is not known here.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"
#include "base/clock.h"
#include "http/message.h"
#include "viewer/study/answers.h"
#include "viewer/study/study.h"

namespace kiroku::study {

/// Holds the study from construction on. Thread-safe.
///
///   GET  /                the page; /study.css and /study.js with it
///   POST /begin           {"code"}: the reader's showings in their order, what was answered, the questions
///   GET  /films/TOKEN     the film of one showing
///   POST /answer          {"code", "showing", "points", "plays", "pictures", "dropped"}: on the disk when it
///                         is answered
class Desk {
 public:
  /// kiroku::UsageError for a folder that is no study, is closed, or is held by another; kiroku::IoError.
  Desk(archive::FileSystem& files, std::filesystem::path folder, const Clock& clock);
  ~Desk();
  Desk(const Desk&) = delete;
  Desk& operator=(const Desk&) = delete;

  http::Response answer(const http::Request& request);
  static http::Response refuse(const http::Refusal& refusal);
  [[nodiscard]] const Study& study() const { return study_.study; }

 private:
  http::Response begin(const http::Request& request);
  http::Response store(const http::Request& request);
  http::Response film(const std::string& token) const;
  /// From 1; 0 where nobody has the code.
  [[nodiscard]] std::size_t reader_of(const std::string& code) const;

  const std::filesystem::path folder_;
  const Clock& clock_;
  const StudyOnDisk study_;
  std::unique_ptr<archive::WritableFile> held_;
  std::map<std::string, std::string> films_;  // by token
  std::mutex mutex_;
  std::vector<std::unique_ptr<AnswerBook>> books_;
};

}  // namespace kiroku::study
