// 'kiroku quality study report'.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/stamped_file.h"
#include "apps/quality/study_command.h"
#include "apps/quality/study_results.h"
#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "media/output_file.h"
#include "media/output_folder.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr const char* kResults = "study-report.json";

struct Request {
  std::string folder;
  std::vector<std::string> identities;
  std::optional<std::string> output, home;
  NamedRoots roots;
  bool force = false, json = false;
};

std::string why_kept(const fs::path& folder) {
  return fs::exists(folder / kResults)
             ? ""
             : "it has no " + std::string(kResults) + " and so is no earlier report";
}

void write(const media::OutputFolder& folder, const std::string& name, ByteView bytes) {
  media::OutputFile file(folder.path() / name, false);
  file.write(bytes);
  file.commit();
}

int run(const Request& request) {
  const fs::path folder = request.folder;
  const study::StudyOnDisk on_disk = study::read_study(folder);
  study::ClosedStudy closed = [&] {
    StepLine line;
    line.show("looking whether films, key and answers are as they were");
    return study::check_closed(folder, on_disk);
  }();
  const std::optional<Home> home = Home::find(request.home);
  std::ranges::move(check_tokens(request.roots, home, folder / study::kSealedFile, closed.closing.sha256),
                    std::back_inserter(closed.checks));
  if (verdict_of(closed.checks) == Check::Answer::kDiffers) {
    // Its own words, since the key stays closed.
    return tell_checks(request.folder, on_disk.study.title, closed.checks,
                       {{"study", on_disk.study.id}, {"sha256", crypto::to_hex(closed.closing.sha256)}},
                       request.json);
  }
  std::optional<media::OutputFolder> output;
  if (request.output) output.emplace(*request.output, request.force, why_kept);
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  const Bytes key_bytes = crypto::unseal_bytes(closed.key, identities);
  StudyResult result;
  result.study = on_disk.study;
  result.key = study::parse_key(text_of(key_bytes), on_disk.study);
  result.closing = closed.closing;
  result.checks = closed.checks;
  result.ratings = study::ratings_of(result.study, result.key, closed.answers);
  result.findings = study::findings_of(result.study, result.key, result.ratings);
  const nlohmann::ordered_json all = study_json(result);
  if (output) {
    write(*output, kResults,
          bytes_of(all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n"));
    write(*output, "answers.csv", bytes_of(study_csv(result)));
    write(*output, "study-report.pdf", study_pdf(result));
    write(*output, "study-report.html", bytes_of(study_html(result)));
    output->commit();
  }
  if (request.json) {
    print_json(all);
    return kDone;
  }
  std::cout << study_text(result);
  for (const Check& check : result.checks) {
    if (check.answer == Check::Answer::kUnknown)
      print_error("kiroku", "warning: " + check.what + ": " + check.text);
  }
  if (request.output)
    std::cout << "\nAll of it is in " << printable((fs::path(*request.output) / "study-report.html").string())
              << "\n";
  return kDone;
}

}  // namespace

void add_study_report_command(Command& study) {
  Command& command = study.add_command("report", "opens the key of a closed study, and says what came of it");
  const auto request = std::make_shared<Request>();
  command.argument("FOLDER", request->folder, "what 'study close' closed");
  command.option("-i,--identity", "FILE", request->identities,
                 "who can open the key; a demonstration home's own if none is named");
  command.option("-o,--output", "FOLDER", request->output,
                 "a folder for study-report.html, .json and .pdf, and answers.csv");
  add_root_options(command, request->roots);
  add_home_option(command, request->home);
  command.flag("--force", request->force, "replaces an earlier report in the output folder");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "First it looks whether answers, key and films are as they were when the study was closed, and what "
      "its time-stamps say. If anything differs it says so, and the key stays closed.");
  command.explain(
      "For each coding and question: how often each point was given, median, share of 4 and 5, and kappa of "
      "the "
      "readers with its 95 % interval (Cohen's of two, Fleiss' of more), also weighted by squares; codings "
      "beside each other by Wilcoxon's exact signed-rank test over clips; and how far each reader agrees "
      "with "
      "themselves.");
  command.explain("Exit status: 0 reported, 1 something was changed since the study was closed.");
  command.example("kiroku quality study report reading --identity statistician.txt -o reading-report",
                  "tables on the terminal, and a folder with page, PDF, JSON and every answer");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
