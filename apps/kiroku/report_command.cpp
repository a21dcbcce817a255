#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <pwd.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/verify_extras.h"
#include "apps/verify/judging.h"
#include "archive/verify/case_data.h"
#include "archive/verify/case_evidence.h"
#include "base/error.h"
#include "viewer/report/html_writer.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/proof_files.h"
#include "viewer/report/report_document.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  std::string named, output;
  JudgingRequest judging;
  std::optional<std::string> language, author;
  bool receipt = false, certificate = false, force = false, json = false;
};

/// The name that the system knows the person by.
std::string person() {
  const passwd* entry = ::getpwuid(::geteuid());
  if (entry == nullptr) return "uid " + std::to_string(::geteuid());
  const std::string full = entry->pw_gecos == nullptr ? "" : entry->pw_gecos;
  const std::string name = full.substr(0, full.find(','));
  return name.empty() ? entry->pw_name : name;
}

/// Now, or the time of SOURCE_DATE_EPOCH (reproducible-builds.org), with which a document can be made again
/// byte by byte.
UtcTime date_of_document() {
  const char* asked = std::getenv("SOURCE_DATE_EPOCH");
  if (asked == nullptr) return utc_now();
  const std::string text = asked;
  if (text.empty() || text.size() > 11 || text.find_first_not_of("0123456789") != std::string::npos) {
    throw UsageError("SOURCE_DATE_EPOCH is '" + text +
                     "', which is no number of seconds since 1970: unset it");
  }
  return UtcTime(std::chrono::seconds(std::stoll(text)));
}

report::Given given_of(const Judged& judged, const JudgingRequest& request) {
  report::Given given;
  for (const crypto::VerifierKey& key : judged.devices) given.devices.push_back({key.to_string(), {}});
  // Of what was taken from them: they may hold something else by now.
  const auto list_roots = [](const std::vector<TakenFile>& files, std::vector<report::GivenFile>& out) {
    for (const TakenFile& each : files) out.push_back({each.file.filename().string(), each.sha256});
  };
  list_roots(judged.roots, given.roots);
  list_roots(judged.own_roots, given.own_roots);
  if (request.evidence) {
    const std::string name = fs::path(*request.evidence).filename().string();
    given.evidence.push_back(
        {name, judged.report.evidence ? std::optional(judged.report.evidence->sha256) : std::nullopt});
  }
  if (request.policy) given.policy.push_back({fs::path(*request.policy).filename().string(), judged.policy});
  if (judged.log_proof) {
    given.proof.push_back({fs::path(judged.log_proof->name).filename().string(),
                           crypto::sha256(bytes_of(judged.log_proof->text))});
  }
  if (request.witnesses)
    given.witnesses.push_back({fs::path(*request.witnesses).filename().string(), judged.witnesses});
  if (judged.log) given.log.push_back({judged.log->string(), {}});
  given.against = report::given_notes(judged.against);
  for (const std::string& file : request.identities)
    given.identities.push_back({fs::path(file).filename().string(), {}});
  return given;
}

/// The home's own log must go on from the checkpoint that witnesses cosigned: a withdrawal that was cut off
/// behind it must not be missed.
report::StatedConsents stated_consents(const Judged& judged, const fs::path& case_folder,
                                       const VerifyExtras& extras) {
  try {
    const VerifyDefaults defaults = extras.defaults(case_folder);
    std::optional<crypto::Checkpoint> seen;
    if (defaults.witnessed_note && defaults.log == judged.log) {
      const std::string& note = defaults.witnessed_note->text;
      seen = crypto::Checkpoint::parse(crypto::open_note(note, defaults.devices).text);
    }
    return report::read_stated_consents(*judged.log, judged.devices, judged.report.case_id, seen);
  } catch (const Error& error) {
    return {{}, error.what()};
  }
}

/// The log with which the case was judged, if its device is trusted: what witnesses cosigned of it, as the
/// home keeps it, comes last.
std::optional<report::ComparedLog> compared_log(const Judged& judged, const fs::path& case_folder,
                                                const VerifyExtras& extras) {
  const auto device =
      std::ranges::find(judged.devices, judged.report.device, &crypto::VerifierKey::to_string);
  if (!judged.log || device == judged.devices.end()) return std::nullopt;
  report::ComparedLog log{*judged.log, *device, judged.against};
  VerifyDefaults defaults = extras.defaults(case_folder);
  if (defaults.witnessed_note && defaults.log == judged.log)
    log.kept.push_back(std::move(*defaults.witnessed_note));
  return log;
}

int run(const Request& request, const VerifyExtras& extras) {
  const fs::path output = request.output;
  const std::string ending = output.extension().string();
  if (ending != ".pdf" && ending != ".html") {
    throw UsageError("cannot write the report as " + request.output +
                     ": its ending says which form it takes, and must be .pdf or .html");
  }
  if (request.receipt && request.certificate)
    throw UsageError("--receipt and --certificate are two documents: ask for one at a time");
  if (!request.force && fs::exists(output)) {
    throw UsageError(request.output + " is there already: name another file, or give --force to replace it");
  }
  const fs::path folder = extras.find_case(request.named);
  const Judge judge(request.judging, extras);
  Judged judged = judge.judge(folder);

  report::ReportInput input;
  input.given = given_of(judged, request.judging);
  if (judged.log) input.consents = stated_consents(judged, folder, extras);
  const std::optional<report::ComparedLog> log = compared_log(judged, folder, extras);
  input.verification = std::move(judged.report);
  input.facts = report::read_case_facts(folder, input.verification);
  input.author = request.author.value_or(person());
  input.program = "kiroku " + std::string(version());
  input.made = date_of_document();
  input.language = report::parse_language(request.language.value_or("en"));
  if (ending == ".pdf" && !request.certificate) {
    const auto log_proof = report::log_proof_file(folder, input, judged.log_proof, log);
    if (request.receipt) {
      input.attachments = report::receipt_files(input, log_proof);
    } else {
      input.attachments = report::read_proof_files(
          folder, input,
          request.judging.evidence ? fs::path(*request.judging.evidence)
                                   : archive::evidence_file(folder, input.verification.case_id));
      if (log_proof) input.attachments.push_back(*log_proof);
    }
  }
  const report::Document document = request.receipt       ? report::make_receipt(input)
                                    : request.certificate ? report::make_certificate(input)
                                                          : report::make_report(input);
  OutputFile file(output);
  if (ending == ".pdf") {
    file.write(report::write_pdf(document));
  } else {
    file.write(bytes_of(report::write_html(document)));
  }
  file.commit(OutputFile::Durability::kEventually);

  const std::string verdict(archive::verdict_name(input.verification.verdict));
  if (request.json) {
    print_json({{"case", input.verification.case_id}, {"file", request.output}, {"verdict", verdict}});
  } else {
    std::cout << printable(request.output) << ": "
              << (request.receipt       ? "receipt"
                  : request.certificate ? "certificate"
                                        : "report")
              << " of " << printable(input.verification.case_id) << ", " << verdict << "\n";
  }
  return kDone;
}

}  // namespace

void add_report_command(Command& program) {
  Command& command =
      program.add_command("report", "writes what a verification finds as a document for people");
  const auto request = std::make_shared<Request>();
  const auto asked_home = std::make_shared<std::optional<std::string>>();
  const VerifyExtras extras = verify_extras(asked_home);
  command.argument("CASE", request->named,
                   "case folder, excerpt folder, or identifier of a case in the home's archive");
  command.required_option("-o,--output", "FILE", request->output,
                          "where to; its ending says in which form: .pdf or .html");
  command.choice("--language", {"en", "ja"}, request->language, "language of the document", "en");
  command.flag("--receipt", request->receipt,
               "one page to keep: root, size and device key, and a QR code of the signed checkpoint");
  command.flag("--certificate", request->certificate,
               "the form of a certificate under U.S. Federal Rules of Evidence 902(13) and (14), for a "
               "qualified person to complete and sign; of an intact record or excerpt alone");
  command.option("--by", "NAME", request->author, "who makes it, as it shall stand there",
                 "the name of your account");
  add_judging_options(command, request->judging, extras);
  add_home_option(command, *asked_home);
  command.flag("--force", request->force, "replaces a file that is there");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The case is verified as 'kiroku verify' does it; whatever the verdict, report and receipt are written "
      "and "
      "tell it, and the exit status is 0. A receipt needs a checkpoint that the device signed of the entries "
      "that are there. With SOURCE_DATE_EPOCH set, that is its date, and the same case "
      "and log give the same bytes. A PDF is PDF/A-3b. A report carries along, as attached files, the "
      "checkpoints, "
      "time-stamp tokens and evidence record that its proof of time rests on; a receipt its checkpoint. Of "
      "a whole case whose end the appliance log knows, both carry a proof from the log along "
      "(case.tlog-proof), as 'kiroku log prove' makes it; with --proof that one, if it holds.");
  command.example("kiroku report 20260805T091502Z-3f9c21ab -o report.pdf", "the report as A4 pages");
  command.example("kiroku report CASE --language ja --by 'Dr. Sato' -o report.html",
                  "one page for a browser, in Japanese");
  command.example("kiroku report CASE --receipt -o receipt.pdf",
                  "the receipt, for somebody else than who keeps the recording");
  command.example("kiroku report CASE --certificate -o certificate.pdf",
                  "a form that somebody who knows the recorder signs, for a court in the United States");
  command.on_run([request, extras] { return run(*request, extras); });
}

}  // namespace kiroku::apps
