#include "viewer/study/closing.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <optional>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "crypto/file_hash.h"

namespace kiroku::study {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using State = Check::Answer;

constexpr const char* kFormat = "kiroku-study-seal-1";
constexpr const char* kLock = ".held";

std::vector<std::string> bound_files(const Study& study) {
  std::vector<std::string> names{kStudyFile, kKeyFile};
  for (std::size_t reader = 1; reader <= study.readers.size(); ++reader)
    names.push_back(answers_name(reader));
  return names;
}

/// A study's folder is given from hand to hand: what is no file in it is refused in the study's own words.
crypto::FileHash hash_of(const fs::path& file) {
  require_no_pipe(file);
  return crypto::hash_file(file);
}

/// What sealed.json, or study.json, says of a file.
struct Listed {
  std::string name;
  std::uint64_t bytes = 0;
  std::string sha256;
};

Check as_it_was(const Listed& listed, bool same) {
  return {"file", same ? State::kHolds : State::kDiffers,
          listed.name + (same ? " is as it was" : " was changed")};
}

/// No more is read than was there: what lies there now can be as long as one likes.
bool has_length(const fs::path& file, std::uint64_t bytes) {
  require_no_pipe(file);
  std::error_code unknown;
  const std::uintmax_t size = fs::file_size(file, unknown);
  return unknown || size == bytes;  // reading it says why
}

Check check_film(const fs::path& folder, const Listed& listed) {
  try {
    const fs::path file = folder / listed.name;
    return as_it_was(listed,
                     has_length(file, listed.bytes) && crypto::to_hex(hash_of(file).sha256) == listed.sha256);
  } catch (const Error& error) {
    return {"file", State::kDiffers, error.what()};
  }
}

/// The bytes of a file of the study, if they are those that are listed; whatever is made of it is made of
/// them.
std::optional<std::string> read_listed(const fs::path& folder, const Listed& listed) {
  const fs::path file = folder / listed.name;
  if (!has_length(file, listed.bytes)) return std::nullopt;
  if (listed.bytes > kLargestAnswers) throw UsageError(file.string() + " is too large for a study's file");
  std::ifstream input(file, std::ios::binary);
  if (!input) throw IoError("read", file, ENOENT);
  std::string text(listed.bytes + 1, '\0');
  input.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (input.bad()) throw IoError("read", file, EIO);
  text.resize(static_cast<std::size_t>(input.gcount()));
  if (text.size() != listed.bytes || crypto::to_hex(crypto::sha256(bytes_of(text))) != listed.sha256)
    return std::nullopt;
  return text;
}

Progress progress_in(const Study& study, std::size_t reader, const NewestAnswers& newest) {
  return {static_cast<std::size_t>(
              std::ranges::count_if(newest, [](const auto& each) { return each.second.is_whole(); })),
          study.readers.at(reader - 1).showings.size()};
}

std::string progress_text(const Progress& progress) {
  return std::to_string(progress.answered) + " of " + std::to_string(progress.showings);
}

/// What the seal says of how far readers were is no part of their answers: whoever made the seal wrote it.
void compare_progress(const Study& study, const std::vector<Progress>& stated, ClosedStudy& found) {
  for (std::size_t i = 0; i < found.answers.size(); ++i)
    found.closing.progress.push_back(progress_in(study, i + 1, found.answers[i]));
  if (stated.size() != found.answers.size()) {
    found.checks.push_back({"progress", State::kDiffers,
                            "sealed.json speaks of " + std::to_string(stated.size()) +
                                " readers, and there are " + std::to_string(found.answers.size())});
    return;
  }
  for (std::size_t i = 0; i < stated.size(); ++i) {
    const Progress& answers = found.closing.progress[i];
    if (stated[i].answered == answers.answered && stated[i].showings == answers.showings) continue;
    found.checks.push_back({"progress", State::kDiffers,
                            "sealed.json says that reader " + std::to_string(i + 1) + " judged " +
                                progress_text(stated[i]) + " films, and the answers are of " +
                                progress_text(answers)});
  }
}

void add_films(const fs::path& folder, const Study& study, std::vector<Check>& checks) {
  std::vector<Check> films = check_films(folder, study);
  std::erase_if(films, [](const Check& check) { return check.answer == State::kHolds; });
  if (films.empty())
    films.push_back(
        {"films", State::kHolds,
         "all " + std::to_string(study.films.size()) + " films are those that the study was made with"});
  std::ranges::move(films, std::back_inserter(checks));
}

/// A check of the file, of whose bytes `found` takes what it needs.
Check check_listed(const fs::path& folder, const StudyOnDisk& study, const Listed& listed,
                   ClosedStudy& found) {
  try {
    // The study was parsed before: its hash is that of the bytes that it is made of.
    if (listed.name == kStudyFile) return as_it_was(listed, crypto::to_hex(study.sha256) == listed.sha256);
    const std::optional<std::string> text = read_listed(folder, listed);
    if (!text) return as_it_was(listed, false);
    if (listed.name == kKeyFile) {
      found.key = to_bytes(*text);
    } else {
      for (std::size_t reader = 1; reader <= study.study.readers.size(); ++reader) {
        if (listed.name == answers_name(reader))
          found.answers.at(reader - 1) = parse_answers(*text, folder / listed.name, study, reader).newest;
      }
    }
    return as_it_was(listed, true);
  } catch (const Error& error) {
    return {"file", State::kDiffers, error.what()};
  }
}

}  // namespace

std::vector<Progress> progress_of(const fs::path& folder, const StudyOnDisk& study) {
  std::vector<Progress> all;
  for (std::size_t reader = 1; reader <= study.study.readers.size(); ++reader) {
    all.push_back(progress_in(study.study, reader, read_answers(folder, study, reader).newest));
  }
  return all;
}

std::unique_ptr<archive::WritableFile> hold_study(archive::FileSystem& files, const fs::path& folder) {
  const fs::path lock = folder / kAnswersFolder / kLock;
  auto file = fs::exists(lock) ? files.append_to(lock) : files.create(lock);
  if (!file->try_lock()) {
    throw UsageError("another program shows the films of " + folder.string() +
                     " or closes it; end 'kiroku quality study serve' first");
  }
  return file;
}

bool is_closed(const fs::path& folder) { return fs::exists(folder / kSealedFile); }

crypto::Sha256Digest close_study(archive::FileSystem& files, const fs::path& folder, const StudyOnDisk& study,
                                 UtcTime utc) {
  if (is_closed(folder)) {
    throw UsageError(folder.string() + " is closed already; 'kiroku quality study report' opens it");
  }
  ordered_json json{{"format", kFormat},
                    {"study", study.study.id},
                    {"closed_utc", format_utc(utc)},
                    {"readers", ordered_json::array()},
                    {"files", ordered_json::array()}};
  for (const Progress& one : progress_of(folder, study))
    json["readers"].push_back({{"showings", one.showings}, {"answered", one.answered}});
  for (const std::string& name : bound_files(study.study)) {
    // Who answered nothing has no file yet.
    if (!fs::exists(folder / name)) files.write_durably(folder / name, {});
    const crypto::FileHash hash = hash_of(folder / name);
    json["files"].push_back({{"name", name}, {"bytes", hash.bytes}, {"sha256", crypto::to_hex(hash.sha256)}});
  }
  const std::string text = json.dump(1) + "\n";
  files.write_durably(folder / kSealedFile, bytes_of(text));
  return crypto::sha256(bytes_of(text));
}

ClosedStudy check_closed(const fs::path& folder, const StudyOnDisk& study) {
  if (!is_closed(folder)) {
    throw UsageError(folder.string() +
                     " is not closed: until then its key stays closed, too; 'kiroku quality study close' "
                     "freezes the answers");
  }
  const fs::path file = folder / kSealedFile;
  constexpr std::size_t kLargest = 1U << 20;
  require_no_pipe(file);
  std::ifstream input(file, std::ios::binary);
  std::string text(kLargest, '\0');
  input.read(text.data(), kLargest);
  text.resize(static_cast<std::size_t>(input.gcount()));
  ClosedStudy found;
  found.closing.sha256 = crypto::sha256(bytes_of(text));
  const auto json = parse_foreign_json<ordered_json>(text);
  try {
    if (json.at("format") != kFormat || json.at("study") != study.study.id)
      throw UsageError(file.string() + " is of another study");
    const std::optional<UtcTime> utc = parse_utc(json.at("closed_utc").get<std::string>());
    if (!utc) throw UsageError(file.string() + " does not say when the study was closed");
    found.closing.utc = *utc;
    std::vector<Progress> stated;
    for (const ordered_json& one : json.at("readers"))
      stated.push_back({one.at("answered"), one.at("showings")});
    found.answers.resize(study.study.readers.size());
    std::vector<std::string> missing = bound_files(study.study);
    for (const ordered_json& one : json.at("files")) {
      const std::string name = one.at("name");
      // Only what belongs there: a name that leads elsewhere is not followed.
      const auto expected = std::ranges::find(missing, name);
      if (expected == missing.end()) throw UsageError(file.string() + " names what is no part of a study");
      missing.erase(expected);
      found.checks.push_back(check_listed(folder, study, {name, one.at("bytes"), one.at("sha256")}, found));
    }
    for (const std::string& name : missing)
      found.checks.push_back({"file", State::kDiffers, "sealed.json does not name " + name});
    // Of answers that were changed nobody can say how far they go.
    if (verdict_of(found.checks) == State::kHolds) compare_progress(study.study, stated, found);
  } catch (const nlohmann::json::exception& error) {
    throw UsageError(file.string() + " is no end of a study: " + error.what());
  }
  if (found.key.empty() || crypto::sha256(found.key) != study.study.key)
    found.checks.push_back({"key", State::kDiffers, "key.age is not the one that the study was made with"});
  add_films(folder, study.study, found.checks);
  return found;
}

std::vector<Check> check_films(const fs::path& folder, const Study& study) {
  std::vector<Check> checks;
  for (const Film& film : study.films) {
    const std::string name = std::string(kFilmsFolder) + "/" + film.name;
    checks.push_back(check_film(folder, {name, film.bytes, crypto::to_hex(film.sha256)}));
  }
  return checks;
}

}  // namespace kiroku::study
