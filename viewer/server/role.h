// Who may do what: the one table of it (docs/viewer.md, "Roles"). Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string_view>

namespace kiroku::viewer {

enum class Role { kOperator, kSurgeon, kAuditor, kAdministrator };
std::string_view role_name(Role role);  // "operator"
std::optional<Role> parse_role(std::string_view name);

/// What a route asks of who calls it.
enum class Right {
  kNone,          // nobody needs to have signed in
  kSignedIn,      // anybody who has
  kListCases,     // that there are cases, when, how long
  kReadCase,      // a case's ledger: streams, segments, gaps, tokens
  kWatch,         // what was recorded, with an identity
  kCompare,       // plans beside recordings
  kVerify,        // verification and its documents
  kReadLog,       // the appliance log
  kSeeLive,       // status and live pictures
  kControlRooms,  // start, stop, mark
  kManageUsers,
};
bool may(Role role, Right right);
std::string_view right_name(Right right);  // "list-cases", as openapi.json has it

}  // namespace kiroku::viewer
