#include "viewer/people/user_store.h"

#include <algorithm>
#include <sys/stat.h>

#include "archive/catalogue/sqlite_file.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/key_derivation.h"
#include "crypto/utf8.h"

namespace kiroku::viewer {
namespace {

constexpr std::size_t kSaltBytes = 16;
constexpr std::size_t kLongestName = 32;

constexpr archive::SqliteFile::Schema kSchema{
    "list of users",
    "CREATE TABLE users (name TEXT PRIMARY KEY, role TEXT NOT NULL, cost INTEGER NOT NULL, salt TEXT NOT "
    "NULL, "
    "hash TEXT NOT NULL, changed TEXT NOT NULL) STRICT;"
    "PRAGMA user_version = 1;",
    1, "SELECT name, role, cost, salt, hash, changed FROM users LIMIT 1", false};

/// Beside the table of format 1, so that an older program can go on with the file.
constexpr std::string_view kOneTimeTable =
    "CREATE TABLE IF NOT EXISTS one_time (name TEXT PRIMARY KEY, until TEXT NOT NULL, used INTEGER NOT NULL) "
    "STRICT";
constexpr std::string_view kSelectUsers =
    "SELECT users.name, role, changed, until, used FROM users LEFT JOIN one_time ON one_time.name = "
    "users.name";

std::size_t characters(std::string_view text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

void require_password(const std::string& name, const crypto::Secret& password) {
  if (!crypto::is_utf8(password.text()) || characters(password.text()) < UserStore::kShortestPassword ||
      password.size() > UserStore::kLongestPassword) {
    throw UsageError("a password has at least " + std::to_string(UserStore::kShortestPassword) +
                     " characters and at most " + std::to_string(UserStore::kLongestPassword) +
                     " bytes of UTF-8");
  }
  if (password.text() == name) throw UsageError("the password must not be the user's name");
}

struct Hash {
  std::string salt, hash;
};

Hash hash_of(const crypto::Secret& password, const PasswordHasher& hasher) {
  Bytes salt(kSaltBytes);
  crypto::fill_random(salt);
  return {crypto::to_hex(salt), crypto::to_hex(hasher(password, salt, UserStore::kCost).bytes())};
}

crypto::Secret scrypt_of(const crypto::Secret& password, ByteView salt, int cost) {
  return crypto::scrypt(password.bytes(), salt, cost);
}

[[noreturn]] void refuse_unknown(const std::string& name) {
  throw UsageError("there is no user '" + name + "': 'kiroku user list' names them");
}

}  // namespace

bool is_user_name(std::string_view text) {
  const auto is_plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  return !text.empty() && text.size() <= kLongestName && is_plain(text[0]) &&
         std::ranges::all_of(text, [&](char c) { return is_plain(c) || c == '.' || c == '_' || c == '-'; });
}

struct UserStore::State {
  std::unique_ptr<archive::SqliteFile> file;
  PasswordHasher hasher;
  std::mutex mutex;

  static User user_of(const archive::SqliteStatement& row) {
    const std::optional<Role> role = parse_role(row.text(1));
    const std::optional<UtcTime> changed = parse_utc(row.text(2));
    const std::string until = row.text(3);
    const std::optional<UtcTime> one_time_until = until.empty() ? std::nullopt : parse_utc(until);
    if (!role || !changed || one_time_until.has_value() != !until.empty())
      throw Error("the list of users is damaged at '" + row.text(0) + "': add the user anew");
    return {row.text(0), *role, *changed, one_time_until, one_time_until && row.integer(4) != 0};
  }
  std::optional<User> find(const std::string& name) {
    auto row = file->statement(std::string(kSelectUsers) + " WHERE users.name = ?");
    row.bind(name);
    if (!row.step()) return {};
    return user_of(row);
  }
  [[nodiscard]] std::int64_t count_others(const std::string& name, const char* condition) {
    auto others = file->statement(std::string("SELECT COUNT(*) FROM users WHERE name <> ?") + condition);
    others.bind(name).step();
    return others.integer(0);
  }
  /// In a transaction: throws where there would be users and no administrator among them.
  void require_another_administrator(const std::string& name) {
    const std::optional<User> user = find(name);
    if (!user) refuse_unknown(name);
    if (user->role != Role::kAdministrator) return;
    if (count_others(name, " AND role = 'administrator'") > 0) return;
    throw UsageError(
        "'" + name +
        "' is the last administrator, and nobody could manage users any more: make somebody else "
        "an administrator first");
  }
  /// In a transaction: the user's own from now on.
  void put_password(const std::string& name, const Hash& hash) {
    file->statement("UPDATE users SET cost = ?, salt = ?, hash = ?, changed = ? WHERE name = ?")
        .bind(std::int64_t{kCost})
        .bind(hash.salt)
        .bind(hash.hash)
        .bind(format_utc(utc_now()))
        .bind(name)
        .step();
    forget_one_time(name);
  }
  void forget_one_time(const std::string& name) {
    file->statement("DELETE FROM one_time WHERE name = ?").bind(name).step();
  }
};

UserStore::UserStore(std::unique_ptr<State> state) : state_(std::move(state)) {}
UserStore::~UserStore() = default;

std::unique_ptr<UserStore> UserStore::open(const std::filesystem::path& file, PasswordHasher hasher) {
  auto state = std::make_unique<State>();
  state->hasher = hasher ? std::move(hasher) : PasswordHasher(scrypt_of);
  state->file = archive::SqliteFile::open(file, kSchema);
  state->file->statement(kOneTimeTable).step();
  if (::chmod(file.c_str(), 0600) != 0 && errno != EPERM) throw IoError("protect", file, errno);
  return std::unique_ptr<UserStore>(new UserStore(std::move(state)));
}

void UserStore::require_valid(const std::string& name, const crypto::Secret& password) {
  if (!is_user_name(name)) {
    throw UsageError("'" + printable(name) + "' is no user's name: write up to " +
                     std::to_string(kLongestName) +
                     " of a-z, 0-9, '.', '_' and '-', beginning with a letter or digit");
  }
  require_password(name, password);
}

crypto::Secret UserStore::new_one_time_password() {
  constexpr std::string_view kDigits = "0123456789abcdefghjkmnpqrstvwxyz";
  constexpr std::size_t kLength = 20, kGroup = 5;
  const crypto::Secret random = crypto::Secret::random(kLength);
  crypto::Secret text(kLength + kLength / kGroup - 1);
  std::size_t at = 0;
  for (std::size_t i = 0; i < kLength; ++i) {
    if (i > 0 && i % kGroup == 0) text.bytes()[at++] = std::byte{'-'};
    text.bytes()[at++] =
        static_cast<std::byte>(kDigits[std::to_integer<std::size_t>(random.bytes()[i]) % kDigits.size()]);
  }
  return text;
}

void UserStore::add(const std::string& name, Role role, const crypto::Secret& password) {
  require_valid(name, password);
  const Hash hash = hash_of(password, state_->hasher);
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  if (state_->find(name)) throw UsageError("there is a user '" + name + "' already: choose another name");
  state_->file
      ->statement("INSERT INTO users (name, role, cost, salt, hash, changed) VALUES (?, ?, ?, ?, ?, ?)")
      .bind(name)
      .bind(role_name(role))
      .bind(std::int64_t{kCost})
      .bind(hash.salt)
      .bind(hash.hash)
      .bind(format_utc(utc_now()))
      .step();
  transaction.commit();
}

void UserStore::set_password(const std::string& name, const crypto::Secret& password,
                             std::optional<UtcTime> one_time_until) {
  require_password(name, password);
  const Hash hash = hash_of(password, state_->hasher);
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  if (!state_->find(name)) refuse_unknown(name);
  state_->put_password(name, hash);
  if (one_time_until) {
    state_->file->statement("INSERT INTO one_time (name, until, used) VALUES (?, ?, 0)")
        .bind(name)
        .bind(format_utc(*one_time_until))
        .step();
  }
  transaction.commit();
}

bool UserStore::replace_password(const std::string& name, const crypto::Secret& password, UtcTime known) {
  require_password(name, password);
  const Hash hash = hash_of(password, state_->hasher);
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  const std::optional<User> user = state_->find(name);
  if (!user || user->changed != known) return false;
  state_->put_password(name, hash);
  transaction.commit();
  return true;
}

bool UserStore::use_one_time(const std::string& name, UtcTime changed) {
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  const std::optional<User> user = state_->find(name);
  if (!user || user->changed != changed || !user->one_time_until || user->one_time_used) return false;
  state_->file->statement("UPDATE one_time SET used = 1 WHERE name = ?").bind(name).step();
  transaction.commit();
  return true;
}

void UserStore::set_role(const std::string& name, Role role) {
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  if (role != Role::kAdministrator) state_->require_another_administrator(name);
  if (!state_->find(name)) refuse_unknown(name);
  state_->file->statement("UPDATE users SET role = ?, changed = ? WHERE name = ?")
      .bind(role_name(role))
      .bind(format_utc(utc_now()))
      .bind(name)
      .step();
  transaction.commit();
}

void UserStore::remove(const std::string& name) {
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  if (!state_->find(name)) refuse_unknown(name);
  // Whoever removes everybody begins anew.
  if (state_->count_others(name, "") > 0) state_->require_another_administrator(name);
  state_->file->statement("DELETE FROM users WHERE name = ?").bind(name).step();
  state_->forget_one_time(name);
  transaction.commit();
}

std::vector<User> UserStore::list() const {
  const std::lock_guard guard(state_->mutex);
  auto rows = state_->file->statement(std::string(kSelectUsers) + " ORDER BY users.name");
  std::vector<User> out;
  while (rows.step()) out.push_back(State::user_of(rows));
  return out;
}

std::optional<User> UserStore::find(const std::string& name) const {
  const std::lock_guard guard(state_->mutex);
  return state_->find(name);
}

std::optional<User> UserStore::check(const std::string& name, const crypto::Secret& password) const {
  std::optional<User> user;
  int cost = kCost;
  Bytes salt(kSaltBytes);
  Bytes expected(crypto::Sha256Digest().size());
  {
    const std::lock_guard guard(state_->mutex);
    user = state_->find(name);
    if (user) {
      auto row = state_->file->statement("SELECT cost, salt, hash FROM users WHERE name = ?");
      row.bind(name);
      row.step();
      cost = static_cast<int>(row.integer(0));
      salt = crypto::from_hex(row.text(1)).value_or(Bytes());
      expected = crypto::from_hex(row.text(2)).value_or(Bytes());
    }
  }
  const crypto::Secret hash = state_->hasher(password, salt, cost);
  const bool is_right = crypto::equal_constant_time(hash.bytes(), expected);
  if (!is_right) user.reset();
  return user;
}

}  // namespace kiroku::viewer
