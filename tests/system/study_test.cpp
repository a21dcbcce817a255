// 'kiroku quality study', as a hospital uses it. The readers are made up: who answers here is this test.

#include <algorithm>
#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <functional>
#include <set>
#include <stdexcept>
#include <sys/stat.h>
#include <unistd.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>

#include "tests/support/eventually.h"
#include "tests/support/textured_film.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class StudyTest : public ProgramTest {
 protected:
  StudyTest() { make_demo_home(); }

  std::string film(const std::string& name, int pictures = 30) const {
    write_textured_film(path(name), 192, 176, pictures);
    return path(name);
  }
  [[nodiscard]] std::string recipient() const {
    const std::string text = read_text(home() / "identity.txt");
    const std::size_t at = text.find("age1");
    return text.substr(at, text.find('\n', at) - at);
  }
  /// Two clips in two codings before two readers, one film again.
  void make(const Arguments& more = {}) const {
    Arguments arguments{"quality", "study",     "make", film("step one.mp4"), film("step two.mp4", 34),
                        "-r",      recipient(), "-o",   path("reading")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProcessResult made = kiroku(arguments);
    ASSERT_EQ(made.status, 0) << made.err;
    EXPECT_THAT(made.out, HasSubstr("reader 2"));
  }
  [[nodiscard]] json study() const { return json::parse(read_text(folder() / "reading/study.json")); }
};

/// The server that readers come to.
class Serving {
 public:
  explicit Serving(const Process::Options& options) : process_(options) {
    if (!process_.wait_for("}\n")) throw std::runtime_error("the study is not served");
    const std::string url = json::parse(process_.out()).at("url");
    port_ = url.substr(url.rfind(':') + 1);
    port_.pop_back();
  }
  struct Answer {
    unsigned status = 0;
    std::string body, fields;
  };
  Answer ask(boost::beast::http::verb verb, const std::string& target, const std::string& body = "") const {
    namespace http = boost::beast::http;
    boost::asio::io_context context;
    boost::asio::ip::tcp::socket socket(context);
    boost::asio::connect(socket, boost::asio::ip::tcp::resolver(context).resolve("127.0.0.1", port_));
    http::request<http::string_body> request(verb, target, 11, body);
    request.set(http::field::host, "127.0.0.1:" + port_);
    request.set(http::field::content_type, "application/json");
    request.prepare_payload();
    http::write(socket, request);
    boost::beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.body_limit(64U << 20);
    http::read(socket, buffer, parser);
    Answer answer{parser.get().result_int(), parser.get().body(), ""};
    for (const auto& field : parser.get())
      answer.fields += std::string(field.name_string()) + ": " + std::string(field.value()) + "\n";
    return answer;
  }
  json post(const std::string& target, const json& body) const {
    const Answer answer = ask(boost::beast::http::verb::post, target, body.dump());
    EXPECT_EQ(answer.status, 200U) << answer.body;
    return json::parse(answer.body);
  }
  int end(int signal = SIGTERM) {
    process_.signal(signal);
    return process_.wait().status;
  }

 private:
  Process process_;
  std::string port_;
};

TEST_F(StudyTest, LeadsFromClipsToAReport) {
  make({"--readers", "2", "--repeats", "25", "--title", "Steps & patterns"});
  const json made = study();
  ASSERT_EQ(made.at("films").size(), 4U);
  const Process::Options serve =
      options({"quality", "study", "serve", path("reading"), "--listen", "127.0.0.1:0", "--json"});

  // Each reader sees every film once and one again, gives points, and corrects one answer.
  for (const json& reader : made.at("readers")) {
    Serving serving(serve);
    const json begun = serving.post("/begin", {{"code", reader.at("code")}});
    EXPECT_EQ(begun.at("title"), "Steps & patterns");
    ASSERT_EQ(begun.at("showings").size(), 5U);
    std::set<std::string> seen;
    for (const json& showing : begun.at("showings")) {
      const auto film =
          serving.ask(boost::beast::http::verb::get, "/films/" + showing.at("token").get<std::string>());
      ASSERT_EQ(film.status, 200U);
      EXPECT_EQ(film.body.size(), made.at("films")[0].at("bytes"));
      // What a reader answers follows from what they see alone.
      const int first = 1 + static_cast<int>(std::hash<std::string>()(film.body) % 5);
      seen.insert(film.body);
      json answer{{"code", reader.at("code")},
                  {"showing", showing.at("token")},
                  {"points", {first, 0}},
                  {"plays", 0},
                  {"pictures", 30},
                  {"dropped", 0}};
      serving.post("/answer", answer);
      answer["points"] = {first, 3};
      answer["plays"] = 1;
      serving.post("/answer", answer);
    }
    EXPECT_EQ(seen.size(), 4U);
    // Killed, as by a crash: what was confirmed is there.
    EXPECT_NE(serving.end(SIGKILL), 0);
  }
  const json status = kiroku_json({"quality", "study", "status", path("reading"), "--json"});
  EXPECT_EQ(status.at("readers")[0].at("answered"), 5);
  EXPECT_EQ(status.at("readers")[1].at("answered"), 5);
  EXPECT_EQ(status.at("closed"), false);

  EXPECT_REFUSED(kiroku({"quality", "study", "report", path("reading")}), "is not closed");
  const json closed = kiroku_json({"quality", "study", "close", path("reading"), "--json"});
  EXPECT_TRUE(closed.at("time_stamps")[0].contains("gen_time")) << closed;
  EXPECT_EQ(closed.at("time_stamps")[0].at("kind"), "self-issued");
  EXPECT_EQ(closed.at("time"), "self-issued");
  EXPECT_REFUSED(kiroku({"quality", "study", "close", path("reading")}), "is closed already");
  EXPECT_REFUSED(kiroku({"quality", "study", "serve", path("reading")}), "is closed");

  const ProcessResult told = kiroku({"quality", "study", "report", path("reading"), "-o", path("report")});
  ASSERT_EQ(told.status, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr("Can the pattern of the mucosa be judged?"));
  EXPECT_THAT(told.out, HasSubstr("MPEG-2 4:2:0, 4 Mbit/s"));
  EXPECT_THAT(files_below(path("report")),
              testing::UnorderedElementsAre("answers.csv", "study-report.html", "study-report.json",
                                            "study-report.pdf"));
  const json report = json::parse(read_text(folder() / "report/study-report.json"));
  EXPECT_EQ(report.at("sealed_sha256"), closed.at("sha256"));
  ASSERT_EQ(report.at("codings").size(), 2U);
  for (const json& coding : report.at("codings")) {
    EXPECT_EQ(coding.at("questions")[0].at("answers"), 4) << "two clips, two readers, the first time";
    EXPECT_EQ(coding.at("questions")[1].at("median"), 3);
    EXPECT_THAT(coding.at("questions")[1].at("agreement").at("why_no_kappa"), HasSubstr("all answers are"));
  }
  // Both answered by the film alone: they agree with each other and with themselves.
  for (const json& own : report.at("own_agreement")) EXPECT_EQ(own.at("same"), own.at("films")) << own;
  EXPECT_EQ(report.at("together")[0].at("agreement").at("observed"), 1);
  for (const json& check : report.at("checks")) EXPECT_EQ(check.at("answer"), "holds") << check;
  const std::string page = read_text(folder() / "report/study-report.html"),
                    csv = read_text(folder() / "report/answers.csv");
  EXPECT_THAT(page, HasSubstr("Steps &amp; patterns"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_EQ(std::ranges::count(csv, '\n'), 11);
  EXPECT_THAT(csv, HasSubstr("step one.mp4,uncompressed"));
}

TEST_F(StudyTest, TellsWhoeverHasTheFolderNothing) {
  make({"--repeats", "0"});
  std::set<std::uintmax_t> sizes;
  std::set<std::string> times;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder() / "reading/films")) {
    sizes.insert(entry.file_size());
    times.insert(std::to_string(entry.last_write_time().time_since_epoch().count()));
    EXPECT_THAT(entry.path().filename().string(), testing::MatchesRegex("[0-9a-f]{16}\\.mp4"));
    EXPECT_EQ(entry.status().permissions() & (fs::perms::group_all | fs::perms::others_all), fs::perms::none);
  }
  EXPECT_EQ(sizes.size(), 1U);
  EXPECT_EQ(times.size(), 1U);
  const std::string text = read_text(folder() / "reading/study.json");
  for (const char* const word : {"mpeg", "MPEG", "uncompressed", "step one", "coding"})
    EXPECT_THAT(text, Not(HasSubstr(word)));
  EXPECT_THAT(read_text(folder() / "reading/key.age"), testing::StartsWith("age-encryption.org/v1\n"));
  // Another recipient's identity opens nothing.
  const ProcessResult other = kiroku({"init", "--demo", "--home", path("other")});
  ASSERT_EQ(other.status, 0) << other.err;
  ASSERT_EQ(kiroku({"quality", "study", "close", path("reading"), "--incomplete"}).status, 0);
  EXPECT_REFUSED(
      kiroku({"quality", "study", "report", path("reading"), "--identity", path("other/identity.txt")}), "");
}

TEST_F(StudyTest, KeepsTheKeyClosedWhereAnAnswerWasChanged) {
  make({"--repeats", "0"});
  const json reader = study().at("readers")[0];
  {
    Serving serving(
        options({"quality", "study", "serve", path("reading"), "--listen", "127.0.0.1:0", "--json"}));
    serving.post(
        "/answer",
        {{"code", reader.at("code")}, {"showing", reader.at("showings")[0].at("token")}, {"points", {2, 2}}});
    EXPECT_EQ(serving.end(), 0);
  }
  EXPECT_REFUSED(kiroku({"quality", "study", "close", path("reading")}), "reader 1 judged 1 of 4 films");
  ASSERT_EQ(kiroku({"quality", "study", "close", path("reading"), "--incomplete"}).status, 0);
  const std::string answers = read_text(folder() / "reading/answers/reader-1.jsonl");
  std::string changed = answers;
  changed.replace(changed.find("[2,2]"), 5, "[5,5]");
  write_text(path("reading/answers/reader-1.jsonl"), changed);
  const ProcessResult told = kiroku({"quality", "study", "report", path("reading"), "-o", path("report")});
  EXPECT_EQ(told.status, 1) << told.err;
  EXPECT_THAT(told.out, HasSubstr("reader-1.jsonl was changed"));
  EXPECT_THAT(told.out, Not(HasSubstr("MPEG-2")));
  EXPECT_FALSE(fs::exists(path("report")));
  // Nor does a new seal over it help: its time-stamp is of the first one.
  write_text(path("reading/answers/reader-1.jsonl"), answers);
  fs::rename(path("reading/sealed.json"), path("first.json"));
  std::string seal = read_text(path("first.json"));
  seal.replace(seal.find("closed_utc\": \"20"), 16, "closed_utc\": \"19");
  write_text(path("reading/sealed.json"), seal);
  EXPECT_EQ(kiroku({"quality", "study", "report", path("reading")}).status, 1);
  fs::rename(path("first.json"), path("reading/sealed.json"));
  EXPECT_EQ(kiroku({"quality", "study", "report", path("reading")}).status, 0);
}

TEST_F(StudyTest, KeepsTheKeyClosedWhereAFilmWasExchanged) {
  make({"--repeats", "0"});
  ASSERT_EQ(kiroku({"quality", "study", "close", path("reading"), "--incomplete"}).status, 0);
  const std::string name = "films/" + study().at("films")[2].at("name").get<std::string>();
  flip_byte(folder() / "reading" / name, 3000);
  const ProcessResult told = kiroku({"quality", "study", "report", path("reading"), "-o", path("report")});
  EXPECT_EQ(told.status, 1) << told.err;
  EXPECT_THAT(told.out, HasSubstr(name + " was changed"));
  EXPECT_FALSE(fs::exists(path("report")));
}

TEST_F(StudyTest, CountsHowFarReadersWereByTheirAnswers) {
  make({"--repeats", "0"});
  ASSERT_EQ(kiroku({"quality", "study", "close", path("reading"), "--incomplete"}).status, 0);
  const ProcessResult told = kiroku({"quality", "study", "report", path("reading")});
  ASSERT_EQ(told.status, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr("0 of 8 films judged"));
  EXPECT_THAT(told.out, HasSubstr("It was closed before all was judged."));
  std::string seal = read_text(folder() / "reading/sealed.json");
  seal.replace(seal.find("\"answered\": 0"), 13, "\"answered\": 4");
  write_text(path("reading/sealed.json"), seal);
  const ProcessResult other = kiroku({"quality", "study", "report", path("reading")});
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.out,
              HasSubstr("sealed.json says that reader 1 judged 4 of 4 films, and the answers are of 0 of 4"));
}

// Roots that are read from a pipe hold the report up behind the checks, as slow disks do.
TEST_F(StudyTest, ReportsTheKeyAndAnswersThatItChecked) {
  make({"--repeats", "0"});
  ASSERT_EQ(kiroku({"quality", "study", "close", path("reading"), "--incomplete"}).status, 0);
  const std::string pipe = path("roots.pem");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  Process process(options({"quality", "study", "report", path("reading"), "--trust", pipe}));
  int writing = -1;
  ASSERT_TRUE(eventually([&] {
    writing = ::open(pipe.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    return writing >= 0;
  })) << "nobody reads the roots";
  write_text(path("reading/key.age"), "another key");
  write_text(path("reading/answers/reader-1.jsonl"), "another answer\n");
  const std::string roots = read_text(home() / "own-authority.pem");
  EXPECT_EQ(::write(writing, roots.data(), roots.size()), static_cast<ssize_t>(roots.size()));
  ::close(writing);
  const ProcessResult told = process.wait();
  EXPECT_EQ(told.status, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr("MPEG-2 4:2:0, 4 Mbit/s"));
}

TEST_F(StudyTest, ShowsNoOtherFilms) {
  make({"--repeats", "0"});
  const std::string name = study().at("films")[2].at("name");
  flip_byte(folder() / "reading/films" / name, 3000);
  EXPECT_REFUSED(kiroku({"quality", "study", "serve", path("reading"), "--listen", "127.0.0.1:0"}),
                 name + " was changed");
}

TEST_F(StudyTest, RefusesInOneSentence) {
  const std::string clip = film("clip.mp4");
  const auto make_with = [&](const Arguments& more) {
    Arguments arguments{"quality", "study", "make", clip, "-o", path("reading")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  EXPECT_REFUSED(make_with({}), "nobody could open the key");
  EXPECT_REFUSED(make_with({"-r", recipient(), "--coding", "lossless"}), "name another");
  EXPECT_REFUSED(make_with({"-r", recipient(), "--coding", "lossless", "--coding", "lossless"}), "twice");
  EXPECT_REFUSED(make_with({"-r", recipient(), "--repeats", "51"}), "--repeats");
  EXPECT_REFUSED(make_with({"-r", recipient(), "--readers", "0"}), "--readers");
  write_text(path("none.txt"), "# no question\n");
  EXPECT_REFUSED(make_with({"-r", recipient(), "--questions", path("none.txt")}), "0 questions");
  write_text(path("notes.txt"), "no film at all\n");
  EXPECT_REFUSED(
      kiroku({"quality", "study", "make", path("notes.txt"), "-r", recipient(), "-o", path("reading")}),
      "notes.txt");
  EXPECT_FALSE(fs::exists(path("reading")));
  EXPECT_REFUSED(kiroku({"quality", "study", "serve", path("nowhere")}), "is no study's folder");
  EXPECT_REFUSED(kiroku({"quality", "study"}), "needs a command after it");
  EXPECT_REFUSED(kiroku({"quality"}), "CLIP is required");
  make();
  EXPECT_REFUSED(kiroku({"quality", "study", "serve", path("reading"), "--listen", "0.0.0.0:0"}),
                 "reached from elsewhere");
  EXPECT_REFUSED(make_with({"-r", recipient()}), "is already there");
  // A study that somebody has answered in is never replaced.
  const json reader = study().at("readers")[0];
  {
    Serving serving(
        options({"quality", "study", "serve", path("reading"), "--listen", "127.0.0.1:0", "--json"}));
    EXPECT_REFUSED(kiroku({"quality", "study", "close", path("reading"), "--incomplete"}), "another program");
    serving.post(
        "/answer",
        {{"code", reader.at("code")}, {"showing", reader.at("showings")[0].at("token")}, {"points", {2, 2}}});
    serving.end();
  }
  EXPECT_REFUSED(make_with({"-r", recipient(), "--force"}), "somebody has answered in it");
}

}  // namespace
}  // namespace kiroku::test
