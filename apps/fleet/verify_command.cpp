// 'kiroku-fleet verify': stored cases are verified anew, by any number of workers.
#include <algorithm>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/stored_judge.h"
#include "apps/kiroku/told_to_end.h"
#include "base/clock.h"
#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::apps {
namespace {

/// A lease outlives the slowest fetch of the longest case; what a dead worker held is taken up afterwards.
constexpr std::chrono::hours kLease{12};
/// A case that is known for so long and has no end was cut off; one that is changed again and again waits no
/// longer.
constexpr std::chrono::hours kLongestPending{48};
/// Before a case that could not be checked is tried again.
constexpr std::chrono::minutes kPause{30};
constexpr std::chrono::seconds kLook{30};

struct Request {
  std::string configuration;
  std::optional<std::string> scratch;
  bool follow = false, all = false, json = false;
};

/// The finding that the verdict stands on, in its sentence.
std::string gravest(const archive::VerificationReport& report) {
  const auto worst = std::ranges::max_element(report.findings, {}, &archive::Finding::severity);
  return worst == report.findings.end() || worst->severity == archive::Severity::kNote ? "" : worst->text;
}

class Worker {
 public:
  Worker(const FleetConfiguration& configuration, const Request& request)
      : configuration_(configuration),
        request_(request),
        judge_(configuration, request.scratch),
        catalogue_(configuration.open_catalogue()) {}

  /// All that is due, one after the other, until it is told to end.
  void run() {
    const UtcTime began = time_.utc();
    // What could not be checked before may be checked by now: whoever asks for all is not told of a pause.
    if (request_.all) catalogue_.end_pauses();
    while (!told_to_end()) {
      const UtcTime now = time_.utc();
      // With --all what this run has verified is not due again.
      const UtcTime verified_before = request_.all ? began : now - configuration_.verify_every;
      const auto lease = catalogue_.lease({verified_before, configuration_.settles, kLongestPending}, kLease);
      if (!lease) return;
      take(*lease);
    }
  }

  /// The exit status that all so far amounts to.
  [[nodiscard]] int status() const { return bad_ > 0 ? kAnswerIsNo : unchecked_ > 0 ? kNoAnswer : kDone; }
  [[nodiscard]] const nlohmann::ordered_json& told() const { return told_; }
  [[nodiscard]] std::string summary() const {
    return counted(done_, "case", "cases") + " verified" +
           (bad_ > 0 ? ", " + std::to_string(bad_) + " NOT INTACT" : "") +
           (unchecked_ > 0 ? ", " + std::to_string(unchecked_) + " could not be checked" : "");
  }

 private:
  void take(const fleet::Lease& lease) {
    fleet::Verification found;
    try {
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
      catalogue_.give_back(lease, std::chrono::seconds(0), time_.utc(), "");
      throw;
    } catch (const std::exception& error) {
      could_not(lease, error.what());
      return;
    }
    if (!catalogue_.enter(lease, found)) {
      ++unchecked_;
      tell(lease, {"could-not-check", found.when, false, 0,
                   "the case changed while it was verified, or took too long: it is verified again"});
      return;
    }
    ++done_;
    if (found.alarm) ++bad_;
    tell(lease, found);
  }

  /// What could not be checked has no verdict, and is tried again later.
  void could_not(const fleet::Lease& lease, const std::string& why) {
    ++unchecked_;
    tell(lease, {"could-not-check", time_.utc(), false, 0, why});
    catalogue_.give_back(lease, kPause, time_.utc(), why);
  }

  fleet::Verification verify(const fleet::Lease& lease) {
    const archive::VerificationReport report = judge_.judge(lease.appliance, lease.case_id, lease.changed);
    const auto told =
        static_cast<std::size_t>(std::ranges::count_if(report.findings, [](const archive::Finding& each) {
          return each.severity != archive::Severity::kNote;
        }));
    const archive::Verdict verdict = report.verdict;
    return {std::string(archive::verdict_name(verdict)), time_.utc(), archive::exit_status(verdict) != kDone,
            told, gravest(report)};
  }

  void tell(const fleet::Lease& lease, const fleet::Verification& found) {
    if (request_.json) {
      told_.push_back({{"appliance", lease.appliance},
                       {"case", lease.case_id},
                       {"verdict", found.verdict},
                       {"findings", found.findings},
                       {"detail", found.detail}});
    } else {
      std::cout << printable(lease.appliance) << "  " << printable(lease.case_id) << "  " << found.verdict
                << (found.detail.empty() ? "" : ": " + printable(found.detail)) << std::endl;
    }
  }

  const FleetConfiguration& configuration_;
  const Request& request_;
  const Clock& time_ = Clock::system();
  StoredJudge judge_;
  fleet::FleetCatalogue catalogue_;
  std::uint64_t done_ = 0, bad_ = 0, unchecked_ = 0;
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
  if (request.json) {
    print_json({{"cases", worker.told()}});
  } else {
    std::cout << worker.summary() << "\n";
  }
  return worker.status();
}

}  // namespace

void add_fleet_verify_command(Command& program) {
  Command& command =
      program.add_command("verify", "verifies stored cases anew, those that wait longest first");
  command.explain(
      "Each case that was never verified, or not for the time that [verification] says, is fetched "
      "from the "
      "store into a scratch folder and judged as 'kiroku-verify' does, by the key of its appliance, the "
      "roots of "
      "[verification] and the appliance's log in the store. Any number of these may run, on one machine or "
      "many: each "
      "takes cases that no other has. Exit status 1 says that one is not intact, 3 that one could not be "
      "checked.");
  const auto request = std::make_shared<Request>();
  command.flag("--all", request->all, "every case that is closed or was cut off, due or not");
  command.flag("--follow", request->follow, "goes on until Ctrl-C, with what becomes due");
  command.option("--scratch", "DIR", request->scratch, "where there is room for a whole case",
                 "the folder for temporary files");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet verify", "what is due, once");
  command.example("kiroku-fleet verify --follow --scratch /srv/scratch", "as a service");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
