// Attempts of the page made cases of a home by the real sealer, where sealing fails half way: an attempt has
// one case, whatever is tried again.
#include <fstream>

#include <sqlite3.h>

#include "apps/train/attempt_seal.h"
#include "apps/train/page_sealer.h"
#include "base/error.h"
#include "tests/support/small_disk.h"
#include "tests/system/program_test.h"
#include "viewer/http/request.h"
#include "viewer/training/attempt_messages.h"
#include "viewer/training/training_room.h"

namespace kiroku::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

class TrainingSealing : public ProgramTest {
 protected:
  /// A room whose results lie beside the home, and a trainee.
  void open(const fs::path& home_folder, std::uint64_t left = viewer::kLeftToRecorder) {
    home_.emplace(home_folder);
    viewer::TrainingOptions options;
    options.database = folder() / "training.sqlite";
    options.sealer = apps::make_page_sealer(*home_, left);
    room_.emplace(std::move(options));
    room_->with_results([](trainer::TrainingDatabase& results) {
      results.add_trainee("Aoki", trainer::kStressShown, false);
    });
  }
  /// An attempt of two seconds that is over, as the page leaves one; its number.
  std::int64_t attempt() {
    trainer::ExclusionRecord record;
    record.object = "a";
    record.fingers = 1;
    const std::int64_t number = room_->with_results([&](trainer::TrainingDatabase& results) {
      return results.begin_attempt(results.trainee("Aoki"), record, utc_now());
    });
    auto files = room_->options().sealer->keep(number);
    std::uint32_t noise = 1;
    for (int picture = 0; picture < 60; ++picture) {
      sim::Picture shown;
      shown.width = 320;
      shown.height = 240;
      shown.rgb.resize(std::size_t{320} * 240 * 3);
      for (std::uint8_t& sample : shown.rgb) {
        noise = noise * 1664525 + 1013904223;
        sample = static_cast<std::uint8_t>(noise >> 24U);
      }
      trainer::ExclusionView view;
      view.time_s = picture / 30.0;
      view.picture = &shown;
      view.hand.forces_n.assign(1, sim::Vector3(0, 0, 0.1 * picture));
      files->see(view, viewer::jpeg_of_moment({.attempt = &view}));
    }
    trainer::HandMotion motion;
    motion.fingers = 1;
    motion.times_s = {0, 2};
    motion.poses.assign(2, std::vector<sim::Pose>(1));
    room_->keep_sealable("Aoki", {number, std::move(files), std::move(motion),
                                  json{{"object", "a"}, {"attempt", number}}.dump(), "Aoki: given-up"});
    return number;
  }
  [[nodiscard]] std::string refusal(std::int64_t number) {
    try {
      (void)room_->seal(user_, number);
    } catch (const Error& error) {
      return error.what();
    }
    return "not refused";
  }
  [[nodiscard]] std::string case_of(std::int64_t number) {
    return room_->with_results([&](const trainer::TrainingDatabase& results) {
      const auto records = results.attempts();
      return std::ranges::find(records, number, &trainer::ExclusionRecord::number)->sealed_case;
    });
  }
  [[nodiscard]] std::vector<std::string> cases() const {
    std::vector<std::string> found;
    for (const auto& entry : fs::directory_iterator(home_->archive())) {
      if (entry.is_directory() && entry.path().filename() != "log")
        found.push_back(entry.path().filename().string());
    }
    return found;
  }
  /// What the case's sealed subject says of the training.
  [[nodiscard]] json subject_of(const std::string& case_id) const {
    const ProcessResult opened = kiroku({"unseal", "-i", (home_->folder() / "identity.txt").string(),
                                         (home_->archive() / case_id / "subject.json.age").string()});
    EXPECT_EQ(opened.status, 0) << opened.err;
    return json::parse(opened.out)["training"];
  }

  std::optional<apps::Home> home_;
  std::optional<viewer::TrainingRoom> room_;
  viewer::TrainingUser user_{"root", true, true};
};

TEST_F(TrainingSealing, AnAttemptIsOneCaseAndItsFilesLieBesideIt) {
  make_demo_home();
  open(home());
  const std::int64_t number = attempt();
  const viewer::SealedAttempt sealed = room_->seal(user_, number);
  EXPECT_EQ(sealed.verdict, "intact");
  EXPECT_EQ(case_of(number), sealed.case_id);
  EXPECT_EQ(cases(), std::vector{sealed.case_id});
  EXPECT_EQ(subject_of(sealed.case_id)["sealed_by"], "root");
  EXPECT_TRUE(fs::exists(home() / "training" / sealed.case_id / "hand.txt"));
  EXPECT_EQ(refusal(number), "this attempt was sealed as " + sealed.case_id + " already");
  EXPECT_THAT(refusal(number + 1), HasSubstr("no such attempt"));
  user_.may_record = false;
  EXPECT_THAT(refusal(number), HasSubstr("surgeons and administrators"));
  // An earlier attempt is gone once the next is over.
  user_.may_record = true;
  const std::int64_t second = attempt(), third = attempt();
  EXPECT_THAT(refusal(second), HasSubstr("until its trainee's next one is over"));
  EXPECT_EQ(room_->seal(user_, third).verdict, "intact");
  EXPECT_EQ(cases().size(), 2U);
}

trainer::Questionnaire said(int useful) {
  trainer::Questionnaire questionnaire;
  questionnaire.answers = {1, useful, std::nullopt};
  questionnaire.comment = "the palm is missing";
  return questionnaire;
}
trainer::Checklist ticked() {
  trainer::Checklist checklist;
  checklist.items[3] = trainer::ItemState::kNotDone;
  checklist.global_rating = 3;
  checklist.examiner = "Dr Sato";
  return checklist;
}

TEST_F(TrainingSealing, WhatWasSaidOfAnAttemptIsSealedWithItAndStaysSo) {
  make_demo_home();
  open(home());
  const std::int64_t number = attempt();
  room_->with_results([&](trainer::TrainingDatabase& results) {
    results.end_attempt(number, trainer::Ending::kGivenUp, {});
  });
  room_->keep_questionnaire(user_, number, said(-2));
  // A try that fails before there is a case; then the mind is changed.
  fs::path kept;
  for (const auto& entry : fs::recursive_directory_iterator(home())) {
    if (entry.path().filename() == "film.mjpeg") kept = entry.path().parent_path();
  }
  fs::create_directory(kept / "vitals.csv");  // in the way
  EXPECT_THAT(refusal(number), HasSubstr("vitals.csv of the attempt cannot be written"));
  fs::remove(kept / "vitals.csv");
  room_->keep_questionnaire(user_, number, said(2));
  room_->keep_checklist(user_, number, ticked());
  const viewer::SealedAttempt sealed = room_->seal(user_, number);
  const json subject = subject_of(sealed.case_id);
  EXPECT_EQ(subject["questionnaire"]["answers"],
            json({{"organ-feel", 1}, {"useful", 2}, {"stress-helps", nullptr}}));
  EXPECT_EQ(subject["questionnaire"]["comment"], "the palm is missing");
  EXPECT_EQ(subject["questionnaire"]["by"], "root");
  EXPECT_EQ(subject["checklist"]["items"]["lifts-steadily"], "not-done");
  EXPECT_EQ(subject["checklist"]["examiner"], "Dr Sato");
  EXPECT_EQ(subject["checklist"]["global_rating"], 3);
  // The file whose hash the case holds says the same.
  const json file = json::parse(read_text(home() / "training" / sealed.case_id / "score.json"));
  EXPECT_EQ(file["questionnaire"], subject["questionnaire"]);
  EXPECT_EQ(file["checklist"], subject["checklist"]);
  const auto refused = [&](const auto& action) {
    try {
      action();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("not refused");
  };
  EXPECT_EQ(refused([&] { room_->keep_questionnaire(user_, number, said(1)); }),
            "this attempt was sealed as " + sealed.case_id + " already");
  EXPECT_EQ(refused([&] { room_->keep_checklist(user_, number, ticked()); }),
            "this attempt was sealed as " + sealed.case_id + " already");
}

TEST_F(TrainingSealing, FilesThatCannotBeMovedLeaveOneCaseThatIsGoneOnWith) {
  make_demo_home();
  open(home());
  const std::int64_t number = attempt();
  std::ofstream(home() / "training") << "a file is in the way\n";
  EXPECT_THAT(refusal(number), HasSubstr("was made, but the attempt's files cannot be moved to"));
  const std::string made = case_of(number);
  EXPECT_EQ(cases(), std::vector{made});
  EXPECT_THAT(refusal(number), HasSubstr("the case " + made + " was made, but"));
  EXPECT_EQ(cases(), std::vector{made});
  // It has its certificate already.
  EXPECT_GT(room_->certificate(user_, number, report::Language::kEnglish).size(), 1000U);
  fs::remove(home() / "training");
  const viewer::SealedAttempt sealed = room_->seal(user_, number);
  EXPECT_EQ(sealed.case_id, made);
  EXPECT_EQ(sealed.verdict, "intact");
  EXPECT_EQ(cases(), std::vector{made});
  EXPECT_TRUE(fs::exists(home() / "training" / made / "score.json"));
  EXPECT_THAT(refusal(number), HasSubstr("was sealed as " + made + " already"));
}

TEST_F(TrainingSealing, NumbersThatCannotBeWrittenAreWrittenOnceThereIsRoom) {
  make_demo_home();
  open(home());
  const std::int64_t number = attempt();
  fs::path kept;
  for (const auto& entry : fs::recursive_directory_iterator(home())) {
    if (entry.path().filename() == "film.mjpeg") kept = entry.path().parent_path();
  }
  ASSERT_FALSE(kept.empty());
  fs::create_directory(kept / "score.json");  // in the way
  EXPECT_THAT(refusal(number), HasSubstr("score.json of the attempt cannot be written"));
  EXPECT_THAT(refusal(number), HasSubstr("score.json of the attempt cannot be written"));
  EXPECT_TRUE(cases().empty());
  fs::remove(kept / "score.json");
  const viewer::SealedAttempt sealed = room_->seal(user_, number);
  EXPECT_EQ(sealed.verdict, "intact");
  EXPECT_EQ(cases(), std::vector{sealed.case_id});
}

TEST_F(TrainingSealing, ResultsThatCannotBeWrittenEndTheCaseBeforeAnythingIsRecorded) {
  make_demo_home();
  open(home());
  const std::int64_t number = attempt();
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open((folder() / "training.sqlite").c_str(), &other), SQLITE_OK);
  // Another program is writing and does not end.
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  EXPECT_THAT(refusal(number), HasSubstr("training.sqlite"));
  sqlite3_close(other);
  EXPECT_EQ(case_of(number), "");
  const viewer::SealedAttempt sealed = room_->seal(user_, number);
  EXPECT_EQ(sealed.verdict, "intact");
  EXPECT_EQ(case_of(number), sealed.case_id);
  // The other one says that it is none.
  for (const std::string& each : cases()) {
    if (each == sealed.case_id) continue;
    EXPECT_FALSE(apps::holds_whole_attempt(home_->archive() / each));
  }
}

TEST_F(TrainingSealing, AFullDiskMakesNoCaseAndTheAttemptIsSealedOnceThereIsRoom) {
  const SmallDisk disk(24U << 20U);
  if (!disk.mounted()) GTEST_SKIP() << "no file system can be mounted here";
  make_demo_home();
  const fs::path on_disk = disk.path() / "home";
  fs::copy(home(), on_disk, fs::copy_options::recursive);
  open(on_disk, 0);  // what a recorder may need is the next test's
  const std::int64_t number = attempt();
  constexpr std::size_t kRoom = std::size_t{300} << 10U;
  std::ofstream(disk.path() / "reserve") << std::string(kRoom, 'x');
  disk.fill("filler");
  fs::remove(disk.path() / "reserve");
  EXPECT_THAT(refusal(number), HasSubstr("No space left on device"));
  EXPECT_EQ(case_of(number), "");
  EXPECT_TRUE(cases().empty());
  fs::remove(disk.path() / "filler");
  const viewer::SealedAttempt sealed = room_->seal(user_, number);
  EXPECT_EQ(sealed.verdict, "intact");
  EXPECT_EQ(case_of(number), sealed.case_id);
  EXPECT_EQ(cases(), std::vector{sealed.case_id});
  EXPECT_THAT(refusal(number), HasSubstr("already"));
}

// Cases of attempts lie on the recorder's disk.
TEST_F(TrainingSealing, AttemptsLeaveARecorderItsRoom) {
  const SmallDisk disk(24U << 20U);
  if (!disk.mounted()) GTEST_SKIP() << "no file system can be mounted here";
  make_demo_home();
  const fs::path on_disk = disk.path() / "home";
  fs::copy(home(), on_disk, fs::copy_options::recursive);
  home_.emplace(on_disk);
  EXPECT_THROW((void)apps::make_page_sealer(*home_)->keep(1), viewer::Refusal) << "a recorder needs more";
  open(on_disk, fs::space(disk.path()).available - (4U << 20U));
  const std::int64_t number = attempt();
  std::ofstream(disk.path() / "filler") << std::string(4U << 20U, 'x');
  EXPECT_THAT(refusal(number), HasSubstr("the disk has no room"));
  EXPECT_TRUE(cases().empty());
  EXPECT_THROW((void)room_->options().sealer->keep(number + 1), viewer::Refusal);
}

TEST_F(TrainingSealing, ACertificateIsWrittenInTheLanguageThatIsAskedFor) {
  make_demo_home();
  open(home());
  const std::int64_t number = attempt();
  try {
    (void)room_->certificate(user_, number, report::Language::kEnglish);
    FAIL() << "it was not sealed";
  } catch (const viewer::Refusal& refused) {
    EXPECT_EQ(refused.status(), 404);
  }
  (void)room_->seal(user_, number);
  const auto text_of_pdf = [&](report::Language language) {
    const Bytes pdf = room_->certificate(user_, number, language);
    const fs::path file = folder() / "certificate.pdf";
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(pdf.data()), static_cast<std::streamsize>(pdf.size()));
    return tool({"pdftotext", file.string(), "-"}).out;
  };
  if (!has_tool("pdftotext")) GTEST_SKIP() << "pdftotext is not installed";
  const std::string text = text_of_pdf(report::Language::kEnglish);
  EXPECT_THAT(text, HasSubstr("Verification report"));
  EXPECT_THAT(text, HasSubstr("--log LOG")) << "the log took part";
  EXPECT_THAT(text_of_pdf(report::Language::kJapanese), HasSubstr("検証報告書"));
}

}  // namespace
}  // namespace kiroku::test
