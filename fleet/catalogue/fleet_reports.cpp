#include "fleet/catalogue/fleet_reports.h"

#include "base/error.h"
#include "fleet/catalogue/catalogue_version.h"

namespace kiroku::fleet {
namespace {

/// How long a request waits for an administrator; and for how long more its appliance may ask for what it was
/// given.
#define KIROKU_REQUEST_LASTS "interval '10 minutes'"
#define KIROKU_ANSWER_LASTS "interval '20 minutes'"
/// TLS looks at a certificate's end when a connection begins, and appliances keep theirs.
#define KIROKU_CERTIFICATE_COUNTS \
  "((certificate = $2 AND now() < certificate_until) OR (next_certificate = $2 AND now() < next_until))"
constexpr std::int64_t kMostRequests = 64, kMostRequestsOfOne = 4;
/// So many runs back one is known to have come back; and so many changes of the run within a minute are no
/// restarts: a machine that starts anew without end needs longer for each.
#define KIROKU_RUNS_KEPT "16"
#define KIROKU_CHANGES_BUT_ONE "7"
#define KIROKU_CHANGES_WITHIN "interval '1 minute'"
/// For how long a process may still have the certificate that another one of its appliance renewed.
#define KIROKU_OLD_ONE_MAY_BE_HELD "interval '5 minutes'"
/// Of one enrolment that have not ended. An honest appliance has two; one that cannot keep what it renews
/// takes about two hundred.
constexpr std::int64_t kMostCertificates = 1000;
constexpr std::int64_t kFreeCodes = 5, kLongestCodeWait_s = 300;

UtcTime time_of(const Postgres::Rows& rows, int row, int column) {
  return UtcTime(std::chrono::microseconds(rows.integer(row, column)));
}
std::optional<UtcTime> time_or_none(const Postgres::Rows& rows, int row, int column) {
  if (rows.is_null(row, column)) return {};
  return time_of(rows, row, column);
}
std::string microseconds_of(UtcTime time) { return std::to_string(time.time_since_epoch().count()); }

[[noreturn]] void refuse_second(const std::string& name) {
  throw UsageError("an appliance named " + name +
                   " is enrolled already: give this one another name, or revoke the other one first "
                   "('kiroku-fleet revoke " +
                   name + "')");
}

}  // namespace

FleetReports::FleetReports(Postgres database) : database_(std::move(database)) {
  require_catalogue_version(database_);
}

void FleetReports::remove_old_requests() {
  database_.ask(
      "DELETE FROM kiroku.enrolments WHERE asked <= now() - CASE WHEN certificate IS NULL "
      "THEN " KIROKU_REQUEST_LASTS " ELSE " KIROKU_ANSWER_LASTS " END");
}

void FleetReports::ask(const PendingEnrolment& request, const std::string& from) {
  database_.together([&] {
    // Whoever asks at once on several servers is counted together.
    database_.ask("SELECT pg_advisory_xact_lock(hashtext('kiroku.enrolments'))");
    remove_old_requests();
    const Postgres::Rows counted = database_.ask(
        "SELECT count(*), count(*) FILTER (WHERE asked_from = $1), (SELECT count(*) FROM kiroku.appliances "
        "WHERE name = $2 AND revoked IS NULL) FROM kiroku.enrolments WHERE certificate IS NULL",
        {from, request.appliance});
    if (counted.integer(0, 2) > 0) refuse_second(request.appliance);
    if (counted.integer(0, 0) >= kMostRequests || counted.integer(0, 1) >= kMostRequestsOfOne)
      throw UsageError("too many requests to be enrolled wait already: try again in ten minutes");
    database_.ask(
        "INSERT INTO kiroku.enrolments (id, appliance, request, nonce, asked_from) VALUES ($1, $2, $3, $4, "
        "$5)",
        {request.id, request.appliance, request.request_pem, request.nonce, from});
  });
}

std::vector<PendingEnrolment> FleetReports::pending() {
  const Postgres::Rows rows = database_.ask(
      "SELECT id, appliance, request, nonce, (extract(epoch FROM asked) * 1000000)::bigint FROM "
      "kiroku.enrolments WHERE certificate IS NULL AND asked > now() - " KIROKU_REQUEST_LASTS
      " ORDER BY asked");
  std::vector<PendingEnrolment> all;
  for (int i = 0; i < rows.size(); ++i)
    all.push_back({rows.text(i, 0), rows.text(i, 1), rows.text(i, 2), rows.text(i, 3), time_of(rows, i, 4)});
  return all;
}

std::optional<std::string> FleetReports::certificate_for(const std::string& id) {
  const Postgres::Rows rows = database_.ask(
      "SELECT coalesce(certificate, '') FROM kiroku.enrolments WHERE id = $1 AND asked > now() - CASE WHEN "
      "certificate IS NULL THEN " KIROKU_REQUEST_LASTS " ELSE " KIROKU_ANSWER_LASTS " END",
      {id});
  if (rows.size() == 0) return {};
  return rows.text(0, 0);
}

void FleetReports::admit(const PendingEnrolment& request, const std::string& certificate_pem,
                         const std::string& by) {
  const CertificateFacts facts = facts_of_certificate_pem(certificate_pem);
  database_.together([&] {
    const Postgres::Rows taken = database_.ask(
        "UPDATE kiroku.enrolments SET certificate = $2 WHERE id = $1 AND certificate IS NULL AND asked > "
        "now() - " KIROKU_REQUEST_LASTS " RETURNING 1",
        {request.id, certificate_pem});
    if (taken.size() != 1)
      throw UsageError("this request is over: begin again with 'kiroku fleet enrol' on the appliance");
    // A name that was revoked is free, and what the appliance before said of itself goes with it.
    const Postgres::Rows entered = database_.ask(
        R"(INSERT INTO kiroku.appliances AS a (name, enrolled_by, certificate, certificate_until)
           VALUES ($1, $2, $3, timestamptz 'epoch' + $4::bigint * interval '1 microsecond')
           ON CONFLICT (name) DO UPDATE SET enrolled = now(), enrolled_by = excluded.enrolled_by,
             certificate = excluded.certificate, certificate_until = excluded.certificate_until,
             next_certificate = NULL, next_until = NULL, revoked = NULL, heard = NULL, report = NULL, run = NULL,
             earlier_runs = '{}', run_changes = '{}', doubled = NULL, replaced = NULL, replaced_shown = NULL
           WHERE a.revoked IS NOT NULL RETURNING 1)",
        {request.appliance, by, facts.fingerprint, microseconds_of(facts.not_after)});
    if (entered.size() != 1) refuse_second(request.appliance);
    // Whoever was revoked tells nothing of the one that has the name now.
    database_.ask("DELETE FROM kiroku.certificates WHERE appliance = $1", {request.appliance});
    keep_certificate(request.appliance, facts);
  });
}

void FleetReports::keep_certificate(const std::string& name, const CertificateFacts& facts) {
  database_.ask(
      "INSERT INTO kiroku.certificates (appliance, certificate, certificate_until) VALUES ($1, $2, "
      "timestamptz 'epoch' + $3::bigint * interval '1 microsecond')",
      {name, facts.fingerprint, microseconds_of(facts.not_after)});
}

std::chrono::seconds FleetReports::code_wait() {
  const Postgres::Rows rows = database_.ask(
      "SELECT ceil(greatest(coalesce(extract(epoch FROM open_again - now()), 0), 0))::bigint FROM "
      "kiroku.wrong_codes");
  return std::chrono::seconds(rows.size() == 0 ? 0 : rows.integer(0, 0));
}

void FleetReports::code_failed() {
  // Some are free; then the wait is twice as long after each. An hour later they are forgotten.
  database_.ask(
      R"(UPDATE kiroku.wrong_codes SET
           failures = CASE WHEN last < now() - interval '1 hour' THEN 1 ELSE failures + 1 END, last = now(),
           open_again = CASE WHEN last < now() - interval '1 hour' OR failures + 1 <= $1::bigint THEN now()
             ELSE now() + least($2::bigint, 2 ^ least(failures + 1 - $1::bigint, 16)) * interval '1 second' END)",
      {std::to_string(kFreeCodes), std::to_string(kLongestCodeWait_s)});
}

void FleetReports::code_succeeded() {
  database_.ask("UPDATE kiroku.wrong_codes SET failures = 0, open_again = now()");
}

std::optional<ReportRefusal> FleetReports::why_not(const std::string& name, const std::string& fingerprint) {
  const Postgres::Rows rows = database_.ask(
      "SELECT revoked IS NOT NULL, coalesce(certificate = $2 OR next_certificate = $2, false) FROM "
      "kiroku.appliances WHERE name = $1",
      {name, fingerprint});
  if (rows.size() == 0) return ReportRefusal::kNotEnrolled;
  if (rows.text(0, 0) == "t") return ReportRefusal::kRevoked;
  return rows.text(0, 1) == "t" ? ReportRefusal::kEnded : ReportRefusal::kOtherCertificate;
}

void FleetReports::note_replaced(const std::string& name, const std::string& fingerprint) {
  // An appliance's own process may not have read its renewed certificate yet. It does once the old one was
  // refused, so that the same one comes twice, or long after, from nobody but a second machine. It is written
  // down once, so that whoever shows such a certificate without end writes nothing.
  database_.together([&] {
    // Waits for whoever enrols the name anew, and then finds its certificate there no more.
    database_.ask("SELECT 1 FROM kiroku.appliances WHERE name = $1 FOR UPDATE", {name});
    database_.ask(
        "UPDATE kiroku.appliances AS a SET replaced_shown = now() FROM kiroku.certificates AS c WHERE "
        "a.name = $1 AND a.revoked IS NULL AND a.replaced_shown IS NULL AND c.appliance = a.name AND "
        "c.certificate = $2 AND (c.refused IS NOT NULL OR a.replaced <= now() - " KIROKU_OLD_ONE_MAY_BE_HELD
        ")",
        {name, fingerprint});
    database_.ask(
        "UPDATE kiroku.certificates SET refused = now() WHERE appliance = $1 AND certificate = $2 AND "
        "refused IS NULL",
        {name, fingerprint});
  });
}

std::optional<ReportRefusal> FleetReports::why_not_noted(const std::string& name,
                                                         const std::string& fingerprint) {
  const std::optional<ReportRefusal> refused = why_not(name, fingerprint);
  if (refused != ReportRefusal::kOtherCertificate) return refused;
  const Postgres::Rows untold = database_.ask(
      "SELECT 1 FROM kiroku.certificates AS c JOIN kiroku.appliances AS a ON a.name = c.appliance WHERE "
      "c.appliance = $1 AND c.certificate = $2 AND (c.refused IS NULL OR a.replaced_shown IS NULL)",
      {name, fingerprint});
  if (untold.size() > 0) note_replaced(name, fingerprint);
  return refused;
}

std::optional<ReportRefusal> FleetReports::take(const std::string& name, const std::string& fingerprint,
                                                const ApplianceReport& report) {
  // A certificate that was renewed is the only one once it was used. A run that others followed, and that
  // comes again, is a second machine; so are runs that follow each other faster than any machine starts:
  // which run a report names is its sender's choice. No flush of the disk is waited for: the next report
  // comes in five seconds, and those of 200 rooms would be 40 flushes a second, one after the other.
  const Postgres::Rows rows = database_.ask(
      R"(UPDATE kiroku.appliances SET heard = now(), report = $3,
           certificate = $2,
           certificate_until = CASE WHEN next_certificate = $2 THEN next_until ELSE certificate_until END,
           next_certificate = nullif(next_certificate, $2),
           next_until = CASE WHEN next_certificate = $2 THEN NULL ELSE next_until END,
           replaced = CASE WHEN next_certificate = $2 THEN now() ELSE replaced END,
           doubled = CASE WHEN run <> $4 AND
                               ($4 = ANY (earlier_runs) OR
                                run_changes[)" KIROKU_CHANGES_BUT_ONE "] > now() - " KIROKU_CHANGES_WITHIN
      R"()
                          THEN now() ELSE doubled END,
           earlier_runs = CASE WHEN run <> $4
             THEN (run || array_remove(earlier_runs, run))[1:)" KIROKU_RUNS_KEPT R"(] ELSE earlier_runs END,
           run_changes = CASE WHEN run <> $4
             THEN (now() || run_changes)[1:)" KIROKU_CHANGES_BUT_ONE R"(] ELSE run_changes END,
           run = $4
         FROM (SELECT set_config('synchronous_commit', 'off', true)) AS without_waiting
         WHERE name = $1 AND revoked IS NULL AND )" KIROKU_CERTIFICATE_COUNTS " RETURNING 1",
      {name, fingerprint, to_json(report), report.run});
  return rows.size() == 1 ? std::nullopt : why_not_noted(name, fingerprint);
}

std::optional<ReportRefusal> FleetReports::refusal(const std::string& name, const std::string& fingerprint) {
  const Postgres::Rows rows = database_.ask(
      "SELECT 1 FROM kiroku.appliances WHERE name = $1 AND revoked IS NULL AND " KIROKU_CERTIFICATE_COUNTS,
      {name, fingerprint});
  return rows.size() == 1 ? std::nullopt : why_not(name, fingerprint);
}

std::optional<ReportRefusal> FleetReports::renew(const std::string& name, const std::string& fingerprint,
                                                 const CertificateFacts& renewed) {
  bool is_taken = false, are_too_many = false;
  database_.together([&] {
    const Postgres::Rows rows = database_.ask(
        R"(UPDATE kiroku.appliances SET certificate = $2,
             certificate_until = CASE WHEN next_certificate = $2 THEN next_until ELSE certificate_until END,
             next_certificate = $3, next_until = timestamptz 'epoch' + $4::bigint * interval '1 microsecond',
             replaced = CASE WHEN next_certificate IS NOT NULL THEN now() ELSE replaced END
           WHERE name = $1 AND revoked IS NULL AND )" KIROKU_CERTIFICATE_COUNTS
        R"( AND (SELECT count(*) FROM kiroku.certificates WHERE appliance = $1 AND certificate_until > now())
                  < $5::bigint RETURNING 1)",
        {name, fingerprint, renewed.fingerprint, microseconds_of(renewed.not_after),
         std::to_string(kMostCertificates)});
    is_taken = rows.size() == 1;
    if (is_taken) {
      // TLS lets in nobody with one that ended.
      database_.ask("DELETE FROM kiroku.certificates WHERE appliance = $1 AND certificate_until < now()",
                    {name});
      keep_certificate(name, renewed);
    } else {
      are_too_many = !refusal(name, fingerprint);
    }
  });
  if (is_taken) return {};
  return are_too_many ? ReportRefusal::kTooManyCertificates : why_not_noted(name, fingerprint);
}

bool FleetReports::revoke(const std::string& name) {
  return database_
             .ask(
                 "UPDATE kiroku.appliances SET revoked = now() WHERE name = $1 AND revoked IS NULL RETURNING "
                 "1",
                 {name})
             .size() == 1;
}

std::vector<EnrolledAppliance> FleetReports::appliances() {
#define KIROKU_TIME(column) "(extract(epoch FROM " column ") * 1000000)::bigint"
  const Postgres::Rows rows = database_.ask(
      "SELECT name, " KIROKU_TIME("enrolled") ", enrolled_by, " KIROKU_TIME(
          "coalesce(next_until, certificate_until)") ", " KIROKU_TIME("revoked") ", " KIROKU_TIME("heard") ", coalesce(report, ''), " KIROKU_TIME("doubled") ", " KIROKU_TIME("replaced_shown") " FROM kiroku.appliances ORDER BY name");
#undef KIROKU_TIME
  std::vector<EnrolledAppliance> all;
  for (int i = 0; i < rows.size(); ++i) {
    all.push_back({rows.text(i, 0), time_of(rows, i, 1), rows.text(i, 2), time_of(rows, i, 3),
                   time_or_none(rows, i, 4), time_or_none(rows, i, 5), rows.text(i, 6),
                   time_or_none(rows, i, 7), time_or_none(rows, i, 8)});
  }
  return all;
}

std::vector<std::string> FleetReports::not_enrolled() {
  const Postgres::Rows rows = database_.ask(
      "SELECT DISTINCT c.appliance FROM kiroku.cases AS c LEFT JOIN kiroku.appliances AS a ON a.name = "
      "c.appliance AND a.revoked IS NULL WHERE a.name IS NULL ORDER BY c.appliance");
  std::vector<std::string> names;
  for (int i = 0; i < rows.size(); ++i) names.push_back(rows.text(i, 0));
  return names;
}

UtcTime FleetReports::now() {
  return time_of(database_.ask("SELECT (extract(epoch FROM now()) * 1000000)::bigint"), 0, 0);
}

}  // namespace kiroku::fleet
