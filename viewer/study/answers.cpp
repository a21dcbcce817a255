#include "viewer/study/answers.h"

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

std::string line_of(const Answer& answer, std::uint64_t number, const crypto::Sha256Digest& previous) {
  const ordered_json json{{"line", number},
                          {"utc", format_utc(answer.utc)},
                          {"showing", answer.showing},
                          {"points", answer.points},
                          {"plays", answer.seen.plays},
                          {"pictures", answer.seen.pictures},
                          {"dropped", answer.seen.dropped},
                          {"previous", crypto::to_hex(previous)}};
  return json.dump();
}

/// "" where the answer may stand there, else what is wrong.
std::string problem_of(const ordered_json& json, const AnswersOnDisk& before, const Study& study,
                       const std::set<std::string>& tokens, Answer& answer) {
  if (!json.is_object()) return "is no answer";
  try {
    if (json.at("line").get<std::uint64_t>() != before.lines + 1) return "has another number";
    if (json.at("previous").get<std::string>() != crypto::to_hex(before.last))
      return "does not follow from what stands before it";
    answer.showing = json.at("showing").get<std::string>();
    answer.points = json.at("points").get<std::vector<int>>();
    answer.seen = {json.at("plays").get<std::uint64_t>(), json.at("pictures").get<std::uint64_t>(),
                   json.at("dropped").get<std::uint64_t>()};
    const std::optional<UtcTime> utc = parse_utc(json.at("utc").get<std::string>());
    if (!utc) return "has no time";
    answer.utc = *utc;
  } catch (const nlohmann::json::exception& error) {
    return std::string("is no answer: ") + error.what();
  }
  if (!tokens.contains(answer.showing)) return "answers what this reader was not shown";
  const bool fits = answer.points.size() == study.questions.size() &&
                    std::ranges::all_of(answer.points, [](int one) { return one >= 0 && one <= kPoints; });
  return fits ? "" : "has points that nobody could give";
}

}  // namespace

bool Answer::is_whole() const {
  return std::ranges::all_of(points, [](int one) { return one > 0; });
}

AnswersOnDisk read_answers(const std::filesystem::path& folder, const StudyOnDisk& study,
                           std::size_t reader) {
  const std::filesystem::path file = folder / answers_name(reader);
  if (!std::filesystem::exists(file)) return parse_answers("", file, study, reader);
  require_no_pipe(file);
  std::ifstream input(file, std::ios::binary);
  std::ostringstream all;
  if (std::filesystem::file_size(file) > kLargestAnswers)
    throw UsageError(file.string() + " is too large for one reader's answers");
  if (std::filesystem::file_size(file) > 0) all << input.rdbuf();
  if (!input) throw IoError("read", file, EIO);
  return parse_answers(all.str(), file, study, reader);
}

AnswersOnDisk parse_answers(const std::string& text, const std::filesystem::path& file,
                            const StudyOnDisk& study, std::size_t reader) {
  AnswersOnDisk found;
  found.last = study.sha256;
  std::set<std::string> tokens;
  for (const Showing& showing : study.study.readers.at(reader - 1).showings) tokens.insert(showing.token);
  for (std::size_t begin = 0, end = 0; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    Answer answer;
    const std::string problem =
        problem_of(parse_foreign_json<ordered_json>(line), found, study.study, tokens, answer);
    if (!problem.empty()) {
      throw UsageError("line " + std::to_string(found.lines + 1) + " of " + file.string() + " " + problem +
                       ": somebody changed it, or it is of another study");
    }
    ++found.lines;
    found.last = crypto::sha256(bytes_of(line));
    found.whole_bytes = end + 1;
    found.newest[answer.showing] = std::move(answer);
  }
  return found;
}

AnswerBook::AnswerBook(archive::FileSystem& files, const std::filesystem::path& folder,
                       const StudyOnDisk& study, std::size_t reader)
    : name_(folder / answers_name(reader)), on_disk_(read_answers(folder, study, reader)) {
  if (std::filesystem::exists(name_)) {
    file_ = files.append_to(name_);
    if (std::filesystem::file_size(name_) > on_disk_.whole_bytes) {
      file_->truncate(on_disk_.whole_bytes);
      file_->sync();
    }
  } else {
    file_ = files.create(name_);
    file_->sync_all();
    files.sync_folder(name_.parent_path());
  }
}

void AnswerBook::add(const Answer& answer) {
  if (failed_) {
    throw Error("answers cannot be written to " + name_.string() +
                " since an error of the disk; end 'kiroku quality study serve' and start it anew");
  }
  const std::string line = line_of(answer, on_disk_.lines + 1, on_disk_.last);
  failed_ = true;
  file_->write(bytes_of(line + "\n"));
  file_->sync();
  failed_ = false;
  ++on_disk_.lines;
  on_disk_.last = crypto::sha256(bytes_of(line));
  on_disk_.newest[answer.showing] = answer;
}

}  // namespace kiroku::study
