#include "viewer/study/desk.h"

#include <cctype>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <string>
#include <variant>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "tests/support/moved_clock.h"
#include "tests/support/sample_study.h"
#include "tests/support/temporary_folder.h"
#include "viewer/study/closing.h"

namespace kiroku::study {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class StudyDesk : public testing::Test {
 protected:
  [[nodiscard]] static http::Request asked(const std::string& method, const std::string& target,
                                           const std::string& body = "") {
    http::Request request{method, target, {{"Host", "127.0.0.1:8450"}}, body, "127.0.0.1"};
    if (method == "POST") request.fields.emplace_back("Content-Type", "application/json");
    return request;
  }
  http::Response post(const std::string& target, const json& body) {
    return desk_->answer(asked("POST", target, body.dump()));
  }
  static json said(const http::Response& response) {
    return json::parse(std::get<std::string>(response.body));
  }
  [[nodiscard]] json an_answer(std::size_t reader, std::size_t at, int first, int second) const {
    const Reader& one = made_.study.readers[reader];
    return {{"code", one.code},
            {"showing", one.showings[at].token},
            {"points", {first, second}},
            {"plays", 1},
            {"pictures", 75},
            {"dropped", 2}};
  }
  void open() { desk_ = std::make_unique<Desk>(archive::real_file_system(), reading_, clock_); }

  test::TemporaryFolder folder_;
  const std::filesystem::path reading_ = folder_ / "reading";
  const test::SampleStudy made_ =
      test::write_sample_study(reading_, 3, 2, 1, crypto::generate_age_key().recipient);
  test::MovedClock clock_;
  std::unique_ptr<Desk> desk_ = std::make_unique<Desk>(archive::real_file_system(), reading_, clock_);
};

TEST_F(StudyDesk, GivesEachReaderTheirOwnOrder) {
  const http::Response first = post("/begin", {{"code", made_.study.readers[0].code}});
  ASSERT_EQ(first.status, 200);
  const json told = said(first);
  EXPECT_EQ(told.at("reader"), 1);
  EXPECT_EQ(told.at("questions").size(), 2U);
  ASSERT_EQ(told.at("showings").size(), 7U);
  for (std::size_t at = 0; at < 7; ++at)
    EXPECT_EQ(told.at("showings")[at].at("token"), made_.study.readers[0].showings[at].token);
  // However it is typed.
  std::string typed = " " + made_.study.readers[1].code;
  for (char& c : typed) c = static_cast<char>(std::tolower(c));
  typed.erase(typed.find('-'), 1);
  EXPECT_EQ(said(post("/begin", {{"code", typed}})).at("reader"), 2);
  for (const json& wrong :
       {json{{"code", ""}}, json{{"code", "AAAA-AAAA"}}, json{{"code", 7}}, json(7), json()})
    EXPECT_EQ(post("/begin", wrong).status, 403) << wrong;
}

TEST_F(StudyDesk, TellsNothingByWhichFilmsCouldBeToldApart) {
  std::string all;
  for (const Reader& reader : made_.study.readers)
    all += said(post("/begin", {{"code", reader.code}})).dump();
  for (const char* const path : {"/", "/study.js", "/study.css"})
    all += std::get<std::string>(desk_->answer(asked("GET", path)).body);
  for (const StudyKey::Film& film : made_.key.films)
    EXPECT_THAT(all, Not(HasSubstr(film.name))) << "a film that comes again would have the same name";
  for (const StudyKey::Clip& clip : made_.key.clips) EXPECT_THAT(all, Not(HasSubstr(clip.name)));
  for (const StudyKey::Coding& coding : made_.key.codings) {
    EXPECT_THAT(all, Not(HasSubstr(coding.word)));
    EXPECT_THAT(all, Not(HasSubstr(coding.name)));
  }
  // Nor do the answers' heads: every film's are the same.
  std::set<std::string> heads;
  for (const Showing& showing : made_.study.readers[0].showings) {
    const http::Response film = desk_->answer(asked("GET", "/films/" + showing.token));
    ASSERT_EQ(film.status, 200);
    std::string head = std::to_string(std::get<http::FileBody>(film.body).size);
    for (const auto& [name, value] : film.fields) head += "\n" + name + ": " + value;
    heads.insert(head);
  }
  EXPECT_EQ(heads.size(), 1U);
}

// Days may lie between the program's start, which looks at all films, and a reader's visit.
TEST_F(StudyDesk, ShowsNoFilmThatWasExchangedSinceItBegan) {
  const Showing& showing = made_.study.readers[0].showings[0];
  ASSERT_EQ(desk_->answer(asked("GET", "/films/" + showing.token)).status, 200);
  std::fstream(reading_ / kFilmsFolder / showing.film, std::ios::in | std::ios::out) << "other";
  EXPECT_EQ(desk_->answer(asked("GET", "/films/" + showing.token)).status, 500);
}

TEST_F(StudyDesk, StoresAnswersAndGoesOnWhereTheyEnd) {
  EXPECT_EQ(said(post("/answer", an_answer(0, 0, 4, 0))).at("stored"), 1);
  EXPECT_EQ(said(post("/answer", an_answer(0, 0, 4, 5))).at("stored"), 2);
  EXPECT_EQ(said(post("/answer", an_answer(1, 0, 1, 1))).at("stored"), 1);
  desk_.reset();
  open();
  const json told = said(post("/begin", {{"code", made_.study.readers[0].code}}));
  EXPECT_EQ(told.at("showings")[0].at("points"), (json{4, 5}));
  EXPECT_EQ(told.at("showings")[1].at("points"), (json{0, 0}));
  const AnswersOnDisk found = read_answers(reading_, read_study(reading_), 1);
  const Answer& one = found.newest.begin()->second;
  EXPECT_EQ(one.seen.dropped, 2U);
  EXPECT_EQ(one.utc, clock_.utc());
}

TEST_F(StudyDesk, RefusesWhatNobodyCouldAnswer) {
  json answer = an_answer(0, 0, 4, 4);
  answer["points"] = {4};
  EXPECT_EQ(post("/answer", answer).status, 400);
  answer["points"] = {4, 6};
  EXPECT_EQ(post("/answer", answer).status, 400);
  answer["points"] = {4, -1};
  EXPECT_EQ(post("/answer", answer).status, 400);
  answer["points"] = "55";
  EXPECT_EQ(post("/answer", answer).status, 400);
  answer = an_answer(0, 0, 4, 4);
  answer["code"] = made_.study.readers[1].code;
  EXPECT_EQ(post("/answer", answer).status, 404) << "another reader's showing";
  answer["code"] = "AAAA-AAAA";
  EXPECT_EQ(post("/answer", answer).status, 403);
  EXPECT_EQ(read_answers(reading_, read_study(reading_), 1).lines, 0U);
  for (const char* const path : {"/films/", "/films/../study.json", "/study.json", "/key.age", "/begin"})
    EXPECT_EQ(desk_->answer(asked("GET", path)).status, 404) << path;
}

TEST_F(StudyDesk, AnswersItsOwnPageAlone) {
  const std::string body = json{{"code", made_.study.readers[0].code}}.dump();
  const auto status = [&](const http::Fields& fields) {
    http::Request request{"POST", "/begin", fields, body, "127.0.0.1"};
    return desk_->answer(request).status;
  };
  const std::pair<std::string, std::string> type{"Content-Type", "application/json"};
  EXPECT_EQ(status({{"Host", "127.0.0.1:8450"}, type}), 200);
  EXPECT_EQ(status({{"Host", "localhost:8450"}, type}), 200);
  EXPECT_EQ(status({{"Host", "[::1]:8450"}, type}), 200);
  EXPECT_EQ(status({{"Host", "127.0.0.1:8450"}, type, {"Origin", "http://127.0.0.1:8450"}}), 200);
  EXPECT_EQ(status({{"Host", "127.0.0.1:8450"}, type, {"Origin", "https://elsewhere.example"}}), 403);
  EXPECT_EQ(status({{"Host", "127.0.0.1:8450"}, type, {"Sec-Fetch-Site", "cross-site"}}), 403);
  EXPECT_EQ(status({{"Host", "reading.elsewhere.example:8450"}, type}), 403) << "a name that leads here";
  EXPECT_EQ(status({type}), 403);
  EXPECT_EQ(status({{"Host", "127.0.0.1:8450"}, {"Content-Type", "text/plain"}}), 415);
  EXPECT_EQ(status({{"Host", "127.0.0.1:8450"}}), 415);
}

TEST_F(StudyDesk, IsClosedWithTheStudy) {
  EXPECT_THROW(open(), UsageError) << "one at a time";
  desk_.reset();
  close_study(archive::real_file_system(), reading_, read_study(reading_), clock_.utc());
  EXPECT_THROW(open(), UsageError);
}

}  // namespace
}  // namespace kiroku::study
