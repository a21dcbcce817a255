// A link that signs in once, without a password: for a demonstration on this very machine. Thread-safe.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "viewer/http/role.h"

namespace kiroku::viewer {

class SignInLink {
 public:
  /// A new token, which replaces one that was not used. Who uses it is `user` with `role`.
  std::string make(std::string user, Role role);
  struct Holder {
    std::string user;
    Role role = Role::kOperator;
  };
  /// Whom the token signs in; nothing if it is not the one, or was used already. Compared in constant time.
  std::optional<Holder> use(std::string_view token);

 private:
  std::mutex mutex_;
  std::string token_;
  Holder holder_;
};

}  // namespace kiroku::viewer
