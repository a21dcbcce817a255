// 'kiroku-fleet renew': evidence records of stored cases are begun and renewed, by any number of workers.
#include <algorithm>
#include <array>
#include <iostream>
#include <memory>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/json_output.h"
#include "apps/common/scratch_folder.h"
#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/kiroku/renewal_results.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/verify/judging.h"
#include "archive/format/case_layout.h"
#include "archive/upkeep/evidence_renewal.h"
#include "base/error.h"
#include "base/number_text.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"
#include "fleet/catalogue/lease_keeper.h"
#include "fleet/catalogue/renewal_board.h"
#include "fleet/renewable_case.h"
#include "recorder/record_stamper.h"
#include "timestamp/client.h"

namespace kiroku::apps {
namespace {

using archive::EvidenceRenewal;
using nlohmann::ordered_json;
using What = EvidenceRenewal::What;

/// So many cases have one time-stamp at most. More of them would be lost to a worker that is killed.
constexpr std::size_t kBatch = 1'000;
/// A batch of which all data is read again takes days; one that hangs does not keep its cases for ever.
constexpr int kMostExtensions = 7 * 24 * 60 * 4;

struct Request {
  std::string configuration;
  std::optional<std::string> scratch, policy;
  bool dry_run = false, take_in = false, begin_anew = false, all = false, json = false;
};

/// Authorities as [[authority]] of the fleet names them.
std::vector<recorder::NamedAuthority> authorities_of(const FleetConfiguration& configuration) {
  std::vector<recorder::NamedAuthority> named;
  for (const AuthorityConfiguration& each : configuration.authorities) {
    recorder::BackOffPolicy pauses;
    pauses.min_interval = each.min_interval;
    named.push_back({each.name, timestamp::http_stamp_source(each.paths), pauses});
  }
  return named;
}

StoreConfiguration store_to_renew(const FleetConfiguration& configuration) {
  StoreConfiguration store = configuration.store;
  if (!configuration.evidence.credentials.empty()) store.credentials = configuration.evidence.credentials;
  return store;
}

/// Of the policy and the roots: by others a record may be due at another time.
std::string hash_of_rules(const FleetConfiguration& configuration,
                          const std::optional<std::filesystem::path>& policy) {
  crypto::Sha256 hash;
  const auto add = [&](const std::filesystem::path& file, const char* what) {
    hash.update(crypto::sha256(read_small_file(file, what)));
  };
  if (policy) add(*policy, "the policy of algorithms");
  constexpr std::array kRoots{std::byte{'r'}}, kOwn{std::byte{'o'}};
  hash.update(kRoots);
  for (const auto& each : configuration.trust) add(each, "certificates from");
  hash.update(kOwn);
  for (const auto& each : configuration.own_authority) add(each, "certificates from");
  return crypto::to_hex(hash.finish());
}

/// Nothing for what is none.
std::optional<crypto::Sha256Digest> digest_of(const std::string& hex) {
  const std::optional<Bytes> bytes = crypto::from_hex(hex);
  crypto::Sha256Digest digest{};
  if (!bytes || bytes->size() != digest.size()) return {};
  std::ranges::copy(*bytes, digest.begin());
  return digest;
}

class RenewalWorker {
 public:
  RenewalWorker(const FleetConfiguration& configuration, const Request& request)
      : configuration_(configuration),
        request_(request),
        policy_(request.policy ? std::optional<std::filesystem::path>(*request.policy)
                               : configuration.policy_file()),
        rules_(hash_of_rules(configuration, policy_)),
        trust_(configuration.trust_store()),
        scratch_(request.scratch),
        store_([this] { return configuration_.open_store(store_to_renew(configuration_)); }),
        board_(open_()),
        catalogue_(configuration.open_catalogue()),
        teller_("kiroku-fleet", request.dry_run) {
    options_.trust = &trust_;
    if (policy_) options_.policy = read_policy(*policy_);
    options_.dry_run = request.dry_run;
    options_.take_in = request.take_in;
    options_.begin_anew = request.begin_anew;
    due_ = {board_.now(), configuration.settles, rules_, configuration.evidence.look_every,
            request.all || request.take_in || request.begin_anew};
    if (request.dry_run) return;
    if (configuration.authorities.empty()) {
      throw UsageError(configuration.file.string() +
                       " names no [[authority]], whose time-stamps could renew a record: add one, with name "
                       "and url");
    }
    authorities_ = authorities_of(configuration);
    options_.stamp = recorder::record_stamper(authorities_, &trust_, nullptr);
  }

  void run() {
    if (request_.dry_run) {
      look(board_.look(due_), "");
    } else {
      while (!told_to_end() && take_batch()) {
      }
      if (const std::uint64_t held = board_.held_elsewhere(due_); held > 0)
        print_error("kiroku-fleet", std::to_string(held) + " more are in another worker's hands");
    }
    ended_early_ = told_to_end();
    out_of_reach_ = board_.out_of_reach();
  }

  int tell() const {
    if (request_.json) {
      print_json({{"dry_run", request_.dry_run},
                  {"ended_early", ended_early_},
                  {"not_looked_at", out_of_reach_},
                  {"cases", told_}});
    } else {
      teller_.sum_up();
    }
    if (out_of_reach_ > 0)
      print_error("kiroku-fleet",
                  "not looked at: " + counted(out_of_reach_, "case", "cases") +
                      " that the store lacks, that were never ended, or whose ledger cannot be read. "
                      "'kiroku-fleet cases' names them by their state");
    const int status = teller_.status();
    return status == kDone && (ended_early_ || out_of_reach_ > 0) ? kNoAnswer : status;
  }

 private:
  /// False where nothing is left.
  bool take_batch() {
    std::array<std::byte, 16> random{};
    crypto::fill_random(random);
    const std::string holder = crypto::to_hex(random);
    const std::vector<fleet::RenewalTurn> turns = board_.lease(due_, kBatch, holder, fleet::kLease);
    if (turns.empty()) return false;
    const fleet::LeaseKeeper keeper(
        [this, holder, board = std::make_shared<std::optional<fleet::RenewalBoard>>()] {
          try {
            if (!*board) board->emplace(open_());
            return (*board)->extend(holder, fleet::kLease);
          } catch (...) {
            board->reset();
            throw;
          }
        },
        kMostExtensions);
    try {
      look(turns, holder);
    } catch (...) {
      board_.give_back(holder);
      throw;
    }
    return true;
  }

  void look(const std::vector<fleet::RenewalTurn>& all, const std::string& holder) {
    fleet::RenewalBatch batch{store_, scratch_.path(), [] { return told_to_end(); }};
    std::vector<std::unique_ptr<archive::RenewableCase>> cases;
    std::vector<fleet::RenewalTurn> turns;
    for (const fleet::RenewalTurn& turn : all) {
      // Whoever may write the catalogue's rows names no folder here, and keeps no other case back.
      if (!archive::is_short_name(turn.appliance) || !archive::is_case_id(turn.case_id)) {
        EvidenceRenewal none;
        none.case_id = turn.case_id;
        none.text = "the catalogue has it of '" + printable(turn.appliance) + "', which names no case";
        finish(turn, holder, none);
        continue;
      }
      turns.push_back(turn);
      cases.push_back(std::make_unique<fleet::StoredRenewableCase>(batch, turn.appliance, turn.case_id,
                                                                   digest_of(turn.record)));
    }
    const std::vector<EvidenceRenewal> results = archive::renew_evidence(cases, options_);
    for (std::size_t i = 0; i < results.size(); ++i) finish(turns[i], holder, results[i]);
  }

  void finish(const fleet::RenewalTurn& turn, const std::string& holder, const EvidenceRenewal& result) {
    tell(turn.appliance, result);
    if (request_.dry_run) return;
    enter(turn, holder, result);
    // That it was intact when it was last verified is not to stand beside this.
    if (result.what == What::kRefused)
      catalogue_.accuse(turn.appliance, turn.case_id,
                        {"could-not-check", false, 0, "its evidence record was not renewed: " + result.text});
  }

  void tell(const std::string& appliance, const EvidenceRenewal& result) {
    if (!request_.json) {
      teller_.tell(result, appliance);
      return;
    }
    teller_.count(result);
    ordered_json one{{"appliance", appliance}};
    one.update(renewal_json(result));
    told_.push_back(std::move(one));
  }

  void enter(const fleet::RenewalTurn& turn, const std::string& holder, const EvidenceRenewal& result) {
    fleet::RenewalFound found;
    found.appliance = turn.appliance;
    found.case_id = turn.case_id;
    found.what = archive::name_of(result.what);
    found.detail = result.text;
    if (result.before) found.renew_from = *result.before - options_.policy.renew_before();
    found.record = result.holds ? crypto::to_hex(*result.holds) : turn.record;
    found.again =
        result.what == What::kRefused || result.what == What::kWaits || result.what == What::kStillOpen;
    if (!board_.enter(holder, rules_, found))
      print_error("kiroku-fleet", turn.appliance + "/" + turn.case_id +
                                      ": it took too long, and is another worker's by now: what was done "
                                      "for it stands in the store all the same");
  }

  const FleetConfiguration& configuration_;
  const Request& request_;
  const std::optional<std::filesystem::path> policy_;
  const std::string rules_;
  const timestamp::TrustStore trust_;
  const ScratchFolder scratch_;
  fleet::StoreConnections store_;
  const std::function<fleet::RenewalBoard()> open_ = [this] {
    return fleet::RenewalBoard(fleet::Postgres(configuration_.connection));
  };
  fleet::RenewalBoard board_;
  fleet::FleetCatalogue catalogue_;
  RenewalTeller teller_;
  std::vector<recorder::NamedAuthority> authorities_;
  archive::EvidenceRenewalOptions options_;
  fleet::RenewalBoard::Due due_;
  ordered_json told_ = ordered_json::array();
  bool ended_early_ = false;
  std::uint64_t out_of_reach_ = 0;
};

int run(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  end_when_told();
  RenewalWorker worker(configuration, request);
  worker.run();
  return worker.tell();
}

}  // namespace

void add_fleet_renew_command(Command& program) {
  Command& command = program.add_command(
      "renew", "begins and renews the evidence records that prove stored cases for decades");
  command.explain(
      "What 'kiroku renew' does on an appliance, this does for closed cases in the store: a case without an "
      "evidence record gets one, a record gets a new time-stamp before its newest one ends, and before its "
      "hash ends all data of the case is read again. One time-stamp, of an [[authority]], serves all cases "
      "of a batch. [evidence] names the policy, and an access key that may put.");
  command.explain(
      "A time-stamp renewal reads ledger, checkpoints and time-stamps alone. Where all data is read, each "
      "segment comes out of the store and goes again: the scratch folder needs no room for a case. The "
      "record becomes a new version beside the case, <appliance>/evidence/CASE.ers, locked like its ledger. "
      "No version is removed. Where an appliance renews, too, both records stay; whoever fetches the case "
      "gets the one that holds and proves the earliest time.");
  command.explain(
      "A case is looked at when it is new or changed, its record is due, the policy or a root is another, "
      "something was left undone, or [evidence] 'every' is over. Any number of these may run: each takes "
      "cases that no other has. A case that is tampered with, or whose data cannot all be read, is named "
      "with these files, and nothing is renewed for it. A store or an authority that is away is waited for.");
  command.explain(
      "Exit status: 0 nothing is due any more, 1 a case or its record must be looked at, 2 wrong usage or "
      "unusable files, 3 something still waits, a case could not be looked at, or Ctrl-C came. With "
      "--dry-run 3 also says that something is due.");
  const auto request = std::make_shared<Request>();
  command.option("--policy", "FILE", request->policy,
                 "TOML file that says until when algorithms count; instead of [evidence] of the "
                 "configuration");
  command.flag("--dry-run", request->dry_run,
               "says what would be done and why; asks no authority, writes nothing, reads no recording");
  command.flag("--take-in", request->take_in,
               "also renews records that do not cover the newest entries of their case, and covers them");
  command.flag("--begin-anew", request->begin_anew,
               "also begins a record for cases of which no record holds; the others stay beside it");
  command.flag("--all", request->all, "looks at every closed case, whatever was found before");
  command.option("--scratch", "DIR", request->scratch, "where a ledger and some segments have room",
                 "the folder for temporary files");
  command.writes("--scratch");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet renew --dry-run", "says what is due");
  command.example("kiroku-fleet renew --scratch /srv/scratch", "does it, as the weekly timer does");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
