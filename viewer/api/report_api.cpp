#include "viewer/api/report_api.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <thread>

#include "archive/verify/case_data.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "viewer/api/home_witnesses.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/proof_files.h"
#include "viewer/report/report_document.h"

namespace kiroku::viewer {

report::Language asked_language(const Request& request) {
  const std::string tag = request.query_text("language").value_or("en");
  try {
    return report::parse_language(tag);
  } catch (const UsageError& error) {
    throw Refusal(400, error.what());
  }
}

namespace {

enum class Kind { kReport, kReceipt };

/// As the page states them: by a log that goes on from what witnesses cosigned.
report::StatedConsents stated_consents(const ViewerHome& home, const std::string& case_id) {
  if (!home.consent.consents) return {};
  try {
    archive::Consents all = home.consent.consents();
    return {std::move(all[case_id].entries), ""};
  } catch (const Error& error) {
    return {{}, error.what()};
  }
}

/// The case is verified anew: a document says what was there when it was made.
report::ReportInput verify(const Request& request, const ViewerContext& context) {
  const ViewerHome& home = context.home();
  const std::filesystem::path folder = context.case_folder(request);
  archive::VerifyOptions options;
  options.devices = {home.device};
  options.trust = home.trust;
  options.log = home.log_folder;
  // A recorder may be at work on the same machine.
  options.threads = std::max(1U, std::thread::hardware_concurrency() / 2);
  report::ReportInput input;
  input.language = asked_language(request);
  const HomeWitnesses witnesses(home.folder, home.device);
  witnesses.ask_in(options);
  input.verification = archive::verify_case(folder, options);
  witnesses.say(input.verification);
  input.facts = report::read_case_facts(folder, input.verification);
  input.given.devices = {{home.device.to_string(), {}}};
  if (home.trust != nullptr) {
    input.given.roots = {{"trust.pem", {}}};
    input.given.own_roots = {{"own-authority.pem", {}}};
  }
  input.given.log = {{home.log_folder.string(), {}}};
  input.given.against = report::given_notes(options.against);
  if (options.witnesses != nullptr) input.given.witnesses = {{"witnesses.txt", {}}};
  input.consents = stated_consents(home, input.verification.case_id);
  input.author = request.session->user();
  input.program = "kiroku " KIROKU_VERSION;
  input.made = utc_now();
  return input;
}

/// One document at a time verifies its case.
class Turn {
 public:
  explicit Turn(std::mutex& mutex) : lock_(mutex, std::try_to_lock) {
    if (!lock_) throw Refusal(503, "another document is being made: try again in a moment");
  }

 private:
  std::unique_lock<std::mutex> lock_;
};

Response answer(const Request& request, ViewerContext& context, Kind kind, std::mutex& making) {
  const Turn turn(making);
  report::ReportInput input = verify(request, context);
  const bool receipt = kind == Kind::kReceipt;
  const std::filesystem::path folder = context.case_folder(request);
  const ViewerHome& home = context.home();
  const HomeWitnesses witnesses(home.folder, home.device);
  const auto log_proof = report::log_proof_file(
      folder, input, std::nullopt, report::ComparedLog{home.log_folder, home.device, witnesses.notes()});
  if (receipt) {
    input.attachments = report::receipt_files(input, log_proof);
  } else {
    input.attachments =
        report::read_proof_files(folder, input, archive::evidence_file(folder, input.verification.case_id));
    if (log_proof) input.attachments.push_back(*log_proof);
  }
  const report::Document document = receipt ? report::make_receipt(input) : report::make_report(input);
  const std::string& case_id = request.parameter("case");
  context.enter_access(request, case_id, receipt ? "made a receipt" : "made a verification report");
  return Response::bytes(report::write_pdf(document), "application/pdf")
      .with("Content-Disposition",
            "inline; filename=\"" + case_id + (receipt ? ".receipt.pdf\"" : ".report.pdf\""));
}

}  // namespace

void add_report_routes(Router& router, ViewerContext& context) {
  const auto making = std::make_shared<std::mutex>();
  router.add("GET", "api/cases/{case:case}/report.pdf", Right::kVerify,
             [&context, making](const Request& request) {
               return answer(request, context, Kind::kReport, *making);
             });
  router.add("GET", "api/cases/{case:case}/receipt.pdf", Right::kVerify,
             [&context, making](const Request& request) {
               return answer(request, context, Kind::kReceipt, *making);
             });
}

}  // namespace kiroku::viewer
