#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/witness_judgement.h"
#include "apps/verify/judging.h"
#include "apps/verify/outside_note.h"
#include "apps/verify/report_text.h"
#include "archive/verify/report_json.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/utc_time.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> home;
  std::vector<std::string> against;
  std::optional<std::string> witnesses;
  std::optional<std::string> policy;
  bool verify = false, json = false;
};

/// What an entry says beyond its number, time and type: "case=… size=…".
std::string details(const std::string& line) {
  std::string out;
  const ordered_json entry = ordered_json::parse(line, nullptr, false);
  if (!entry.is_object()) return printable(line);
  for (const auto& [key, value] : entry.items()) {
    if (key == "type" || key == "seq" || key == "utc" || key == "mono_ns") continue;
    out +=
        (out.empty() ? "" : "  ") + key + "=" + (value.is_string() ? value.get<std::string>() : value.dump());
  }
  return printable(out);
}

int list(const Home& home, bool json) {
  if (json) {
    ordered_json entries = ordered_json::array();
    archive::for_each_log_line(home.log_folder(), [&](const archive::LogLine& line) {
      entries.push_back(ordered_json::parse(line.json));
    });
    print_json({{"log", home.log_folder().string()}, {"entries", entries}});
    return kDone;
  }
  std::vector<std::vector<std::string>> rows{{"entry", "when", "what", ""}};
  archive::for_each_log_line(home.log_folder(), [&](const archive::LogLine& line) {
    rows.push_back({std::to_string(line.seq), format_local(line.utc), line.type, details(line.json)});
  });
  std::cout << format_table(rows, "rlll", 0);
  return kDone;
}

/// Notes that may hold cosignatures: those that were given, and the home's own.
std::vector<archive::OutsideNote> notes_for_witnesses(const Home& home,
                                                      const archive::VerifyOptions& options) {
  std::vector<archive::OutsideNote> notes = options.against;
  std::error_code ignored;
  if (std::filesystem::exists(home.newest_witnessed_note(), ignored))
    notes.push_back(load_outside_note(home.newest_witnessed_note()));
  return notes;
}

bool counts_now(const evidence::Policy& algorithms) {
  const UtcTime now = utc_now();
  return algorithms.hash("sha256").holds_at(now) && algorithms.signature({"ed25519", 0, ""}).holds_at(now);
}

int verify(const Home& home, const Request& request) {
  std::optional<crypto::WitnessPolicy> policy;
  if (request.witnesses) {
    policy = crypto::WitnessPolicy::parse(
        text_of(read_small_file(*request.witnesses, "the policy of witnesses")), *request.witnesses);
  }
  const timestamp::TrustStore trust = home.trust();
  archive::VerifyOptions options;
  options.devices = {home.device()};
  options.trust = &trust;
  for (const std::string& note : request.against) options.against.push_back(load_outside_note(note));
  std::optional<evidence::Policy> algorithms;
  if (request.policy) {
    algorithms = read_policy(*request.policy);
    options.policy = &*algorithms;
  }
  Progress progress("verifying");
  options.progress = [&progress](std::uint64_t done, std::uint64_t total) { progress.update(done, total); };
  const archive::VerificationReport report = archive::verify_log(home.log_folder(), options);
  std::optional<WitnessJudgement> witnesses;
  if (policy)
    witnesses =
        judge_log_witnesses(home.log_folder(), home.device(), *policy, notes_for_witnesses(home, options));
  // Cosignatures are by Ed25519 over roots of SHA-256, as the log's own signatures are.
  if (witnesses && algorithms && !counts_now(*algorithms)) {
    witnesses->witnessed.quorum = false;
    witnesses->unused.emplace_back(
        "cosignatures prove nothing any more: Ed25519 or SHA-256 ended by the policy of algorithms");
  }
  progress.clear();
  if (request.json) {
    ordered_json object = archive::report_json(report);
    if (witnesses) object["witnesses"] = witnesses->json();
    print_json(object);
  } else {
    std::cout << report_text(report, home.log_folder().string(),
                             report.device == options.devices[0].to_string());
    if (witnesses) std::cout << witnesses->text();
  }
  const int status = archive::exit_status(report.verdict);
  const bool is_witnessed = !witnesses || witnesses->witnessed.quorum;
  return status == kDone && !is_witnessed ? kNoAnswer : status;
}

}  // namespace

void add_log_command(Command& program) {
  Command& command = program.add_command("log", "lists or verifies the appliance log");
  const auto request = std::make_shared<Request>();
  command.flag("--verify", request->verify, "judges the log instead of listing it");
  command.option(
      "--against", "NOTE", request->against,
      "with --verify: checkpoint of the log kept outside, or a copy of its folder from before: tells "
      "what was cut off or rewritten since");
  command.option(
      "--witnesses", "FILE", request->witnesses,
      "with --verify: a policy of witnesses; says who cosigned the log, as 'kiroku witness ask' left it "
      "or in notes of --against");
  command.option("--policy", "FILE", request->policy,
                 "with --verify: TOML file that says until when algorithms count", "no algorithm ends");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The appliance log states when the recorder ran, which cases it opened and closed, and who decrypted "
      "or "
      "exported what; it makes the removal of a whole case evident. With --verify, exit status as for "
      "'kiroku "
      "verify'.");
  command.example("kiroku log", "lists every entry");
  command.explain(
      "With --against, the log must still begin with the entries that the note was signed of. Whoever holds "
      "the "
      "device's key can cut the log's end off and sign the rest anew; only a note that was kept elsewhere "
      "(in a "
      "mail, on another machine, on paper) shows it. Of two notes of one size with different roots the "
      "device "
      "signed two logs, whatever is here now. A note of another log, or not signed by this home's device, "
      "could "
      "not be compared: exit status 3.");
  command.example("kiroku log --verify", "tells whether the log is whole");
  command.example("kiroku log --verify --against kept.note",
                  "tells also whether it goes on from a note that was kept elsewhere");
  command.explain(
      "With --witnesses, exit status 3 where the log is whole and the policy's quorum of witnesses has not "
      "cosigned "
      "it. Only cosignatures over entries that are here count.");
  command.explain(
      "With --policy, a log whose signatures or hash ended is unproven: no evidence record covers a log, so "
      "anybody can have written it since.");
  command.on_run([request] {
    const Home home = Home::open(request->home);
    if (!request->verify && !request->against.empty())
      throw UsageError("--against compares the log with a note: give --verify, too");
    if (!request->verify && request->witnesses)
      throw UsageError("--witnesses judges who cosigned the log: give --verify, too");
    if (!request->verify && request->policy)
      throw UsageError("--policy says by what the log is judged: give --verify, too");
    return request->verify ? verify(home, *request) : list(home, request->json);
  });
}

}  // namespace kiroku::apps
