#include <algorithm>
#include <iterator>
#include <sstream>

#include "tests/support/cube_plan.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A command, and what it must be given.
struct Page {
  Arguments command;
  std::string usage, text;
};

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  return {std::istream_iterator<std::string>(stream), {}};
}

/// Every way to name a place that a command writes to.
const std::vector<std::string> kWritingOptions{"--output",   "--stills",       "--write-form",
                                               "--database", "--new-identity", "--write-by-hand"};

/// These only read the database that they are given.
const std::vector<Arguments> kReadDatabase{{"train", "budget"}, {"train", "results"}};

class OutputPlace : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
    log_ = home() / "archive/log";
  }

  /// All commands below this one, by their pages of help.
  void collect(const Arguments& command, std::vector<Page>& pages) const {
    Arguments asked = command;
    asked.emplace_back("--help");
    Page page{command, "", kiroku(asked).out};
    std::istringstream lines(page.text);
    bool below = false;
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with("Usage: kiroku")) page.usage = line.substr(std::string("Usage: kiroku").size());
      if (!line.starts_with("  ")) below = line == "Commands:";
      const bool is_command = below && line.starts_with("  ") && line.size() > 2 && line[2] != ' ';
      if (!is_command) continue;
      Arguments child = command;
      child.push_back(words_of(line).front());
      collect(child, pages);
    }
    pages.push_back(std::move(page));
  }

  /// The command with everything that it requires, and `option` naming `place`.
  static Arguments call(const Page& page, const std::string& option, const std::string& place) {
    Arguments all = page.command;
    const std::vector<std::string> words = words_of(page.usage);
    for (std::size_t i = page.command.size(); i < words.size(); ++i) {
      if (words[i].starts_with("[")) continue;
      if (!words[i].starts_with("--")) {
        all.push_back(words[i] == "COLUMNSxROWS" ? "9x6" : "x");
        continue;
      }
      const std::string& value = words[++i];
      if (words[i - 1] == option) continue;
      all.push_back(words[i - 1]);
      all.push_back(value.find('|') == std::string::npos ? "x" : value.substr(0, value.find('|')));
    }
    all.push_back(option);
    all.push_back(place);
    return all;
  }

  fs::path case_, log_;
};

TEST_F(OutputPlace, OfNoCommandIsWithinACase) {
  std::vector<Page> pages;
  collect({}, pages);
  ASSERT_GT(pages.size(), 80U);
  const auto before = files_below(home());
  std::size_t asked = 0;
  for (const Page& page : pages) {
    for (const std::string& option : kWritingOptions) {
      // As an option of this command, not a word of an example of another.
      const bool has_it = page.text.find("\n  " + option + " ") != std::string::npos ||
                          page.text.find(", " + option + " ") != std::string::npos;
      const bool reads_only =
          option == "--database" && std::ranges::find(kReadDatabase, page.command) != kReadDatabase.end();
      if (!has_it || reads_only) continue;
      SCOPED_TRACE(testing::PrintToString(page.command) + " " + option);
      EXPECT_REFUSED(kiroku(call(page, option, (case_ / "new").string())), "the folder of a recorded case");
      ++asked;
    }
  }
  EXPECT_GT(asked, 35U);
  EXPECT_REFUSED(kiroku({"boot", "new-key", (case_ / "new").string()}), case_.string());
  EXPECT_REFUSED(kiroku({"log", "publish", (case_ / "new").string()}), case_.string());
  EXPECT_REFUSED(kiroku({"log", "follow", "x", (case_ / "new").string()}), case_.string());
  EXPECT_REFUSED(kiroku({"witness", "init", "--name", "w", (case_ / "new").string()}), case_.string());
  EXPECT_REFUSED(kiroku({"init", "--demo", "--home", (case_ / "new").string()}), case_.string());
  EXPECT_EQ(files_below(home()), before);
  EXPECT_EQ(kiroku({"verify", case_.string()}).status, 0);
}

TEST_F(OutputPlace, IsNoLedgerAndNoFileOfAHomeEvenByForce) {
  const auto refused_at = [&](const fs::path& place) {
    return kiroku({"export", case_.string(), "--stream", "vitals", "--force", "-o", place.string()});
  };
  const auto before = files_below(home());
  const std::string ledger = read_text(case_ / "ledger.jsonl"), log = read_text(log_ / "ledger.jsonl");
  EXPECT_REFUSED(refused_at(case_ / "ledger.jsonl"), "read as tampered");
  EXPECT_REFUSED(refused_at(case_ / "segments/vitals/00000000.jsonl"), case_.string());
  EXPECT_REFUSED(refused_at(case_ / "no/such/folder/x.jsonl"), case_.string());
  EXPECT_REFUSED(refused_at(log_ / "ledger.jsonl"), log_.string());
  EXPECT_REFUSED(refused_at(home() / "archive/x.jsonl"), "the archive of a home");
  EXPECT_REFUSED(refused_at(home() / "authority/x.jsonl"), "time-stamping authority");
  for (const char* const file : {"device.key", "device.pub", "identity.txt", "kiroku.toml",
                                 "catalogue.sqlite", "newest-log.note", "recipients.txt"})
    EXPECT_REFUSED(refused_at(home() / file), "the home consists of this file");
  EXPECT_EQ(read_text(case_ / "ledger.jsonl"), ledger);
  EXPECT_EQ(read_text(log_ / "ledger.jsonl"), log);
  EXPECT_EQ(files_below(home()), before);
  EXPECT_EQ(refused_at(home() / "mine.jsonl").status, 0) << "a home is no case";
}

TEST_F(OutputPlace, IsSeenThroughLinks) {
  fs::create_symlink(case_, path("case"));
  fs::create_symlink(case_ / "ledger.jsonl", path("x.jsonl"));
  EXPECT_REFUSED(kiroku({"report", case_.string(), "-o", path("case/report.html")}), case_.string());
  EXPECT_REFUSED(kiroku({"report", case_.string(), "-o", path("case") + "/../case/report.html"}), "archive");
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "vitals", "--force", "-o", path("x.jsonl")}),
                 case_.string());
  // An archive that is on another disk.
  fs::rename(home() / "archive", path("disk"));
  fs::create_directory_symlink(path("disk"), home() / "archive");
  EXPECT_REFUSED(kiroku({"report", case_.string(), "-o", (home() / "archive/report.html").string()}),
                 "the archive of a home");
  EXPECT_EQ(kiroku({"report", case_.string(), "-o", path("report.html")}).status, 0);
}

// What nobody is asked the place of lies beside what is read.
TEST_F(OutputPlace, BesideAPlanIsInNoCase) {
  write_cube_plan(folder());
  fs::create_directory(case_ / "plans");
  for (const char* file : {"plan.json", "cube.msh", "ct.nrrd"})
    fs::copy_file(folder() / file, case_ / "plans" / file);
  const auto before = files_below(home());
  EXPECT_REFUSED(kiroku({"plan", "seal", (case_ / "plans/plan.json").string()}),
                 "plan.seal.json would be written beside");
  fs::create_directory_symlink(case_ / "plans", path("linked"));
  EXPECT_REFUSED(kiroku({"plan", "seal", path("linked/plan.json")}), case_.string());
  EXPECT_REFUSED(kiroku({"plan", "serve", "--plans", (case_ / "plans").string()}), case_.string());
  EXPECT_REFUSED(kiroku({"quality", "study", "close", (case_ / "plans").string()}), case_.string());
  EXPECT_EQ(files_below(home()), before);
  EXPECT_EQ(kiroku({"plan", "seal", "plan.json"}).status, 0);
}

TEST_F(OutputPlace, IsInNoExcerpt) {
  const Arguments cut{"excerpt", case_.string(), "--from", "0", "--to", "2", "-o"};
  Arguments outside = cut, inside = cut;
  outside.push_back(path("part"));
  inside.push_back(path("part/again"));
  ASSERT_EQ(kiroku(outside).status, 0);
  EXPECT_REFUSED(kiroku(inside), "the folder of an excerpt");
  EXPECT_REFUSED(kiroku({"report", path("part"), "-o", path("part/report.pdf")}), "the folder of an excerpt");
}

}  // namespace
}  // namespace kiroku::test
