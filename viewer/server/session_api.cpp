#include <semaphore>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/identity_text.h"
#include "viewer/server/api.h"
#include "viewer/server/dispatcher.h"
#include "viewer/server/http_fields.h"
#include "viewer/server/json_fields.h"
#include "viewer/server/sign_in_link.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kIdentityBodyLimit = 256U << 10;
/// So many passwords are hashed at a time, each with 128 MiB: guessing must not cost the machine its memory.
constexpr std::ptrdiff_t kHashedAtATime = 2;

std::string cookie(const std::string& token, const std::string& more) {
  return std::string(kSessionCookie) + "=" + token + "; Path=/; Secure; HttpOnly; SameSite=Strict" + more;
}

class SessionApi {
 public:
  SessionApi(ViewerContext& context, SignInLink& link) : context_(context), link_(link) {}

  [[nodiscard]] ordered_json describe(const Session& session, const Request& request) const {
    ordered_json out{{"user", session.user()},
                     {"role", role_name(session.role())},
                     {"unlocked", session.identities() != nullptr},
                     {"expires_s", context_.sessions().left(session).count()},
                     {"language", preferred_language(request.header("accept-language"))},
                     {"serves", context_.home().serves}};
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
      return open(request, holder->user, holder->role, {});
    }
    const crypto::Secret invitation = take_secret(asked, "invitation");
    if (!invitation.empty()) return join(request, invitation);
    const crypto::Secret password = take_secret(asked, "password");
    const std::string name = take_text(asked, "user");
    const std::optional<User> user = check(request, name, password);
    if (!user) throw Refusal(401, "the name or the password is wrong");
    return open(request, user->name, user->role, user->changed);
  }

  Response sign_out(const Request& request) {
    const auto token = cookie_value(request.header("cookie"), kSessionCookie);
    if (const auto& invitation = request.session->invitation()) context_.invitations().leave(*invitation);
    if (token) context_.sessions().close(*token);
    return Response::nothing()
        .with("Set-Cookie", cookie("", "; Max-Age=0"))
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
    // A sealed one costs as much memory as its maker chose.
    const Hashing turn(hashing_);
    auto identities = std::make_shared<const crypto::AgeIdentities>(
        crypto::read_identities(std::move(content), "the identity",
                                [&](const std::string& /*what_for*/) { return passphrase.clone(); }));
    context_.enter_access(request, ViewerContext::kEveryCase, "unlocked recordings with an identity");
    request.session->unlock(std::move(identities));
    return Response::json(describe(*request.session, request));
  }

 private:
  /// A turn at what takes much memory.
  class Hashing {
   public:
    explicit Hashing(std::counting_semaphore<>& turns) : turns_(turns) {
      if (!turns_.try_acquire_for(std::chrono::milliseconds(500))) {
        throw Refusal(503, "many are signing in now: try again in a moment");
      }
    }
    ~Hashing() { turns_.release(); }
    Hashing(const Hashing&) = delete;
    Hashing& operator=(const Hashing&) = delete;

   private:
    std::counting_semaphore<>& turns_;
  };

  Response join(const Request& request, const crypto::Secret& token) {
    const std::string address_key = "address:" + request.peer;
    AttemptGuard& attempts = context_.attempts();
    refuse_who_must_wait(attempts.wait(address_key, AttemptGuard::Clock::now()));
    const auto opened = context_.invitations().join(
        token.text(), request.peer, context_.sessions(), [&](const Invitation& invitation) {
          const InvitationTerms& terms = invitation.terms();
          context_.enter_access(
              context_.case_of(terms.room),
              "joined " + terms.room + " by invitation " + invitation.id() + " of " + terms.made_by,
              "guest " + terms.guest, request.peer);
        });
    if (!opened) {
      attempts.failed(address_key, AttemptGuard::Clock::now());
      context_.tell("somebody at " + request.peer + " came with an invitation that lets nobody in");
      throw Refusal(401,
                    "this invitation has ended, was used before, or was never given out: ask for another");
    }
    return Response::json(describe(*opened->session, request)).with("Set-Cookie", cookie(opened->token, ""));
  }

  static void refuse_who_must_wait(std::chrono::seconds wait) {
    if (wait.count() > 0) {
      throw Refusal(429, "too many failures: try again in " + std::to_string(wait.count()) + " s");
    }
  }

  std::optional<User> check(const Request& request, const std::string& name, const crypto::Secret& password) {
    if (password.size() > UserStore::kLongestPassword)
      throw Refusal(400, "a password is never as long as this");
    const std::string address_key = "address:" + request.peer;
    AttemptGuard& attempts = context_.attempts();
    // Before looking at who has to wait: those that waited for their turn here would all pass together.
    const Hashing turn(hashing_);
    const auto now = AttemptGuard::Clock::now();
    refuse_who_must_wait(std::max(attempts.wait(user_key(name), now), attempts.wait(address_key, now)));
    const std::optional<User> user = context_.users().check(name, password);
    if (user) {
      attempts.succeeded(user_key(name));
    } else {
      attempts.failed(user_key(name), AttemptGuard::Clock::now());
      attempts.failed(address_key, AttemptGuard::Clock::now());
      context_.tell("a sign-in from " + request.peer + " failed");
    }
    return user;
  }

  Response open(const Request& request, const std::string& user, Role role,
                std::optional<UtcTime> credential) {
    const SessionStore::Opened opened = context_.sessions().open(user, role, credential);
    const Session& session = *opened.session;
    if (context_.home().identities != nullptr && may(role, Right::kWatch)) {
      Request as_signed_in;
      as_signed_in.peer = request.peer;
      as_signed_in.session = opened.session;
      context_.enter_access(as_signed_in, ViewerContext::kEveryCase,
                            "unlocked recordings with the server's identity");
      opened.session->unlock(context_.home().identities);
    }
    return Response::json(describe(session, request)).with("Set-Cookie", cookie(opened.token, ""));
  }

  ViewerContext& context_;
  SignInLink& link_;
  std::counting_semaphore<> hashing_{kHashedAtATime};
};

}  // namespace

void add_session_routes(Router& router, ViewerContext& context, SignInLink& link) {
  const auto api = std::make_shared<SessionApi>(context, link);
  router.add(
      {"GET", "api/session", Right::kSignedIn,
       [api](const Request& request) { return Response::json(api->describe(*request.session, request)); },
       false});
  router.add("POST", "api/session", Right::kNone,
             [api](const Request& request) { return api->sign_in(request); });
  router.add("DELETE", "api/session", Right::kSignedIn,
             [api](const Request& request) { return api->sign_out(request); });
  router.add({"POST", "api/session/unlock", Right::kWatch,
              [api](const Request& request) { return api->unlock(request); }, true, kIdentityBodyLimit});
  router.add("DELETE", "api/session/unlock", Right::kWatch, [](const Request& request) {
    request.session->lock();
    return Response::nothing();
  });
}

}  // namespace kiroku::viewer
