#include "viewer/api/report_api.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/sample_case.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// The documents' routes over one case, called as the dispatcher calls them.
class ReportApi : public testing::Test {
 protected:
  ReportApi() {
    context_.emplace(ViewerHome{.archive = archive_.folder(),
                                .catalogue_file = temporary_ / "catalogue.sqlite",
                                .log_folder = archive_.log_folder(),
                                .users_file = temporary_ / "users.sqlite",
                                .control_socket = temporary_ / "control",
                                .copies_folder = temporary_ / "copies",
                                .device_key = &archive_.key(),
                                .device = archive_.device(),
                                .trust = archive_.options().trust,
                                .identities = {}},
                     SessionLimits{}, [](const std::string&) {});
    add_report_routes(router_, *context_);
  }

  Response get(const std::string& document, const std::string& language = "") {
    const Router::Match match = router_.match("GET", {"api", "cases", folder_.filename().string(), document});
    EXPECT_EQ(match.route->right, Right::kVerify);
    Request request;
    request.parameters = match.parameters;
    request.session = session_;
    if (!language.empty()) request.query.emplace_back("language", language);
    return match.route->handler(request);
  }
  [[nodiscard]] std::string log() const {
    std::ostringstream text;
    text << std::ifstream(archive_.log_folder() / "ledger.jsonl").rdbuf();
    return text.str();
  }

  test::TemporaryFolder temporary_;
  test::SampleArchive archive_;
  std::filesystem::path folder_ = test::SampleCase::write(archive_);
  std::shared_ptr<Session> session_ =
      std::make_shared<Session>("haru", Role::kAuditor, std::nullopt, Clock::system().now() + 1h);
  std::optional<ViewerContext> context_;
  Router router_;
};

TEST_F(ReportApi, AnswersDocumentsAsPdfAndEntersThem) {
  const Bytes report = *std::get<BytesBody>(get("report.pdf").body).bytes;
  EXPECT_THAT(text_of(report), testing::StartsWith("%PDF-1."));
  EXPECT_THAT(text_of(report), HasSubstr("/EmbeddedFiles"));
  EXPECT_THAT(log(), HasSubstr("made a verification report"));
  const Response receipt = get("receipt.pdf");
  EXPECT_EQ(receipt.type, "application/pdf");
  EXPECT_THAT(text_of(*std::get<BytesBody>(receipt.body).bytes), testing::StartsWith("%PDF-1."));
  for (const Bytes& document : {report, *std::get<BytesBody>(receipt.body).bytes})
    EXPECT_THAT(text_of(document), HasSubstr("(case.tlog-proof)")) << "the log's proof travels with it";
  EXPECT_THAT(log(), HasSubstr("made a receipt"));
  EXPECT_NE(*std::get<BytesBody>(get("report.pdf", "ja").body).bytes, report);
}

TEST_F(ReportApi, RefusesALanguageThatHasNoTexts) {
  try {
    (void)get("report.pdf", "tlh");
    FAIL();
  } catch (const Refusal& refusal) {
    EXPECT_EQ(refusal.status(), 400);
    EXPECT_THAT(refusal.what(), HasSubstr("'tlh'"));
  }
}

}  // namespace
}  // namespace kiroku::viewer
