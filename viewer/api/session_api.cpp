#include <mutex>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/network_address.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/identity_text.h"
#include "viewer/api/api.h"
#include "viewer/api/stored_cases.h"
#include "viewer/http/http_fields.h"
#include "viewer/people/json_fields.h"
#include "viewer/people/sign_in_link.h"
#include "viewer/server/dispatcher.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kIdentityBodyLimit = 256U << 10;
/// Of one address under whatever names, before it waits: many people may share one.
constexpr std::size_t kFreeFailuresOfAddress = 20;

std::string cookie(std::string_view name, const std::string& token, const std::string& more) {
  return std::string(name) + "=" + token + "; Path=/; Secure; HttpOnly; SameSite=Strict" + more;
}

class SessionApi {
 public:
  SessionApi(ViewerContext& context, SignInLink& link)
      : context_(context), link_(link), cookie_name_(session_cookie(context.home().serves)) {}

  [[nodiscard]] ordered_json describe(const Session& session, const Request& request) const {
    ordered_json out{{"user", session.user()},
                     {"role", role_name(session.role())},
                     {"unlocked", session.identities() != nullptr},
                     {"expires_s", context_.sessions().left(session).count()},
                     {"must_change_password", session.must_change_password()},
                     {"has_password", session.credential().has_value()},
                     {"language", preferred_language(request.header("accept-language"))},
                     {"serves", context_.home().serves}};
    if (const auto& stored = context_.home().stored)
      out["searches"] = stored->can_search() && may(session.role(), Right::kWatch);
    if (const auto& invitation = session.invitation()) {
      out["invitation"] = {{"guest", invitation->terms().guest}, {"room", invitation->terms().room}};
    }
    return out;
  }

  Response sign_in(const Request& request) {
    json asked = request.json();
    const crypto::Secret token = take_secret(asked, "link");
    if (!token.empty()) {
      const auto holder = link_.use(token.text());
      if (!holder)
        throw Refusal(401, "this link has been used, or was never given out: start the viewer anew");
      return open(request, {holder->user, holder->role, {}}, {}, "");
    }
    const crypto::Secret invitation = take_secret(asked, "invitation");
    if (!invitation.empty()) return join(request, invitation);
    const auto password = std::make_shared<const crypto::Secret>(take_secret(asked, "password"));
    if (password->size() > UserStore::kLongestPassword)
      throw Refusal(400, "a password is never as long as this");
    const Attempt attempt = attempt_of(request, take_text(asked, "user"));
    refuse_who_must_wait(wait_of(attempt));
    const bool is_device = attempt.standing == KnownDevices::Standing::kKnownDevice;
    return Response::later({.work = [this, &request, attempt,
                                     password] { return sign_in_by_password(request, attempt, *password); },
                            .goes_first = attempt.is_known(),
                            .who = is_device ? person_of(attempt.caller.user) : attempt.caller.holder});
  }

  /// Of whoever has signed in with a password, for themselves.
  Response choose_password(const Request& request) {
    json asked = request.json();
    const auto password = std::make_shared<const crypto::Secret>(take_secret(asked, "password"));
    const auto chosen = std::make_shared<const crypto::Secret>(take_secret(asked, "new_password"));
    if (!request.session->credential()) throw Refusal(409, "this session has no password to change");
    return Response::later(
        {.work = [this, &request, password, chosen] { return change_password(request, *password, *chosen); },
         .goes_first = true,
         .who = request.session->person()});
  }

  Response sign_out(const Request& request) {
    const auto token = cookie_value(request.header("cookie"), cookie_name_);
    if (const auto& invitation = request.session->invitation()) context_.invitations().leave(*invitation);
    if (token) context_.sessions().close(*token);
    return Response::nothing()
        .with("Set-Cookie", cookie(cookie_name_, "", "; Max-Age=0"))
        .with("Clear-Site-Data", "\"cache\"");
  }

  Response unlock(const Request& request) {
    json asked = request.json();
    crypto::Secret content = take_secret(asked, "identity");
    const crypto::Secret passphrase = take_secret(asked, "passphrase");
    if (content.empty()) throw Refusal(400, "'identity' is missing: the text of an identity file");
    // A file sealed with a passphrase is no text, and comes in base64.
    if (content.text().starts_with("YWdlLWVuY3J5cHRpb24ub3Jn")) {
      auto decoded = crypto::from_base64(content.text(), crypto::Base64Padding::kPadded);
      if (!decoded) throw Refusal(400, "'identity' is neither an identity file's text nor base64 of one");
      content = crypto::Secret::copy_of(*decoded);
      crypto::zeroise(*decoded);
    }
    // A sealed one costs as much memory as its maker chose, up to a limit.
    const auto sealed = std::make_shared<crypto::Secret>(std::move(content));
    const auto opens = std::make_shared<const crypto::Secret>(passphrase.clone());
    return Response::later(
        {.work = [this, &request, sealed, opens] { return unlock_with(request, std::move(*sealed), *opens); },
         .goes_first = true,
         .who = request.session->person()});
  }

 private:
  /// Somebody with a password, before it is looked at.
  struct Attempt {
    KnownDevices::Caller caller;
    KnownDevices::Standing standing = KnownDevices::Standing::kStranger;
    [[nodiscard]] bool is_known() const { return standing != KnownDevices::Standing::kStranger; }
    /// Under which a stranger's failures are counted: one name from one address, and all names from there.
    [[nodiscard]] std::string name_key() const { return user_key(caller.user) + caller.holder; }
  };

  Response unlock_with(const Request& request, crypto::Secret sealed, const crypto::Secret& passphrase) {
    // One after the other: a sealed one takes 256 MiB, beside a recorder.
    const auto read = [&] {
      const std::lock_guard guard(unsealing_);
      return crypto::read_identities(
          std::move(sealed), "the identity",
          [&](const std::string& /*what_for*/) { return passphrase.clone(); }, crypto::kLimitsOfStrangers);
    };
    auto identities = std::make_shared<const crypto::AgeIdentities>(read());
    context_.enter_access(request, ViewerContext::kEveryCase, "unlocked recordings with an identity");
    request.session->unlock(std::move(identities));
    return Response::json(describe(*request.session, request));
  }

  Response join(const Request& request, const crypto::Secret& token) {
    const auto opened = context_.invitations().join(
        token.text(), request.peer, context_.sessions(), [&](const Invitation& invitation) {
          const InvitationTerms& terms = invitation.terms();
          context_.enter_access(
              context_.case_of(terms.room),
              "joined " + terms.room + " by invitation " + invitation.id() + " of " + terms.made_by,
              "guest " + terms.guest, request.peer);
        });
    if (!opened) {
      // The right token is never refused: nobody guesses 256 bits, but a guest may share an address.
      const std::string key = "invitation:" + address_holder(request.peer);
      const auto now = context_.home().clock->now();
      refuse_who_must_wait(context_.attempts().wait(key, now));
      context_.attempts().failed(key, now);
      context_.tell("somebody at " + request.peer + " came with an invitation that lets nobody in");
      throw Refusal(401,
                    "this invitation has ended, was used before, or was never given out: ask for another");
    }
    return Response::json(describe(*opened->session, request))
        .with("Set-Cookie", cookie(cookie_name_, opened->token, ""));
  }

  static void refuse_who_must_wait(std::chrono::seconds wait) {
    if (wait.count() > 0) {
      throw Refusal(429, "too many failures: try again in " + std::to_string(wait.count()) + " s", wait);
    }
  }

  Attempt attempt_of(const Request& request, const std::string& name) {
    Attempt attempt;
    attempt.caller.user = name;
    attempt.caller.holder = address_holder(request.peer);
    attempt.caller.device = cookie_value(request.header("cookie"), kDeviceCookie).value_or("");
    if (!is_user_name(name)) return attempt;
    if (const std::optional<User> user = context_.users().find(name)) {
      attempt.caller.credential = user->changed;
    }
    // Also for a user there is not, so that time tells nothing of it.
    with_devices([&](KnownDevices& devices) { attempt.standing = devices.standing(attempt.caller); });
    return attempt;
  }

  /// Who signed in before, by this browser or from this address, does not wait for the failures of others.
  std::chrono::seconds wait_of(const Attempt& attempt) {
    if (attempt.is_known()) return std::chrono::seconds(0);
    const auto now = context_.home().clock->now();
    return std::max(context_.attempts().wait(attempt.name_key(), now),
                    of_addresses_.wait(attempt.caller.holder, now));
  }

  Response sign_in_by_password(const Request& request, const Attempt& attempt,
                               const crypto::Secret& password) {
    // Those that waited for their turn would else all pass together.
    refuse_who_must_wait(wait_of(attempt));
    const std::optional<User> user = context_.users().check(attempt.caller.user, password);
    if (!user) {
      note_failure(attempt);
      context_.tell("a sign-in from " + request.peer + " failed");
      throw Refusal(401, "the name or the password is wrong");
    }
    use_one_time_password(*user);
    context_.attempts().succeeded(attempt.name_key());
    KnownDevices::Caller caller = attempt.caller;
    caller.credential = user->changed;
    std::string device;
    with_devices([&](KnownDevices& devices) { device = devices.remember(caller); });
    return open(request, *user, device);
  }

  void refuse_late(const User& user) const {
    if (user.one_time_until && *user.one_time_until < context_.home().clock->utc()) {
      throw Refusal(403, "the time of this one-time password is over: ask an administrator for another");
    }
  }
  /// Who finds it afterwards must not come in, and its owner must hear of whoever was faster.
  void use_one_time_password(const User& user) {
    if (!user.one_time_until) return;
    refuse_late(user);
    if (context_.users().use_one_time(user.name, user.changed)) return;
    throw Refusal(403, "this one-time password was used already: ask an administrator for another");
  }

  /// Failures of somebody who has signed in are counted by session: they lock nobody else out, and whoever
  /// took one session over does not keep its owner, in another, from choosing a new password.
  [[nodiscard]] std::string own_key(const Request& request) const {
    const std::string token = cookie_value(request.header("cookie"), cookie_name_).value_or("");
    return "own-password:" + crypto::to_hex(crypto::sha256(bytes_of(token)));
  }

  Response change_password(const Request& request, const crypto::Secret& password,
                           const crypto::Secret& chosen) {
    const std::string name = request.session->user();
    const auto now = context_.home().clock->now();
    refuse_who_must_wait(context_.attempts().wait(own_key(request), now));
    const std::optional<User> user = context_.users().check(name, password);
    if (!user || user->changed != request.session->credential()) {
      context_.attempts().failed(own_key(request), now);
      throw Refusal(403, "the password of now is wrong");
    }
    context_.attempts().succeeded(own_key(request));
    refuse_late(*user);
    if (password.text() == chosen.text()) throw Refusal(400, "choose another password than the one of now");
    UserStore::require_valid(name, chosen);
    context_.enter_access(request, ViewerContext::kEveryCase, "chose a new password");
    if (!context_.users().replace_password(name, chosen, user->changed)) {
      throw Refusal(409, "an administrator changed this user meanwhile: sign in again");
    }
    // Also this one, which is replaced; whoever else had signed in under the name must do so anew.
    context_.sessions().close_all_of(name);
    const std::optional<User> changed = context_.users().find(name);
    if (!changed) throw Refusal(401, "this user was removed");
    KnownDevices::Caller caller{name, changed->changed,
                                cookie_value(request.header("cookie"), kDeviceCookie).value_or(""),
                                address_holder(request.peer)};
    std::string device;
    with_devices([&](KnownDevices& devices) { device = devices.remember(caller); });
    return open(request, *changed, device);
  }

  void note_failure(const Attempt& attempt) {
    if (attempt.is_known()) {
      with_devices([&](KnownDevices& devices) { devices.note_failure(attempt.caller); });
      return;
    }
    const auto now = context_.home().clock->now();
    context_.attempts().failed(attempt.name_key(), now);
    of_addresses_.failed(attempt.caller.holder, now);
  }

  /// Nobody is kept from signing in because the list of devices cannot be used: all are strangers then.
  void with_devices(const std::function<void(KnownDevices&)>& action) {
    try {
      action(context_.devices());
    } catch (const Error& error) {
      context_.tell(std::string("who signed in from where cannot be remembered: ") + error.what());
    }
  }

  Response open(const Request& request, const User& user, const std::string& device) {
    return open(request, user, user.changed, device);
  }
  Response open(const Request& request, const User& user, std::optional<UtcTime> credential,
                const std::string& device) {
    const SessionStore::Opened opened =
        context_.sessions().open(user.name, user.role, credential, user.one_time_until.has_value());
    const Session& session = *opened.session;
    // A role or password that was changed while the one of before was hashed: whoever changed it has ended
    // this session too, or had not yet seen it.
    if (credential) {
      const std::optional<User> now = context_.users().find(user.name);
      if (!now || now->changed != *credential) {
        context_.sessions().close(opened.token);
        throw Refusal(401, "this user was changed meanwhile: sign in again");
      }
    }
    if (context_.home().identities != nullptr && may(user.role, Right::kWatch) &&
        !session.must_change_password()) {
      Request as_signed_in;
      as_signed_in.peer = request.peer;
      as_signed_in.session = opened.session;
      context_.enter_access(as_signed_in, ViewerContext::kEveryCase,
                            "unlocked recordings with the server's identity");
      opened.session->unlock(context_.home().identities);
    }
    Response response = Response::json(describe(session, request));
    if (!device.empty()) {
      response = std::move(response).with(
          "Set-Cookie", cookie(kDeviceCookie, device, "; Max-Age=" + std::to_string(kDeviceCookieSeconds)));
    }
    return std::move(response).with("Set-Cookie", cookie(cookie_name_, opened.token, ""));
  }

  ViewerContext& context_;
  SignInLink& link_;
  const std::string cookie_name_;
  std::mutex unsealing_;
  AttemptGuard of_addresses_{AttemptLimits{.free_failures = kFreeFailuresOfAddress}};
};

}  // namespace

void add_session_routes(Router& router, ViewerContext& context, SignInLink& link) {
  const auto api = std::make_shared<SessionApi>(context, link);
  const auto of_session = [&router](Route route) {
    route.before_own_password = true;
    route.is_quick = true;
    router.add(std::move(route));
  };
  of_session(
      {"GET", "api/session", Right::kSignedIn,
       [api](const Request& request) { return Response::json(api->describe(*request.session, request)); },
       false});
  router.add("POST", "api/session", Right::kNone,
             [api](const Request& request) { return api->sign_in(request); });
  of_session({"DELETE", "api/session", Right::kSignedIn,
              [api](const Request& request) { return api->sign_out(request); }});
  of_session({"POST", "api/session/password", Right::kSignedIn,
              [api](const Request& request) { return api->choose_password(request); }});
  router.add({"POST", "api/session/unlock", Right::kWatch,
              [api](const Request& request) { return api->unlock(request); }, true, kIdentityBodyLimit});
  router.add("DELETE", "api/session/unlock", Right::kWatch, [](const Request& request) {
    request.session->lock();
    return Response::nothing();
  });
}

}  // namespace kiroku::viewer
