// 'kiroku fleet': this appliance and its hospital. It enrols, and reports how the recorder is, in a process
// of its own, so that nothing of it can hold a recording.
#include "apps/kiroku/fleet_command.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/store.h"
#include "apps/kiroku/told_to_end.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "fleet/reports/appliance_report.h"
#include "fleet/reports/fleet_authority.h"
#include "fleet/reports/machine_run.h"
#include "fleet/reports/report_client.h"
#include "fleet/shipper.h"
#include "recorder/control/control_client.h"

namespace kiroku::apps {
namespace {

using namespace std::chrono_literals;
using fleet::ReportClient;
using fleet::ReportError;
using fleet::ReportingIdentity;
using nlohmann::json;

constexpr std::chrono::seconds kReportInterval = 5s, kLongestReportPause = 60s, kPollInterval = 1s;
/// What waits for the store is looked for less often: it means looking at the archive's folders.
constexpr std::chrono::seconds kShippingInterval = 30s;
/// A recorder that takes longer counts as one that does not answer.
constexpr std::chrono::seconds kRecorderPatience = 2s;

struct Request {
  std::optional<std::string> home, name;
  std::string url;
  bool follow = false, renew = false, json = false;
};

std::string text_in(const json& answer, const char* name) {
  if (!answer.is_object() || !answer.contains(name) || !answer[name].is_string())
    throw ReportError("whoever answers there is no report server of this version of Kiroku", 0);
  return answer[name].get<std::string>();
}

/// The name under which this appliance ships, or its device's.
std::string name_of_appliance(const Home& home, const std::optional<std::string>& asked) {
  if (asked) return *asked;
  const Configuration configuration = home.configuration();
  if (configuration.store && !configuration.store->appliance.empty()) return configuration.store->appliance;
  return home.device().name();
}

/// The certificate is what the fleet's authority issued for this key and name, or whoever answers is no
/// server of that fleet.
void require_own(const ReportingIdentity& given) {
  if (fleet::facts_of_certificate_pem(given.certificate_pem).appliance != given.appliance)
    throw ReportError("the fleet issued a certificate of another name than " + given.appliance, 0);
  if (!fleet::is_issued_for(given.certificate_pem, given.authority_pem, given.key_pem.text()))
    throw ReportError(
        "whoever answers gave a certificate that is not for this appliance's key, by the authority whose "
        "code was shown: nothing was changed here",
        0);
}

int enrol(const Request& request) {
  const Home home = Home::open(request.home);
  const std::filesystem::path file = home.reporting_file();
  const std::string name = name_of_appliance(home, request.name);
  const fleet::CertificateRequest asked = fleet::make_certificate_request(name);
  end_when_told();
  ReportClient client(request.url);
  const json taken = parse_foreign_json(
      client.post("/enrol", nlohmann::ordered_json{{"request", asked.request_pem}}.dump()));
  const std::string id = text_in(taken, "id"), authority = text_in(taken, "authority");
  if (id.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw ReportError("whoever answers there is no report server of this version of Kiroku", 0);
  const std::string code = fleet::enrolment_code(asked.request_pem, authority, text_in(taken, "nonce"));
  const std::string fingerprint = fleet::request_fingerprint(asked.request_pem);
  if (request.json) {
    print_json({{"appliance", name}, {"code", code}, {"fingerprint", fingerprint}});
  } else {
    std::cout
        << "This appliance asks to report as " << name << ". Its code is\n\n    " << code
        << "\n\nEnter it within ten minutes on the hospital's page (Rooms), or there:\n  kiroku-fleet enrol "
        << code << "\nThe fingerprint of its request is\n  " << fingerprint << "\n";
  }
  std::cout << std::flush;
  while (!wait_until_told(kPollInterval)) {
    json answer;
    try {
      answer = parse_foreign_json(client.get("/enrol/" + id));
    } catch (const ReportError& error) {
      // The code that somebody is about to enter is this key's: a server that is away is asked again.
      if (!error.passes()) throw;
      continue;
    }
    if (!answer.is_object() || !answer.contains("certificate")) continue;
    ReportingIdentity identity{request.url, name, text_in(answer, "certificate"), authority,
                               asked.key_pem.clone()};
    require_own(identity);
    // A renewal of what was enrolled before, which is under way, is not to come after this.
    std::optional<fleet::ReportingTurn> turn = fleet::ReportingTurn::take(file);
    while (!turn && !wait_until_told(kPollInterval)) turn = fleet::ReportingTurn::take(file);
    if (!turn)
      throw UsageError(
          "another process of this appliance renews its certificate at this moment, and this one was told to "
          "end: nothing was changed here; enrol again");
    identity.write(file);
    if (!request.json)
      std::cout << "Enrolled, says the server at " << printable(request.url)
                << ". If the hospital's page did not take the code, somebody else answered there: remove "
                << printable(file.string())
                << ", and enrol again.\nNext: 'kiroku fleet report --follow', which kiroku-report.service "
                   "does.\n";
    return kDone;
  }
  throw UsageError("it was ended before anybody entered the code: nothing was changed here");
}

ReportingIdentity require_identity(const Home& home) {
  std::optional<ReportingIdentity> identity = ReportingIdentity::read(home.reporting_file());
  if (!identity)
    throw UsageError(
        "this appliance is not enrolled: run 'kiroku fleet enrol URL' (docs/how-to/run-a-fleet.md)");
  return std::move(*identity);
}

/// What is said of this appliance, again and again.
/// Kept: opening the list checks all of it, and a new shipper reads the log of years.
struct ShippingPlace {
  explicit ShippingPlace(const Home& home)
      : of(store_of(home)),
        store(open_store(home, of)),
        list(shipping_list_file(home, of)),
        shipper(store, list,
                {of.appliance, of.retain, home.device(), of.publish_log ? home.published_log() : "",
                 search_notes_to_ship(home, of, [](const std::string& /*sentence*/) {})}) {}
  const StoreConfiguration of;
  fleet::ObjectStore store;
  fleet::ShippingList list;
  fleet::Shipper shipper;  // last: uses the two before
};

class Reporter {
 public:
  explicit Reporter(const Home& home) : home_(home), configuration_(home.configuration()) {}

  fleet::ApplianceReport report() {
    fleet::ApplianceReport out;
    out.program = version();
    // Anew each time: where somebody removed what it rests on, all who report of this home name the next one.
    out.run = fleet::run_of_machine(home_.folder());
    out.number = ++number_;
    out.has_store = configuration_.store.has_value();
    if (out.has_store) out.shipping = shipping();
    // Last, so that it is newest; it never waits for long.
    out.now = utc_now();
    try {
      const json status =
          recorder::ask_recorder(home_.control_socket(configuration_), {{"do", "status"}}, kRecorderPatience);
      out.now = utc_now();
      out.recorder = fleet::recorder_report(status, out.now);
    } catch (const Error&) {
      // That no recorder answers is what is reported then.
    } catch (const json::exception&) {
      // So is a recorder of another version.
    }
    return out;
  }

 private:
  std::optional<fleet::ShippingReported> shipping() {
    const auto now = std::chrono::steady_clock::now();
    if (looked_ && now - *looked_ < kShippingInterval) return shipping_;
    looked_ = now;
    shipping_.reset();
    try {
      if (!place_) place_ = std::make_unique<ShippingPlace>(home_);
      const fleet::ShippingReport left = place_->shipper.look(home_.archive());
      fleet::ShippingReported told{left.waiting, left.waiting_bytes, std::nullopt, left.holds_waiting.size(),
                                   left.problems.size()};
      if (left.waiting_since) {
        const auto age = std::chrono::duration_cast<std::chrono::seconds>(utc_now() - *left.waiting_since);
        told.waiting_s = std::max<std::int64_t>(age.count(), 0);
      }
      shipping_ = told;
    } catch (const Error&) {
      // That it is not known is what is reported then.
      place_.reset();
    }
    return shipping_;
  }

  const Home& home_;
  const Configuration configuration_;
  std::uint64_t number_ = 0;
  std::optional<std::chrono::steady_clock::time_point> looked_;
  std::optional<fleet::ShippingReported> shipping_;
  std::unique_ptr<ShippingPlace> place_;
};

/// As it is now: another process of this appliance may have renewed it, or somebody enrolled it anew. Whoever
/// shows a certificate that was replaced is taken for a copy where it happens again. Keeps the one it has
/// where the file holds none that can be read: the server says what becomes of that.
void read_again(const Home& home, ReportingIdentity& identity) {
  try {
    if (std::optional<ReportingIdentity> there = ReportingIdentity::read(home.reporting_file()))
      identity = std::move(*there);
  } catch (const Error&) {
    // As above.
  }
}

/// A new key and certificate, by the one that still counts: whoever asks has the turn, and has read that one
/// since.
void renew(const fleet::ReportingTurn& /*turn*/, ReportingIdentity& identity,
           const std::filesystem::path& file) {
  fleet::CertificateRequest asked = fleet::make_certificate_request(identity.appliance);
  const json answer = parse_foreign_json(
      ReportClient(identity).post("/renew", nlohmann::ordered_json{{"request", asked.request_pem}}.dump()));
  const std::string certificate = text_in(answer, "certificate");
  ReportingIdentity renewed{identity.url, identity.appliance, certificate, identity.authority_pem,
                            std::move(asked.key_pem)};
  require_own(renewed);
  // Until this stands there, the one before counts, too, and nothing is signed by the new one.
  renewed.write(file);
  identity = std::move(renewed);
}

fleet::ReportingTurn require_turn(const Home& home) {
  std::optional<fleet::ReportingTurn> turn = fleet::ReportingTurn::take(home.reporting_file());
  if (!turn)
    throw UsageError(
        "another process of this appliance renews its certificate, or enrols it, at this moment: nothing was "
        "changed here; try again in a minute");
  return std::move(*turn);
}

int report_once(const Request& request, const Home& home, ReportingIdentity identity) {
  const fleet::ApplianceReport report = Reporter(home).report();
  // Until the report is made: a renewal in between would replace the certificate that it shows.
  std::optional<fleet::ReportingTurn> turn;
  if (request.renew) turn = require_turn(home);
  read_again(home, identity);
  if (turn) renew(*turn, identity, home.reporting_file());
  const std::string told = fleet::to_json(report);
  ReportClient(identity).post("/report", told);
  if (request.json) {
    print_json(nlohmann::ordered_json::parse(told));
  } else {
    std::cout << "Reported to " << identity.url << " as " << identity.appliance << ", " << told.size()
              << " bytes; 'kiroku fleet report --json' shows them.\n";
  }
  return kDone;
}

/// Renews the certificate while it runs, once that is due. A renewal that fails may have cost the server a
/// certificate that this appliance could not keep: it is tried again after a sixteenth of the time that is
/// left, so about two hundred times until that is over.
class Renewal {
 public:
  /// Why the certificate is not renewed though it is due; "" otherwise. The one before still counts then, and
  /// what is reported may be why: a disk that is full.
  const std::string& look(const Home& home, ReportingIdentity& identity) {
    const UtcTime now = utc_now();
    const auto is_due = [&] {
      return fleet::facts_of_certificate_pem(identity.certificate_pem).is_to_be_renewed(now);
    };
    if (!is_due()) {
      failure_.clear();
      return failure_;
    }
    const auto tried = std::chrono::steady_clock::now();
    if (!failure_.empty() && tried < next_) return failure_;
    const UtcTime not_after = fleet::facts_of_certificate_pem(identity.certificate_pem).not_after;
    try {
      const auto turn = fleet::ReportingTurn::take(home.reporting_file());
      // Whoever has it renews the certificate: the next look finds that done.
      if (!turn) return failure_;
      read_again(home, identity);
      if (is_due()) renew(*turn, identity, home.reporting_file());
      failure_.clear();
    } catch (const Error& error) {
      failure_ = std::string("its certificate was not renewed: ") + error.what();
      next_ = tried + std::chrono::duration_cast<std::chrono::seconds>(not_after - now) / kShareOfRest;
    }
    return failure_;
  }

 private:
  static constexpr int kShareOfRest = 16;
  std::string failure_;
  std::chrono::steady_clock::time_point next_;
};

int follow(const Home& home, ReportingIdentity identity) {
  Reporter reporter(home);
  Renewal renewal;
  std::optional<ReportClient> client;
  std::string url, certificate;  // of the client
  std::chrono::seconds pause = kReportInterval;
  std::string told;
  do {
    std::string now;
    try {
      const fleet::ApplianceReport report = reporter.report();
      read_again(home, identity);
      const std::string& not_renewed = renewal.look(home, identity);
      if (!client || url != identity.url || certificate != identity.certificate_pem) {
        client.emplace(identity);
        url = identity.url;
        certificate = identity.certificate_pem;
      }
      client->post("/report", fleet::to_json(report));
      now = not_renewed;
      pause = kReportInterval;
    } catch (const Error& error) {
      now = error.what();
      pause = std::min(2 * pause, kLongestReportPause);
      client.reset();
    }
    // The same trouble is told once, and that it is over.
    if (now != told) {
      if (now.empty()) {
        std::cout << "the fleet takes reports again" << std::endl;
      } else {
        print_error("kiroku", now + "; recording goes on, and it is tried again");
      }
    }
    told = now;
  } while (!wait_until_told(pause));
  return kDone;
}

int report(const Request& request) {
  if (request.follow && (request.renew || request.json))
    throw UsageError("--follow reports until Ctrl-C and renews by itself: leave out --renew and --json");
  const Home home = Home::open(request.home);
  ReportingIdentity identity = require_identity(home);
  if (!request.follow) return report_once(request, home, std::move(identity));
  end_when_told();
  return follow(home, std::move(identity));
}

void add_enrol_command(Command& group) {
  Command& command = group.add_command("enrol", "asks the hospital's fleet to take this appliance's reports");
  const auto request = std::make_shared<Request>();
  command.argument("URL", request->url, "where 'kiroku-fleet serve' takes reports");
  command.option("--name", "NAME", request->name, "as which it reports",
                 "the name under which it ships, or the device's");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints the code as one JSON object instead");
  command.explain(
      "It makes a key, which never leaves this appliance, shows a code, and waits for an administrator to "
      "enter "
      "it. Whoever stands between this appliance and the server makes for another code. Enrolling anew takes "
      "the "
      "place of what was enrolled before, once the administrator has revoked that.");
  command.example("kiroku fleet enrol https://fleet.hospital.example:8444", "shows the code and waits");
  command.on_run([request] { return enrol(*request); });
}

void add_report_to_fleet_command(Command& group) {
  Command& command = group.add_command("report", "tells the hospital how this appliance is");
  const auto request = std::make_shared<Request>();
  command.flag("--follow", request->follow, "goes on until Ctrl-C, as kiroku-report.service does");
  command.flag("--renew", request->renew, "takes a new key and certificate first");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints what was reported");
  command.explain(
      "Rooms, disks, clock, authorities, and what is not shipped: names, numbers and states, and no "
      "patient's "
      "data. It asks the recorder as 'kiroku status' does, from a process of its own. A certificate is "
      "renewed "
      "when a third of its time is left.");
  command.example("kiroku fleet report", "once, to try it");
  command.on_run([request] { return report(*request); });
}

}  // namespace

void add_fleet_command(Command& program) {
  Command& group = program.add_command("fleet", "reports to the hospital's page of all rooms");
  add_enrol_command(group);
  add_report_to_fleet_command(group);
}

}  // namespace kiroku::apps
