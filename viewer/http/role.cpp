#include "viewer/http/role.h"

#include <algorithm>
#include <array>

namespace kiroku::viewer {
namespace {

struct RightRow {
  Right right;
  std::string_view name;
  bool operator_may, surgeon_may, auditor_may, administrator_may, guest_may;
};

constexpr std::array<RightRow, 15> kRights{{
    {Right::kNone, "none", true, true, true, true, true},
    {Right::kSignedIn, "signed-in", true, true, true, true, true},
    {Right::kListCases, "list-cases", true, true, true, true, false},
    {Right::kReadCase, "read-case", false, true, true, true, false},
    {Right::kWatch, "watch", false, true, false, true, false},
    {Right::kCompare, "compare", false, true, false, true, false},
    {Right::kPlan, "plan", false, true, false, true, false},
    {Right::kTrain, "train", true, true, true, true, false},
    {Right::kVerify, "verify", false, true, true, true, false},
    {Right::kReadLog, "read-log", false, false, true, true, false},
    {Right::kSeeLive, "see-live", true, true, false, true, false},
    {Right::kWatchRoom, "watch-room", true, true, false, true, true},
    {Right::kControlRooms, "control-rooms", true, true, false, true, false},
    {Right::kInvite, "invite", false, true, false, true, false},
    {Right::kManageUsers, "manage-users", false, false, false, true, false},
}};

constexpr std::array<std::pair<Role, std::string_view>, 5> kNames{{{Role::kOperator, "operator"},
                                                                   {Role::kSurgeon, "surgeon"},
                                                                   {Role::kAuditor, "auditor"},
                                                                   {Role::kAdministrator, "administrator"},
                                                                   {Role::kGuest, "guest"}}};

}  // namespace

std::string_view role_name(Role role) {
  return std::ranges::find(kNames, role, &std::pair<Role, std::string_view>::first)->second;
}

std::optional<Role> parse_role(std::string_view name) {
  const auto* const found = std::ranges::find(kNames, name, &std::pair<Role, std::string_view>::second);
  if (found == kNames.end() || found->first == Role::kGuest) return {};
  return found->first;
}

std::string_view right_name(Right right) { return std::ranges::find(kRights, right, &RightRow::right)->name; }

bool may(Role role, Right right) {
  const auto* const row = std::ranges::find(kRights, right, &RightRow::right);
  if (row == kRights.end()) return false;
  switch (role) {
    case Role::kOperator:
      return row->operator_may;
    case Role::kSurgeon:
      return row->surgeon_may;
    case Role::kAuditor:
      return row->auditor_may;
    case Role::kAdministrator:
      return row->administrator_may;
    case Role::kGuest:
      return row->guest_may;
  }
  return false;
}

}  // namespace kiroku::viewer
