// 'kiroku-fleet verify': stored cases are verified anew, by any number of workers.
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/stored_judge.h"
#include "apps/fleet/verified_cases.h"
#include "apps/kiroku/told_to_end.h"
#include "base/error.h"
#include "fleet/catalogue/lease_keeper.h"

namespace kiroku::apps {
namespace {

/// A case that is known for so long and has no end was cut off; one that is changed again and again waits no
/// longer.
constexpr std::chrono::hours kLongestPending{48};
/// Before a case that could not be checked is tried again.
constexpr std::chrono::minutes kPause{30};
constexpr std::chrono::seconds kLook{30};
/// Before whoever asks for all looks again for cases that other workers hold.
constexpr std::chrono::seconds kLookForOthers{1};

struct Request {
  std::string configuration;
  std::optional<std::string> scratch;
  bool follow = false, all = false, json = false;
};

class Worker {
 public:
  Worker(const FleetConfiguration& configuration, const Request& request)
      : configuration_(configuration),
        request_(request),
        judge_(configuration, request.scratch, StoredJudge::Mends::kAsConfigured),
        catalogue_(open_()) {}

  /// All that is due, one after the other, until it is told to end. With --all the catalogue is asked at last
  /// what was not due, or another worker's.
  void run() {
    const UtcTime began = catalogue_.now();
    // What could not be checked before may be checked by now: whoever asks for all is not told of a pause.
    if (request_.all) catalogue_.end_pauses();
    while (!told_to_end()) {
      fleet::FleetCatalogue::Due due{configuration_.verify_every, configuration_.settles, kLongestPending};
      // With --all what this run has verified is not due again.
      if (request_.all) due.verified_before = began;
      const auto lease = catalogue_.lease(due, fleet::kLease);
      if (lease) {
        take(*lease);
      } else if (!request_.all) {
        return;
      } else if (catalogue_.held_elsewhere(due) == 0) {
        verified_.compare(catalogue_.totals());
        return;
      } else {
        // Another worker may have been killed over it.
        if (!std::exchange(waited_, true))
          print_error("kiroku-fleet", "waiting for cases that other workers verify; Ctrl-C ends it");
        wait_until_told(kLookForOthers);
      }
    }
    verified_.end_early();
    if (request_.all) verified_.compare(catalogue_.totals());
  }

  /// All so far.
  [[nodiscard]] const VerifiedCases& verified() const { return verified_; }
  [[nodiscard]] const nlohmann::ordered_json& told() const { return told_; }

 private:
  void take(const fleet::Lease& lease) {
    fleet::Verification found;
    try {
      const fleet::LeaseKeeper keeper(lease, open_);
      found = verify(lease);
    } catch (const fleet::DatabaseError&) {
      throw;
    } catch (const fleet::StoreError& error) {
      constexpr long kForbidden = 403;
      if (!error.passes() && error.status() != kForbidden) {
        could_not(lease, error.what());
        return;
      }
      // The store is away, or lets this access key read nothing: that says nothing of this case, and every
      // other would fare the same.
      catalogue_.give_back(lease, std::chrono::seconds(0), "");
      throw;
    } catch (const std::exception& error) {
      could_not(lease, error.what());
      return;
    }
    if (!catalogue_.enter(lease, found)) {
      verified_.add_unchecked();
      tell(lease, {"could-not-check", false, 0,
                   "the case changed while it was verified, or took too long: it is verified again"});
      return;
    }
    verified_.add(found);
    tell(lease, found);
  }

  /// What could not be checked has no verdict, and is tried again later.
  void could_not(const fleet::Lease& lease, const std::string& why) {
    verified_.add_unchecked();
    tell(lease, {"could-not-check", false, 0, why});
    catalogue_.give_back(lease, kPause, why);
  }

  fleet::Verification verify(const fleet::Lease& lease) {
    const archive::VerificationReport report = judge_.judge(lease.appliance, lease.case_id, lease.changed);
    return verification_of(report, judge_.mending(), judge_.hold());
  }

  void tell(const fleet::Lease& lease, const fleet::Verification& found) {
    nlohmann::ordered_json mended = nlohmann::ordered_json::array(), left = mended;
    verified_.add_mended(judge_.mending().mended.size(), judge_.mending().left_count());
    if (judge_.hold().lifted) verified_.add_lifted();
    if (!judge_.hold().text.empty())
      print_error("kiroku-fleet", lease.appliance + "/" + lease.case_id + ": " + judge_.hold().text);
    for (const fleet::MendedFile& each : judge_.mending().mended) {
      mended.push_back({{"file", each.path}, {"from", each.from}, {"version", each.version}});
      print_error("kiroku-fleet", lease.appliance + "/" + lease.case_id + ": mended " + each.path + " from " +
                                      each.from + ", as version " + each.version);
    }
    for (const fleet::UnmendedFile& each : judge_.mending().left) {
      left.push_back({{"file", each.path}, {"why", each.told()}});
      print_error("kiroku-fleet", lease.appliance + "/" + lease.case_id + ": could not mend " + each.path +
                                      ": " + each.told());
    }
    if (const std::uint64_t more = judge_.mending().more_left; more > 0)
      print_error("kiroku-fleet", lease.appliance + "/" + lease.case_id + ": could not mend " +
                                      std::to_string(more) + " more of its files");
    if (request_.json) {
      told_.push_back({{"appliance", lease.appliance},
                       {"case", lease.case_id},
                       {"verdict", found.verdict},
                       {"findings", found.findings},
                       {"detail", found.detail},
                       {"mended", mended},
                       {"not_mended", left},
                       {"more_not_mended", judge_.mending().more_left},
                       {"erased", judge_.mending().erased},
                       {"legal_hold_differs", judge_.hold().text},
                       {"legal_hold_lifted", judge_.hold().lifted}});
    } else {
      std::cout << printable(lease.appliance) << "  " << printable(lease.case_id) << "  " << found.verdict
                << (found.detail.empty() ? "" : ": " + printable(found.detail)) << std::endl;
    }
  }

  const FleetConfiguration& configuration_;
  const Request& request_;
  StoredJudge judge_;
  const std::function<fleet::FleetCatalogue()> open_ = [this] { return configuration_.open_catalogue(); };
  fleet::FleetCatalogue catalogue_;
  VerifiedCases verified_;
  bool waited_ = false;  // for other workers, which is told once
  nlohmann::ordered_json told_ = nlohmann::ordered_json::array();
};

void wait_because(const Error& error) {
  print_error("kiroku-fleet", std::string(error.what()) + "; it is tried again");
  wait_until_told(kLook);
}

/// Again and again; a database or a store that is away is waited for.
int follow(const FleetConfiguration& configuration, const Request& request) {
  while (!told_to_end()) {
    try {
      Worker worker(configuration, request);
      while (!told_to_end()) {
        worker.run();
        wait_until_told(kLook);
      }
    } catch (const fleet::DatabaseError& error) {
      if (!error.passes()) throw;
      wait_because(error);
    } catch (const fleet::StoreError& error) {
      if (!error.passes()) throw;
      wait_because(error);
    }
  }
  return kDone;
}

int run(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  if (request.follow && (request.all || request.json))
    throw UsageError("--follow goes on for ever: leave out --all and --json");
  end_when_told();
  if (request.follow) return follow(configuration, request);
  Worker worker(configuration, request);
  worker.run();
  const VerifiedCases& verified = worker.verified();
  if (request.json) {
    nlohmann::ordered_json told{{"cases", worker.told()}, {"ended_early", verified.ended_early()}};
    if (request.all)
      told["not_looked_at"] = {{"missing", verified.missing()},
                               {"unreadable", verified.unreadable()},
                               {"changed_just_now", verified.unsettled()}};
    print_json(told);
  } else {
    std::cout << verified.summary() << "\n";
  }
  return verified.status();
}

}  // namespace

void add_fleet_verify_command(Command& program) {
  Command& command =
      program.add_command("verify", "verifies stored cases anew, those that wait longest first");
  command.explain(
      "Each case that is not verified as it is now, or not for the time that [verification] says, is read "
      "in the store and judged as 'kiroku-verify' does, by the key of its appliance, the "
      "roots of "
      "[verification] and the appliance's log in the store. Any number of these may run, on one machine or "
      "many: each "
      "takes cases that no other has. Exit status 1 says that one of those is not intact, 3 that one is "
      "incomplete or unproven, or could not be checked, or that Ctrl-C came before all were looked at; 0 "
      "says "
      "nothing of cases that were not due, of which 'kiroku-fleet status' tells.");
  command.explain(
      "With --all the exit status is of the whole catalogue as it is then: what other workers found counts, "
      "too. It is also 1 where a case is missing from the store or its ledger cannot be read, and 3 where a "
      "closed case changed so shortly ago that it was not looked at ('settle_minutes'). A case without an "
      "end "
      "is looked at once it has had no verdict for two days.");
  command.explain(
      "With [mending] in the configuration, a segment, time-stamp, checkpoint or ledger whose bytes in the "
      "store are not those that the appliance signed is put again, as a new version under the same lock, "
      "from an older version or a [[copy]] that has these bytes. Nothing is removed. What was mended, and "
      "what could not be, stands in the log of the home that [mending] names ('kiroku log'). The verdict is "
      "that of the store after it was mended. What could not be mended makes the exit status 3 at least. "
      "Film "
      "that the appliance erased, as signed lines of the ledger say, is never put again. Where it is damaged "
      "in the store and still locked or held there, it counts as what could not be mended.");
  command.explain(
      "Where the appliance's log says that a case is under legal hold and the store does not hold all of it, "
      "the line of the case says so, and the exit status is 3 at least. The verdict stays: it is of what is "
      "there.");
  const auto request = std::make_shared<Request>();
  command.flag("--all", request->all,
               "every case that is closed or was cut off, due or not; waits for those that another holds");
  command.flag("--follow", request->follow, "goes on until Ctrl-C, with what becomes due");
  command.option("--scratch", "DIR", request->scratch,
                 "where there is room for what lies beside a case's segments, segments of several versions, "
                 "and for a whole case where [mending] is",
                 "the folder for temporary files");
  command.writes("--scratch");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet verify", "what is due, once");
  command.example("kiroku-fleet verify --follow --scratch /srv/scratch", "as a service");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
