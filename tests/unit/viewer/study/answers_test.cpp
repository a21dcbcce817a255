#include "viewer/study/answers.h"

#include <cerrno>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/sample_study.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::study {
namespace {

using testing::HasSubstr;

class StudyAnswers : public testing::Test {
 protected:
  [[nodiscard]] std::string token(std::size_t at) const { return study_.study.readers[0].showings[at].token; }
  [[nodiscard]] Answer answer(std::size_t at, int first, int second) const {
    return {token(at), {first, second}, {1, 250, 0}, UtcTime(std::chrono::seconds(1'785'920'400))};
  }
  [[nodiscard]] std::filesystem::path file() const { return reading_ / answers_name(1); }
  [[nodiscard]] std::string text() const {
    std::ostringstream all;
    all << std::ifstream(file(), std::ios::binary).rdbuf();
    return all.str();
  }
  void write(const std::string& text) const { std::ofstream(file(), std::ios::binary) << text; }
  [[nodiscard]] AnswersOnDisk read() const { return read_answers(reading_, study_, 1); }
  [[nodiscard]] std::string why() const {
    try {
      static_cast<void>(read());
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
  const std::filesystem::path reading_ = folder_ / "reading";
  const test::SampleStudy made_ =
      test::write_sample_study(reading_, 3, 2, 0, crypto::generate_age_key().recipient);
  const StudyOnDisk study_ = read_study(reading_);
  archive::FileSystem& real_ = archive::real_file_system();
};

TEST_F(StudyAnswers, StayAndTheNewestCounts) {
  {
    AnswerBook book(real_, reading_, study_, 1);
    book.add(answer(0, 4, 0));
    book.add(answer(1, 5, 5));
    book.add(answer(0, 2, 3));
  }
  const AnswersOnDisk found = read();
  EXPECT_EQ(found.lines, 3U);
  ASSERT_EQ(found.newest.size(), 2U);
  EXPECT_THAT(found.newest.at(token(0)).points, testing::ElementsAre(2, 3));
  EXPECT_EQ(found.newest.at(token(0)).seen.pictures, 250U);
  EXPECT_TRUE(found.newest.at(token(1)).is_whole());
  EXPECT_FALSE(answer(0, 4, 0).is_whole());
  AnswerBook again(real_, reading_, study_, 1);
  EXPECT_EQ(again.lines(), 3U);
  again.add(answer(2, 1, 1));
  EXPECT_EQ(read().lines, 4U);
}

TEST_F(StudyAnswers, AreOnTheDiskWhenTheyAreStored) {
  test::FaultFileSystem files(reading_);
  AnswerBook book(files, reading_, study_, 1);
  files.forget_calls();
  book.add(answer(0, 4, 4));
  const std::vector<std::string> calls = files.calls();
  ASSERT_EQ(calls.size(), 2U);
  EXPECT_THAT(calls[0], HasSubstr("write answers/reader-1.jsonl"));
  EXPECT_EQ(calls[1], "sync answers/reader-1.jsonl");
}

TEST_F(StudyAnswers, OfACrashLeaveWhatWasConfirmed) {
  test::FaultFileSystem files(reading_);
  AnswerBook book(files, reading_, study_, 1);
  book.add(answer(0, 4, 4));
  files.fail("write", EIO);
  EXPECT_THROW(book.add(answer(1, 1, 1)), IoError);
  files.heal();
  EXPECT_THROW(book.add(answer(1, 1, 1)), Error) << "what stands in the file is not known";
  EXPECT_THAT(text(), testing::Not(testing::EndsWith("\n"))) << "half a line is left";
  EXPECT_EQ(read().lines, 1U);
  AnswerBook again(real_, reading_, study_, 1);
  EXPECT_THAT(text(), testing::EndsWith("\n"));
  again.add(answer(1, 2, 2));
  EXPECT_EQ(read().lines, 2U);
  EXPECT_THAT(read().newest.at(token(1)).points, testing::ElementsAre(2, 2));
}

TEST_F(StudyAnswers, ThatSomebodyChangedAreNoAnswers) {
  {
    AnswerBook book(real_, reading_, study_, 1);
    for (std::size_t at = 0; at < 3; ++at) book.add(answer(at, 4, 4));
  }
  const std::string good = text();
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string other = good;
    other.replace(other.find(from), from.size(), to);
    write(other);
    return why();
  };
  EXPECT_THAT(changed("[4,4]", "[5,4]"), HasSubstr("line 2 of"));
  EXPECT_THAT(changed("[4,4]", "[6,4]"), HasSubstr("points that nobody could give"));
  EXPECT_THAT(changed("[4,4]", "[4]"), HasSubstr("points that nobody could give"));
  EXPECT_THAT(changed("\"line\":2", "\"line\":3"), HasSubstr("another number"));
  EXPECT_THAT(changed(token(0), made_.study.readers[1].showings[0].token),
              HasSubstr("answers what this reader was not shown"));
  write(good.substr(good.find('\n') + 1));
  EXPECT_THAT(why(), HasSubstr("line 1 of"));
  write("rubbish\n" + good);
  EXPECT_THAT(why(), HasSubstr("is no answer"));
  // Answers of another study do not follow from this one's hash.
  write(good);
  EXPECT_EQ(why(), "");
  StudyOnDisk other = study_;
  other.sha256 = {};
  EXPECT_THROW(read_answers(reading_, other, 1), UsageError);
}

}  // namespace
}  // namespace kiroku::study
