#include "viewer/study/study.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <set>
#include <sstream>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"

namespace kiroku::study {
namespace {

using nlohmann::ordered_json;

constexpr const char* kStudyFormat = "kiroku-study-1";
constexpr const char* kKeyFormat = "kiroku-study-key-1";
constexpr std::size_t kLongestQuestion = 300, kLargestFile = 16U << 20;

crypto::Sha256Digest digest_of(const std::string& hex) {
  const std::optional<Bytes> bytes = crypto::from_hex(hex);
  crypto::Sha256Digest digest{};
  if (!bytes || bytes->size() != digest.size()) throw UsageError("a hash in it is none");
  std::ranges::copy(*bytes, digest.begin());
  return digest;
}

bool is_hex(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

void require(bool holds, const char* what) {
  if (!holds) throw UsageError(what);
}

/// What `read` makes of a document; what is wrong with it becomes one sentence that names it.
template <typename Read>
auto document(std::string_view text, const char* format, const std::string& name, const std::string& what,
              Read read) {
  const auto json = parse_foreign_json<ordered_json>(text);
  try {
    require(json.is_object() && json.value("format", "") == format, "its format is another");
    return read(json);
  } catch (const nlohmann::json::exception& error) {
    throw UsageError(name + " is no " + what + ": " + error.what());
  } catch (const UsageError& error) {
    throw UsageError(name + " is no " + what + ": " + error.what());
  }
}

std::size_t number_below(const ordered_json& json, std::size_t limit) {
  require(json.is_number_unsigned() && json.get<std::uint64_t>() < limit, "a number in it is out of bounds");
  return json.get<std::size_t>();
}

Study study_of(const ordered_json& json) {
  Study study;
  study.id = json.at("study");
  require(is_hex(study.id), "its name is none");
  study.title = json.at("title");
  const std::optional<UtcTime> made = parse_utc(json.at("made_utc").get<std::string>());
  require(made.has_value(), "its time is none");
  study.made = *made;
  study.questions = json.at("questions").get<std::vector<std::string>>();
  require(!study.questions.empty() && study.questions.size() <= kMostQuestions,
          "it has no questions, or too many");
  const auto points = json.at("points").get<std::vector<std::string>>();
  require(points.size() == kPoints, "its points are not five");
  std::ranges::copy(points, study.points.begin());
  std::set<std::string> films, tokens, codes;
  for (const ordered_json& one : json.at("films")) {
    Film film{one.at("name"), one.at("bytes").get<std::uint64_t>(), digest_of(one.at("sha256"))};
    // A name that leads elsewhere is none.
    constexpr std::string_view kEnding = ".mp4";
    require(film.name.ends_with(kEnding) &&
                is_hex(std::string_view(film.name).substr(0, film.name.size() - kEnding.size())),
            "a film's name in it is none");
    require(films.insert(film.name).second, "a film stands twice in it");
    study.films.push_back(std::move(film));
  }
  require(!study.films.empty(), "it has no films");
  study.key = digest_of(json.at("key_sha256"));
  for (const ordered_json& one : json.at("readers")) {
    Reader reader{one.at("code"), {}};
    require(!reader.code.empty() && codes.insert(reader.code).second, "a reader's code stands twice in it");
    for (const ordered_json& shown : one.at("showings")) {
      Showing showing{shown.at("token"), shown.at("film")};
      require(is_hex(showing.token) && tokens.insert(showing.token).second, "a token stands twice in it");
      require(films.contains(showing.film), "it shows a film that it does not have");
      reader.showings.push_back(std::move(showing));
    }
    require(!reader.showings.empty(), "a reader in it sees nothing");
    study.readers.push_back(std::move(reader));
  }
  require(!study.readers.empty() && study.readers.size() <= kMostReaders, "it has no readers, or too many");
  return study;
}

StudyKey key_of(const ordered_json& json, const Study& study) {
  StudyKey key;
  key.study = json.at("study");
  require(key.study == study.id, "it is of another study");
  for (const ordered_json& one : json.at("clips"))
    key.clips.push_back({one.at("name"), one.at("pictures_are"), one.value("remark", "")});
  for (const ordered_json& one : json.at("codings"))
    key.codings.push_back({one.at("coding"), one.value("bit_rate", std::int64_t{0}), one.at("name")});
  std::set<std::pair<std::size_t, std::size_t>> places;
  std::set<std::string> names;
  for (const ordered_json& one : json.at("films")) {
    StudyKey::Film film{one.at("name"), number_below(one.at("clip"), key.clips.size()),
                        number_below(one.at("coding"), key.codings.size())};
    require(std::ranges::find(study.films, film.name, &Film::name) != study.films.end(),
            "it names a film that the study does not have");
    require(names.insert(film.name).second && places.emplace(film.clip, film.coding).second,
            "a film stands twice in it");
    key.films.push_back(std::move(film));
  }
  require(key.films.size() == study.films.size() && key.films.size() == key.clips.size() * key.codings.size(),
          "it does not name each film of the study");
  return key;
}

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return std::string(text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin));
}

}  // namespace

std::string study_text(const Study& study) {
  ordered_json json{{"format", kStudyFormat},
                    {"study", study.id},
                    {"title", study.title},
                    {"made_utc", format_utc(study.made)},
                    {"questions", study.questions},
                    {"points", study.points},
                    {"films", ordered_json::array()},
                    {"key_sha256", crypto::to_hex(study.key)},
                    {"readers", ordered_json::array()}};
  for (const Film& film : study.films) {
    json["films"].push_back(
        {{"name", film.name}, {"bytes", film.bytes}, {"sha256", crypto::to_hex(film.sha256)}});
  }
  for (const Reader& reader : study.readers) {
    ordered_json showings = ordered_json::array();
    for (const Showing& showing : reader.showings)
      showings.push_back({{"token", showing.token}, {"film", showing.film}});
    json["readers"].push_back({{"code", reader.code}, {"showings", std::move(showings)}});
  }
  return json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

Study parse_study(std::string_view text, const std::string& name_for_errors) {
  return document(text, kStudyFormat, name_for_errors, "study", study_of);
}

void require_no_pipe(const std::filesystem::path& file) {
  std::error_code unknown;
  if (std::filesystem::exists(file, unknown) && !std::filesystem::is_regular_file(file, unknown)) {
    throw UsageError(
        file.string() +
        " is no file but a folder, a pipe, a socket or a device: put the study's own file there");
  }
}

StudyOnDisk read_study(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kStudyFile;
  if (std::error_code failed; !std::filesystem::is_regular_file(file, failed)) {
    throw UsageError(folder.string() + " is no study's folder: it has no " + kStudyFile +
                     "; 'kiroku quality study make' makes one");
  }
  std::ifstream input(file, std::ios::binary);
  std::string text(kLargestFile + 1, '\0');
  input.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (input.bad()) throw IoError("read", file, EIO);
  text.resize(static_cast<std::size_t>(input.gcount()));
  if (text.size() > kLargestFile) throw UsageError(file.string() + " is too large for a study");
  return {parse_study(text, file.string()), crypto::sha256(bytes_of(text))};
}

std::string key_text(const StudyKey& key) {
  ordered_json json{{"format", kKeyFormat},
                    {"study", key.study},
                    {"clips", ordered_json::array()},
                    {"codings", ordered_json::array()},
                    {"films", ordered_json::array()}};
  for (const StudyKey::Clip& clip : key.clips) {
    ordered_json one{{"name", clip.name}, {"pictures_are", clip.pictures_are}};
    if (!clip.remark.empty()) one["remark"] = clip.remark;
    json["clips"].push_back(std::move(one));
  }
  for (const StudyKey::Coding& coding : key.codings) {
    ordered_json one{{"coding", coding.word}, {"name", coding.name}};
    if (coding.bit_rate > 0) one["bit_rate"] = coding.bit_rate;
    json["codings"].push_back(std::move(one));
  }
  for (const StudyKey::Film& film : key.films)
    json["films"].push_back({{"name", film.name}, {"clip", film.clip}, {"coding", film.coding}});
  return json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

StudyKey parse_key(std::string_view text, const Study& study) {
  return document(text, kKeyFormat, kKeyFile, "key of this study",
                  [&](const ordered_json& json) { return key_of(json, study); });
}

Questions usual_questions() {
  return {{"Can the appropriateness of this step be judged?", "Can the pattern of the mucosa be judged?"},
          {"not at all", "hardly", "in part", "well enough", "fully"}};
}

Questions parse_questions(std::string_view text, const std::string& name_for_errors) {
  Questions found{{}, usual_questions().points};
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    line = trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    if (line.size() > kLongestQuestion) {
      throw UsageError(name_for_errors + " has a line of " + std::to_string(line.size()) +
                       " bytes; a question has at most " + std::to_string(kLongestQuestion));
    }
    const bool of_points = line.size() > 2 && line[0] >= '1' && line[0] < '1' + kPoints && line[1] == ':';
    if (of_points) {
      found.points.at(static_cast<std::size_t>(line[0] - '1')) = trimmed(std::string_view(line).substr(2));
    } else {
      found.questions.push_back(line);
    }
  }
  if (found.questions.empty() || found.questions.size() > kMostQuestions) {
    throw UsageError(name_for_errors + " has " + std::to_string(found.questions.size()) +
                     " questions; a study asks from 1 to " + std::to_string(kMostQuestions) + ", one a line");
  }
  return found;
}

std::string answers_name(std::size_t reader) {
  return std::string(kAnswersFolder) + "/reader-" + std::to_string(reader) + ".jsonl";
}

}  // namespace kiroku::study
