#include <algorithm>
#include <csignal>
#include <sstream>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

class Token : public ProgramTest {
 protected:
  void SetUp() override {
    for (const char* name : {"openssl", "curl"}) {
      if (!has_tool(name)) GTEST_SKIP() << name << " is not installed";
    }
    make_demo_home();
    write_text(folder() / "data", "to be stamped\n");
  }
  /// Serves the home's authority, has stock tools ask it for a time-stamp of `data`, and ends it with Ctrl-C.
  void stamp(const std::string& hash = "-sha256") const {
    Process authority(options({"tsa", "serve", "--listen", "127.0.0.1:0", "--json"}));
    ASSERT_TRUE(authority.wait_for("}\n"));
    const std::string url = nlohmann::json::parse(authority.out()).at("url");
    ASSERT_EQ(tool({"openssl", "ts", "-query", "-data", "data", hash, "-cert", "-out", "query"}).status, 0);
    ASSERT_EQ(tool({"curl", "-sSf", "-H", "Content-Type: application/timestamp-query", "--data-binary",
                    "@query", "-o", "response", url})
                  .status,
              0);
    authority.signal(SIGINT);
    EXPECT_EQ(authority.wait().status, 0);
  }
  [[nodiscard]] std::string own() const { return (home() / "own-authority.pem").string(); }
};

TEST_F(Token, OfTheHomesAuthorityIsVerifiedByStockOpenssl) {
  stamp();
  const ProcessResult verified =
      tool({"openssl", "ts", "-verify", "-data", "data", "-in", "response", "-CAfile", own()});
  EXPECT_EQ(verified.status, 0) << verified.out << verified.err;
}

TEST_F(Token, IsValidForItsDataAndNoOther) {
  stamp();
  const ProcessResult valid =
      kiroku({"token", "verify", "response", "--data", "data", "--own-authority", own()});
  EXPECT_EQ(valid.status, 0) << valid.out << valid.err;
  EXPECT_THAT(valid.out, testing::StartsWith("VALID: "));
  write_text(folder() / "other", "something else\n");
  const ProcessResult refused =
      kiroku({"token", "verify", "response", "--data", "other", "--own-authority", own()});
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_THAT(refused.out, HasSubstr("token-imprint-differs"));
}

TEST_F(Token, TakesTheHomesRootsWhereNoneIsNamed) {
  stamp();
  const auto answer = kiroku_json({"token", "verify", "response", "--data", "data", "--json"});
  EXPECT_EQ(answer["verdict"], "valid");
  EXPECT_EQ(answer["token"]["algorithm"], "sha256");
  EXPECT_EQ(answer["time"], "self-issued");
}

TEST_F(Token, OfTheHomesAuthorityIsSelfIssuedHoweverItsRootIsGiven) {
  stamp();
  for (const char* option : {"--own-authority", "--trust"}) {
    const auto answer =
        kiroku_json({"token", "verify", "response", "--data", "data", option, own(), "--json"});
    EXPECT_EQ(answer["verdict"], "valid") << option;
    EXPECT_EQ(answer["time"], "self-issued") << option;
  }
}

TEST_F(Token, OfAnOlderHomeWhoseOwnRootStandsInTrustPemIsSelfIssued) {
  stamp();
  std::filesystem::rename(own(), home() / "trust.pem");
  const auto answer = kiroku_json({"token", "verify", "response", "--data", "data", "--json"});
  EXPECT_EQ(answer["verdict"], "valid");
  EXPECT_EQ(answer["time"], "self-issued");
  EXPECT_THAT(kiroku({"doctor", "--json"}).out, HasSubstr("own-authority.pem"));
  // The authority was made anew since: only trust.pem knows the former root.
  std::filesystem::remove(home() / "authority/ca.pem");
  EXPECT_EQ(kiroku_json({"token", "verify", "response", "--data", "data", "--json"})["time"], "self-issued");
}

TEST_F(Token, IsJudgedByTheHashAloneInItsOwnHashFunction) {
  stamp("-sha512");
  std::string digest = tool({"sha512sum", "data"}).out.substr(0, 128);
  EXPECT_EQ(kiroku({"token", "verify", "response", "--digest", digest}).status, 0);
  EXPECT_EQ(kiroku({"token", "verify", "response", "--data", "data"}).status, 0);
  digest[0] = digest[0] == '0' ? '1' : '0';
  EXPECT_EQ(kiroku({"token", "verify", "response", "--digest", digest}).status, 1);
}

TEST_F(Token, CouldNotBeCheckedUnderAForeignRoot) {
  stamp();
  ASSERT_EQ(tool({"openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes",
                  "-keyout", "foreign.key", "-out", "foreign.pem", "-subj", "/CN=foreign", "-days", "10"})
                .status,
            0);
  const ProcessResult unknown =
      kiroku({"token", "verify", "response", "--data", "data", "--trust", "foreign.pem"});
  EXPECT_EQ(unknown.status, 2) << unknown.out;
  EXPECT_THAT(unknown.out, testing::StartsWith("COULD NOT BE CHECKED: "));
}

TEST_F(Token, VerificationRefusesUnusableInput) {
  stamp();
  write_text(folder() / "page.html", "<html>502 Bad Gateway</html>");
  EXPECT_EQ(kiroku({"token", "verify", "page.html", "--data", "data"}).status, 1);
  EXPECT_REFUSED(kiroku({"token", "verify", "absent", "--data", "data"}), "absent");
  EXPECT_REFUSED(kiroku({"token", "verify", "response", "--data", "absent"}), "absent");
  EXPECT_REFUSED(kiroku({"token", "verify", "response"}), "--data FILE");
  EXPECT_REFUSED(kiroku({"token", "verify", "response", "--digest", "XYZ"}), "XYZ");
  EXPECT_REFUSED(kiroku({"token", "verify", "response", "--data", "data", "--trust", "page.html"}),
                 "page.html");
}

TEST_F(Token, ServicesOfATrustedListAreListedAndTrusted) {
  const std::string list = (source_folder() / "tests/fuzz/seeds/trusted_list/one_service").string();
  const ProcessResult listed = kiroku({"token", "services", list, "-o", "qualified.pem"});
  EXPECT_EQ(listed.status, 0) << listed.err;
  EXPECT_THAT(listed.out, HasSubstr("trusted list of IE, number 17 of 2019-07-29"));
  EXPECT_THAT(listed.out, HasSubstr("granted since 2017-08-31  Adobe"));
  EXPECT_EQ(tool({"openssl", "x509", "-in", "qualified.pem", "-noout"}).status, 0);
  EXPECT_REFUSED(kiroku({"token", "services", list, "-o", "qualified.pem"}), "--force");
  EXPECT_REFUSED(kiroku({"token", "services", "data"}), "no XML");

  // The home's own authority is on no list, and without a root of its own nobody vouches for its token.
  stamp();
  const ProcessResult unknown =
      kiroku({"token", "verify", "response", "--data", "data", "--trusted-list", list});
  EXPECT_EQ(unknown.status, 2) << unknown.out;
  EXPECT_THAT(unknown.out, HasSubstr("qualified could not be told: the token is not valid"));
}

/// A record of one time-stamp without a hash tree.
std::string xml_record_of(const std::string& token) {
  return "<EvidenceRecord xmlns='urn:ietf:params:xml:ns:ers' Version='1.0'><ArchiveTimeStampSequence>"
         "<ArchiveTimeStampChain Order='1'><DigestMethod "
         "Algorithm='http://www.w3.org/2001/04/xmlenc#sha256'/><CanonicalizationMethod "
         "Algorithm='http://www.w3.org/2001/10/xml-exc-c14n#'/><ArchiveTimeStamp Order='1'><TimeStamp>"
         "<TimeStampToken Type='RFC3161'>" +
         token +
         "</TimeStampToken></TimeStamp></ArchiveTimeStamp></ArchiveTimeStampChain>"
         "</ArchiveTimeStampSequence></EvidenceRecord>";
}

TEST_F(Token, OfARecordInXmlIsJudgedOverItsFile) {
  stamp();
  ASSERT_EQ(tool({"openssl", "ts", "-reply", "-in", "response", "-token_out", "-out", "token"}).status, 0);
  const ProcessResult base64 = tool({"openssl", "base64", "-in", "token"});
  write_text(folder() / "record.xml", xml_record_of(base64.out));
  const auto answer = kiroku_json({"token", "evidence", "record.xml", "data", "--json"});
  EXPECT_EQ(answer["verdict"], "holds");
  EXPECT_EQ(answer["form"], "rfc6283");
  EXPECT_EQ(answer["outside"], false) << "the home's own authority is nobody else's clock";
  EXPECT_EQ(answer["time_stamps"].size(), 1U);
  EXPECT_THAT(kiroku({"token", "evidence", "record.xml", "data"}).out,
              testing::StartsWith("HOLDS, by the recorder's own word: the file was there"));
  EXPECT_EQ(answer["only_as_canonical_xml"], nlohmann::json::array());

  write_text(folder() / "other", "something else\n");
  const ProcessResult of_other = kiroku({"token", "evidence", "record.xml", "other"});
  EXPECT_EQ(of_other.status, 1) << of_other.out;
  EXPECT_THAT(of_other.out, HasSubstr("record-imprint-differs"));
  write_text(folder() / "broken.xml", xml_record_of("no token"));
  EXPECT_REFUSED(kiroku({"token", "evidence", "broken.xml", "data"}), "is no base64");
  EXPECT_REFUSED(kiroku({"token", "evidence", "response", "data"}),
                 "cannot read the evidence record response");
}

TEST_F(Token, OfARecordInXmlOverCanonicalXmlThatIsSaid) {
  // What is stamped is the canonical form, in the file that is called data.
  write_text(folder() / "data", "<a b=\"1\"></a>");
  stamp();
  ASSERT_EQ(tool({"openssl", "ts", "-reply", "-in", "response", "-token_out", "-out", "token"}).status, 0);
  write_text(folder() / "record.xml", xml_record_of(tool({"openssl", "base64", "-in", "token"}).out));
  EXPECT_THAT(kiroku({"token", "evidence", "record.xml", "data"}).out,
              testing::StartsWith("HOLDS, by the recorder's own word: the file was there"));
  write_text(folder() / "written.xml", "<a  b='1'><!-- said later --></a>");
  const ProcessResult held = kiroku({"token", "evidence", "record.xml", "written.xml"});
  EXPECT_EQ(held.status, 0) << held.out;
  EXPECT_THAT(held.out,
              testing::StartsWith("HOLDS, by the recorder's own word: the file's canonical XML was there"));
  EXPECT_THAT(held.out, HasSubstr("written.xml: how it is written is not covered"));
  const auto answer = kiroku_json({"token", "evidence", "record.xml", "written.xml", "--json"});
  EXPECT_EQ(answer["only_as_canonical_xml"], nlohmann::json::array({"written.xml"}));
  // Of what is not covered nothing is said of the form in which it is.
  write_text(folder() / "other.xml", "<a  b='2'/>");
  const auto of_other =
      nlohmann::json::parse(kiroku({"token", "evidence", "record.xml", "other.xml", "--json"}).out);
  EXPECT_EQ(of_other["verdict"], "refused");
  EXPECT_EQ(of_other["only_as_canonical_xml"], nlohmann::json::array());
  write_text(folder() / "sjis.xml", "<?xml version='1.0' encoding='Shift_JIS'?><a b='1'></a>");
  const ProcessResult open = kiroku({"token", "evidence", "record.xml", "sjis.xml"});
  EXPECT_EQ(open.status, 2) << open.out;
  EXPECT_THAT(open.out, HasSubstr("UTF-8 alone is read"));
}

TEST_F(Token, ACasesOwnRecordIsJudgedOverItsFilesAsAnybodyElsesIs) {
  const std::filesystem::path made = record();
  ASSERT_EQ(kiroku({"renew"}).status, 0);
  // The lines that the newest checkpoint covers, and every file that they name.
  std::string newest;
  Arguments command{"token",
                    "evidence",
                    (home() / "archive/evidence" / (made.filename().string() + ".ers")).string(),
                    "lines",
                    "--own-authority",
                    own(),
                    "--json"};
  for (const char* folder_name : {"checkpoints", "tokens", "segments"}) {
    for (const auto& each : std::filesystem::recursive_directory_iterator(made / folder_name)) {
      if (!each.is_regular_file()) continue;
      command.push_back(each.path().string());
      if (each.path().extension() == ".note") newest = std::max(newest, each.path().stem().string());
    }
  }
  if (std::filesystem::exists(made / "subject.age")) command.push_back((made / "subject.age").string());
  std::istringstream ledger(read_text(made / "ledger.jsonl"));
  std::string lines, line;
  for (int i = 0; i < std::stoi(newest) && std::getline(ledger, line); ++i) lines += line + "\n";
  write_text(folder() / "lines", lines);
  const auto covered = nlohmann::json::parse(kiroku(command).out);
  EXPECT_EQ(covered["form"], "rfc4998");
  EXPECT_EQ(covered["verdict"], "holds") << covered;
  write_text(folder() / "lines", lines + "\n");
  EXPECT_EQ(nlohmann::json::parse(kiroku(command).out)["problems"][0]["code"], "record-data-not-covered");
}

TEST_F(Token, AuthorityRefusesAnAddressItCannotListenOn) {
  EXPECT_REFUSED(kiroku({"tsa", "serve", "--listen", "nonsense"}), "nonsense");
  EXPECT_REFUSED(kiroku({"tsa", "serve", "--listen", "203.0.113.1:3161"}), "203.0.113.1");
}

}  // namespace
}  // namespace kiroku::test
