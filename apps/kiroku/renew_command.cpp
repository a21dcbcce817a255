#include <algorithm>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/renewal_results.h"
#include "apps/verify/judging.h"
#include "archive/format/case_layout.h"
#include "archive/upkeep/evidence_renewal.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "recorder/record_stamper.h"
#include "viewer/http/disk_room.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using archive::EvidenceRenewal;
using nlohmann::ordered_json;

struct Request {
  std::vector<std::string> cases;
  std::optional<std::string> policy, home;
  bool dry_run = false, take_in = false, json = false;
};

std::vector<fs::path> all_cases(const Home& home) {
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(home.archive())) {
    if (archive::is_case_id(entry.path().filename().string()) && entry.is_directory() &&
        !archive::is_excerpt(entry.path())) {
      folders.push_back(entry.path());
    }
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

std::vector<fs::path> named_cases(const Home& home, const std::vector<std::string>& named) {
  std::vector<fs::path> folders;
  for (const std::string& name : named) {
    const fs::path folder = find_case(home, name);
    if (!home.holds(folder) || archive::is_excerpt(folder)) {
      throw UsageError("'" + name + "' is no case of " + home.archive().string() +
                       ": evidence records are kept where their cases are");
    }
    // Through the home, so that records lie where its archive keeps them.
    fs::path in_archive = home.archive() / fs::canonical(folder).filename();
    if (std::find(folders.begin(), folders.end(), in_archive) == folders.end()) {
      folders.push_back(std::move(in_archive));
    }
  }
  return folders;
}

/// --policy, else that of kiroku.toml.
evidence::Policy policy_of(const Home& home, const Configuration& configuration, const Request& request) {
  fs::path file;
  if (request.policy) {
    file = *request.policy;
  } else if (!configuration.evidence.policy.empty()) {
    file = home.folder() / configuration.evidence.policy;
  } else {
    return evidence::Policy::without_ends();
  }
  return read_policy(file);
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const Configuration configuration = home.configuration();
  const timestamp::TrustStore trust = home.trust();
  archive::EvidenceRenewalOptions options;
  options.trust = &trust;
  options.policy = policy_of(home, configuration, request);
  options.dry_run = request.dry_run;
  options.take_in = request.take_in;
  const std::vector<fs::path> cases =
      request.cases.empty() ? all_cases(home) : named_cases(home, request.cases);

  std::optional<archive::EvidenceLock> lock;
  std::optional<Authorities> authorities;
  std::unique_ptr<recorder::StampingQueue> queue;
  if (!request.dry_run) {
    lock = archive::EvidenceLock::take(archive::real_file_system(), home.archive());
    authorities.emplace(home, configuration, std::vector<std::string>{});
    queue = open_stamping_queue(home);
    // A record is small, and one that waits half a year too long is lost: so only what is due asks for room,
    // and what finds none waits.
    options.stamp = [&home, ask = recorder::record_stamper(authorities->named(), &trust, queue.get())](
                        crypto::HashAlgorithm algorithm, ByteView imprint) {
      viewer::require_disk_room(home.archive(), 0, "free some, then renew again");
      return ask(algorithm, imprint);
    };
  }
  const std::vector<EvidenceRenewal> results =
      archive::renew_evidence(archive::real_file_system(), cases, options);
  RenewalTeller teller("kiroku", request.dry_run);
  if (request.json) {
    ordered_json told = ordered_json::array();
    for (const EvidenceRenewal& each : results) {
      teller.count(each);
      told.push_back(renewal_json(each));
    }
    print_json({{"dry_run", request.dry_run}, {"cases", std::move(told)}});
  } else {
    for (const EvidenceRenewal& each : results) teller.tell(each);
    if (results.empty()) std::cout << "There is no case.\n";
    teller.sum_up();
  }
  return teller.status();
}

}  // namespace

void add_renew_command(Command& program) {
  Command& command = program.add_command(
      "renew", "begins and renews the evidence records that prove closed cases for decades");
  const auto request = std::make_shared<Request>();
  command.option("--case", "CASE", request->cases, "this case of the home alone");
  command.option("--policy", "FILE", request->policy,
                 "TOML file that says until when algorithms count; instead of [evidence] of kiroku.toml");
  command.flag("--dry-run", request->dry_run,
               "says what would be done and why; asks no authority, writes nothing, reads no recording");
  command.flag("--take-in", request->take_in,
               "also renews records that do not cover the newest entries of their case, and covers them");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A case without a record gets its first one. A record gets a new time-stamp before a certificate or an "
      "algorithm of its newest one ends. Before its hash ends, all data of the case is read again under the "
      "policy's new hash. One time-stamp serves all cases that need the same. It is asked of the authorities "
      "of kiroku.toml, an outside one first. Records lie beside the cases, as archive/evidence/CASE.ers; "
      "'kiroku verify' judges them.");
  command.explain(
      "A case that is still being recorded is left alone. One that is tampered with, or whose data cannot "
      "all be read, is named with these files, and nothing is renewed for it. A record that does not hold "
      "stays as it is. The others are renewed all the same.");
  command.explain(
      "What is added to a case behind its record, as an erasure or a late token, is outside it: a new "
      "time-stamp takes nothing in. It is counted here and in the report. --take-in reads all data of such "
      "cases again and covers it, too.");
  command.explain(
      "Exit status: 0 nothing is due any more, 1 a case or its record must be looked at, 2 wrong usage or "
      "unusable files, 3 something still waits for an authority. With --dry-run 3 also says that something "
      "is due.");
  command.example("kiroku renew --dry-run", "says what is due");
  command.example("kiroku renew", "does it, as the weekly timer does");
  command.example("kiroku renew --policy algorithms.toml --case 20260805T091502Z-3f9c21ab",
                  "renews one record by another policy");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
