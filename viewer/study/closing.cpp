#include "viewer/study/closing.h"

#include <algorithm>
#include <fstream>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "crypto/file_hash.h"
#include "viewer/study/answers.h"

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

Check check_file(const fs::path& folder, const std::string& name, std::uint64_t bytes,
                 const std::string& sha256) {
  try {
    const crypto::FileHash now = hash_of(folder / name);
    if (now.bytes == bytes && crypto::to_hex(now.sha256) == sha256)
      return {"file", State::kHolds, name + " is as it was"};
    return {"file", State::kDiffers, name + " was changed"};
  } catch (const Error& error) {
    return {"file", State::kDiffers, error.what()};
  }
}

}  // namespace

std::vector<Progress> progress_of(const fs::path& folder, const StudyOnDisk& study) {
  std::vector<Progress> all;
  for (std::size_t reader = 1; reader <= study.study.readers.size(); ++reader) {
    const AnswersOnDisk answers = read_answers(folder, study, reader);
    Progress& one = all.emplace_back();
    one.showings = study.study.readers[reader - 1].showings.size();
    one.answered = static_cast<std::size_t>(
        std::ranges::count_if(answers.newest, [](const auto& each) { return each.second.is_whole(); }));
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
    for (const ordered_json& one : json.at("readers"))
      found.closing.progress.push_back({one.at("answered"), one.at("showings")});
    std::vector<std::string> missing = bound_files(study.study);
    for (const ordered_json& one : json.at("files")) {
      const std::string name = one.at("name");
      // Only what belongs there: a name that leads elsewhere is not followed.
      const auto expected = std::ranges::find(missing, name);
      if (expected == missing.end()) throw UsageError(file.string() + " names what is no part of a study");
      missing.erase(expected);
      found.checks.push_back(check_file(folder, name, one.at("bytes"), one.at("sha256")));
    }
    for (const std::string& name : missing)
      found.checks.push_back({"file", State::kDiffers, "sealed.json does not name " + name});
  } catch (const nlohmann::json::exception& error) {
    throw UsageError(file.string() + " is no end of a study: " + error.what());
  }
  const crypto::FileHash key = hash_of(folder / kKeyFile);
  if (key.sha256 != study.study.key)
    found.checks.push_back({"key", State::kDiffers, "key.age is not the one that the study was made with"});
  return found;
}

std::vector<Check> check_films(const fs::path& folder, const Study& study) {
  std::vector<Check> checks;
  for (const Film& film : study.films) {
    const std::string name = std::string(kFilmsFolder) + "/" + film.name;
    checks.push_back(check_file(folder, name, film.bytes, crypto::to_hex(film.sha256)));
  }
  return checks;
}

}  // namespace kiroku::study
