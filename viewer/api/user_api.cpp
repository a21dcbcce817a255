#include <mutex>

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"
#include "viewer/api/api.h"
#include "viewer/people/json_fields.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

/// Long enough for a shift, so that it need not be handed over at once.
constexpr std::chrono::hours kOneTimePasswordLasts{24};

ordered_json user_json(const User& user, ViewerContext& context) {
  const auto now = context.home().clock->now();
  return {{"user", user.name},
          {"role", role_name(user.role)},
          {"locked", context.attempts().longest_wait(user_key(user.name), now).count() > 0},
          {"one_time_until", or_null(user.one_time_until)}};
}

Response list_users(ViewerContext& context) {
  ordered_json users = ordered_json::array();
  for (const User& user : context.users().list()) users.push_back(user_json(user, context));
  return Response::json({{"users", std::move(users)}});
}

/// While it lives nobody else is added, changed or removed, and whoever asked was an administrator when it
/// began: a removal either comes after the whole deed, or before it and refuses it.
class UserDeed {
 public:
  /// Refusal 401.
  UserDeed(ViewerContext& context, const Request& request) : lock_(context.user_deeds()) {
    const Session& session = *request.session;
    const std::optional<User> user = context.users().find(session.user());
    // 'kiroku users' changes the list, too, and sessions hear of it later.
    const bool is_void = session.credential() && (!user || user->changed != session.credential());
    if (session.has_ended() || is_void) throw Refusal(401, "the session has ended");
  }

 private:
  const std::lock_guard<std::mutex> lock_;
};

/// Nobody raises themselves, and no administrator is lost by mistake.
[[noreturn]] void refuse_own_role() {
  throw Refusal(409, "nobody changes their own role: ask another administrator");
}

/// Adds one, or gives one who is there another password or role; then whoever has signed in under the name
/// must do so anew.
Response put_user(ViewerContext& context, const Request& request) {
  const UserDeed deed(context, request);
  json asked = request.json();
  const std::string name = take_text(asked, "user");
  const crypto::Secret password = take_secret(asked, "password");
  const std::optional<Role> role = parse_role(take_text(asked, "role"));
  if (!role) throw Refusal(400, "a role is operator, surgeon, auditor or administrator");
  const bool is_there = context.users().find(name).has_value();
  if (is_there && name == request.session->user()) refuse_own_role();
  if (!is_there || !password.empty()) UserStore::require_valid(name, password);
  // Nothing changes that the log does not say first.
  context.enter_access(
      request, ViewerContext::kEveryCase,
      (is_there ? "changes user " : "adds user ") + name + " as " + std::string(role_name(*role)));
  if (!is_there) {
    context.users().add(name, *role, password);
  } else {
    // First what may be refused.
    context.users().set_role(name, *role);
    if (!password.empty()) context.users().set_password(name, password);
    context.sessions().close_all_of(name);
  }
  return Response::json(user_json(*context.users().find(name), context), is_there ? 200 : 201);
}

User user_of(ViewerContext& context, const std::string& name) {
  std::optional<User> user = context.users().find(name);
  if (!user) throw Refusal(404, "there is no user " + name);
  return *user;
}

Response change_role(ViewerContext& context, const Request& request) {
  const UserDeed deed(context, request);
  const std::string& name = request.parameter("user");
  const std::optional<Role> role = parse_role(take_text(request.json(), "role"));
  if (!role) throw Refusal(400, "a role is operator, surgeon, auditor or administrator");
  if (name == request.session->user()) refuse_own_role();
  const User user = user_of(context, name);
  context.enter_access(request, ViewerContext::kEveryCase,
                       "changes user " + name + " from " + std::string(role_name(user.role)) + " to " +
                           std::string(role_name(*role)));
  context.users().set_role(name, *role);
  context.sessions().close_all_of(name);
  return Response::json(user_json(user_of(context, name), context));
}

/// Told once, to the administrator alone, who hands it on; whoever signs in with it must choose another.
Response reset_password(ViewerContext& context, const Request& request) {
  const UserDeed deed(context, request);
  const std::string& name = request.parameter("user");
  if (name == request.session->user()) {
    throw Refusal(409, "nobody resets their own password: choose a new one with the one of now");
  }
  user_of(context, name);
  const crypto::Secret password = UserStore::new_one_time_password();
  const UtcTime until = context.home().clock->utc() + kOneTimePasswordLasts;
  context.enter_access(request, ViewerContext::kEveryCase, "resets the password of user " + name);
  context.users().set_password(name, password, until);
  context.sessions().close_all_of(name);
  return Response::json({{"user", name}, {"password", password.text()}, {"until", format_utc(until)}});
}

Response remove_user(ViewerContext& context, const Request& request) {
  const UserDeed deed(context, request);
  const std::string& name = request.parameter("user");
  if (name == request.session->user()) throw Refusal(409, "nobody removes themselves");
  if (!context.users().find(name)) throw Refusal(404, "there is no user " + name);
  context.enter_access(request, ViewerContext::kEveryCase, "removes user " + name);
  context.users().remove(name);
  context.sessions().close_all_of(name);
  return Response::nothing();
}

}  // namespace

void add_user_routes(Router& router, ViewerContext& context) {
  router.add("GET", "api/users", Right::kManageUsers,
             [&context](const Request& /*request*/) { return list_users(context); });
  router.add("POST", "api/users", Right::kManageUsers, [&context](const Request& request) {
    // A new password is hashed.
    return Response::later({.work = [&context, &request] { return put_user(context, request); },
                            .goes_first = true,
                            .who = "session:" + request.session->user()});
  });
  router.add("POST", "api/users/{user:text}/role", Right::kManageUsers,
             [&context](const Request& request) { return change_role(context, request); });
  router.add(
      "POST", "api/users/{user:text}/password", Right::kManageUsers, [&context](const Request& request) {
        return Response::later({.work = [&context, &request] { return reset_password(context, request); },
                                .goes_first = true,
                                .who = "session:" + request.session->user()});
      });
  router.add("DELETE", "api/users/{user:text}", Right::kManageUsers,
             [&context](const Request& request) { return remove_user(context, request); });
}

}  // namespace kiroku::viewer
