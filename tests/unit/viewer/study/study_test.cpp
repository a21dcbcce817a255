#include "viewer/study/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/sample_study.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::study {
namespace {

using testing::HasSubstr;
using testing::Not;

class StudyFile : public testing::Test {
 protected:
  static std::string why(const std::string& text) {
    try {
      parse_study(text, "study.json");
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  }
  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  }

  test::TemporaryFolder folder_;
  const crypto::AgeKeyPair pair_ = crypto::generate_age_key();
  const test::SampleStudy made_ = test::write_sample_study(folder_ / "reading", 3, 2, 1, pair_.recipient);
};

TEST_F(StudyFile, ComesBackAsItWasWritten) {
  const StudyOnDisk read = read_study(folder_ / "reading");
  EXPECT_EQ(study_text(read.study), study_text(made_.study));
  EXPECT_EQ(read.sha256, crypto::sha256(bytes_of(study_text(made_.study))));
  EXPECT_EQ(key_text(parse_key(key_text(made_.key), read.study)), key_text(made_.key));
}

TEST_F(StudyFile, TellsNothingOfCodingsAndClips) {
  const std::string text = study_text(made_.study);
  for (const StudyKey::Coding& coding : made_.key.codings) {
    EXPECT_THAT(text, Not(HasSubstr(coding.name)));
    EXPECT_THAT(text, Not(HasSubstr(coding.word)));
  }
  for (const StudyKey::Clip& clip : made_.key.clips) EXPECT_THAT(text, Not(HasSubstr(clip.name)));
  EXPECT_THAT(text, Not(HasSubstr("coding")));
}

TEST_F(StudyFile, RefusesWhatItWouldNotHaveWritten) {
  const std::string text = study_text(made_.study), film = made_.study.films[0].name,
                    token = made_.study.readers[0].showings[0].token,
                    other = made_.study.readers[0].showings[1].token;
  EXPECT_EQ(why(text), "");
  EXPECT_THAT(why("{}"), HasSubstr("study.json is no study: its format"));
  EXPECT_THAT(why("not json"), HasSubstr("study.json is no study"));
  EXPECT_THAT(why(replaced(text, film, "../../etc/passwd.mp4")), HasSubstr("a film's name in it is none"));
  EXPECT_THAT(why(replaced(text, token, other)), HasSubstr("a token stands twice"));
  EXPECT_THAT(why(replaced(text, made_.study.readers[0].code, made_.study.readers[1].code)),
              HasSubstr("code stands twice"));
  EXPECT_THAT(why(replaced(text, "\"questions\"", "\"answers\"")), HasSubstr("questions"));
  EXPECT_THAT(why(replaced(text, "\"bytes\": 64", "\"bytes\": \"many\"")), HasSubstr("is no study"));
}

TEST_F(StudyFile, RefusesAKeyOfAnotherStudy) {
  const auto why_key = [&](const StudyKey& key) -> std::string {
    try {
      parse_key(key_text(key), made_.study);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  };
  StudyKey key = made_.key;
  EXPECT_EQ(why_key(key), "");
  key.study = "0123456789abcdef";
  EXPECT_THAT(why_key(key), HasSubstr("of another study"));
  key = made_.key;
  key.films.pop_back();
  EXPECT_THAT(why_key(key), HasSubstr("does not name each film"));
  key = made_.key;
  key.films[0].coding = 7;
  EXPECT_THAT(why_key(key), HasSubstr("out of bounds"));
  key = made_.key;
  key.films[0].clip = key.films[2].clip;
  EXPECT_THAT(why_key(key), HasSubstr("stands twice"));
}

TEST(StudyQuestions, AreOneALine) {
  const Questions found = parse_questions(
      "# for endoscopists\n\n  Is the border seen?  \r\n1: no\n5: yes, wholly\nAre vessels seen?\n", "q.txt");
  EXPECT_THAT(found.questions, testing::ElementsAre("Is the border seen?", "Are vessels seen?"));
  EXPECT_EQ(found.points[0], "no");
  EXPECT_EQ(found.points[1], usual_questions().points[1]);
  EXPECT_EQ(found.points[4], "yes, wholly");
  EXPECT_THROW(parse_questions("# nothing\n1: no\n", "q.txt"), UsageError);
  EXPECT_THROW(parse_questions(std::string(301, 'x'), "q.txt"), UsageError);
  EXPECT_THROW(parse_questions("1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n", "q.txt"), UsageError);
}

}  // namespace
}  // namespace kiroku::study
