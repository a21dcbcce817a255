// A blinded reading of coded films: what a study's folder holds, and what of it is sealed.
//
//   study.json          questions, films under random names, who sees which of them in which order
//   key.age             which film is which clip in which coding, sealed to whoever opens it in the end
//   films/NAME.mp4      all of one size
//   answers/reader-N.jsonl
//   sealed.json         what the answers were when the study was closed; tokens beside it
//
// Plain values; pure functions, thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::study {

inline constexpr const char* kStudyFile = "study.json";
inline constexpr const char* kKeyFile = "key.age";
inline constexpr const char* kFilmsFolder = "films";
inline constexpr const char* kAnswersFolder = "answers";
inline constexpr const char* kSealedFile = "sealed.json";

/// Answers are from 1 to this.
inline constexpr int kPoints = 5;
inline constexpr std::size_t kMostReaders = 100, kMostQuestions = 10;

struct Film {
  std::string name;  // of its file, which tells nothing: "5f0c9a7e1b2d3c4f.mp4"
  std::uint64_t bytes = 0;
  crypto::Sha256Digest sha256{};
};

/// One film before one reader. A film that a reader sees again has another token.
struct Showing {
  std::string token;  // what the page knows it by: random, and of this showing alone
  std::string film;
};

struct Reader {
  std::string code;  // what the reader signs in with: "7KQM-3XWD"
  std::vector<Showing> showings;
};

struct Study {
  std::string id;
  std::string title;
  UtcTime made;
  std::vector<std::string> questions;
  std::array<std::string, kPoints> points;  // what 1 to 5 mean
  std::vector<Film> films;
  crypto::Sha256Digest key{};  // of key.age
  std::vector<Reader> readers;
};

/// The whole file, and back. kiroku::UsageError naming `name_for_errors` for what is no study, or one that
/// this program would not have made.
std::string study_text(const Study& study);
Study parse_study(std::string_view text, const std::string& name_for_errors);

/// Whoever hands over a study's folder may have put a pipe or a device there, which gives no end of bytes, or
/// none at all. Throws kiroku::UsageError for what is there and no file.
void require_no_pipe(const std::filesystem::path& file);

/// The study in `folder`, and the hash of its file. kiroku::UsageError, kiroku::IoError.
struct StudyOnDisk {
  Study study;
  crypto::Sha256Digest sha256{};
};
StudyOnDisk read_study(const std::filesystem::path& folder);

/// What is sealed until the study is closed.
struct StudyKey {
  struct Clip {
    std::string name;          // of its file, without its folder
    std::string pictures_are;  // "1280x720 yuv420p"
    std::string remark;        // what a browser cannot show of it; "" where there is nothing
  };
  struct Coding {
    std::string word;           // "mpeg2"
    std::int64_t bit_rate = 0;  // bit/s; 0 where it has none
    std::string name;           // for people: "MPEG-2 4:2:0, 4 Mbit/s"
  };
  struct Film {
    std::string name;
    std::size_t clip = 0, coding = 0;
  };
  std::string study;  // its id
  std::vector<Clip> clips;
  std::vector<Coding> codings;
  std::vector<Film> films;
};
std::string key_text(const StudyKey& key);
/// kiroku::UsageError for what is no key, or not of this study: each film once, each clip in each coding.
StudyKey parse_key(std::string_view text, const Study& study);

/// Questions and the words of points from a text: a question a line; lines "1: word" to "5: word" say what
/// points mean; lines that begin with '#' and empty ones are passed over. kiroku::UsageError naming
/// `name_for_errors` for none, too many, and too long ones.
struct Questions {
  std::vector<std::string> questions;
  std::array<std::string, kPoints> points;
};
Questions parse_questions(std::string_view text, const std::string& name_for_errors);
/// What the study of Keio University Hospital (2006) asked two surgeons of films of laparoscopy and EMR: the
/// appropriateness of a step, and the mucosa's pattern.
Questions usual_questions();

/// "answers/reader-1.jsonl", counted from 1.
std::string answers_name(std::size_t reader);

}  // namespace kiroku::study
