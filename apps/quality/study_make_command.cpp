// 'kiroku quality study make'.
#include <algorithm>
#include <cmath>
#include <fcntl.h>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <set>
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/quality/coding_options.h"
#include "apps/quality/study_command.h"
#include "apps/sim/number_option.h"
#include "base/clock.h"
#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/file_hash.h"
#include "media/output_file.h"
#include "media/output_folder.h"
#include "recorder/quality/shown_film.h"
#include "viewer/study/closing.h"
#include "viewer/study/order.h"
#include "viewer/study/study.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::vector<std::string> clips, recipients, recipient_files;
  CodingOptions coding;
  StretchOptions stretch;
  std::string output, readers = "2", repeats = "20";
  std::optional<std::string> questions, title;
  bool force = false, json = false;
};

/// The two that surgeons were shown in the study that this follows.
std::vector<recorder::Coding> codings_of_keio() {
  constexpr std::int64_t kRate = 4'000'000;
  return {{recorder::CodingFamily::kMpeg2, kRate}, {recorder::CodingFamily::kUncompressed, 0}};
}

std::vector<recorder::Coding> wanted_codings(const CodingOptions& options) {
  std::vector<recorder::Coding> codings = codings_of(options, codings_of_keio());
  std::set<std::string> names;
  for (const recorder::Coding& one : codings) {
    if (!names.insert(one.name()).second) throw UsageError(one.name() + " is asked for twice");
  }
  if (codings.size() < 2)
    throw UsageError("a study compares codings, and " + codings.front().name() +
                     " is the only one: name another with --coding or --rate");
  return codings;
}

crypto::AgeRecipients recipients_of(const Request& request) {
  crypto::AgeRecipients recipients;
  for (const std::string& text : request.recipients) recipients.push_back(crypto::parse_recipient(text));
  for (const std::string& file : request.recipient_files) {
    for (auto& one : load_recipients(file)) recipients.push_back(std::move(one));
  }
  if (recipients.empty()) {
    throw UsageError(
        "nobody could open the key: name with -r age1... who will, best somebody who does not run the "
        "reading, or a file of such with -R");
  }
  return recipients;
}

study::Questions questions_of(const Request& request) {
  if (!request.questions) return study::usual_questions();
  return study::parse_questions(text_of(read_small_file(*request.questions, "the questions")),
                                *request.questions);
}

std::vector<std::string> names_of(const std::vector<std::string>& clips) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  for (const std::string& clip : clips) {
    const std::string own = fs::path(clip).filename().string();
    std::string name = own;
    for (int number = 2; !taken.insert(name).second; ++number)
      name = own + " (" + std::to_string(number) + ")";
    names.push_back(name);
  }
  return names;
}

void write(const fs::path& file, ByteView bytes) {
  media::OutputFile out(file, false);
  out.write(bytes);
  out.commit();
}

std::string why_kept(const fs::path& folder) {
  if (!fs::exists(folder / study::kStudyFile))
    return "it has no " + std::string(study::kStudyFile) + " and so is no earlier study";
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder / study::kAnswersFolder, failed)) {
    if (entry.is_regular_file() && entry.file_size() > 0) return "somebody has answered in it";
  }
  return "";
}

/// Films of one clip show the same pictures; so no film is longer than another for its coding.
class Films {
 public:
  Films(const Request& request, const std::vector<recorder::Coding>& codings, fs::path folder)
      : request_(request), codings_(codings), folder_(std::move(folder)), names_(names_of(request.clips)) {}

  /// In an order that tells nothing: a file's number on the disk follows it.
  void make() {
    std::vector<study::Place> places;
    for (std::size_t clip = 0; clip < names_.size(); ++clip) {
      for (std::size_t coding = 0; coding < codings_.size(); ++coding) places.push_back({clip, coding});
    }
    study::shuffle(places, study::system_random());
    StepLine line;
    for (std::size_t done = 0; done < places.size(); ++done) {
      const std::string step = "film " + std::to_string(done + 1) + " of " + std::to_string(places.size());
      add(places[done], [&](std::uint64_t pictures) {
        if (told_to_end()) throw Error("ended before all films were made: nothing was written");
        constexpr std::uint64_t kBetween = 25;
        if (pictures % kBetween == 0) line.show(step + ": " + std::to_string(pictures) + " pictures");
      });
    }
  }

  /// All of one size and one time.
  void level(UtcTime made) {
    std::uint64_t largest = 0;
    for (const study::StudyKey::Film& film : films_)
      largest = std::max<std::uint64_t>(largest, fs::file_size(path(film)));
    for (const study::StudyKey::Film& film : films_) {
      recorder::pad_film(path(film), largest + recorder::kLeastPadding);
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(made.time_since_epoch()).count();
      const timespec time{seconds, 0};
      const timespec both[2] = {time, time};
      if (::utimensat(AT_FDCWD, path(film).c_str(), both, 0) != 0)
        throw IoError("set the time of", path(film), errno);
    }
    std::ranges::sort(films_, {}, &study::StudyKey::Film::name);
  }

  [[nodiscard]] const std::vector<study::StudyKey::Film>& films() const { return films_; }
  [[nodiscard]] fs::path path(const study::StudyKey::Film& film) const {
    return folder_ / study::kFilmsFolder / film.name;
  }
  [[nodiscard]] study::StudyKey key(const std::string& id) const {
    study::StudyKey key;
    key.study = id;
    for (std::size_t clip = 0; clip < names_.size(); ++clip) {
      const recorder::ShownFilm& shown = shown_.at(clip);
      constexpr int kShownBits = 8;
      key.clips.push_back(
          {names_[clip], shown.pictures_are,
           shown.depth > kShownBits ? "its " + std::to_string(shown.depth) + " bits are shown as 8" : ""});
    }
    for (const recorder::Coding& coding : codings_)
      key.codings.push_back(
          {std::string(recorder::coding_word(coding.family)), coding.bit_rate, coding.name()});
    key.films = films_;
    return key;
  }

 private:
  void add(const study::Place& place, const recorder::ShownProgress& progress) {
    constexpr std::size_t kNameBytes = 8;
    study::StudyKey::Film film{study::random_name(kNameBytes) + ".mp4", place.clip, place.coding};
    const recorder::ShownFilm shown =
        recorder::write_shown_film(request_.clips[place.clip], stretch_of(request_.stretch),
                                   codings_[place.coding], path(film), progress);
    const auto [other, is_first] = shown_.emplace(place.clip, shown);
    if (!is_first && other->second.pictures != shown.pictures) {
      throw Error(codings_[place.coding].name() + " gave " + std::to_string(shown.pictures) +
                  " pictures of " + names_[place.clip] + ", and another coding " +
                  std::to_string(other->second.pictures));
    }
    films_.push_back(std::move(film));
  }

  const Request& request_;
  const std::vector<recorder::Coding>& codings_;
  const fs::path folder_;
  const std::vector<std::string> names_;
  std::vector<study::StudyKey::Film> films_;
  std::map<std::size_t, recorder::ShownFilm> shown_;  // by clip
};

std::vector<study::Reader> readers_of(std::size_t count, std::size_t repeats, const study::StudyKey& key) {
  const study::RandomBelow random = study::system_random();
  std::map<std::pair<std::size_t, std::size_t>, std::string> names;
  for (const study::StudyKey::Film& film : key.films) names[{film.clip, film.coding}] = film.name;
  std::vector<study::Reader> readers;
  std::set<std::string> codes;
  while (readers.size() < count) {
    study::Reader reader{study::reader_code(random), {}};
    if (!codes.insert(reader.code).second) continue;
    constexpr std::size_t kTokenBytes = 16;
    for (const study::Place& place : study::make_order(key.clips.size(), key.codings.size(), repeats, random))
      reader.showings.push_back({study::random_name(kTokenBytes), names.at({place.clip, place.coding})});
    readers.push_back(std::move(reader));
  }
  return readers;
}

int run(const Request& request) {
  const std::vector<recorder::Coding> codings = wanted_codings(request.coding);
  const crypto::AgeRecipients recipients = recipients_of(request);
  const study::Questions questions = questions_of(request);
  const std::size_t readers = parse_count(request.readers, "--readers", 1, study::kMostReaders);
  constexpr std::size_t kMostPercent = 50;
  const std::size_t percent = parse_count(request.repeats, "--repeats", 0, kMostPercent);
  const std::size_t all = request.clips.size() * codings.size();
  const std::size_t repeats = std::min(all / 2, (all * percent + 99) / 100);
  static_cast<void>(stretch_of(request.stretch));  // refuses what is none, in time
  media::OutputFolder folder(request.output, request.force, why_kept);
  for (const char* const name : {study::kFilmsFolder, study::kAnswersFolder}) {
    fs::create_directory(folder.path() / name);
    fs::permissions(folder.path() / name, fs::perms::owner_all);
  }
  end_when_told();
  Films films(request, codings, folder.path());
  films.make();
  study::Study study;
  constexpr std::size_t kIdBytes = 8;
  study.id = study::random_name(kIdBytes);
  study.title = request.title.value_or("");
  study.made = Clock::system().utc();
  study.questions = questions.questions;
  study.points = questions.points;
  films.level(study.made);
  for (const study::StudyKey::Film& film : films.films()) {
    const crypto::FileHash hash = crypto::hash_file(films.path(film));
    study.films.push_back({film.name, hash.bytes, hash.sha256});
  }
  const study::StudyKey key = films.key(study.id);
  study.readers = readers_of(readers, repeats, key);
  const Bytes sealed = crypto::seal_bytes(bytes_of(study::key_text(key)), recipients);
  study.key = crypto::sha256(sealed);
  write(folder.path() / study::kKeyFile, sealed);
  write(folder.path() / study::kStudyFile, bytes_of(study::study_text(study)));
  folder.commit();

  const std::uint64_t bytes = study.films.front().bytes * study.films.size();
  if (request.json) {
    ordered_json codes = ordered_json::array();
    for (const study::Reader& reader : study.readers) codes.push_back(reader.code);
    print_json({{"study", study.id},
                {"folder", request.output},
                {"films", study.films.size()},
                {"bytes", bytes},
                {"repeats", repeats},
                {"readers", std::move(codes)}});
    return kDone;
  }
  std::cout << "Study " << study.id << ": " << study.films.size() << " films (" << format_bytes(bytes)
            << "), " << repeats << " of which each reader sees again\n";
  for (std::size_t i = 0; i < study.readers.size(); ++i)
    std::cout << "  reader " << i + 1 << "  " << study.readers[i].code << "\n";
  std::cout << "  key       sealed to ";
  for (std::size_t i = 0; i < recipients.size(); ++i)
    std::cout << (i == 0 ? "" : ", ") << recipients[i]->to_string();
  std::cout << "\n  next      kiroku quality study serve " << printable(request.output) << "\n";
  return kDone;
}

}  // namespace

void add_study_make_command(Command& study) {
  Command& command = study.add_command("make", "codes clips, and seals which film is which");
  const auto request = std::make_shared<Request>();
  command.arguments("CLIP", request->clips, "a film, best of pictures that were never compressed");
  command.required_option("-o,--output", "FOLDER", request->output,
                          "where the study is kept; it holds a patient's pictures");
  command.option("-r,--recipient", "KEY", request->recipients,
                 "an age1... recipient, who can open the key in the end");
  command.option("-R,--recipients-file", "FILE", request->recipient_files,
                 "a file with one recipient a line");
  add_coding_options(command, request->coding);
  add_stretch_options(command, request->stretch);
  command.option("--readers", "N", request->readers, "how many people read");
  command.option("--repeats", "PERCENT", request->repeats,
                 "of the films, so many are seen again, which tells how far a reader agrees with "
                 "themselves; 0 to 50");
  command.option("--questions", "FILE", request->questions,
                 "a question a line; lines '1: word' to '5: word' say what points mean",
                 "appropriateness of the step; pattern of the mucosa");
  command.option("--title", "TEXT", request->title, "what readers see above; it tells nothing of codings");
  command.flag("--force", request->force, "replaces an earlier study that nobody has answered in");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Without --coding and --rate: MPEG-2 of 4 Mbit/s and uncompressed, the two that surgeons of Keio "
      "University Hospital compared in 2006. Kiroku's own codings are those of 'kiroku record'.");
  command.explain(
      "Each film is coded, decoded, and kept as lossless H.264, which takes nothing more away: every sample "
      "is compared. All films have one size, one time and random names; every reader sees them in a random "
      "order of their own, with each coding as often as the others in each part of it, or once more. Nobody "
      "sees by the folder which film is which, unless they take the films apart.");
  command.example("kiroku quality study make emr-*.mkv -o reading -r age1...",
                  "two readers, MPEG-2 of 4 Mbit/s beside uncompressed");
  command.example(
      "kiroku quality study make lap-*.mkv -o reading -R statistician.txt --coding mpeg2 --coding h264 "
      "--rate 2M --rate 4M --readers 5 --repeats 25 --duration 10s",
      "four codings of the first ten seconds of each clip");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
