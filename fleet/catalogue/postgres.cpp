#include "fleet/catalogue/postgres.h"

#include <charconv>
#include <libpq-fe.h>
#include <string_view>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::fleet {
namespace {

/// A message of the server or the library, on one line.
std::string sentence_of(std::string_view message) {
  constexpr std::string_view kSeverity = "ERROR:";
  if (message.starts_with(kSeverity)) message.remove_prefix(kSeverity.size());
  std::string text;
  for (const char each : message) {
    const bool is_space = each == '\n' || each == ' ' || each == '\t';
    if (!is_space) {
      text += each;
    } else if (!text.empty() && text.back() != ' ') {
      text += ' ';
    }
  }
  while (text.ends_with(' ')) text.pop_back();
  return printable(text);
}

/// What to do about an error of this kind, behind its sentence.
std::string advice_for(std::string_view state) {
  if (state == "42501") return "; give this user one of the roles that 'kiroku-fleet init' made";
  if (state == "42P01" || state == "3F000" || state == "42703")
    return "; the catalogue is not there, or of another version: run 'kiroku-fleet init' as the database's "
           "administrator";
  if (state == "25006") return "; this is a copy that takes no changes: connect to the primary server";
  return "";
}

/// A server that lost its power says nothing more: without limits TCP waits for a quarter of an hour. What
/// the administrator's own text says comes later, and counts.
PGconn* connect(const std::string& connection) {
  const char* const names[] = {"connect_timeout",     "tcp_user_timeout", "keepalives_idle",
                               "keepalives_interval", "dbname",           nullptr};
  const char* const values[] = {"5", "8000", "10", "4", connection.c_str(), nullptr};
  constexpr int kExpandDbname = 1;
  return PQconnectdbParams(names, values, kExpandDbname);
}

}  // namespace

bool DatabaseError::passes() const {
  // 08: the connection; 53: resources; 57P: the server stops or starts; 40: another transaction came first.
  return state_.empty() || state_.starts_with("08") || state_.starts_with("53") ||
         state_.starts_with("57P") || state_.starts_with("40");
}

Postgres::Rows::Rows(pg_result* result) : result_(result, PQclear) {}
int Postgres::Rows::size() const { return PQntuples(result_.get()); }
bool Postgres::Rows::is_null(int row, int column) const {
  return PQgetisnull(result_.get(), row, column) != 0;
}
std::string Postgres::Rows::text(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column),
          static_cast<std::size_t>(PQgetlength(result_.get(), row, column))};
}
std::int64_t Postgres::Rows::integer(int row, int column) const {
  const std::string value = text(row, column);
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || value.empty())
    throw DatabaseError("the catalogue holds '" + printable(value) + "' where a whole number must be",
                        "22P02");
  return number;
}

Postgres::Postgres(const std::string& connection) : connection_(connect(connection), PQfinish) {
  if (PQstatus(connection_.get()) != CONNECTION_OK)
    throw DatabaseError("cannot reach PostgreSQL: " + sentence_of(PQerrorMessage(connection_.get())), "");
  PQsetNoticeProcessor(
      connection_.get(), [](void*, const char*) {}, nullptr);
}

Postgres::Rows Postgres::ask(const std::string& statement, const std::vector<Value>& values) {
  std::vector<const char*> pointers;
  pointers.reserve(values.size());
  for (const Value& value : values) {
    // The database would take the part before it for the whole.
    if (value && value->find('\0') != std::string::npos)
      throw UsageError("a text with a zero byte cannot stand in the catalogue: leave it out");
    pointers.push_back(value ? value->c_str() : nullptr);
  }
  Rows rows(PQexecParams(connection_.get(), statement.c_str(), static_cast<int>(values.size()), nullptr,
                         pointers.data(), nullptr, nullptr, 0));
  // Freed with `rows`.
  PGresult* const result = rows.raw();
  const ExecStatusType status = PQresultStatus(result);
  if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) return rows;
  const char* const given = result == nullptr ? nullptr : PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string state = given == nullptr ? "" : given;
  throw DatabaseError("PostgreSQL: " + sentence_of(PQerrorMessage(connection_.get())) + advice_for(state),
                      state);
}

void Postgres::together(const std::function<void()>& work) {
  if (in_transaction_) return work();
  ask("BEGIN");
  in_transaction_ = true;
  try {
    work();
    in_transaction_ = false;
    ask("COMMIT");
  } catch (...) {
    in_transaction_ = false;
    try {
      ask("ROLLBACK");
    } catch (const DatabaseError&) {
      // The connection is gone, and its transaction with it; what is told is why `work` threw.
    }
    throw;
  }
}

}  // namespace kiroku::fleet
