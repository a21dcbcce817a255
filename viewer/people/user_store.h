// Who may sign in: names, roles and password hashes in a database of the home (users.sqlite). Thread-safe;
// other processes may use the same file at the same time.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "crypto/secret.h"
#include "viewer/http/role.h"

namespace kiroku::viewer {

struct User {
  std::string name;
  Role role = Role::kOperator;
  UtcTime changed;  // when role or password last did
  /// The password is one that somebody else gave for signing in once and choosing another, until then;
  /// nothing: it is the user's own.
  std::optional<UtcTime> one_time_until = {};
  /// Somebody has signed in with that password: nobody does again.
  bool one_time_used = false;
};

/// [a-z0-9][a-z0-9._-]{0,31}.
bool is_user_name(std::string_view text);

/// Of a password with this salt and cost: scrypt, but in tests.
using PasswordHasher = std::function<crypto::Secret(const crypto::Secret& password, ByteView salt, int cost)>;

/// Every function throws kiroku::Error where the database cannot be used.
class UserStore {
 public:
  /// Opens or makes the file, mode 0600. An empty `hasher` is scrypt.
  static std::unique_ptr<UserStore> open(const std::filesystem::path& file, PasswordHasher hasher = {});
  ~UserStore();

  /// Throws kiroku::UsageError for a name that is none, and for a password shorter than kShortestPassword
  /// characters, longer than kLongestPassword bytes or the same as the name.
  static void require_valid(const std::string& name, const crypto::Secret& password);
  /// The same, and for a name that is there already.
  void add(const std::string& name, Role role, const crypto::Secret& password);
  /// The same for a user who is there; throws kiroku::UsageError for one who is not. It is the user's own
  /// then, unless `one_time_until` says until when it may be used for choosing another.
  void set_password(const std::string& name, const crypto::Secret& password,
                    std::optional<UtcTime> one_time_until = {});
  /// As set_password(), by the user themselves. False, and nothing changes, where the user was removed, or
  /// got another password or role since `known` (User::changed): what an administrator did while a new
  /// password was hashed must not be undone by it.
  [[nodiscard]] bool replace_password(const std::string& name, const crypto::Secret& password, UtcTime known);
  /// Takes the one-time password that was set with `changed` (User::changed) as used. False where it was used
  /// before, or replaced: of two that sign in with it at once, in whatever process, one is told so.
  [[nodiscard]] bool use_one_time(const std::string& name, UtcTime changed);
  /// These throw kiroku::UsageError for a user who is not there, and where there would be users and no
  /// administrator among them any more; of two that are asked at once, in whatever process, one is refused.
  void set_role(const std::string& name, Role role);
  void remove(const std::string& name);
  [[nodiscard]] std::vector<User> list() const;  // by name
  [[nodiscard]] std::optional<User> find(const std::string& name) const;
  /// The user if name and password are right, also where a one-time password was used or its time is over:
  /// the caller looks at it. Takes as long for a user there is not.
  [[nodiscard]] std::optional<User> check(const std::string& name, const crypto::Secret& password) const;

  /// For one-time passwords: 20 letters and digits of 100 random bits, in groups, none of which is taken for
  /// another when it is read out or written down (Crockford's base 32).
  static crypto::Secret new_one_time_password();

  static constexpr std::size_t kShortestPassword = 10;
  static constexpr std::size_t kLongestPassword = 1024;
  /// Cost of scrypt (RFC 7914): N = 2^17, r = 8, p = 1: 128 MiB, and a third of a second of one core. What
  /// OWASP's password storage cheat sheet asks for.
  static constexpr int kCost = 17;

 private:
  struct State;
  explicit UserStore(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::viewer
