#include "viewer/study/closing.h"

#include <fstream>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/sample_study.h"
#include "tests/support/temporary_folder.h"
#include "viewer/study/answers.h"

namespace kiroku::study {
namespace {

using testing::HasSubstr;

class StudyClosing : public testing::Test {
 protected:
  [[nodiscard]] UtcTime now() const { return UtcTime(std::chrono::seconds(1'785'920'400)); }
  void answer_all() {
    for (std::size_t reader = 1; reader <= 2; ++reader) {
      AnswerBook book(real_, reading_, study_, reader);
      for (const Showing& one : study_.study.readers[reader - 1].showings)
        book.add({one.token, {3, 4}, {1, 250, 0}, now()});
    }
  }
  void add_to(const std::string& name, const std::string& text) const {
    std::ofstream(reading_ / name, std::ios::binary | std::ios::app) << text;
  }
  [[nodiscard]] std::vector<std::string> differing() const {
    std::vector<std::string> found;
    for (const Check& check : check_closed(reading_, study_).checks) {
      if (check.answer == Check::Answer::kDiffers) found.push_back(check.text);
    }
    return found;
  }

  test::TemporaryFolder folder_;
  const std::filesystem::path reading_ = folder_ / "reading";
  const test::SampleStudy made_ =
      test::write_sample_study(reading_, 3, 2, 1, crypto::generate_age_key().recipient);
  const StudyOnDisk study_ = read_study(reading_);
  archive::FileSystem& real_ = archive::real_file_system();
};

TEST_F(StudyClosing, SaysHowFarReadersAre) {
  EXPECT_EQ(progress_of(reading_, study_).size(), 2U);
  EXPECT_EQ(progress_of(reading_, study_)[0].answered, 0U);
  AnswerBook(real_, reading_, study_, 1).add({study_.study.readers[0].showings[0].token, {3, 0}, {}, now()});
  EXPECT_EQ(progress_of(reading_, study_)[0].answered, 0U) << "one of two questions is no answer";
  answer_all();
  EXPECT_TRUE(progress_of(reading_, study_)[0].is_done());
  EXPECT_EQ(progress_of(reading_, study_)[0].showings, 7U);
}

TEST_F(StudyClosing, BindsKeyStudyAndEveryAnswer) {
  answer_all();
  EXPECT_FALSE(is_closed(reading_));
  EXPECT_THROW(check_closed(reading_, study_), UsageError);
  const crypto::Sha256Digest digest = close_study(real_, reading_, study_, now());
  const ClosedStudy closed = check_closed(reading_, study_);
  EXPECT_EQ(closed.closing.sha256, digest);
  EXPECT_EQ(closed.closing.utc, now());
  EXPECT_EQ(closed.checks.size(), 5U) << "four files, and all films";
  EXPECT_EQ(verdict_of(closed.checks), Check::Answer::kHolds);
  EXPECT_THROW(close_study(real_, reading_, study_, now()), UsageError) << "it is closed once";
}

TEST_F(StudyClosing, ShowsWhatWasChangedAfterwards) {
  answer_all();
  close_study(real_, reading_, study_, now());
  EXPECT_THAT(differing(), testing::IsEmpty());
  // An answer that follows as it should, so that the chain of lines alone would not tell.
  AnswerBook(real_, reading_, study_, 2)
      .add({study_.study.readers[1].showings[0].token, {5, 5}, {1, 250, 0}, now()});
  EXPECT_THAT(differing(), testing::ElementsAre(HasSubstr("reader-2.jsonl was changed")));
  add_to(kKeyFile, "x");
  EXPECT_THAT(differing(),
              testing::UnorderedElementsAre(HasSubstr("reader-2.jsonl"), HasSubstr("key.age was"),
                                            HasSubstr("not the one that the study was made")));
  std::filesystem::remove(reading_ / answers_name(1));
  EXPECT_EQ(differing().size(), 4U);
}

TEST_F(StudyClosing, AsksWhetherTheFilmsAreThoseThatTheStudyWasMadeWith) {
  answer_all();
  close_study(real_, reading_, study_, now());
  const std::string name = "films/" + made_.study.films[1].name;
  std::fstream(reading_ / name, std::ios::in | std::ios::out) << "other";
  EXPECT_THAT(differing(), testing::ElementsAre(name + " was changed"));
  std::filesystem::resize_file(reading_ / name, std::uintmax_t{1} << 40U);  // hours of hashing
  EXPECT_THAT(differing(), testing::ElementsAre(name + " was changed"));
  std::filesystem::remove(reading_ / name);
  EXPECT_EQ(differing().size(), 1U);
}

// "It was closed before all was judged" would be gone.
TEST_F(StudyClosing, BelievesNoSealThatSaysHowFarReadersWere) {
  AnswerBook(real_, reading_, study_, 1).add({study_.study.readers[0].showings[0].token, {3, 4}, {}, now()});
  close_study(real_, reading_, study_, now());
  EXPECT_EQ(check_closed(reading_, study_).closing.progress[0].answered, 1U);
  const std::filesystem::path file = reading_ / kSealedFile;
  std::string text;
  std::getline(std::ifstream(file), text, '\0');
  text.replace(text.find("\"answered\": 1"), 13, "\"answered\": 7");
  std::ofstream(file, std::ios::trunc) << text;
  EXPECT_THAT(differing(), testing::ElementsAre("sealed.json says that reader 1 judged 7 of 7 films, and the "
                                                "answers are of 1 of 7"));
  EXPECT_EQ(check_closed(reading_, study_).closing.progress[0].answered, 1U);
}

TEST_F(StudyClosing, GivesKeyAndAnswersOfTheBytesThatItCompared) {
  answer_all();
  close_study(real_, reading_, study_, now());
  const ClosedStudy closed = check_closed(reading_, study_);
  EXPECT_EQ(crypto::sha256(closed.key), study_.study.key);
  ASSERT_EQ(closed.answers.size(), 2U);
  EXPECT_EQ(closed.answers[0].size(), 7U);
  EXPECT_EQ(closed.answers[1].at(study_.study.readers[1].showings[0].token).points, (std::vector<int>{3, 4}));
  // Of the study, too, what was parsed counts, and not what lies there by now.
  add_to(kStudyFile, " ");
  EXPECT_THAT(differing(), testing::IsEmpty());
}

TEST_F(StudyClosing, TakesNoSealThatLeavesAnythingOut) {
  close_study(real_, reading_, study_, now());
  const std::filesystem::path file = reading_ / kSealedFile;
  std::string text;
  std::getline(std::ifstream(file), text, '\0');
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string other = text;
    other.replace(other.find(from), from.size(), to);
    std::ofstream(file, std::ios::trunc) << other;
  };
  with("answers/reader-1.jsonl", "answers/reader-7.jsonl");
  EXPECT_THROW(check_closed(reading_, study_), UsageError);
  with(made_.study.id, "0000000000000000");
  EXPECT_THROW(check_closed(reading_, study_), UsageError);
  std::ofstream(file, std::ios::trunc) << "{}";
  EXPECT_THROW(check_closed(reading_, study_), UsageError);
}

// Whoever hands over a study may have put it there; reading it would never end.
TEST_F(StudyClosing, ReadsNoPipeInThePlaceOfAFile) {
  answer_all();
  close_study(real_, reading_, study_, now());
  const auto with_pipe = [&](const std::string& name) {
    const std::filesystem::path file = reading_ / name, aside = folder_ / "aside";
    std::filesystem::rename(file, aside);
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
    if (name == kSealedFile) {
      EXPECT_THROW(check_closed(reading_, study_), UsageError);
    } else if (name == kKeyFile) {
      EXPECT_THAT(differing(), testing::Contains(HasSubstr(name + " is no file")));
    } else {
      EXPECT_THAT(differing(), testing::ElementsAre(HasSubstr(name + " is no file")));
      EXPECT_THROW(read_answers(reading_, study_, 1), UsageError);
    }
    std::filesystem::remove(file);
    std::filesystem::rename(aside, file);
  };
  for (const std::string& name : {std::string(kSealedFile), std::string(kKeyFile), answers_name(1)})
    with_pipe(name);
  EXPECT_EQ(verdict_of(check_closed(reading_, study_).checks), Check::Answer::kHolds);
}

TEST_F(StudyClosing, IsForOneProgramAtATime) {
  const auto held = hold_study(real_, reading_);
  EXPECT_THROW(hold_study(real_, reading_), UsageError);
}

TEST_F(StudyClosing, KnowsItsFilms) {
  EXPECT_EQ(verdict_of(check_films(reading_, study_.study)), Check::Answer::kHolds);
  add_to("films/" + made_.study.films[1].name, "x");
  EXPECT_EQ(verdict_of(check_films(reading_, study_.study)), Check::Answer::kDiffers);
}

}  // namespace
}  // namespace kiroku::study
