#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/log_compare_command.h"
#include "apps/kiroku/log_lines.h"
#include "apps/kiroku/log_prove_command.h"
#include "apps/kiroku/log_publish_command.h"
#include "apps/kiroku/witnessed_note.h"
#include "apps/verify/judging.h"
#include "apps/verify/outside_note.h"
#include "apps/verify/report_text.h"
#include "apps/verify/witness_judgement.h"
#include "archive/verify/report_json.h"
#include "archive/verify/verifier.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "base/printable.h"
#include "base/utc_time.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> home;
  std::vector<std::string> against;
  std::optional<std::string> witnesses;
  std::optional<std::string> policy;
  bool verify = false, json = false;
};

std::string as_json(const ordered_json& value) {
  return printable_json(value.dump(-1, ' ', false, ordered_json::error_handler_t::replace));
}

/// An object whose "entries" has an entry a line; nothing is held of a line that was printed.
void list_as_json(const fs::path& log) {
  std::cout << "{\n  \"log\": " << as_json(log.string()) << ",\n  \"entries\": [";
  const char* before = "\n    ";
  archive::for_each_log_line(log, [&](const archive::LogLine& line) {
    std::cout << std::exchange(before, ",\n    ") << as_json(ordered_json::parse(line.json));
  });
  std::cout << "\n  ]\n}\n";
}

/// What a column lacks; nothing where a line that came since is wider.
std::string padding(std::size_t width, std::size_t used) {
  return std::string(width - std::min(width, used), ' ');
}

void list_as_table(const fs::path& log, std::uint64_t entries, std::size_t widest_type) {
  const std::size_t digits = std::max(std::string_view("entry").size(), std::to_string(entries).size());
  const std::size_t when = format_local(UtcTime{}).size();
  const auto row = [&](const std::string& entry, const std::string& time, const std::string& what,
                       const std::string& more) {
    std::string line = padding(digits, entry.size()) + entry + "  " + time + padding(when, time.size()) +
                       "  " + what + padding(widest_type, what.size()) + "  " + more;
    line.erase(line.find_last_not_of(' ') + 1);
    std::cout << line << "\n";
  };
  row("entry", "when", "what", "");
  archive::for_each_log_line(log, [&](const archive::LogLine& line) {
    row(std::to_string(line.seq), format_local(line.utc), line.type, entry_details(line.json));
  });
}

/// Twice through the log, so that it is judged before a line is printed, and nothing of it is held.
int list(const Home& home, bool json) {
  const fs::path log = home.log_folder();
  std::uint64_t entries = 0;
  std::size_t widest_type = std::string_view("what").size();
  archive::for_each_log_line(log, [&](const archive::LogLine& line) {
    ++entries;
    widest_type = std::max(widest_type, line.type.size());
  });
  if (json) {
    list_as_json(log);
  } else {
    list_as_table(log, entries, widest_type);
  }
  return kDone;
}

int verify(const Home& home, const Request& request) {
  std::optional<crypto::WitnessPolicy> policy;
  if (request.witnesses) {
    policy = read_witnesses(*request.witnesses);
  }
  const timestamp::TrustStore trust = home.trust();
  archive::VerifyOptions options;
  options.devices = {home.device()};
  options.trust = &trust;
  KeptOutside kept = load_kept_outside(request.against);
  std::optional<archive::OutsideNote> witnessed = home_witnessed_note(home);
  std::optional<evidence::Policy> algorithms;
  if (request.policy) {
    algorithms = read_policy(*request.policy);
    options.policy = &*algorithms;
  }
  std::vector<archive::OutsideNote> notes = kept.newest(options.devices);  // that may hold cosignatures
  options.against = std::move(kept.notes);
  options.copies = std::move(kept.copies);
  // What the home keeps tells of a log that is another one, as when the archive's disk is not mounted.
  if (auto newest = home_newest_note(home)) options.against.push_back(std::move(*newest));
  if (witnessed) notes.push_back(*witnessed);
  // What the device signed and gave away binds it, whoever cosigned it.
  if (witnessed && is_of_log(*witnessed, home.device())) options.against.push_back(std::move(*witnessed));
  Progress progress("verifying");
  options.progress = [&progress](std::uint64_t done, std::uint64_t total) { progress.update(done, total); };
  const archive::VerificationReport report = archive::verify_log(home.log_folder(), options);
  std::optional<WitnessJudgement> witnesses;
  if (policy) witnesses = judge_log_witnesses(home.log_folder(), home.device(), *policy, notes, options);
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
  command.explain(
      "The checkpoint that 'kiroku witness ask' left in the home is compared with the log, too, as if it was "
      "given with --against. So is the newest checkpoint, which whoever writes the log keeps in the home, "
      "outside of the archive.");
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
  add_log_compare_command(command);
  add_log_prove_command(command);
  add_log_publish_command(command);
  add_log_follow_command(command);
}

}  // namespace kiroku::apps
