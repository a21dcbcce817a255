// A connection to PostgreSQL by libpq, with results that free themselves and errors that say what to do. Not
// thread-safe: one thread uses a connection.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"

struct pg_conn;    // NOLINT(readability-identifier-naming): libpq's
struct pg_result;  // NOLINT(readability-identifier-naming): libpq's

namespace kiroku::fleet {

/// The database did not do what it was asked. what() says what that means.
class DatabaseError : public Error {
 public:
  DatabaseError(const std::string& sentence, std::string state) : Error(sentence), state_(std::move(state)) {}
  /// SQLSTATE (PostgreSQL manual, appendix A); "" where no answer came.
  [[nodiscard]] const std::string& state() const { return state_; }
  /// Whether the same may succeed later on a new connection: the server is away, stops, or has too many
  /// connections.
  [[nodiscard]] bool passes() const;

 private:
  std::string state_;
};

class Postgres {
 public:
  using Value = std::optional<std::string>;

  class Rows {
   public:
    explicit Rows(pg_result* result);
    [[nodiscard]] int size() const;
    [[nodiscard]] bool is_null(int row, int column) const;
    [[nodiscard]] std::string text(int row, int column) const;  // "" of null
    /// Throws DatabaseError where the value is no whole number.
    [[nodiscard]] std::int64_t integer(int row, int column) const;
    [[nodiscard]] pg_result* raw() const { return result_.get(); }

   private:
    std::shared_ptr<pg_result> result_;
  };

  /// Connects. `connection` as libpq takes it ("host=db.example dbname=kiroku user=worker"; PostgreSQL
  /// manual, "Connection Strings"); passwords stand in ~/.pgpass or PGPASSFILE, not in it. Throws
  /// DatabaseError.
  explicit Postgres(const std::string& connection);

  /// One statement, with $1, $2 and so on for `values`. Throws DatabaseError, and
  /// kiroku::UsageError for a value with a zero byte, of which the database would take the part before it.
  Rows ask(const std::string& statement, const std::vector<Value>& values = {});
  /// All that `work` does, or nothing of it where it throws. Within another it is a part of that one.
  void together(const std::function<void()>& work);

 private:
  std::unique_ptr<pg_conn, void (*)(pg_conn*)> connection_;
  bool in_transaction_ = false;
};

}  // namespace kiroku::fleet
