#include "viewer/server/workplace_caller.h"

#include "viewer/people/user_store.h"

namespace kiroku::viewer {

WhoCalls whom_the_viewer_names() {
  return [](Request& request, bool /*is_activity*/) -> std::shared_ptr<Session> {
    const std::string user(request.header(kCallersUser));
    const std::optional<Role> role = parse_role(request.header(kCallersRole));
    if (!is_user_name(user) || !role) return nullptr;
    request.peer = request.header(kCallersAddress);
    // When it ends is the viewer's to know, which ends its connections then.
    return std::make_shared<Session>(user, *role, std::nullopt, Clock::Time::max());
  };
}

}  // namespace kiroku::viewer
