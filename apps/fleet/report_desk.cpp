#include "apps/fleet/report_desk.h"

#include <array>
#include <chrono>
#include <optional>
#include <string_view>

#include <nlohmann/json.hpp>

#include "apps/fleet/desk_refusal.h"
#include "apps/fleet/shared_reports.h"
#include "apps/fleet/stamp_desk.h"
#include "base/attempt_guard.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "fleet/reports/appliance_report.h"
#include "fleet/reports/fleet_authority.h"
#include "http/server.h"

namespace kiroku::apps {
namespace {

using http::Request;
using http::Response;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::uint16_t kExamplePort = 8444;
constexpr std::size_t kThreads = 4, kNonceBytes = 16;
/// Of a hospital group's appliances, each of which keeps one connection.
constexpr std::size_t kMostConnections = 1000;
constexpr std::string_view kEnrolPath = "/enrol";
constexpr std::string_view kTooMany =
    "too many requests to be enrolled came from this address: try again later";
constexpr std::string_view kNoSuchRequest =
    "nobody entered the code within ten minutes: run 'kiroku fleet enrol' again";
constexpr std::string_view kTooManyGuesses =
    "too many questions about requests that nobody made came from this address: try again later";

Response written_answer(int status, std::string body) {
  return {status, {{"Content-Type", "application/json"}, {"Cache-Control", "no-store"}}, std::move(body)};
}
Response answer_of(int status, const ordered_json& body) { return written_answer(status, body.dump()); }

std::string random_hex() {
  std::array<std::byte, kNonceBytes> random{};
  crypto::fill_random(random);
  return crypto::to_hex(random);
}

std::string request_in(const Request& request) {
  const json body = parse_foreign_json(request.body);
  if (!body.is_object() || !body.contains("request") || !body["request"].is_string())
    throw DeskRefusal{400, "the body is no JSON object with 'request'"};
  return body["request"].get<std::string>();
}

}  // namespace

struct ReportDesk::State {
  State(const FleetConfiguration& of, const std::string& listen, const timestamp::TrustStore& trust,
        std::function<void(const std::string&)> tell)
      : configuration(of),
        authority(fleet::FleetAuthority::open_or_make(of.authority, utc_now())),
        reports(of),
        strangers({.memory = std::chrono::minutes(10)}),
        guessers({.memory = std::chrono::minutes(10)}) {
    if (!of.authorities.empty()) {
      StampDesk::Options stamping;
      stamping.authorities = of.authorities;
      stamping.round = of.round;
      stamping.trust = &trust;
      stamping.tell = std::move(tell);
      stamps.emplace(std::move(stamping));
    }
    fleet::FleetAuthority::ServerIdentity identity = authority.issue_server_identity();
    http::ServerOptions options;
    options.listen = parse_listen_address(listen, kExamplePort);
    options.answer = [this](const Request& request) { return answer(request); };
    options.refuse = [](const http::Refusal& refusal) {
      return answer_of(refusal.status, {{"error", refusal.why}});
    };
    options.threads = kThreads;
    options.most_body_bytes = fleet::kLargestReport;
    options.connections = {.all = kMostConnections, .of_holder = kMostConnections / 2};
    options.tls = http::ServerTls{std::move(identity.certificate_pem), std::move(identity.key_pem),
                                  authority.certificate_pem()};
    address = options.listen;
    server.emplace(std::move(options));
    address.port = server->port();
  }

  Response answer(const Request& request) {
    try {
      return answer_or_throw(request);
    } catch (const DeskRefusal& refusal) {
      return answer_of(refusal.status, {{"error", refusal.why}});
    } catch (const fleet::DatabaseError&) {
      // Why is the administrator's to know, not a stranger's.
      return answer_of(503, {{"error", "the fleet's database does not answer: try again later"}});
    } catch (const UsageError& error) {
      return answer_of(400, {{"error", error.what()}});
    }
  }

  Response answer_or_throw(const Request& request) {
    const bool is_post = request.method == "POST";
    const std::string_view target = request.target;
    if (is_post && target == kEnrolPath) return enrol(request);
    if (request.method == "GET" && target.starts_with("/enrol/"))
      return tell_enrolment(std::string(target.substr(std::string_view("/enrol/").size())), request.holder);
    if (is_post && target == "/report") return take_report(request);
    if (is_post && target == "/renew") return renew(request);
    if (is_post && target == fleet::kStampPath) return enter_round(request);
    if (request.method == "GET") {
      if (const auto question = fleet::parse_stamp_path(target)) return tell_of_round(request, *question);
    }
    throw DeskRefusal{404, "there is nothing for appliances at this address"};
  }

  Response enrol(const Request& request) {
    const auto now = AttemptGuard::Clock::now();
    if (strangers.wait(request.holder, now).count() > 0) throw DeskRefusal{429, std::string(kTooMany)};
    strangers.failed(request.holder, now);
    fleet::PendingEnrolment asked;
    asked.request_pem = fleet::request_alone(request_in(request));
    asked.appliance = fleet::appliance_of_request(asked.request_pem);
    asked.id = authority.new_enrolment_id();
    // Drawn now that the request is known: see enrolment_code().
    asked.nonce = random_hex();
    try {
      reports.with([&](fleet::FleetReports& all) { all.ask(asked, request.holder); });
    } catch (const UsageError& error) {
      throw DeskRefusal{409, error.what()};
    }
    return answer_of(202,
                     {{"id", asked.id}, {"nonce", asked.nonce}, {"authority", authority.certificate_pem()}});
  }

  Response tell_enrolment(const std::string& id, const std::string& holder) {
    // A right one is never refused: nobody guesses it, but an appliance may share its address with whoever
    // tries. A wrong one costs no question to the database, which all reports share and which ends its
    // connection over text that is no UTF-8.
    if (!authority.is_enrolment_id(id)) {
      const auto now = AttemptGuard::Clock::now();
      if (guessers.wait(holder, now).count() > 0) throw DeskRefusal{429, std::string(kTooManyGuesses)};
      guessers.failed(holder, now);
      throw DeskRefusal{404, std::string(kNoSuchRequest)};
    }
    const std::optional<std::string> certificate =
        reports.with([&](fleet::FleetReports& all) { return all.certificate_for(id); });
    if (!certificate) throw DeskRefusal{404, std::string(kNoSuchRequest)};
    if (certificate->empty()) return answer_of(202, ordered_json::object());
    // Rooms whose requests come from one address, a proxy's, are enrolled one after the other: an
    // administrator has just confirmed that those of this address are no stranger's.
    strangers.succeeded(holder);
    return answer_of(200, {{"certificate", *certificate}});
  }

  /// Whose certificate was shown; TLS let in none that the authority did not issue to a client.
  static fleet::CertificateFacts caller(const Request& request) {
    if (request.certificate.empty())
      throw DeskRefusal{401, "an appliance reports with its certificate: enrol it with 'kiroku fleet enrol'"};
    fleet::CertificateFacts facts = fleet::facts_of_certificate(request.certificate);
    if (facts.appliance.empty()) throw DeskRefusal{403, "this certificate is no appliance's"};
    return facts;
  }

  static void require_taken(const std::optional<fleet::ReportRefusal>& refused, const std::string& name) {
    using enum fleet::ReportRefusal;
    if (!refused) return;
    switch (*refused) {
      case kNotEnrolled:
        throw DeskRefusal{403, name + " is not enrolled here: enrol it with 'kiroku fleet enrol'"};
      case kRevoked:
        throw DeskRefusal{403,
                          name + " was revoked by an administrator: enrol it anew with 'kiroku fleet enrol'"};
      case kEnded:
        throw DeskRefusal{403, "this certificate of " + name +
                                   " has ended: an administrator revokes the name "
                                   "('kiroku-fleet revoke'), then enrol it anew with 'kiroku fleet enrol'"};
      case kTooManyCertificates:
        throw DeskRefusal{403, name +
                                   " was given a thousand certificates that have not ended: it reports with "
                                   "the one it has, and an administrator revokes the name once that ends "
                                   "('kiroku-fleet revoke')"};
      case kOtherCertificate:
        throw DeskRefusal{403,
                          "another certificate of " + name +
                              " counts now: this one was replaced, or another appliance was enrolled under "
                              "the name. If nobody renewed it here, a copy of this appliance did: an "
                              "administrator revokes the name ('kiroku-fleet revoke'), then enrol it anew "
                              "with 'kiroku fleet enrol'"};
    }
  }

  Response take_report(const Request& request) {
    const fleet::CertificateFacts who = caller(request);
    const fleet::ApplianceReport report = fleet::parse_report(request.body);
    require_taken(reports.with([&](fleet::FleetReports& all) {
      return all.take(who.appliance, who.fingerprint, report);
    }),
                  who.appliance);
    return answer_of(200, ordered_json::object());
  }

  Response renew(const Request& request) {
    const fleet::CertificateFacts who = caller(request);
    const std::string asked = request_in(request);
    if (fleet::appliance_of_request(asked) != who.appliance)
      throw DeskRefusal{403, who.appliance + " cannot be given a certificate of another name"};
    const std::string certificate = authority.issue(asked, utc_now(), configuration.certificates_last);
    const fleet::CertificateFacts renewed = fleet::facts_of_certificate_pem(certificate);
    require_taken(reports.with([&](fleet::FleetReports& all) {
      return all.renew(who.appliance, who.fingerprint, renewed);
    }),
                  who.appliance);
    return answer_of(200, {{"certificate", certificate}});
  }

  StampDesk& stamp_desk() {
    if (!stamps) throw DeskRefusal{404, "nothing is stamped together here: fleet.toml has no [[authority]]"};
    return *stamps;
  }

  Response enter_round(const Request& request) {
    const fleet::CertificateFacts who = caller(request);
    StampDesk& desk = stamp_desk();
    // Not by name: whoever holds a certificate that was revoked has its name, too.
    desk.count(who.fingerprint);
    const fleet::StampRequest asked = fleet::parse_stamp_request(request.body);
    require_taken(
        reports.with([&](fleet::FleetReports& all) { return all.refusal(who.appliance, who.fingerprint); }),
        who.appliance);
    StampDesk::Answer answer = desk.enter(who.appliance, asked);
    return written_answer(answer.status, std::move(answer.json));
  }

  /// The database is not asked again: a ticket was given to an appliance that counted, and tells nobody
  /// anything but what that one gave.
  Response tell_of_round(const Request& request, const fleet::StampQuestion& question) {
    const fleet::CertificateFacts who = caller(request);
    StampDesk& desk = stamp_desk();
    desk.count(who.fingerprint);
    StampDesk::Answer answer = desk.fetch(who.appliance, question);
    return written_answer(answer.status, std::move(answer.json));
  }

  const FleetConfiguration& configuration;
  const fleet::FleetAuthority authority;
  SharedReports reports;
  AttemptGuard strangers, guessers;
  std::optional<StampDesk> stamps;  // none: nothing is stamped together
  ListenAddress address;
  std::optional<http::Server> server;  // last: uses the rest
};

ReportDesk::ReportDesk(const FleetConfiguration& configuration, const std::string& listen,
                       const timestamp::TrustStore& trust, std::function<void(const std::string&)> tell)
    : state_(std::make_unique<State>(configuration, listen, trust, std::move(tell))) {}
ReportDesk::~ReportDesk() = default;
std::string ReportDesk::url() const { return "https://" + state_->address.to_string(); }

}  // namespace kiroku::apps
