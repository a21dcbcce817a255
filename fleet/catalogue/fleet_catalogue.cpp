#include "fleet/catalogue/fleet_catalogue.h"

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "base/error.h"
#include "base/printable.h"
#include "fleet/catalogue/catalogue_version.h"

namespace kiroku::fleet {
namespace {

using archive::CaseStamp;
using archive::CatalogueRow;

constexpr std::int64_t kVersion = 7, kWithReports = 2, kWithStricterAlarms = 3, kWithTraces = 4,
                       kWithNotes = 5, kWithRenewals = 6;

// A statement each. Times are of microseconds, as in ledgers.
constexpr const char* kTables[] = {
    "CREATE SCHEMA kiroku",
    "CREATE TABLE kiroku.version (version bigint NOT NULL)",
    R"(CREATE TABLE kiroku.cases (
         appliance    text COLLATE "C" NOT NULL,
         case_id      text COLLATE "C" NOT NULL,
         opened       timestamptz NOT NULL,
         duration_ns  bigint,
         state        text NOT NULL CHECK (state IN ('closed', 'open', 'unreadable', 'missing')),
         streams      text NOT NULL,
         segments     bigint NOT NULL,
         bytes        bigint NOT NULL,
         tokens       bigint NOT NULL,
         ledger_bytes bigint NOT NULL,
         changed      bigint NOT NULL,
         changed_at   timestamptz NOT NULL DEFAULT now(),  -- by this server's clock, when it was seen to be other than before
         pending      timestamptz DEFAULT now(),           -- since when nothing is known of it as it is; null once it was verified
         verdict      text,
         verified     timestamptz,
         alarm        boolean NOT NULL DEFAULT false,      -- the newest verdict says that it is not intact, whatever changed since
         unchecked    text,                                -- why the newest try gave no verdict
         leased_by    text,
         leased_until timestamptz,
         PRIMARY KEY (appliance, case_id)))",
    "CREATE INDEX cases_newest ON kiroku.cases (opened DESC, appliance DESC, case_id DESC)",
    "CREATE INDEX cases_of_appliance ON kiroku.cases (appliance, opened DESC, case_id DESC)",
    "CREATE INDEX cases_by_verdict ON kiroku.cases (verdict, opened DESC, appliance DESC, case_id DESC)",
    "CREATE INDEX cases_by_state ON kiroku.cases (state, opened DESC, appliance DESC, case_id DESC)",
    "CREATE INDEX cases_due ON kiroku.cases (verified NULLS FIRST, pending) WHERE state <> 'missing'",
    // A verdict is of what was verified. That an alarm was raised stays: whoever can change a case could take
    // it back.
    R"(CREATE FUNCTION kiroku.forget() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
         NEW.changed_at = now();
         NEW.pending = coalesce(OLD.pending, now());
         NEW.verdict = NULL; NEW.verified = NULL; NEW.leased_by = NULL; NEW.leased_until = NULL;
         RETURN NEW;
       END $$)",
    R"(CREATE TRIGGER forget BEFORE UPDATE ON kiroku.cases FOR EACH ROW
         WHEN ((OLD.ledger_bytes, OLD.changed) IS DISTINCT FROM (NEW.ledger_bytes, NEW.changed))
         EXECUTE FUNCTION kiroku.forget())",
    R"(CREATE TABLE kiroku.verifications (
         number    bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
         appliance text COLLATE "C" NOT NULL,
         case_id   text COLLATE "C" NOT NULL,
         at        timestamptz NOT NULL,
         verdict   text NOT NULL,
         findings  bigint NOT NULL,
         detail    text NOT NULL,
         entered_by text NOT NULL DEFAULT session_user))",
    "CREATE INDEX verifications_of_case ON kiroku.verifications (appliance, case_id, number)",
};

// What version 2 has more: who may report, and what each said last. Reports change their row every few
// seconds, so that pages have room for its next version beside it.
constexpr const char* kReportTables[] = {
    R"(CREATE TABLE kiroku.appliances (
         name              text COLLATE "C" PRIMARY KEY,
         enrolled          timestamptz NOT NULL DEFAULT now(),
         enrolled_by       text NOT NULL,
         certificate       text NOT NULL,         -- SHA-256 of the one with which it may report,
         certificate_until timestamptz NOT NULL,
         next_certificate  text,                  -- and of the one that follows once it was used
         next_until        timestamptz,
         revoked           timestamptz,
         heard             timestamptz,           -- when its newest report came, by this server's clock
         report            text,
         run               text,                  -- of the process that reports, and the one before it
         earlier_run       text,
         doubled           timestamptz) WITH (fillfactor = 50))",
    R"(CREATE TABLE kiroku.enrolments (
         id          text PRIMARY KEY,
         appliance   text COLLATE "C" NOT NULL,
         request     text NOT NULL,
         nonce       text NOT NULL,
         asked       timestamptz NOT NULL DEFAULT now(),
         asked_from  text NOT NULL,
         certificate text))",
    R"(CREATE TABLE kiroku.wrong_codes (
         failures bigint NOT NULL, last timestamptz NOT NULL, open_again timestamptz NOT NULL))",
    "INSERT INTO kiroku.wrong_codes VALUES (0, now(), now())",
};

#define KIROKU_NEEDS_A_PERSON                                                                         \
  "(alarm OR unchecked IS NOT NULL OR verdict IN ('incomplete', 'unproven') OR state IN ('missing', " \
  "'unreadable'))"

// What version 3 has otherwise: an alarm says that a case is not intact, and no more that it could not be
// proven or has no end. Of a case that changed since the history knows which of them it was.
constexpr const char* kAlarmsOfWhatIsNotIntact[] = {
    "DROP INDEX IF EXISTS kiroku.cases_for_a_person",
    "CREATE INDEX cases_for_a_person ON kiroku.cases (opened DESC, appliance DESC, case_id DESC) "
    "WHERE " KIROKU_NEEDS_A_PERSON,
    R"(UPDATE kiroku.cases AS c SET alarm = false
         WHERE alarm AND (SELECT v.verdict FROM kiroku.verifications AS v
                          WHERE v.appliance = c.appliance AND v.case_id = c.case_id AND
                                v.verdict <> 'could-not-check'
                          ORDER BY v.number DESC LIMIT 1) IN ('incomplete', 'unproven'))",
};

// What version 4 has more, by which a copy of an appliance is seen: every certificate that an enrolment was
// given, and the runs that reported lately (fleet/catalogue/fleet_reports).
constexpr const char* kTracesOfCopies[] = {
    R"(CREATE TABLE kiroku.certificates (
         appliance         text COLLATE "C" NOT NULL,
         certificate       text NOT NULL,         -- SHA-256, as in kiroku.appliances
         certificate_until timestamptz NOT NULL,
         refused           timestamptz,           -- when it was first shown after another had replaced it
         PRIMARY KEY (appliance, certificate)))",
    R"(INSERT INTO kiroku.certificates (appliance, certificate, certificate_until)
         SELECT name, certificate, certificate_until FROM kiroku.appliances WHERE revoked IS NULL
         UNION SELECT name, next_certificate, next_until FROM kiroku.appliances
         WHERE revoked IS NULL AND next_certificate IS NOT NULL)",
    R"(ALTER TABLE kiroku.appliances
         ADD COLUMN earlier_runs text[] NOT NULL DEFAULT '{}',        -- newest first
         ADD COLUMN run_changes timestamptz[] NOT NULL DEFAULT '{}',  -- when the run changed, newest first
         ADD COLUMN replaced timestamptz,        -- when a certificate was last replaced by its next one
         ADD COLUMN replaced_shown timestamptz)",  // since when one that was replaced is known to be in use
    R"(UPDATE kiroku.appliances SET earlier_runs = ARRAY[earlier_run] WHERE earlier_run IS NOT NULL)",
    "ALTER TABLE kiroku.appliances DROP COLUMN earlier_run",
};

// What version 5 has more: search notes, as they lie in the store.
constexpr const char* kSearchNotes[] = {
    R"(CREATE TABLE kiroku.search_notes (
         appliance text COLLATE "C" NOT NULL,
         case_id   text COLLATE "C" NOT NULL,
         version   text NOT NULL,   -- of the object that it was read from
         note      text NOT NULL,   -- '': it cannot be used
         PRIMARY KEY (appliance, case_id)))",
};

// What version 6 has more: when each case's evidence record was last looked at
// (fleet/catalogue/renewal_board). The records themselves lie in the store.
constexpr const char* kRenewals[] = {
    R"(CREATE TABLE kiroku.renewals (
         appliance    text COLLATE "C" NOT NULL,
         case_id      text COLLATE "C" NOT NULL,
         looked       timestamptz,  -- when the newest look began that was brought to its end
         judged_by    text,         -- by which policy and roots
         what         text,         -- what was done, or why nothing was
         detail       text,
         renew_from   timestamptz,  -- from then on the record is due; null: no end is known
         again        boolean NOT NULL DEFAULT false,  -- something was left to be done
         record       text,         -- SHA-256 of the record, where all that it covers was compared with the case
         leased_by    text,
         leased_at    timestamptz,
         leased_until timestamptz,
         PRIMARY KEY (appliance, case_id)))",
};

// What version 7 has more: what whoever may not enter verdicts found of a case, the page or a renewal. An
// alarm or a doubt stands until the case is verified anew, which is due at once. A worker that verifies it
// meanwhile may have read it before, and enters nothing. That a case is intact nobody says in this way. And
// since when a case changed that no renewal has looked at: a verdict ends what is pending, and not that.
constexpr const char* kAccusations[] = {
    R"(CREATE OR REPLACE FUNCTION kiroku.accuse(of_appliance text, of_case text, not_intact boolean, its_verdict text,
                                     its_findings bigint, why text)
         RETURNS void LANGUAGE sql SECURITY DEFINER SET search_path = pg_catalog, pg_temp AS $$
         UPDATE kiroku.cases SET alarm = alarm OR not_intact,
             unchecked = CASE WHEN not_intact THEN unchecked ELSE why END, verdict = NULL, verified = NULL,
             pending = 'epoch', leased_by = NULL, leased_until = NULL
           WHERE appliance = of_appliance AND case_id = of_case AND state <> 'missing';
         INSERT INTO kiroku.verifications (appliance, case_id, at, verdict, findings, detail)
           SELECT of_appliance, of_case, now(),
                  CASE WHEN NOT not_intact THEN 'could-not-check' WHEN its_verdict = 'intact-excerpt' THEN its_verdict
                       ELSE 'tampered' END, its_findings, why
           WHERE EXISTS (SELECT FROM kiroku.cases WHERE appliance = of_appliance AND case_id = of_case) $$)",
    "REVOKE ALL ON FUNCTION kiroku.accuse FROM PUBLIC",
    "ALTER TABLE kiroku.cases ADD COLUMN IF NOT EXISTS not_renewed_since timestamptz DEFAULT now()",
    R"(CREATE OR REPLACE FUNCTION kiroku.forget() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
         NEW.changed_at = now();
         NEW.pending = coalesce(OLD.pending, now());
         NEW.not_renewed_since = coalesce(OLD.not_renewed_since, now());
         NEW.verdict = NULL; NEW.verified = NULL; NEW.leased_by = NULL; NEW.leased_until = NULL;
         RETURN NEW;
       END $$)",
};

// Roles belong to the whole server, and may be there from another database of it.
constexpr const char* kRoles[] = {
    R"(DO $$ DECLARE role text; BEGIN
         FOREACH role IN ARRAY ARRAY['kiroku_reader', 'kiroku_indexer', 'kiroku_verifier', 'kiroku_reporter'] LOOP
           IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = role) THEN
             EXECUTE format('CREATE ROLE %I NOLOGIN', role);
           END IF;
         END LOOP;
       END $$)",
    "GRANT USAGE ON SCHEMA kiroku TO kiroku_reader, kiroku_indexer, kiroku_verifier, kiroku_reporter",
    R"(GRANT SELECT ON ALL TABLES IN SCHEMA kiroku TO kiroku_reader, kiroku_indexer, kiroku_verifier,
                                                    kiroku_reporter)",
    R"(GRANT INSERT (appliance, case_id, opened, duration_ns, state, streams, segments, bytes, tokens, ledger_bytes,
                     changed) ON kiroku.cases TO kiroku_indexer)",
    R"(GRANT UPDATE (opened, duration_ns, state, streams, segments, bytes, tokens, ledger_bytes, changed)
         ON kiroku.cases TO kiroku_indexer)",
    "GRANT INSERT, UPDATE ON kiroku.search_notes TO kiroku_indexer",
    R"(GRANT UPDATE (verdict, verified, alarm, unchecked, pending, not_renewed_since, leased_by, leased_until)
         ON kiroku.cases TO kiroku_verifier)",
    "GRANT INSERT ON kiroku.verifications TO kiroku_verifier",
    "GRANT EXECUTE ON FUNCTION kiroku.accuse TO kiroku_reader, kiroku_verifier",
    "GRANT INSERT, UPDATE ON kiroku.renewals TO kiroku_verifier",
    "GRANT INSERT, UPDATE ON kiroku.appliances TO kiroku_reporter",
    "GRANT INSERT, UPDATE (refused), DELETE ON kiroku.certificates TO kiroku_reporter",
    "GRANT INSERT, UPDATE (certificate), DELETE ON kiroku.enrolments TO kiroku_reporter",
    "GRANT UPDATE ON kiroku.wrong_codes TO kiroku_reporter",
};

#define KIROKU_US(column) "(extract(epoch FROM " column ") * 1000000)::bigint"
constexpr std::string_view kColumns = "case_id, " KIROKU_US("opened") ", duration_ns, state, streams, segments, bytes, tokens, verdict, " KIROKU_US(
    "verified") ", appliance, alarm, unchecked";
#undef KIROKU_US

/// A parameter that holds microseconds since 1970, as a time.
std::string time_from(const std::string& parameter) {
  return "(timestamptz 'epoch' + " + parameter + "::bigint * interval '1 microsecond')";
}

Postgres::Value number(std::int64_t value) { return std::to_string(value); }
/// What ledgers claim may be more than a column holds.
Postgres::Value number(std::uint64_t value) {
  return std::to_string(std::min<std::uint64_t>(value, INT64_MAX));
}
Postgres::Value number(UtcTime time) { return std::to_string(time.time_since_epoch().count()); }

CatalogueRow row_of(const Postgres::Rows& rows, int at) {
  const auto time = [&](int column) { return UtcTime(std::chrono::microseconds(rows.integer(at, column))); };
  const auto count = [&](int column) { return static_cast<std::uint64_t>(rows.integer(at, column)); };
  CatalogueRow row;
  row.case_id = rows.text(at, 0);
  row.opened = time(1);
  if (!rows.is_null(at, 2)) row.duration_ns = rows.integer(at, 2);
  row.state = rows.text(at, 3);
  row.streams = archive::split_names(rows.text(at, 4));
  row.segments = count(5);
  row.bytes = count(6);
  row.tokens = count(7);
  if (!rows.is_null(at, 8)) row.last_verdict = rows.text(at, 8);
  if (!rows.is_null(at, 9)) row.verified = time(9);
  return row;
}

constexpr int kTotalsColumns = 14;
constexpr std::string_view kTotals = R"(
    count(*), least(coalesce(sum(segments), 0), 9223372036854775807)::bigint,
    least(coalesce(sum(bytes), 0), 9223372036854775807)::bigint,
    count(*) FILTER (WHERE state = 'open'), count(*) FILTER (WHERE state = 'unreadable'),
    count(*) FILTER (WHERE state = 'missing'), count(*) FILTER (WHERE state <> 'missing' AND verified IS NULL),
    count(*) FILTER (WHERE state = 'closed' AND verified IS NULL AND unchecked IS NULL),
    count(*) FILTER (WHERE state = 'unreadable' AND verified IS NULL AND unchecked IS NULL),
    count(*) FILTER (WHERE alarm), count(*) FILTER (WHERE verdict = 'incomplete'),
    count(*) FILTER (WHERE verdict = 'unproven'), count(unchecked),
    count(*) FILTER (WHERE leased_by IS NOT NULL AND leased_until > now()))";

FleetTotals totals_of(const Postgres::Rows& rows, int row) {
  const auto count = [&](int column) { return static_cast<std::uint64_t>(rows.integer(row, column)); };
  return {count(0), count(1), count(2), count(3),  count(4),  count(5),  count(6),
          count(7), count(8), count(9), count(10), count(11), count(12), count(13)};
}

/// The condition under which a case is due; its $1 to $3 are values_of(). Only the database's clock counts:
/// workers' clocks may differ, and a ledger claims what its writer likes.
std::string is_due(const FleetCatalogue::Due& due) {
  return R"(state <> 'missing' AND
            CASE WHEN verified IS NOT NULL THEN verified < )" +
         (std::holds_alternative<UtcTime>(due.verified_before) ? time_from("$1")
                                                               : "now() - $1::bigint * interval '1 second'") +
         R"( ELSE pending <= now() - $3::bigint * interval '1 second' OR
                  (state = 'closed' AND changed_at <= now() - $2::bigint * interval '1 second') END)";
}

std::vector<Postgres::Value> values_of(const FleetCatalogue::Due& due) {
  const auto* const ago = std::get_if<std::chrono::seconds>(&due.verified_before);
  return {ago ? number(std::int64_t{ago->count()}) : number(std::get<UtcTime>(due.verified_before)),
          number(std::int64_t{due.settled.count()}), number(std::int64_t{due.longest_pending.count()})};
}

class PostgresCaseTable final : public archive::CaseTable {
 public:
  PostgresCaseTable(Postgres& database, std::string appliance)
      : database_(database), appliance_(std::move(appliance)) {}

  void put(const CatalogueRow& row, const CaseStamp& stamp) override {
    database_.ask(
        "INSERT INTO kiroku.cases (appliance, case_id, opened, duration_ns, state, streams, segments, "
        "bytes, "
        "tokens, ledger_bytes, changed) VALUES ($1, $2, " +
            time_from("$3") + R"(, $4, $5, $6, $7, $8, $9, $10, $11)
           ON CONFLICT (appliance, case_id) DO UPDATE SET
             opened = excluded.opened, duration_ns = excluded.duration_ns, state = excluded.state,
             streams = excluded.streams, segments = excluded.segments, bytes = excluded.bytes, tokens = excluded.tokens,
             ledger_bytes = excluded.ledger_bytes, changed = excluded.changed)",
        {appliance_, row.case_id, number(row.opened),
         row.duration_ns ? number(*row.duration_ns) : std::nullopt, row.state,
         archive::joined_names(row.streams), number(row.segments), number(row.bytes), number(row.tokens),
         number(stamp.bytes), number(stamp.changed)});
  }
  std::map<std::string, CaseStamp> stamps() override {
    const Postgres::Rows rows = database_.ask(
        "SELECT case_id, ledger_bytes, changed FROM kiroku.cases WHERE appliance = $1", {appliance_});
    std::map<std::string, CaseStamp> stamps;
    for (int i = 0; i < rows.size(); ++i) stamps[rows.text(i, 0)] = {rows.integer(i, 1), rows.integer(i, 2)};
    return stamps;
  }
  std::vector<CatalogueRow> rows() override {
    const Postgres::Rows found =
        database_.ask("SELECT " + std::string(kColumns) +
                          " FROM kiroku.cases WHERE appliance = $1 ORDER BY opened DESC, case_id DESC",
                      {appliance_});
    std::vector<CatalogueRow> list;
    for (int i = 0; i < found.size(); ++i) list.push_back(row_of(found, i));
    return list;
  }
  void remove(const std::string& case_id) override {
    database_.ask("DELETE FROM kiroku.cases WHERE appliance = $1 AND case_id = $2", {appliance_, case_id});
  }
  void set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when) override {
    database_.ask("UPDATE kiroku.cases SET pending = NULL, verdict = $3, verified = " + time_from("$4") +
                      " WHERE appliance = $1 AND case_id = $2",
                  {appliance_, case_id, verdict, number(when)});
  }
  void together(const std::function<void()>& work) override { database_.together(work); }

 private:
  Postgres& database_;
  const std::string appliance_;
};

std::optional<std::int64_t> version_of(Postgres& database) {
  if (database.ask("SELECT to_regclass('kiroku.version')").is_null(0, 0)) return {};
  const Postgres::Rows rows = database.ask("SELECT version FROM kiroku.version");
  return rows.size() == 1 ? std::optional(rows.integer(0, 0)) : std::nullopt;
}

}  // namespace

void FleetCatalogue::prepare(Postgres& database) {
  database.together([&] {
    // Of two that begin at once the second waits here, and finds everything made.
    database.ask("SELECT pg_advisory_xact_lock(hashtext('kiroku.version'))");
    const std::optional<std::int64_t> there = version_of(database);
    if (there && *there > kVersion) {
      throw UsageError("the catalogue is of version " + std::to_string(*there) + ", and this program knows " +
                       std::to_string(kVersion) + ": use the newer program");
    }
    if (!there) {
      for (const char* statement : kTables) database.ask(statement);
      database.ask("INSERT INTO kiroku.version VALUES ($1)", {number(kVersion)});
    }
    if (!there || *there < kWithReports) {
      for (const char* statement : kReportTables) database.ask(statement);
    }
    if (!there || *there < kWithStricterAlarms) {
      for (const char* statement : kAlarmsOfWhatIsNotIntact) database.ask(statement);
    }
    if (!there || *there < kWithTraces) {
      for (const char* statement : kTracesOfCopies) database.ask(statement);
    }
    if (!there || *there < kWithNotes) {
      for (const char* statement : kSearchNotes) database.ask(statement);
    }
    if (!there || *there < kWithRenewals) {
      for (const char* statement : kRenewals) database.ask(statement);
    }
    if (!there || *there < kVersion) {
      for (const char* statement : kAccusations) database.ask(statement);
      database.ask("UPDATE kiroku.version SET version = $1", {number(kVersion)});
    }
    for (const char* statement : kRoles) database.ask(statement);
  });
}

void require_catalogue_version(Postgres& database) {
  const std::optional<std::int64_t> there = version_of(database);
  if (there == kVersion) return;
  throw UsageError(
      there ? "the catalogue is of version " + std::to_string(*there) + ", and this program needs " +
                  std::to_string(kVersion) + ": run 'kiroku-fleet init' of the newest program"
            : "this database holds no catalogue of Kiroku: run 'kiroku-fleet init' as its administrator");
}

FleetCatalogue::FleetCatalogue(Postgres database) : database_(std::move(database)) {
  require_catalogue_version(database_);
}

std::vector<std::string> FleetCatalogue::appliances() {
  const Postgres::Rows rows = database_.ask("SELECT DISTINCT appliance FROM kiroku.cases ORDER BY appliance");
  std::vector<std::string> names;
  for (int i = 0; i < rows.size(); ++i) names.push_back(rows.text(i, 0));
  return names;
}

std::unique_ptr<archive::CaseTable> FleetCatalogue::table_of(const std::string& appliance) {
  return std::make_unique<PostgresCaseTable>(database_, appliance);
}

std::vector<FleetCase> FleetCatalogue::find(const CaseQuery& query) {
  std::vector<Postgres::Value> values;
  std::string where;
  const auto parameter = [&](Postgres::Value value) {
    values.push_back(std::move(value));
    return "$" + std::to_string(values.size());
  };
  const auto require = [&](const std::string& condition) {
    where += (where.empty() ? " WHERE " : " AND ") + condition;
  };
  if (query.appliance) require("appliance = " + parameter(query.appliance));
  if (query.case_id) require("case_id = " + parameter(query.case_id));
  if (query.state) require("state = " + parameter(query.state));
  if (query.verdict) require("verdict = " + parameter(query.verdict));
  if (query.unverified) require("verified IS NULL");
  if (query.needs_a_person) require(KIROKU_NEEDS_A_PERSON);
  if (query.opened_from) require("opened >= " + time_from(parameter(number(*query.opened_from))));
  if (query.opened_before) require("opened < " + time_from(parameter(number(*query.opened_before))));
  if (query.after) {
    const std::string opened = time_from(parameter(number(query.after->opened)));
    const std::string appliance = parameter(query.after->appliance),
                      case_id = parameter(query.after->case_id);
    require("(opened, appliance, case_id) < (" + opened + ", " + appliance + ", " + case_id + ")");
  }
  constexpr std::string_view kNote =
      ", (SELECT note FROM kiroku.search_notes AS n WHERE n.appliance = cases.appliance AND n.case_id = "
      "cases.case_id)";
  const Postgres::Rows rows = database_.ask(
      "SELECT " + std::string(kColumns) + std::string(query.with_notes ? kNote : "") + " FROM kiroku.cases" +
          where + " ORDER BY opened DESC, appliance DESC, case_id DESC LIMIT " +
          parameter(number(std::uint64_t{query.limit})),
      values);
  std::vector<FleetCase> found;
  for (int i = 0; i < rows.size(); ++i) {
    FleetCase& one = found.emplace_back(FleetCase{rows.text(i, 10), row_of(rows, i)});
    one.alarm = rows.text(i, 11) == "t";
    if (!rows.is_null(i, 12)) one.unchecked = rows.text(i, 12);
    if (query.with_notes && !rows.is_null(i, 13)) one.search_note = rows.text(i, 13);
  }
  return found;
}

std::map<std::string, std::string> FleetCatalogue::note_versions(const std::string& appliance) {
  const Postgres::Rows rows =
      database_.ask("SELECT case_id, version FROM kiroku.search_notes WHERE appliance = $1", {appliance});
  std::map<std::string, std::string> versions;
  for (int i = 0; i < rows.size(); ++i) versions[rows.text(i, 0)] = rows.text(i, 1);
  return versions;
}

void FleetCatalogue::put_note(const std::string& appliance, const std::string& case_id,
                              const std::string& version, const std::string& note) {
  database_.ask(
      "INSERT INTO kiroku.search_notes (appliance, case_id, version, note) VALUES ($1, $2, $3, $4) ON "
      "CONFLICT "
      "(appliance, case_id) DO UPDATE SET version = excluded.version, note = excluded.note",
      {appliance, case_id, version, note});
}

FleetTotals FleetCatalogue::totals() {
  return totals_of(database_.ask("SELECT " + std::string(kTotals) + " FROM kiroku.cases"), 0);
}

std::vector<ApplianceTotals> FleetCatalogue::totals_by_appliance() {
  const Postgres::Rows rows = database_.ask(
      "SELECT " + std::string(kTotals) +
      ", appliance, (extract(epoch FROM max(opened)) * 1000000)::bigint, "
      "(extract(epoch FROM max(changed_at)) * 1000000)::bigint FROM kiroku.cases GROUP BY appliance ORDER BY "
      "appliance");
  std::vector<ApplianceTotals> all;
  for (int i = 0; i < rows.size(); ++i) {
    all.push_back({rows.text(i, kTotalsColumns), totals_of(rows, i),
                   UtcTime(std::chrono::microseconds(rows.integer(i, kTotalsColumns + 1))),
                   UtcTime(std::chrono::microseconds(rows.integer(i, kTotalsColumns + 2)))});
  }
  return all;
}

UtcTime FleetCatalogue::now() {
  const Postgres::Rows rows = database_.ask("SELECT (extract(epoch FROM now()) * 1000000)::bigint");
  return UtcTime(std::chrono::microseconds(rows.integer(0, 0)));
}

std::optional<Lease> FleetCatalogue::lease(const Due& due, std::chrono::seconds for_how_long) {
  std::vector<Postgres::Value> values = values_of(due);
  values.push_back(number(std::int64_t{for_how_long.count()}));
  const Postgres::Rows rows = database_.ask(
      R"(UPDATE kiroku.cases AS c
         SET leased_by = gen_random_uuid()::text, leased_until = now() + $4::bigint * interval '1 second'
         FROM (SELECT appliance, case_id FROM kiroku.cases
               WHERE (leased_until IS NULL OR leased_until <= now()) AND )" +
          is_due(due) + R"(
               ORDER BY verified NULLS FIRST, pending LIMIT 1 FOR UPDATE SKIP LOCKED) AS due
         WHERE c.appliance = due.appliance AND c.case_id = due.case_id
         RETURNING c.appliance, c.case_id, (extract(epoch FROM c.changed_at) * 1000000)::bigint, c.leased_by)",
      values);
  if (rows.size() == 0) return {};
  return Lease{rows.text(0, 0), rows.text(0, 1), UtcTime(std::chrono::microseconds(rows.integer(0, 2))),
               rows.text(0, 3)};
}

bool FleetCatalogue::extend(const Lease& lease, std::chrono::seconds for_how_long) {
  return database_
             .ask(
                 "UPDATE kiroku.cases SET leased_until = now() + $4::bigint * interval '1 second' "
                 "WHERE appliance = $1 AND case_id = $2 AND leased_by = $3 RETURNING 1",
                 {lease.appliance, lease.case_id, lease.holder, number(std::int64_t{for_how_long.count()})})
             .size() == 1;
}

std::uint64_t FleetCatalogue::held_elsewhere(const Due& due) {
  return static_cast<std::uint64_t>(
      database_
          .ask("SELECT count(*) FROM kiroku.cases WHERE leased_by IS NOT NULL AND leased_until > now() AND " +
                   is_due(due),
               values_of(due))
          .integer(0, 0));
}

bool FleetCatalogue::enter(const Lease& lease, const Verification& found) {
  bool entered = false;
  database_.together([&] {
    const Postgres::Rows rows = database_.ask(
        "UPDATE kiroku.cases SET verdict = $4, verified = now(), alarm = $5, unchecked = NULL, "
        "pending = NULL, leased_by = NULL, leased_until = NULL "
        "WHERE appliance = $1 AND case_id = $2 AND leased_by = $3 AND state <> 'missing' RETURNING 1",
        {lease.appliance, lease.case_id, lease.holder, found.verdict, found.alarm ? "true" : "false"});
    entered = rows.size() == 1;
    if (entered) keep(lease, found);
  });
  return entered;
}

void FleetCatalogue::give_back(const Lease& lease, std::chrono::seconds pause, const std::string& why) {
  database_.together([&] {
    const Postgres::Rows rows = database_.ask(
        "UPDATE kiroku.cases SET leased_by = NULL, leased_until = now() + $4::bigint * interval '1 second', "
        "unchecked = coalesce($5, unchecked) WHERE appliance = $1 AND case_id = $2 AND leased_by = $3 "
        "RETURNING 1",
        {lease.appliance, lease.case_id, lease.holder, number(std::int64_t{pause.count()}),
         why.empty() ? std::nullopt : Postgres::Value(printable(why))});
    if (rows.size() == 1 && !why.empty()) keep(lease, {"could-not-check", false, 0, why});
  });
}

void FleetCatalogue::accuse(const std::string& appliance, const std::string& case_id,
                            const Verification& found) {
  database_.ask("SELECT kiroku.accuse($1, $2, $3::boolean, $4, $5::bigint, $6)",
                {appliance, case_id, found.alarm ? "true" : "false", found.verdict,
                 number(std::uint64_t{found.findings}), printable(found.detail)});
}

void FleetCatalogue::end_pauses() {
  database_.ask(
      "UPDATE kiroku.cases SET leased_until = NULL WHERE leased_by IS NULL AND leased_until IS NOT NULL", {});
}

void FleetCatalogue::keep(const Lease& lease, const Verification& found) {
  database_.ask(
      "INSERT INTO kiroku.verifications (appliance, case_id, at, verdict, findings, detail) VALUES ($1, "
      "$2, now(), $3, $4, $5)",
      {lease.appliance, lease.case_id, found.verdict, number(std::uint64_t{found.findings}), found.detail});
}

std::vector<EnteredVerification> FleetCatalogue::verifications(const std::string& appliance,
                                                               const std::string& case_id) {
  const Postgres::Rows rows = database_.ask(
      "SELECT verdict, (extract(epoch FROM at) * 1000000)::bigint, findings, detail FROM "
      "kiroku.verifications "
      "WHERE appliance = $1 AND case_id = $2 ORDER BY number",
      {appliance, case_id});
  std::vector<EnteredVerification> all;
  for (int i = 0; i < rows.size(); ++i) {
    EnteredVerification& one = all.emplace_back();
    one.verdict = rows.text(i, 0);
    one.when = UtcTime(std::chrono::microseconds(rows.integer(i, 1)));
    one.findings = static_cast<std::size_t>(rows.integer(i, 2));
    one.detail = rows.text(i, 3);
  }
  return all;
}

}  // namespace kiroku::fleet
