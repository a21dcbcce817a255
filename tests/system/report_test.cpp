#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

class Report : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
  }
  std::filesystem::path case_;
};

TEST_F(Report, TellsTheVerdictAsPdfAndHtml) {
  const auto made = kiroku_json({"report", case_.string(), "-o", "report.pdf", "--by", "Dr. Sato", "--json"});
  EXPECT_EQ(made["verdict"], "intact");
  EXPECT_EQ(made["case"], case_.filename().string());
  EXPECT_THAT(read_text(path("report.pdf")), testing::StartsWith("%PDF-1."));
  if (has_tool("pdfdetach")) {
    const std::string files = tool({"pdfdetach", "-list", "report.pdf"}).out;
    EXPECT_THAT(files, testing::AllOf(HasSubstr(".note"), HasSubstr(".tsr"), HasSubstr("receipt.pdf")));
  }
  if (has_tool("pdftotext")) {
    const std::string text = tool({"pdftotext", "-layout", "report.pdf", "-"}).out;
    EXPECT_THAT(text, HasSubstr("INTACT"));
    EXPECT_THAT(text, HasSubstr("Made by"));
    EXPECT_THAT(text, HasSubstr("Dr. Sato"));
    EXPECT_THAT(text, HasSubstr("kiroku 0.1.0"));
    EXPECT_THAT(text, HasSubstr("Not checked"));
  }
  ASSERT_EQ(kiroku({"report", case_.string(), "-o", "report.html", "--language", "ja"}).status, 0);
  EXPECT_THAT(read_text(path("report.html")), HasSubstr("検証報告書"));
}

TEST_F(Report, OfATamperedCaseIsWrittenAndNamesTheFile) {
  flip_byte(case_ / "segments/endoscope/00000001.ts.age", 500);
  const auto made = kiroku_json({"report", case_.string(), "-o", "report.html", "--json"});
  EXPECT_EQ(made["verdict"], "tampered");
  EXPECT_THAT(read_text(path("report.html")), HasSubstr("segments/endoscope/00000001.ts.age"));
  EXPECT_THAT(read_text(path("report.html")), HasSubstr("DOES NOT HOLD"));
}

TEST_F(Report, WithAnIdentitySaysThatThePicturesOpen) {
  const std::string identity = (home() / "identity.txt").string();
  ASSERT_EQ(kiroku({"report", case_.string(), "-i", identity, "-o", "report.html"}).status, 0);
  EXPECT_THAT(read_text(path("report.html")), HasSubstr("each was decrypted and decoded"));
  EXPECT_THAT(kiroku({"verify", "-i", identity, case_.string()}).out,
              testing::ContainsRegex("contents +([0-9]+) of [0-9]+ segments decrypted"));

  // What nobody opened is not said to have been looked at.
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  const std::string other = path("other/identity.txt");
  ASSERT_EQ(kiroku({"report", case_.string(), "-i", other, "-o", "unopened.html"}).status, 0);
  EXPECT_THAT(read_text(path("unopened.html")), HasSubstr("The keys that were given opened nothing."));
  EXPECT_THAT(kiroku({"verify", "-i", other, case_.string()}).out,
              testing::ContainsRegex("contents +none of [0-9]+ segments"));
}

TEST_F(Report, CertificateIsAFormOfAnIntactRecordAlone) {
  const auto made =
      kiroku_json({"report", case_.string(), "--certificate", "-o", "certificate.pdf", "--json"});
  EXPECT_EQ(made["verdict"], "intact");
  if (has_tool("pdftotext")) {
    EXPECT_THAT(tool({"pdftotext", "certificate.pdf", "-"}).out, HasSubstr("902(13)"));
  }
  EXPECT_REFUSED(kiroku({"report", case_.string(), "--certificate", "--receipt", "-o", "x.pdf"}),
                 "one at a time");
  EXPECT_REFUSED(kiroku({"report", case_.string(), "--certificate", "--language", "ja", "-o", "x.pdf"}),
                 "English");
  flip_byte(case_ / "segments/endoscope/00000001.ts.age", 500);
  EXPECT_REFUSED(kiroku({"report", case_.string(), "--certificate", "-o", "x.pdf"}), "tampered");
  EXPECT_FALSE(std::filesystem::exists(path("x.pdf")));
}

TEST_F(Report, IsTheSameBytesForTheSameDate) {
  Process::Options run = options({"report", case_.string(), "-o", "one.pdf", "--by", "me"});
  run.environment["SOURCE_DATE_EPOCH"] = "1785920102";
  ASSERT_EQ(run_process(run).status, 0);
  run.command[4] = "two.pdf";
  ASSERT_EQ(run.command[3], "-o");
  ASSERT_EQ(run_process(run).status, 0);
  EXPECT_EQ(read_text(path("one.pdf")), read_text(path("two.pdf")));
  run.environment["SOURCE_DATE_EPOCH"] = "yesterday";
  run.command[4] = "three.pdf";
  EXPECT_REFUSED(run_process(run), "SOURCE_DATE_EPOCH");
}

TEST_F(Report, RefusesWhatItCannotDo) {
  EXPECT_REFUSED(kiroku({"report", case_.string(), "-o", "report.doc"}), ".pdf or .html");
  write_text(folder() / "there.pdf", "mine");
  EXPECT_REFUSED(kiroku({"report", case_.string(), "-o", "there.pdf"}), "--force");
  EXPECT_EQ(read_text(path("there.pdf")), "mine");
  EXPECT_EQ(kiroku({"report", case_.string(), "-o", "there.pdf", "--receipt", "--force"}).status, 0);
  EXPECT_REFUSED(kiroku({"report", path("absent"), "-o", "x.pdf"}), "absent");
  EXPECT_FALSE(std::filesystem::exists(path("x.pdf")));
}

}  // namespace
}  // namespace kiroku::test
