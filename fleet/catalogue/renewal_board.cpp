#include "fleet/catalogue/renewal_board.h"

#include <utility>

#include "base/printable.h"
#include "fleet/catalogue/catalogue_version.h"

namespace kiroku::fleet {
namespace {

std::string moment_at(const std::string& parameter) {
  return "(timestamptz 'epoch' + " + parameter + "::bigint * interval '1 microsecond')";
}
Postgres::Value value_of(std::int64_t value) { return std::to_string(value); }
Postgres::Value value_of(UtcTime time) { return std::to_string(time.time_since_epoch().count()); }

/// Of the tables c and r; parameters 1 to 5. Whoever may put makes a case look as if it were open again, or
/// had just changed, as often as they like: that keeps none from being looked at.
std::string is_to_be_looked_at() {
  return R"((c.state = 'closed' OR (c.state <> 'missing' AND r.looked IS NOT NULL)) AND
            (c.changed_at <= now() - $2::bigint * interval '1 second' OR
             c.not_renewed_since <= now() - interval '2 days') AND
            (r.looked IS NULL OR (r.looked < )" +
         moment_at("$1") + R"( AND ($5::boolean OR r.judged_by IS DISTINCT FROM $3 OR r.renew_from <= now() OR
             r.looked <= now() - $4::bigint * interval '1 second' OR c.changed_at > r.looked OR r.again))))";
}
constexpr const char* kCasesAndRenewals =
    " FROM kiroku.cases AS c LEFT JOIN kiroku.renewals AS r "
    "ON r.appliance = c.appliance AND r.case_id = c.case_id WHERE ";

std::vector<Postgres::Value> look_values_of(const RenewalBoard::Due& due) {
  return {value_of(due.began), value_of(std::int64_t{due.settled.count()}), due.judged_by,
          value_of(std::int64_t{due.every.count()}), due.all ? "true" : "false"};
}

std::vector<RenewalTurn> turns_of(const Postgres::Rows& rows) {
  std::vector<RenewalTurn> turns;
  for (int i = 0; i < rows.size(); ++i) turns.push_back({rows.text(i, 0), rows.text(i, 1), rows.text(i, 2)});
  return turns;
}

}  // namespace

RenewalBoard::RenewalBoard(Postgres database) : database_(std::move(database)) {
  require_catalogue_version(database_);
}

UtcTime RenewalBoard::now() {
  const Postgres::Rows rows = database_.ask("SELECT (extract(epoch FROM now()) * 1000000)::bigint");
  return UtcTime(std::chrono::microseconds(rows.integer(0, 0)));
}

std::vector<RenewalTurn> RenewalBoard::lease(const Due& due, std::size_t most, const std::string& holder,
                                             std::chrono::seconds for_how_long) {
  std::vector<Postgres::Value> values = look_values_of(due);
  values.push_back(value_of(static_cast<std::int64_t>(most)));
  values.push_back(holder);
  values.push_back(value_of(std::int64_t{for_how_long.count()}));
  // Of two workers that see the same case as free, the second finds at the last condition that it is not, and
  // looks for others.
  constexpr int kMostTries = 20;
  for (int tries = 0; tries < kMostTries; ++tries) {
    std::vector<RenewalTurn> turns = turns_of(database_.ask(
        "WITH due AS (SELECT c.appliance, c.case_id" + std::string(kCasesAndRenewals) + is_to_be_looked_at() +
            R"( AND (r.leased_until IS NULL OR r.leased_until <= now())
             ORDER BY r.looked NULLS FIRST, c.changed_at LIMIT $6::bigint FOR UPDATE OF c SKIP LOCKED)
         INSERT INTO kiroku.renewals AS r (appliance, case_id, leased_by, leased_at, leased_until)
           SELECT appliance, case_id, $7, now(), now() + $8::bigint * interval '1 second' FROM due
         ON CONFLICT (appliance, case_id) DO UPDATE SET
           leased_by = excluded.leased_by, leased_at = excluded.leased_at, leased_until = excluded.leased_until
           WHERE r.leased_until IS NULL OR r.leased_until <= now()
         RETURNING r.appliance, r.case_id, r.record)",
        values));
    const Postgres::Rows free =
        database_.ask("SELECT 1" + std::string(kCasesAndRenewals) + is_to_be_looked_at() +
                          " AND (r.leased_until IS NULL OR r.leased_until <= now()) LIMIT 1",
                      look_values_of(due));
    if (!turns.empty() || free.size() == 0) return turns;
  }
  return {};
}

std::vector<RenewalTurn> RenewalBoard::look(const Due& due) {
  return turns_of(database_.ask("SELECT c.appliance, c.case_id, r.record" + std::string(kCasesAndRenewals) +
                                    is_to_be_looked_at() + " ORDER BY c.appliance, c.case_id",
                                look_values_of(due)));
}

std::uint64_t RenewalBoard::held_elsewhere(const Due& due) {
  return static_cast<std::uint64_t>(database_
                                        .ask("SELECT count(*)" + std::string(kCasesAndRenewals) +
                                                 is_to_be_looked_at() + " AND r.leased_until > now()",
                                             look_values_of(due))
                                        .integer(0, 0));
}

bool RenewalBoard::extend(const std::string& holder, std::chrono::seconds for_how_long) {
  return database_
             .ask(
                 "UPDATE kiroku.renewals SET leased_until = now() + $2::bigint * interval '1 second' "
                 "WHERE leased_by = $1 RETURNING 1",
                 {holder, value_of(std::int64_t{for_how_long.count()})})
             .size() > 0;
}

bool RenewalBoard::enter(const std::string& holder, const std::string& judged_by, const RenewalFound& found) {
  // What changed since it was leased has not been looked at.
  return database_
             .ask(
                 "WITH entered AS (UPDATE kiroku.renewals SET looked = leased_at, judged_by = $4, what = $5, "
                 "detail = $6, renew_from = " +
                     moment_at("$7") +
                     R"(, record = $8, again = $9, leased_by = NULL, leased_at = NULL, leased_until = NULL
                      WHERE appliance = $1 AND case_id = $2 AND leased_by = $3 RETURNING looked)
                    UPDATE kiroku.cases SET
                      not_renewed_since = CASE WHEN changed_at > entered.looked THEN changed_at END
                      FROM entered WHERE appliance = $1 AND case_id = $2 RETURNING 1)",
                 {found.appliance, found.case_id, holder, judged_by, found.what, printable(found.detail),
                  found.renew_from ? value_of(*found.renew_from) : std::nullopt,
                  found.record.empty() ? std::nullopt : Postgres::Value(found.record),
                  found.again ? "true" : "false"})
             .size() == 1;
}

std::uint64_t RenewalBoard::refused() {
  return static_cast<std::uint64_t>(
      database_.ask("SELECT count(*) FROM kiroku.renewals WHERE what = 'refused'").integer(0, 0));
}

std::uint64_t RenewalBoard::out_of_reach() {
  return static_cast<std::uint64_t>(
      database_
          .ask(
              "SELECT count(*)" + std::string(kCasesAndRenewals) +
              "c.state = 'missing' OR (r.looked IS NULL AND (c.state = 'unreadable' OR (c.state = 'open' AND "
              "least(c.changed_at, c.not_renewed_since) <= now() - interval '2 days')))")
          .integer(0, 0));
}

void RenewalBoard::give_back(const std::string& holder) {
  database_.ask(
      "UPDATE kiroku.renewals SET leased_by = NULL, leased_at = NULL, leased_until = NULL "
      "WHERE leased_by = $1",
      {holder});
}

}  // namespace kiroku::fleet
