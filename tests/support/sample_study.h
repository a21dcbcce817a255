// A blinded study without films worth looking at: whoever tests readers, answers and their end needs only
// their names. Readers' answers in tests are made up.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "crypto/age_file.h"
#include "viewer/study/order.h"
#include "viewer/study/study.h"

namespace kiroku::test {

struct SampleStudy {
  study::Study study;
  study::StudyKey key;
};

/// Of so many clips in two codings, each film a few bytes, in `folder`, which is made. The key is sealed to
/// `recipient`.
inline SampleStudy write_sample_study(const std::filesystem::path& folder, std::size_t clips,
                                      std::size_t readers, std::size_t repeats,
                                      const std::string& recipient) {
  namespace fs = std::filesystem;
  fs::create_directories(folder / study::kFilmsFolder);
  fs::create_directories(folder / study::kAnswersFolder);
  SampleStudy made;
  made.study.id = study::random_name(8);
  made.study.title = "A sample";
  made.study.made = UtcTime(std::chrono::seconds(1'785'920'400));
  const study::Questions questions = study::usual_questions();
  made.study.questions = questions.questions;
  made.study.points = questions.points;
  made.key.study = made.study.id;
  made.key.codings = {{"mpeg2", 4'000'000, "MPEG-2 4:2:0, 4 Mbit/s"}, {"uncompressed", 0, "uncompressed"}};
  const auto write = [](const fs::path& file, const std::string& text) {
    std::ofstream(file, std::ios::binary) << text;
  };
  for (std::size_t clip = 0; clip < clips; ++clip) {
    made.key.clips.push_back({"clip" + std::to_string(clip + 1) + ".mkv", "320x240 yuv420p", ""});
    for (std::size_t coding = 0; coding < made.key.codings.size(); ++coding) {
      const std::string name = study::random_name(8) + ".mp4", content = study::random_name(32);
      write(folder / study::kFilmsFolder / name, content);
      made.key.films.push_back({name, clip, coding});
      made.study.films.push_back({name, content.size(), crypto::sha256(bytes_of(content))});
    }
  }
  const auto film = [&](const study::Place& place) {
    for (const study::StudyKey::Film& one : made.key.films) {
      if (one.clip == place.clip && one.coding == place.coding) return one.name;
    }
    return std::string();
  };
  for (std::size_t reader = 0; reader < readers; ++reader) {
    study::Reader& one = made.study.readers.emplace_back();
    one.code = study::reader_code(study::system_random());
    for (const study::Place& place :
         study::make_order(clips, made.key.codings.size(), repeats, study::system_random()))
      one.showings.push_back({study::random_name(16), film(place)});
  }
  const Bytes sealed =
      crypto::seal_bytes(bytes_of(study::key_text(made.key)), {crypto::parse_recipient(recipient)});
  made.study.key = crypto::sha256(sealed);
  write(folder / study::kKeyFile, std::string(text_of(sealed)));
  write(folder / study::kStudyFile, study::study_text(made.study));
  return made;
}

}  // namespace kiroku::test
