// The answers of one reader: a file that is only ever added to, whose lines hold each other.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "archive/storage/file_system.h"
#include "base/utc_time.h"
#include "crypto/hash.h"
#include "viewer/study/study.h"

namespace kiroku::study {

/// How the film ran before the reader, as the browser counted.
struct Seen {
  std::uint64_t plays = 0;     // how often it came to its end
  std::uint64_t pictures = 0;  // that were due
  std::uint64_t dropped = 0;   // of those, never shown
};

struct Answer {
  std::string showing;      // its token
  std::vector<int> points;  // of each question; 0: not answered yet
  Seen seen;
  UtcTime utc;  // the machine's opinion
  [[nodiscard]] bool is_whole() const;
};

inline constexpr std::size_t kLargestAnswers = std::size_t{64} << 20U;

/// The newest answer to each showing, by token.
using NewestAnswers = std::map<std::string, Answer>;

struct AnswersOnDisk {
  NewestAnswers newest;
  std::uint64_t lines = 0;
  crypto::Sha256Digest last{};    // hash of the last line, or of study.json before the first
  std::uint64_t whole_bytes = 0;  // of the lines; what follows was cut off in writing and never confirmed
};
/// The reader's answers, by the bytes of their file. Each line states the hash of the one before; the first
/// one that of study.json. kiroku::UsageError naming the line for one that this program did not write there.
AnswersOnDisk parse_answers(const std::string& text, const std::filesystem::path& name_for_errors,
                            const StudyOnDisk& study, std::size_t reader);
/// As they lie in the folder; likewise. No file: no answers.
AnswersOnDisk read_answers(const std::filesystem::path& folder, const StudyOnDisk& study, std::size_t reader);

/// Adds to them. One thread at a time.
class AnswerBook {
 public:
  /// Reads what is there, and cuts off what a crash left half written. `reader` counts from 1. Throws as
  /// read_answers(); kiroku::IoError.
  AnswerBook(archive::FileSystem& files, const std::filesystem::path& folder, const StudyOnDisk& study,
             std::size_t reader);
  /// On the disk when it returns. After a kiroku::IoError the book takes nothing more: whether the line is
  /// there is not known until it is read anew.
  void add(const Answer& answer);
  [[nodiscard]] const NewestAnswers& newest() const { return on_disk_.newest; }
  [[nodiscard]] std::uint64_t lines() const { return on_disk_.lines; }

 private:
  const std::filesystem::path name_;
  AnswersOnDisk on_disk_;
  std::unique_ptr<archive::WritableFile> file_;
  bool failed_ = false;
};

}  // namespace kiroku::study
