// `kiroku renew` as a person and the weekly timer call it, with the home's own authority.
#include "tests/support/reserved_port.h"
#include "tests/support/small_disk.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::SizeIs;

class Renew : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  [[nodiscard]] fs::path record_of(const fs::path& folder) const {
    return home() / "archive/evidence" / (folder.filename().string() + ".ers");
  }
  [[nodiscard]] nlohmann::json verify(const Arguments& arguments) const {
    Arguments all{"verify", "--json"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return nlohmann::json::parse(kiroku(all).out);
  }
  static std::string told(const nlohmann::json& report, const std::string& code) {
    for (const auto& finding : report.at("findings")) {
      if (finding.at("code") == code) return finding.at("text");
    }
    return "";
  }
};

TEST_F(Renew, BeginsARecordForEachCaseWithOneTimeStamp) {
  const auto first = record(), second = record();
  const ProcessResult due = kiroku({"renew", "--dry-run"});
  EXPECT_EQ(due.status, 3) << due.err;
  EXPECT_THAT(due.out,
              HasSubstr(first.filename().string() + ": a record would be begun: it had no record\n"));
  EXPECT_FALSE(fs::exists(record_of(first)));

  const auto done = kiroku_json({"renew", "--json"});
  EXPECT_EQ(done.at("dry_run"), false);
  ASSERT_THAT(done.at("cases"), SizeIs(2));
  EXPECT_EQ(done.at("cases")[0].at("what"), "begun");
  EXPECT_TRUE(done.at("cases")[0].at("renew_before").is_string());
  const auto report = verify({first.string()});
  EXPECT_EQ(report.at("verdict"), "intact");
  EXPECT_EQ(report.at("evidence").at("holds"), true) << report.at("evidence");
  EXPECT_EQ(report.at("evidence").at("time"), "self-issued");
  EXPECT_EQ(report.at("evidence").at("entries"), report.at("entries"));
  ASSERT_THAT(report.at("evidence").at("links"), SizeIs(1));
  EXPECT_EQ(report.at("evidence").at("links")[0].at("covers_data"), true);
  EXPECT_THAT(kiroku({"verify", second.string()}).out, HasSubstr(" there by the recorder's own word at "));
  // One token over both.
  EXPECT_EQ(report.at("evidence").at("since"), verify({second.string()}).at("evidence").at("since"));

  const ProcessResult again = kiroku({"renew"});
  EXPECT_EQ(again.status, 0);
  EXPECT_THAT(again.out, HasSubstr("2 records need nothing.\nThe next end is at "));
  EXPECT_EQ(kiroku({"renew", "--dry-run"}).status, 0);
  // The folder of records is no case.
  EXPECT_THAT(kiroku_json({"cases", "--json"}).at("cases"), SizeIs(2));
  EXPECT_REFUSED(kiroku({"verify", "evi"}), "is neither a folder nor a case");
}

TEST_F(Renew, APolicyMakesTimeStampsAndHashesDue) {
  const auto folder = record();
  ASSERT_EQ(kiroku({"renew"}).status, 0);
  // The embedded authority signs with ECDSA over SHA-256: by this policy both end within the half year to
  // come.
  const std::string soon = tool({"date", "-u", "-d", "+100 days", "+%Y-%m-%d"}).out.substr(0, 10);
  write_text(home() / "algorithms.toml",
             "name = \"Test\"\nnew_hash = \"sha512\"\n[[algorithm]]\nname = \"sha256\"\nuntil = " + soon +
                 "\n[[algorithm]]\nname = \"sha512\"\n[[algorithm]]\nname = \"ecdsa\"\n"
                 "[[algorithm]]\nname = \"ed25519\"\n");
  write_text(home() / "kiroku.toml",
             read_text(home() / "kiroku.toml") + "\n[evidence]\npolicy = \"algorithms.toml\"\n");
  const std::string both = read_text(home() / "kiroku.toml");
  // kiroku init writes the section, and TOML allows it once.
  const std::size_t section = both.find("[evidence]");
  ASSERT_NE(section, std::string::npos);
  write_text(home() / "kiroku.toml", both.substr(0, section) + both.substr(both.rfind("[evidence]")));
  const ProcessResult due = kiroku({"renew", "--dry-run", "--home", home().string()});
  EXPECT_EQ(due.status, 3) << due.err << due.out;
  EXPECT_THAT(due.out, HasSubstr("all its data would be read again under a new hash: sha256 ends at "));

  EXPECT_EQ(kiroku_json({"renew", "--json"}).at("cases")[0].at("what"), "hash-tree-renewed");
  const auto report = verify({"--policy", path("home/algorithms.toml"), folder.string()});
  EXPECT_EQ(report.at("evidence").at("holds"), true) << report.at("evidence");
  EXPECT_EQ(report.at("evidence").at("hashes"), (nlohmann::json{"sha256", "sha512"}));
  EXPECT_EQ(report.at("evidence").at("time_stamps"), 2);
}

TEST_F(Renew, ACaseThatCannotBeReadIsNamedAndKeepsTheOthersFromNothing) {
  const auto bad = record(), good = record();
  const fs::path segment = bad / "segments/endoscope/00000000.ts.age";
  flip_byte(segment, -1);
  const ProcessResult result = kiroku({"renew"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr(bad.filename().string() + ": nothing was renewed: "));
  EXPECT_THAT(result.out, HasSubstr("  not as recorded: segments/endoscope/00000000.ts.age\n"));
  EXPECT_FALSE(fs::exists(record_of(bad)));
  EXPECT_TRUE(fs::exists(record_of(good)));
  const ProcessResult json = kiroku({"renew", "--json", "--case", bad.filename().string()});
  EXPECT_EQ(json.status, 1);
  const auto cases = nlohmann::json::parse(json.out).at("cases");
  ASSERT_THAT(cases, SizeIs(1));
  EXPECT_EQ(cases[0].at("what"), "refused");
  EXPECT_EQ(cases[0].at("unread"), nlohmann::json{"segments/endoscope/00000000.ts.age"});
}

TEST_F(Renew, AnAuthorityThatIsAwayIsWaitedFor) {
  const auto folder = record();
  const std::string url =
      "http://127.0.0.1:" + std::to_string(reserved_port()) + "/";  // nobody listens there
  write_text(home() / "kiroku.toml",
             "[[authority]]\nname = \"embedded\"\nurl = \"embedded\"\n"
             "[[authority]]\nname = \"outside\"\nurl = \"" +
                 url + "\"\n");
  const ProcessResult waits = kiroku({"renew"});
  EXPECT_EQ(waits.status, 3) << waits.err;
  EXPECT_THAT(waits.out,
              HasSubstr("waits: it had no record; no time-stamp came: no outside authority answered"));
  EXPECT_THAT(waits.out, HasSubstr("is unreachable"));
  EXPECT_FALSE(fs::exists(record_of(folder)));
}

TEST_F(Renew, ReportReceiptAndExcerptTellWhatTheRecordProves) {
  const auto folder = record({"--segment", "1s"}, "00:00:08");
  ASSERT_EQ(kiroku({"renew"}).status, 0);
  for (const std::string kind : {"report", "receipt"}) {
    for (const std::string language : {"en", "ja"}) {
      Arguments arguments{"report",     folder.string(), "-o", path(kind + "-" + language + ".html"),
                          "--language", language};
      if (kind == "receipt") arguments.emplace_back("--receipt");
      ASSERT_EQ(kiroku(arguments).status, 0) << kind;
      const std::string page = read_text(path(kind + "-" + language + ".html"));
      EXPECT_THAT(page,
                  HasSubstr(language == "en" ? "By the recorder's own word all" : "1個のタイムスタンプ"))
          << kind;
      EXPECT_THAT(page, HasSubstr(language == "en" ? "no outside clock stands behind these times"
                                                   : "これらの時刻に外部の時計の裏付けはなく"));
    }
  }
  EXPECT_THAT(read_text(path("report-en.html")),
              HasSubstr("It does not prove when before that it was recorded"));

  ASSERT_EQ(kiroku({"excerpt", folder.filename().string(), "--from", "00:00:02", "--to", "00:00:04", "-o",
                    path("part")})
                .status,
            0);
  const auto alone = verify({path("part")});
  EXPECT_EQ(alone.at("evidence"), nullptr) << "no record lies beside it";
  const auto with = verify({"--evidence", record_of(folder).string(), path("part")});
  EXPECT_EQ(with.at("verdict"), "intact-excerpt") << with.at("findings");
  EXPECT_THAT(told(with, "evidence-holds"),
              HasSubstr("says, by the recorder's own word, that the checkpoint over "));
}

// No record covers a log.
TEST_F(Renew, TheLogIsJudgedByAPolicy) {
  write_text(path("policy.toml"),
             "[[algorithm]]\nname = \"sha256\"\n[[algorithm]]\nname = \"ed25519\"\nuntil = 2025-12-31\n");
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
  const ProcessResult ended = kiroku({"log", "--verify", "--policy", path("policy.toml")});
  EXPECT_EQ(ended.status, 3) << ended.err;
  EXPECT_THAT(ended.out, HasSubstr("algorithm-ended"));
  EXPECT_REFUSED(kiroku({"log", "--policy", path("policy.toml")}), "give --verify, too");
  EXPECT_REFUSED(kiroku({"log", "--verify", "--policy", path("none.toml")}), "none.toml");
}

// A record lies on the recorder's disk. What finds no room waits, and nobody is asked for a time-stamp.
TEST_F(Renew, LeavesARecorderItsRoom) {
  const SmallDisk disk(48U << 20U);
  if (!disk.mounted()) GTEST_SKIP() << "no file system can be mounted here";
  const auto folder = record();
  const fs::path on_disk = disk.path() / "home";
  fs::copy(home(), on_disk, fs::copy_options::recursive);
  const ProcessResult waits = kiroku({"renew", "--home", on_disk.string()});
  EXPECT_EQ(waits.status, 3) << waits.err << waits.out;
  EXPECT_THAT(waits.out, HasSubstr("waits: it had no record; no time-stamp came: the disk has no room"));
  EXPECT_FALSE(fs::exists(on_disk / "archive/evidence" / (folder.filename().string() + ".ers")));
}

TEST_F(Renew, RefusesWhatItCannotDo) {
  EXPECT_REFUSED(kiroku({"renew", "--case", "20200101T000000Z-00000000"}), "is neither a folder nor a case");
  EXPECT_REFUSED(kiroku({"renew", "--policy", path("none.toml")}), "none.toml");
  write_text(path("bad.toml"), "[[algorithm]]\nname = \"md5\"\n");
  EXPECT_REFUSED(kiroku({"renew", "--policy", path("bad.toml")}),
                 "bad.toml:1:1: 'md5' is no algorithm known here");
  const ProcessResult nothing = kiroku({"renew"});
  EXPECT_EQ(nothing.status, 0) << nothing.err;
  EXPECT_EQ(nothing.out, "There is no case.\n");
}

}  // namespace
}  // namespace kiroku::test
