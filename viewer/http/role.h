// Who may do what: the one table of it (docs/reference/viewer.md, "Roles"). Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string_view>

namespace kiroku::viewer {

/// kGuest is whoever came by an invitation (viewer/people/invitations.h), and never a user's.
enum class Role { kOperator, kSurgeon, kAuditor, kAdministrator, kGuest };
std::string_view role_name(Role role);  // "operator"
/// A role that a user can have.
std::optional<Role> parse_role(std::string_view name);

/// What a route asks of who calls it.
enum class Right {
  kNone,          // nobody needs to have signed in
  kSignedIn,      // anybody who has
  kListCases,     // that there are cases, when, how long
  kReadCase,      // a case's ledger: streams, segments, gaps, tokens
  kWatch,         // what was recorded, with an identity
  kCompare,       // plans beside recordings
  kPlan,          // planning on the page
  kTrain,         // training on the page
  kVerify,        // verification and its documents
  kReadLog,       // the appliance log
  kSeeLive,       // status
  kWatchRoom,     // live pictures of a room; a guest: of the one they were invited to
  kControlRooms,  // start, stop, mark; see and end invitations
  kInvite,        // make them
  kManageUsers,
};
bool may(Role role, Right right);
std::string_view right_name(Right right);  // "list-cases", as openapi.json has it

}  // namespace kiroku::viewer
