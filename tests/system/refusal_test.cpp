#include <unistd.h>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

/// What is refused, and a part of the sentence that says why.
struct Refusal {
  const char* name;
  Arguments arguments;
  const char* part;
};

void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.name; }

/// Every refusal: one sentence, exit status 2, and nothing half-written.
class Refuses : public ProgramTest, public testing::WithParamInterface<Refusal> {
 protected:
  void SetUp() override {
    make_demo_home();
    write_text(folder() / "empty.mp4", "");
    write_text(folder() / "text.txt", "this is no film\n");
    write_text(folder() / "bad.csv", "when,what\n1,2\n");
    write_text(folder() / "list.json", "[1, 2]");
    std::filesystem::create_directory(folder() / "nocase");
  }
};

/// But for what every recorder keeps in its home, whether it then records or not.
std::vector<std::string> made_files(const std::filesystem::path& folder) {
  std::vector<std::string> files = files_below(folder);
  std::erase_if(files, [](const std::string& file) {
    return file == "home/archive/.recorder" || file == "home/stamping.sqlite";
  });
  return files;
}

TEST_P(Refuses, WithOneSentenceAndNothingHalfWritten) {
  const auto before = made_files(folder());
  EXPECT_REFUSED(kiroku(GetParam().arguments), GetParam().part);
  EXPECT_EQ(made_files(folder()), before);
}

INSTANTIATE_TEST_SUITE_P(
    Input, Refuses,
    testing::Values(
        Refusal{"NoSource", {"record"}, "--endoscope"},
        Refusal{"AbsentFilm", {"record", "--endoscope", "absent.mp4"}, "absent.mp4"},
        Refusal{"AbsentCamera", {"record", "--endoscope", "/dev/video99"}, "/dev/video99"},
        Refusal{"EmptyFilm", {"record", "--endoscope", "empty.mp4"}, "empty.mp4"},
        Refusal{"NoFilm", {"record", "--endoscope", "text.txt"}, "text.txt"},
        Refusal{"UnknownSynthetic", {"record", "--endoscope", "synthetic:kitchen"}, "kitchen"},
        Refusal{"TooWide", {"record", "--endoscope", "synthetic:endoscope?size=20000x64"}, "20000"},
        Refusal{"NoVitals", {"record", "--vitals", "bad.csv"}, "bad.csv"},
        Refusal{"SecondSourceAbsent",
                {"record", "--endoscope", "synthetic:endoscope", "--vitals", "absent.csv"},
                "absent.csv"},
        Refusal{
            "BadDuration", {"record", "--vitals", "synthetic:patient", "--duration", "soon"}, "--duration"},
        Refusal{"NoDuration", {"record", "--vitals", "synthetic:patient", "--duration", "0s"}, "--duration"},
        Refusal{"LongSegment", {"record", "--vitals", "synthetic:patient", "--segment", "11s"}, "--segment"},
        Refusal{"BadBitRate", {"record", "--vitals", "synthetic:patient", "--bitrate", "fast"}, "--bitrate"},
        Refusal{
            "AbsentSubject", {"record", "--vitals", "synthetic:patient", "--subject", "absent"}, "absent"},
        Refusal{"SubjectNoObject",
                {"record", "--vitals", "synthetic:patient", "--subject", "list.json"},
                "list.json"},
        Refusal{"NoHome", {"record", "--vitals", "synthetic:patient", "--home", "nocase"}, "kiroku init"},
        Refusal{"CasesNoHome", {"cases", "--home", "nocase"}, "no Kiroku home"},
        Refusal{"VerifyNoCase", {"verify", "nocase"}, "nocase"},
        Refusal{"VerifyAbsent", {"verify", "./absent"}, "./absent"},
        Refusal{"VerifyFile", {"verify", "text.txt"}, "text.txt"},
        Refusal{"ExportNoCase", {"export", "nocase", "--stream", "room", "-o", "x.ts"}, "nocase"},
        Refusal{
            "ExcerptNoCase", {"excerpt", "nocase", "--from", "0:0:0", "--to", "0:0:1", "-o", "x"}, "nocase"},
        Refusal{"VerifyNoTrust", {"verify", "nocase", "--trust", "text.txt"}, "text.txt"},
        Refusal{"ServeNoHome", {"tsa", "serve", "--home", "nocase"}, "no Kiroku home"}),
    [](const auto& test) { return std::string(test.param.name); });

class RefusesConfiguration : public ProgramTest {};

TEST_F(RefusesConfiguration, WithLineAndColumn) {
  make_demo_home();
  write_text(home() / "kiroku.toml", "[recording]\nprofil = \"mpeg2\"\n");
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient"}),
                 "kiroku.toml:2:1: unknown key 'profil'");
}

class RefusesCase : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
  }
  std::filesystem::path case_;
};

TEST_F(RefusesCase, WithAWrongIdentity) {
  if (!has_tool("age-keygen")) GTEST_SKIP() << "age-keygen is not installed";
  ASSERT_EQ(tool({"age-keygen", "-o", "other.txt"}).status, 0);
  const auto before = files_below(folder());
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "endoscope", "-i", "other.txt", "-o", "x.ts"}),
                 "identit");
  EXPECT_EQ(files_below(folder()), before);
}

TEST_F(RefusesCase, WithoutAnIdentity) {
  std::filesystem::remove(home() / "identity.txt");
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "endoscope", "-o", "x.ts"}),
                 "--identity FILE");
}

TEST_F(RefusesCase, WithAnUnknownStreamTimeOrEnding) {
  const auto before = files_below(folder());
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "kitchen", "-o", "x.ts"}),
                 "endoscope, vitals");
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "endoscope", "-o", "x.avi"}), ".avi");
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "endoscope", "--from", "noon", "-o", "x.ts"}),
                 "noon");
  EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "endoscope", "-o", "no/folder/x.ts"}),
                 "no/folder");
  EXPECT_EQ(files_below(folder()), before);
}

TEST_F(RefusesCase, ThatItMayNotWriteTo) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  const auto archive = home() / "archive";
  std::filesystem::permissions(archive,
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient", "--duration", "1s"}), "archive");
  std::filesystem::permissions(archive, std::filesystem::perms::owner_all);
}

TEST_F(RefusesCase, WhenItsLedgerIsNotOne) {
  const std::string ledger = read_text(case_ / "ledger.jsonl");
  const std::string open = ledger.substr(0, ledger.find('\n') + 1);
  for (const std::string& text :
       {std::string("\0\n", 2), std::string("{}\n"), std::string(100'000, '[') + "\n",
        std::string(3U << 20, 'x') + "\n", open.substr(0, open.size() - 2) + ",\"seq\":0}\n",
        std::string("{\"seq\":9007199254740993}\n")}) {
    write_text(case_ / "ledger.jsonl", text);
    const ProcessResult judged = kiroku({"verify", case_.string()});
    EXPECT_TRUE(judged.status == 1 || judged.status == 2) << judged.status << judged.out << judged.err;
    EXPECT_REFUSED(kiroku({"export", case_.string(), "--stream", "endoscope", "-o", "x.ts"}), "ledger.jsonl");
  }
}

}  // namespace
}  // namespace kiroku::test
