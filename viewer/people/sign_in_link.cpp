#include "viewer/people/sign_in_link.h"

#include "crypto/secret.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {

std::string SignInLink::make(std::string user, Role role) {
  const std::lock_guard guard(mutex_);
  token_ = random_token();
  holder_ = {std::move(user), role};
  return token_;
}

std::optional<SignInLink::Holder> SignInLink::use(std::string_view token) {
  const std::lock_guard guard(mutex_);
  if (token_.empty() || !crypto::equal_constant_time(bytes_of(token), bytes_of(token_))) return {};
  token_.clear();
  return holder_;
}

}  // namespace kiroku::viewer
