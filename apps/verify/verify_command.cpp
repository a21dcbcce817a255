#include "apps/verify/verify_command.h"

#include <algorithm>
#include <iostream>
#include <sstream>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/json_output.h"
#include "apps/verify/judging.h"
#include "apps/verify/report_text.h"
#include "archive/format/case_layout.h"
#include "archive/format/file_reading.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "archive/verify/report_json.h"
#include "base/error.h"
#include "crypto/device_identity.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::vector<std::string> cases;
  JudgingRequest judging;
  bool excerpt = false, json = false, light = false;
  std::vector<std::string> light_streams;
};

/// What the verification proves, for the comparison with light.
LightQuestion light_question(const std::filesystem::path& folder, const archive::VerificationReport& report,
                             const Request& request) {
  LightQuestion question;
  question.folder = folder;
  question.lines_root = report.lines_root;
  question.identities = request.judging.identities;
  question.streams = request.light_streams;
  question.is_tampered = report.verdict == archive::Verdict::kTampered;
  if (!question.is_tampered && report.time != archive::TimeProof::kNone) question.brackets = report.brackets;
  question.by_outside_clocks =
      report.time == archive::TimeProof::kExternal || report.time == archive::TimeProof::kExternalInPart;
  return question;
}

/// What stands in the way of comparing light hides no verdict. That may be the folder's own doing, also where
/// it reads as wrong usage: a ledger that is gone, a stream that was renamed.
LightOutcome read_light(const VerifyExtras& extras, const LightQuestion& question) {
  const auto told = [](int status, const Error& error) {
    const ordered_json json{{"error", error.what()}};
    return LightOutcome{status, "Light: could not check: " + printable(error.what()) + "\n",
                        json.dump(-1, ' ', false, ordered_json::error_handler_t::replace)};
  };
  try {
    return extras.read_light(question);
  } catch (const UsageError& error) {
    return told(kRefused, error);
  } catch (const Error& error) {
    return told(kNoAnswer, error);
  }
}

/// Throws kiroku::UsageError where a log was given as a case, or a case as a log. By its first line, and by
/// its name: what is called like a case is judged as one, whatever somebody put into it.
void require_kind(const std::filesystem::path& folder, bool as_log) try {
  const std::filesystem::path normal = folder.lexically_normal();
  const std::filesystem::path name =
      normal.has_filename() ? normal.filename() : normal.parent_path().filename();
  const bool is_named_as_case = archive::is_case_id(name.string());
  if (is_named_as_case != as_log) return;
  const archive::ReadableFile ledger = archive::real_reading().open_to_read(folder / archive::kLedgerFile);
  const std::optional<std::string> line = archive::first_whole_line(ledger);
  if (!line) return;
  if (as_log && archive::parse_case_entry(*line).entry)
    throw UsageError(folder.string() + " is a case and no appliance log: leave out --as-log");
  if (!as_log && archive::parse_log_entry(*line).entry)
    throw UsageError(
        folder.string() +
        " is an appliance log and no case: --as-log verifies it, and --log compares cases with it");
} catch (const IoError&) {  // whoever verifies it says what cannot be read
}

int run(const Request& request, const VerifyExtras& extras, const std::string& program) {
  if (!request.judging.against.empty() && request.cases.size() > 1) {
    throw UsageError("--against takes notes of one case: verify the cases one by one");
  }
  if (request.judging.log_proof && request.cases.size() > 1)
    throw UsageError("--proof is of one case: verify the cases one by one");
  if (request.judging.log_proof && request.judging.as_log)
    throw UsageError("--proof is of a case, and --as-log judges a log: 'kiroku-verify CASE --proof FILE'");
  if (!request.light_streams.empty() && !request.light)
    throw UsageError("--light-stream says where --light looks: give --light, too");
  if (request.light && request.judging.as_log)
    throw UsageError("--light looks into the pictures of a case, and --as-log judges a log");
  const Judge judge(request.judging, extras);
  int status = kDone;
  ordered_json reports = ordered_json::array();
  bool first = true;
  for (const std::string& named : request.cases) {
    try {
      const std::filesystem::path folder = extras.find_case && !request.judging.as_log
                                               ? extras.find_case(named)
                                               : std::filesystem::path(named);
      require_kind(folder, request.judging.as_log);
      const Judged judged = judge.judge(folder);
      status = worse(status, archive::exit_status(judged.report.verdict, request.excerpt));
      if (!judged.is_witnessed()) status = worse(status, kNoAnswer);
      LightOutcome light;
      if (request.light) {
        light = read_light(extras, light_question(folder, judged.report, request));
        status = worse(status, light.status);
      }
      if (request.json) {
        reports.push_back(archive::report_json(judged.report));
        if (judged.log_witnesses) reports.back()["witnesses"] = judged.log_witnesses->json();
        if (request.light) reports.back()["light"] = ordered_json::parse(light.json);
      } else {
        const std::string log = request.judging.as_log ? ""
                                : judged.log           ? "compared with " + judged.log->string()
                                                       : no_log_words();
        std::cout << (first ? "" : "\n")
                  << report_text(judged.report, folder.string(), judged.device_trusted, log)
                  << (judged.log_witnesses ? judged.log_witnesses->text() : std::string()) << light.text
                  << std::flush;
        first = false;
      }
    } catch (const Error& error) {
      // One case that cannot be read does not hide what the others say.
      if (request.cases.size() == 1) throw;
      print_error(program, error.what());
      status = worse(status, kRefused);
      reports.push_back({{"case", named}, {"error", error.what()}});
    }
  }
  if (request.json) print_json(request.cases.size() == 1 ? reports[0] : ordered_json{{"cases", reports}});
  return status;
}

}  // namespace

std::vector<crypto::VerifierKey> parse_device_keys(std::string_view text,
                                                   const std::string& name_for_errors) {
  if (crypto::looks_like_device_identity(text)) {
    try {
      return {crypto::parse_device_identity(text)};
    } catch (const Error& error) {
      throw UsageError(name_for_errors + " is no device identity: " + error.what());
    }
  }
  std::vector<crypto::VerifierKey> keys;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    try {
      keys.push_back(crypto::VerifierKey::parse(line));
    } catch (const Error& error) {
      throw UsageError(name_for_errors + " is no device key file: " + error.what());
    }
  }
  if (keys.empty()) {
    throw UsageError(
        name_for_errors +
        " holds no device key: give the device.identity, or the device.pub, of the recorder's home");
  }
  return keys;
}

std::vector<crypto::VerifierKey> load_device_keys(const std::string& file_or_key) {
  std::error_code ignored;
  if (!std::filesystem::exists(file_or_key, ignored) &&
      std::count(file_or_key.begin(), file_or_key.end(), '+') >= 2) {
    return {crypto::VerifierKey::parse(file_or_key)};
  }
  const Bytes text = read_small_file(file_or_key, "the device key");
  return parse_device_keys(text_of(text), file_or_key);
}

void make_verify_command(Command& command, const VerifyExtras& extras) {
  const auto request = std::make_shared<Request>();
  const std::string program = command.full_name().substr(0, command.full_name().find(' '));
  const bool home = bool(extras.defaults);
  command.arguments("CASE", request->cases,
                    home ? "case folder, excerpt folder, or identifier of a case in the home's archive"
                         : "case folder or excerpt folder");
  add_judging_options(command, request->judging, extras);
  command.flag("--excerpt", request->excerpt,
               "an excerpt will do: an intact one gives exit status 0 instead of 4");
  command.flag("--as-log", request->judging.as_log, "CASE is the folder of an appliance log");
  if (extras.read_light) {
    command.flag("--light", request->light,
                 "also compares codes that a display in the room showed, or sounded (kiroku display), with "
                 "the ledger");
    command.option("--light-stream", "STREAM", request->light_streams,
                   "looks and listens for them in this stream alone; otherwise in every stream of pictures");
  }
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "--against compares with a signed note that was kept elsewhere: from a receipt, a replica, a mail. If "
      "the "
      "record has fewer entries than the note, or others, its end was cut off or its history rewritten, by "
      "whomever, and the answer is no. A note of another record, or not signed by a trusted device, could "
      "not "
      "be compared: exit status 3.");
  command.explain(
      "Witnesses say of a log that it is the only one, and of a case nothing: --witnesses changes no "
      "verdict. (In a home, the log's cosigned checkpoint that it keeps is compared, as with --against.) "
      "Where the policy's quorum did not cosign the case's end, exit status 0 or 4 becomes 3.");
  if (extras.read_light) {
    command.explain(
        "--light opens the pictures and their sound, so it takes an identity. It changes no verdict. Exit "
        "status 0 or 4 becomes 1 where pictures show, or sound carries, a code that the ledger did not have "
        "then, and 3 where codes were not read in nine of ten seconds, or in none. Sound in which no code "
        "was "
        "heard counts for nothing beside pictures. Of a case that reads as tampered it proves nothing. It "
        "cannot tell "
        "a film that somebody put together within seconds, with the recorder's ledger at hand.");
  }
  command.explain(
      "Exit status: 0 intact (also with stated gaps), 1 tampered, 2 wrong usage or unreadable, 3 incomplete "
      "or unproven, 4 an intact excerpt, which is a part of a case. --excerpt changes nothing else: an "
      "excerpt that is tampered or unproven still gives 1 or 3, and a whole case is judged as without it. Of "
      "several cases the worst counts. Time is external only as far as tokens under a root of --trust cover "
      "the case; a root of a recorder's own authority is recognised there, too, and gives self-issued time.");
  command.example(command.full_name() + " 20260805T091502Z-3f9c21ab --device device.pub --trust roots.pem",
                  "judges a case by a device key and roots that you trust");
  command.example(command.full_name() + " --excerpt for-the-court --device device.pub --trust roots.pem",
                  "judges an excerpt, and says what part of the case it is");
  command.example(command.full_name() + " CASE --against receipt.note",
                  "tells also whether the case is still the one of a printed receipt");
  command.example(
      command.full_name() + " CASE --device device.pub --proof case.tlog-proof --witnesses witnesses.txt",
      "tells without the log how it says that the case ended, and who witnessed that");
  command.example(command.full_name() + " --as-log archive/log --device device.pub --against kept.note",
                  "judges an appliance log by a note that was kept elsewhere");
  if (extras.read_light) {
    command.example(command.full_name() + " CASE --light --light-stream room -i identity.txt",
                    "tells also whether the room's pictures show the codes of this ledger");
  }
  command.example(command.full_name() + " --json CASE | jq -r .verdict", "prints the verdict alone");
  command.on_run([request, extras, program] { return run(*request, extras, program); });
}

}  // namespace kiroku::apps
