#include "viewer/viewer.h"

#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "viewer/api/api.h"
#include "viewer/people/sign_in_link.h"
#include "viewer/server/inner_door.h"
#include "viewer/server/workplace_caller.h"

namespace kiroku::viewer {
namespace {

constexpr std::chrono::seconds kSessionSweepEvery{5};

/// Ends sessions soon after they expire, so that their keys leave memory though nobody asks again, and those
/// of users whom 'kiroku user' removed or changed.
class Sweeper {
 public:
  explicit Sweeper(ViewerContext& context)
      : clock_(*context.home().clock), thread_([this, &context] { run(context); }) {}
  ~Sweeper() {
    {
      const std::lock_guard guard(mutex_);
      stop_ = true;
    }
    wake_.notify_one();
    thread_.join();
  }
  Sweeper(const Sweeper&) = delete;
  Sweeper& operator=(const Sweeper&) = delete;

 private:
  void run(ViewerContext& context) {
    std::unique_lock lock(mutex_);
    while (!clock_.wait_for(wake_, lock, kSessionSweepEvery, [this] { return stop_; })) {
      try {
        sweep(context);
      } catch (const Error& error) {
        context.tell(std::string("sessions cannot be compared with the users: ") + error.what());
      }
    }
  }
  static void sweep(ViewerContext& context) {
    std::map<std::string, UtcTime> changed;
    for (const User& user : context.users().list()) changed[user.name] = user.changed;
    const auto is_void = [&](const std::string& name, const std::optional<UtcTime>& credential) {
      if (!credential) return false;
      const auto user = changed.find(name);
      return user == changed.end() || user->second != *credential;
    };
    context.sessions().sweep(
        [&](const Session& session) { return is_void(session.user(), session.credential()); });
    context.invitations().sweep(
        [&](const std::string& room) { return context.running_case(room); },
        [&](const InvitationTerms& terms) { return is_void(terms.made_by, terms.credential); });
    tell_who_has_gone(context);
  }
  static void tell_who_has_gone(ViewerContext& context) {
    for (const auto& each : context.invitations().list()) {
      if (!each->has_gone()) continue;
      const InvitationTerms& terms = each->terms();
      context.note_access(context.case_of(terms.room),
                          "watches " + terms.room + " no more, invitation " + each->id() + " lasts",
                          "guest " + terms.guest + " (kiroku view)");
    }
  }
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread thread_;  // last: uses the rest
};

/// Null for the viewer itself, which has none, and where it cannot be opened but people come otherwise.
std::unique_ptr<InnerDoor> open_inner_door(const ViewerHome& home, bool has_address,
                                           const std::function<void(const std::string&)>& tell) {
  if (home.serves == "cases" || home.serves == "fleet") return nullptr;
  try {
    return std::make_unique<InnerDoor>(home.serves == "planning"    ? home.planning_socket
                                       : home.serves == "breathing" ? home.breathing_socket
                                                                    : home.training_socket);
  } catch (const Error& error) {
    if (!has_address) throw;
    tell(std::string("nobody is led here by the viewer: ") + error.what());
    return nullptr;
  }
}

}  // namespace

struct Viewer::State {
  explicit State(ViewerOptions options)
      : context(std::move(options.home), options.sessions, options.tell),
        page(options.page ? StaticFiles::load(*options.page) : StaticFiles()),
        dispatcher(router, whoever_has_cookie(context.sessions(), session_cookie(context.home().serves)),
                   page, options.tell),
        inner_dispatcher(inner_router, whom_the_viewer_names(), no_page, options.tell),
        sweeper(context) {
    const bool has_address = !options.web.listen.empty();
    if (has_address && !is_loopback(options.web.listen) && context.users().list().empty()) {
      throw UsageError("nobody could sign in, so " + options.web.listen +
                       " is not opened to the network: add a user with 'kiroku user add NAME', or listen on "
                       "127.0.0.1");
    }
    if (context.home().serves == "cases") {
      add_routes(router, context, link);
    } else if (context.home().serves == "fleet") {
      add_fleet_routes(router, context, link);
    } else {
      add_session_routes(router, context, link);
      add_log_routes(router, context);
      add_user_routes(router, context);
    }
    if (options.more_routes) {
      options.more_routes(router, context);
      options.more_routes(inner_router, context);
    }
    options.web.inner_door = open_inner_door(context.home(), has_address, options.tell);
    server.emplace(std::move(options.web), dispatcher, &inner_dispatcher);
  }
  ~State() {
    context.close();
    context.invitations().end_all(InvitationEnd::kStopped);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  ViewerContext context;
  SignInLink link;
  Router router;
  /// Of what comes through the inner door: nothing but what this program adds.
  Router inner_router;
  StaticFiles page, no_page;
  Dispatcher dispatcher, inner_dispatcher;
  Sweeper sweeper;
  std::optional<WebServer> server;  // last: gone before what it calls
};

Viewer::Viewer(ViewerOptions options) : state_(std::make_unique<State>(std::move(options))) {}
Viewer::~Viewer() = default;

std::string Viewer::url() const { return state_->server->url(); }
std::uint16_t Viewer::port() const { return state_->server->port(); }

std::string Viewer::sign_in_url(const std::string& user) {
  return url() + "#sign-in=" + state_->link.make(user, Role::kAdministrator);
}

}  // namespace kiroku::viewer
